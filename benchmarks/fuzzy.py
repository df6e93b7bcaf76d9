"""The rows about fuzzy inference: one decision of P2's shape, 15 rules to three metrics and 20 to four weights.

The peer is FuzzyLite for Python, its engines built once, asked with one row a call as a robot would, and with thousands
of rows in one call, as its documentation advises where they are known ahead. It runs in an environment of its own;
`make` makes it. Both sides are asked with the same rows, and must answer the same.
"""

from __future__ import annotations

import itertools
import json
import random
import statistics
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
from rows import Row

from codra_dsl.fuzzy import compile_engine, read_fll

ROOT = Path(__file__).parents[1]
ENGINES = ROOT / "tests" / "data" / "fuzzy"
PEER = (ROOT / ".venv-fuzzylite" / "bin" / "python", Path(__file__).with_name("fuzzylite_peer.py"))
RANGES = ((0.0, 10.0), (0.0, 3.0), (0.0, 100.0), (0.0, 5.0), (0.0, 1.0), (0.0, 1.0))
ROWS = 5_000
CALLS = 200
TURNS = 15


def rows(_: Path) -> Iterator[Row]:
    """Measure both sides in turns, by processor time."""
    chance = random.Random(7)
    contexts = [[chance.uniform(low, high) for low, high in RANGES] for _ in range(ROWS)]
    metrics, actions = _module("store_metrics"), _module("store_actions")

    def cascade(context: list[float]) -> tuple[float, ...]:
        distance, _, battery, _, load, _ = context
        found: tuple[float, ...] = actions.infer(distance, battery, load, *metrics.infer(*context).values).values
        return found

    with subprocess.Popen(PEER, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as peer:
        assert peer.stdin is not None
        assert peer.stdout is not None

        def ask(line: str) -> str:
            print(line, file=peer.stdin, flush=True)
            return peer.stdout.readline()  # type: ignore[union-attr]

        theirs = json.loads(ask(json.dumps(contexts)))
        np.testing.assert_allclose([cascade(each) for each in contexts], theirs, atol=1e-6)
        given = itertools.cycle(contexts)
        ours_s, scalar_s, vectorised_s = [], [], []
        for _ in range(TURNS):
            began_s = time.process_time()
            for _ in range(CALLS):
                cascade(next(given))
            ours_s.append((time.process_time() - began_s) / CALLS)
            scalar_s.append(float(ask(f"scalar {CALLS}")))
            vectorised_s.append(float(ask(f"vectorised {ROWS}")))
        peer.stdin.close()
    ours, scalar, vectorised = map(statistics.median, (ours_s, scalar_s, vectorised_s))
    yield Row(name="fuzzy_cascade", ours=ours, peer=scalar, target=0.05)
    yield Row(name="fuzzy_cascade_vectorised", ours=ours, peer=vectorised, target=10.0)


def _module(name: str) -> ModuleType:
    engine = read_fll((ENGINES / f"{name}.fll").read_bytes(), f"{name}.fll").engine
    assert engine is not None
    module = ModuleType(name)
    exec(compile(compile_engine(engine), f"{name}.py", "exec"), module.__dict__)
    return module
