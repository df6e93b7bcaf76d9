"""The rows about fuzzy inference: one decision as in P2, with 15 rules for three metrics and 20 for four weights.

The peer is FuzzyLite for Python. Its engines are built once. They are called with one row per call, as a robot would
do, and with thousands of rows in one call, as its documentation recommends if the rows are known in advance. FuzzyLite
runs in an environment of its own, which `make` creates. Both sides get the same rows, and must give the same results.
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
MAXIMA = {
    "person_distance": 10.0,
    "person_speed": 3.0,
    "battery": 100.0,
    "drain": 5.0,
    "load": 1.0,
    "progress": 1.0,
}
"""The maximum of each input; the minimum is 0."""

ROW_COUNT = 5_000
CALLS_PER_TURN = 200
TURNS = 15


def rows(_: Path) -> Iterator[Row]:
    """Measure both sides in turns, by processor time."""
    random_source = random.Random(7)
    contexts = [[random_source.uniform(0.0, high) for high in MAXIMA.values()] for _ in range(ROW_COUNT)]
    metrics, actions = map(_module, FILES)

    def cascade(context: list[float]) -> tuple[float, ...]:
        distance, _, battery, _, load, _ = context
        weights: tuple[float, ...] = actions.infer(distance, battery, load, *metrics.infer(*context).values).values
        return weights

    with FuzzyLite(FILES, list(MAXIMA), contexts) as fuzzylite:
        np.testing.assert_allclose([cascade(context) for context in contexts], fuzzylite.weights, atol=1e-6)
        context_cycle = itertools.cycle(contexts)
        ours_s, scalar_s, vectorised_s = [], [], []
        for _ in range(TURNS):
            start_s = time.process_time()
            for _ in range(CALLS_PER_TURN):
                cascade(next(context_cycle))
            ours_s.append((time.process_time() - start_s) / CALLS_PER_TURN)
            scalar_s.append(fuzzylite.scalar_s(CALLS_PER_TURN))
            vectorised_s.append(fuzzylite.vectorised_s(ROW_COUNT))
    ours, scalar, vectorised = map(statistics.median, (ours_s, scalar_s, vectorised_s))
    yield Row(name="fuzzy_cascade", ours=ours, peer=scalar, target=0.05)
    yield Row(name="fuzzy_cascade_vectorised", ours=ours, peer=vectorised, target=10.0)


def _module(file: Path) -> ModuleType:
    engine = read_fll(file.read_bytes(), file.name).engine
    assert engine is not None
    module = ModuleType(file.stem)
    exec(compile(compile_engine(engine), file.name, "exec"), module.__dict__)
    return module
