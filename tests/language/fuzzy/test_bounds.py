"""Inference with unknown inputs: the interval contains every value that the inputs allow."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codra_dsl.language.fuzzy.model import Engine
from codra_dsl.runtime.loops.fuzzy import bounded_activations, terms
from codra_dsl.runtime.loops.fuzzy.bounds import (
    ANYTHING,
    UNKNOWN,
    Bounds,
    End,
    clipped,
    image,
    join,
    known,
    point,
    refined,
)
from tests.language.fuzzy.engines import NAMES, engine_of, loaded, stored

PLACES = 5
"""The number of points that are tried in each box."""

shares = st.floats(-0.2, 1.2) | st.sampled_from([0.0, 0.25, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0])
boxes = st.lists(st.tuples(shares, shares, st.booleans()), min_size=6, max_size=6)
inside = st.lists(st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6), min_size=PLACES, max_size=PLACES)


def box_of(engine: Engine, drawn: list[tuple[float, float, bool]]) -> list[Bounds]:
    """Return an interval for each input; the interval of a known input is a point."""
    box = []
    for variable, (one, other, is_known) in zip(engine.inputs, drawn, strict=False):
        width = variable.maximum - variable.minimum
        low, high = (variable.minimum + share * width for share in sorted((one, other)))
        box.append(Bounds(low, low if is_known else high))
    return box


def assert_held(module: ModuleType, box: list[Bounds], points: list[list[float]]) -> None:
    bounds = module.infer_bounds(*box)
    ends = [[0.0] * len(box), [1.0] * len(box)]
    for shares in [*points, *ends]:
        row = [
            interval.low + share * (interval.high - interval.low) for interval, share in zip(box, shares, strict=False)
        ]
        row = [min(max(value, interval.low), interval.high) for value, interval in zip(row, box, strict=True)]
        inference = module.infer(*row)
        for name, value, bound in zip(module.OUTPUTS, inference.values, bounds.values, strict=True):
            assert bound.holds(value), (name, row, value, bound)
        for rule, strength, bound in zip(module.RULES, inference.strengths, bounds.strengths, strict=True):
            slack = 1e-9 * max(1.0, abs(strength))
            is_held = bound.holds(strength) or bound.low - slack <= strength <= bound.high + slack
            assert is_held, (rule, row, strength, bound)


@pytest.mark.parametrize("name", NAMES)
def test_bounds_contain_every_value_that_the_inputs_allow(name: str) -> None:
    engine, module = stored(name), loaded(stored(name))

    @settings(max_examples=50, deadline=None)
    @given(boxes, inside)
    @example([(0.0, 1.0, False)] * 6, [[share] * 6 for share in (0.1, 0.3, 0.5, 0.7, 0.9)])
    def held(drawn: list[tuple[float, float, bool]], points: list[list[float]]) -> None:
        assert_held(module, box_of(engine, drawn), points)

    held()


FAN = """\
Engine: fan
InputVariable: heat
  range: 0.0 1.0
  term: cold Ramp 1.0 0.0
  term: hot Ramp 0.0 1.0
OutputVariable: speed
  range: 0.0 10.0
  defuzzifier: WeightedAverage
  term: slow Constant 2.0
  term: fast Constant 6.0
RuleBlock:
  activation: General
  rule: if heat is cold then speed is slow
  rule: if heat is hot then speed is fast
