"""FuzzyLite in a process of its own environment, called from here.

The environment is separate because FuzzyLite is licensed under the GPL and needs an old version of numpy.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from rows import PeerMissingError

ROOT = Path(__file__).parents[1]
ENVIRONMENT = ROOT / ".venv-fuzzylite"
READY_FILE = ENVIRONMENT / ".ready"
PEER_COMMAND = (ENVIRONMENT / "bin" / "python", Path(__file__).with_name("fuzzylite_peer.py"))


class FuzzyLite:
    """Two engines, built once and called for some rows. The second reads the outputs of the first.

    Use it in a `with` statement.

    Attributes:
        weights: the outputs of the second engine for each row.
    """

    def __init__(self, engines: tuple[Path, Path], names: Sequence[str], rows: Sequence[Sequence[float]]) -> None:
        """Start the process, and infer each row once.

        Args:
            engines: files in FLL.
            names: the names of the inputs that are not outputs of the first engine.
            rows: the values of the inputs, in the order of names.

        Raises:
            PeerMissingError: if FuzzyLite's environment has not been made.
        """
        if not READY_FILE.exists():
            raise PeerMissingError(f"FuzzyLite is not installed: `make {READY_FILE.relative_to(ROOT)}` installs it")
        self._process = subprocess.Popen(PEER_COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        task = {"engines": list(map(str, engines)), "names": list(names), "rows": [list(row) for row in rows]}
        self.weights: list[list[float]] = json.loads(self._ask(json.dumps(task)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def scalar_s(self, rows: int) -> float:
        """Return the processor time in seconds per row, with one row per call."""
        return float(self._ask(f"scalar {rows}"))

    def vectorised_s(self, rows: int) -> float:
        """Return the processor time in seconds per row, with all rows in one call."""
        return float(self._ask(f"vectorised {rows}"))

    def _ask(self, line: str) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(line, file=self._process.stdin, flush=True)
        return self._process.stdout.readline()
