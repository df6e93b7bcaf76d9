"""The rows about fuzzy inference: one decision like in P2, with 15 rules for three metrics and 20 for four weights.

The peer is FuzzyLite for Python. Its engines are built once, and called with one row per call, as a robot would do, and
with thousands of rows in one call, as its documentation recommends if they are known in advance. It runs in an
environment of its own, which `make` creates. Both sides get the same rows, and must give the same results.
"""

from __future__ import annotations

import itertools
import random
import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
from fuzzylite_calls import ROOT, FuzzyLite
from rows import Row

from codra_dsl.language.fuzzy import compile_engine, read_fll

ENGINES = ROOT / "tests" / "data" / "fuzzy"
FILES = (ENGINES / "store_metrics.fll", ENGINES / "store_actions.fll")
RANGES = {
    "person_distance": 10.0,
    "person_speed": 3.0,
    "battery": 100.0,
    "drain": 5.0,
    "load": 1.0,
    "progress": 1.0,
}
"""The maximum of each input; the minimum is 0."""

ROWS = 5_000
CALLS = 200
TURNS = 15


def rows(_: Path) -> Iterator[Row]:
    """Measure both sides in turns, by processor time."""
    chance = random.Random(7)
    contexts = [[chance.uniform(0.0, high) for high in RANGES.values()] for _ in range(ROWS)]
    metrics, actions = map(_module, FILES)

    def cascade(context: list[float]) -> tuple[float, ...]:
        distance, _, battery, _, load, _ = context
        weights: tuple[float, ...] = actions.infer(distance, battery, load, *metrics.infer(*context).values).values
        return weights

    with FuzzyLite(FILES, list(RANGES), contexts) as peer:
        np.testing.assert_allclose([cascade(context) for context in contexts], peer.weights, atol=1e-6)
        context_cycle = itertools.cycle(contexts)
        ours_s, scalar_s, vectorised_s = [], [], []
        for _ in range(TURNS):
            began_s = time.process_time()
            for _ in range(CALLS):
                cascade(next(context_cycle))
            ours_s.append((time.process_time() - began_s) / CALLS)
            scalar_s.append(peer.scalar_s(CALLS))
            vectorised_s.append(peer.vectorised_s(ROWS))
    ours, scalar, vectorised = map(statistics.median, (ours_s, scalar_s, vectorised_s))
    yield Row(name="fuzzy_cascade", ours=ours, peer=scalar, target=0.05)
    yield Row(name="fuzzy_cascade_vectorised", ours=ours, peer=vectorised, target=10.0)


def _module(file: Path) -> ModuleType:
    engine = read_fll(file.read_bytes(), file.name).engine
    assert engine is not None
    module = ModuleType(file.stem)
    exec(compile(compile_engine(engine), file.name, "exec"), module.__dict__)
    return module