"""


def test_a_known_input_gives_the_value_itself() -> None:
    module = loaded(engine_of(FAN))
    (speed,) = module.infer_bounds(point(0.25)).values

    assert speed.low == pytest.approx(3.0)
    assert speed.high == pytest.approx(3.0)
    assert not speed.may_be_unknown


def test_an_unknown_input_has_the_bounds_of_its_range_and_a_worse_end() -> None:
    module = loaded(engine_of(FAN))
    (speed,) = module.infer_bounds(Bounds(0.25, 0.75)).values

    assert speed.worse(End.LOW) == pytest.approx(3.0)
    assert speed.worse(End.HIGH) == pytest.approx(5.0)


def test_if_possibly_no_rule_acts_the_worse_end_is_unknown() -> None:
    module = loaded(engine_of(FAN.replace("Ramp 0.0 1.0", "Ramp 0.5 1.0").replace("Ramp 1.0 0.0", "Ramp 0.4 0.0")))

    assert math.isnan(module.infer_bounds(point(0.45)).values[0].worse(End.LOW))
    assert math.isnan(module.infer_bounds(*module.RANGES).values[0].worse(End.LOW))
    assert not module.infer_bounds(Bounds(0.5001, 1.0)).values[0].may_be_unknown


def test_more_pieces_are_never_wider_and_contain_every_value() -> None:
    engine, module = stored("store_metrics"), loaded(stored("store_metrics"))
    inputs = [bounds if index < 2 else point(bounds.high / 3.0) for index, bounds in enumerate(module.RANGES)]
    undivided_bounds = module.infer_bounds(*inputs).values
    halves = refined(module.infer_bounds, inputs, pieces=2).values
    pieces = refined(module.infer_bounds, inputs, pieces=32).values

    assert len(engine.inputs) == len(inputs)
    for first, second, third in zip(undivided_bounds, halves, pieces, strict=True):
        assert first.low <= second.low <= third.low <= third.high <= second.high <= first.high
    for index in range(21):
        row = (index / 2.0, index * 3.0 / 20.0, *(bounds.low for bounds in inputs[2:]))
        for value, piece_bounds in zip(module.infer(*row).values, pieces, strict=True):
            assert piece_bounds.holds(value)


def test_a_missing_value_is_replaced_by_the_previous_one_or_the_default() -> None:
    partly = Bounds(0.2, 0.4, may_be_unknown=True)

    assert known(Bounds(0.2, 0.4), point(0.9)) == Bounds(0.2, 0.4)
    assert known(partly, point(0.9)) == Bounds(0.2, 0.9)
    assert known(UNKNOWN, point(0.9)) == point(0.9)
    assert known(UNKNOWN, UNKNOWN, point(0.1)) == point(0.1)
    assert known(partly, UNKNOWN) == partly
    assert join(point(0.1), UNKNOWN) == Bounds(0.1, 0.1, may_be_unknown=True)
    assert clipped(Bounds(-3.0, 0.5), 0.0, 1.0) == Bounds(0.0, 0.5)
    assert clipped(ANYTHING, 0.0, 1.0) == Bounds(0.0, 1.0, may_be_unknown=True)


IMAGES: list[tuple[Callable[..., float], tuple[float, ...], Bounds, tuple[float, float]]] = [
    (terms.ramp, (2.0, 1.0), Bounds(0.0, 1.5), (0.5, 1.0)),
    (terms.triangle, (0.0, 1.0, 2.0), Bounds(0.5, 1.75), (0.25, 1.0)),
    (terms.triangle, (1.0, 1.0, 2.0), Bounds(0.5, 1.5), (0.0, 1.0)),
    (terms.rectangle, (0.4, 0.6), Bounds(0.0, 1.0), (0.0, 1.0)),
    (terms.rectangle, (0.4, 0.6), Bounds(0.5, 0.55), (1.0, 1.0)),
    (terms.trapezoid, (0.0, 1.0, 2.0, 3.0), Bounds(-math.inf, math.inf), (0.0, 1.0)),
    (terms.cosine, (0.0, 2.0), Bounds(-5.0, 5.0), (0.0, 1.0)),
]


@pytest.mark.parametrize(("term", "corners", "x", "ends"), IMAGES)
def test_the_degrees_of_a_term_over_an_interval_are_exact(
    term: Callable[..., float], corners: tuple[float, ...], x: Bounds, ends: tuple[float, float]
) -> None:
    assert image(term, x, *corners)[:2] == ends


def test_rules_are_classified_as_acting_for_sure_possibly_or_never() -> None:
    strong, middle, weak, none = Bounds(0.8, 0.9), Bounds(0.3, 0.85), Bounds(0.1, 0.2), point(0.0)

    assert bounded_activations.highest((strong, weak, none), 1) == (strong, None, None)
    assert bounded_activations.highest((strong, middle), 1) == (Bounds(0.0, 0.9), Bounds(0.0, 0.85))
    assert bounded_activations.lowest((strong, weak, none), 1) == (None, weak, None)
    gate = bounded_activations.Gate(1, 0.25)
    assert [gate.admit(strength) for strength in (weak, strong, middle)] == [None, strong, None]
    assert bounded_activations.threshold(middle, ">", 0.5) == Bounds(0.0, 0.85)
    assert bounded_activations.threshold(strong, ">", 0.5) == strong
    assert bounded_activations.threshold(weak, ">", 0.5) is None
