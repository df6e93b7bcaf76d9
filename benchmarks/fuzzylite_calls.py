"""FuzzyLite, asked from here: a process in the environment that has it."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from rows import PeerMissingError

ROOT = Path(__file__).parents[1]
ENVIRONMENT = ROOT / ".venv-fuzzylite"
READY = ENVIRONMENT / ".ready"
PROGRAM = (ENVIRONMENT / "bin" / "python", Path(__file__).with_name("fuzzylite_peer.py"))


class FuzzyLite:
    """Two engines, the second fed by the first, built once and asked about some rows. Use it in a `with` statement.

    Attributes:
        weights: what the second engine says of each row.
    """

    def __init__(self, engines: tuple[Path, Path], names: Sequence[str], rows: Sequence[Sequence[float]]) -> None:
        """Begin, and ask about each row once.

        Args:
            engines: files in FLL.
            names: of the inputs that are no outputs of the first engine.
            rows: the values of the inputs, in the order of names.

        Raises:
            PeerMissingError: if FuzzyLite's environment has not been made.
        """
        if not READY.exists():
            raise PeerMissingError(f"FuzzyLite is not there: `make {READY.relative_to(ROOT)}` installs it")
        self._process = subprocess.Popen(PROGRAM, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        task = {"engines": list(map(str, engines)), "names": list(names), "rows": [list(row) for row in rows]}
        self.weights: list[list[float]] = json.loads(self._ask(json.dumps(task)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def scalar_s(self, rows: int) -> float:
        """Return the processor time in seconds of a row, one row a call."""
        return float(self._ask(f"scalar {rows}"))

    def vectorised_s(self, rows: int) -> float:
        """Return the processor time in seconds of a row, all rows in one call."""
        return float(self._ask(f"vectorised {rows}"))

    def _ask(self, line: str) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(line, file=self._process.stdin, flush=True)
        return self._process.stdout.readline()
