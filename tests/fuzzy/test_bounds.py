"""Inference with unknown inputs: the interval holds every value that the inputs allow."""

from __future__ import annotations

import math
from types import ModuleType

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codra_dsl.fuzzy.model import Engine
from codra_dsl.runtime.mape.fuzzy.bounds import ANYTHING, UNKNOWN, Bounds, End, joined, known, point, refined
from tests.fuzzy.engines import NAMES, loaded, stored

PLACES = 5
"""How many points of each box are tried."""

shares = st.floats(-0.2, 1.2) | st.sampled_from([0.0, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0])
boxes = st.lists(st.tuples(shares, shares, st.booleans()), min_size=6, max_size=6)
inside = st.lists(st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6), min_size=PLACES, max_size=PLACES)


def box_of(engine: Engine, drawn: list[tuple[float, float, bool]]) -> list[Bounds]:
    """An interval for each input; some are known, and then a point."""
    found = []
    for variable, (one, other, is_known) in zip(engine.inputs, drawn, strict=False):
        width = variable.maximum - variable.minimum
        low, high = (variable.minimum + share * width for share in sorted((one, other)))
        found.append(Bounds(low, low if is_known else high))
    return found


def assert_held(module: ModuleType, box: list[Bounds], points: list[list[float]]) -> None:
    bounds = module.infer_bounds(*box)
    ends = [[0.0] * len(box), [1.0] * len(box)]
    for chosen in [*points, *ends]:
        row = [each.low + share * (each.high - each.low) for each, share in zip(box, chosen, strict=False)]
        row = [min(max(value, each.low), each.high) for value, each in zip(row, box, strict=True)]
        found = module.infer(*row)
        for name, value, held in zip(module.OUTPUTS, found.values, bounds.values, strict=True):
            assert held.holds(value), (name, row, value, held)
        for rule, strength, held in zip(module.RULES, found.strengths, bounds.strengths, strict=True):
            slack = 1e-9 * max(1.0, abs(strength))
            is_held = held.holds(strength) or held.low - slack <= strength <= held.high + slack
            assert is_held, (rule, row, strength, held)


@pytest.mark.parametrize("name", NAMES)
def test_bounds_hold_every_value_that_the_inputs_allow(name: str) -> None:
    engine, module = stored(name), loaded(stored(name))

    @settings(max_examples=150, deadline=None)
    @given(boxes, inside)
    @example([(0.0, 1.0, False)] * 6, [[share] * 6 for share in (0.1, 0.3, 0.5, 0.7, 0.9)])
    def held(drawn: list[tuple[float, float, bool]], points: list[list[float]]) -> None:
        assert_held(module, box_of(engine, drawn), points)

    held()
