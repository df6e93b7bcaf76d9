"""What would have kept the course: found, verified, and the smallest."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import assess
from codra_dsl.runtime.loops.counterfactual import Changed, Counterfactual, keeping, would_keep
from codra_dsl.runtime.loops.courses import CourseState, Decision, choose
from codra_dsl.runtime.loops.declarations import InputModel
from codra_dsl.runtime.loops.filters import FilterState, Tracked
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds
from codra_dsl.runtime.loops.observations import Observation
from tests.runtime.loops.shop import COURSE, LOADS, MAPE, UNFILTERED

NAMES = ("person_distance", "battery_level", "battery_drain", "container_load", "bumped")
BUMPED = InputModel(variable="bumped", range=Bounds(0.0, 1.0), members=("false", "true"))


def scene(*values: Value | None) -> dict[str, Observation]:
    """Return what is known, in the order of NAMES."""
    return {name: Observation(variable=name, value=value) for name, value in zip(NAMES, values, strict=True)}


def decided(before: str, *values: Value | None) -> Decision | None:
    """Return the decision to leave an action, where what is known has it so."""
    running = {action: Tracked(weight=0.0, smoothed=0.0) for action in UNFILTERED.choose}
    standing = CourseState(state=FilterState(instant_s=0.0, action=before, since_s=0.0, tracked=running))
    _, decision, _ = choose(MAPE, UNFILTERED, standing, assess(MAPE, scene(*values)), 10.0)
    return decision


def found(before: str, *values: Value | None) -> dict[Changed, Counterfactual]:
    """Return what would have kept an action, by what is changed."""
    decision = decided(before, *values)
    assert decision is not None
    return {each.kind: each for each in keeping(MAPE, UNFILTERED, decision, (BUMPED,))}


def test_somebody_farther_away_would_have_kept_the_delivery() -> None:
    changes = found("deliver", 1.0, 80.0, 0.5, "empty", False)
    assert changes[Changed.INPUT].name == "person_distance"
    assert changes[Changed.INPUT].other == pytest.approx(2.015, abs=0.01)
    assert changes[Changed.WEIGHT].name == "start"
    assert changes[Changed.WEIGHT].other == pytest.approx(0.339, abs=0.01)


def test_of_a_hard_rule_its_condition_is_what_would_have_to_be_otherwise() -> None:
    changes = found("deliver", 6.0, 80.0, 0.5, "empty", True)
    assert set(changes) == {Changed.INPUT}
    assert (changes[Changed.INPUT].name, changes[Changed.INPUT].other) == ("bumped", False)


def test_actions_that_the_course_does_not_choose_from_are_no_rivals() -> None:
    """The battery is empty, so dock weighs most; a course without it asks about start only."""
    course = replace(UNFILTERED, choose=("deliver", "start"))
    decision = decided("deliver", 1.0, 80.0, 0.5, "empty", False)
    assert decision is not None
    actions = decision.assessment.actions
    heavy = tuple(replace(each, value=1.0) if each.name == "dock" else each for each in actions.outputs)
    assessment = replace(decision.assessment, actions=replace(actions, outputs=heavy))
    kept = keeping(MAPE, course, replace(decision, assessment=assessment))
    (weight,) = [each for each in kept if each.kind is Changed.WEIGHT]
    assert weight.share < 0.5


def test_where_what_was_known_would_have_kept_the_course_no_change_is_told() -> None:
    """A smoothed weight led as long as was to be held, and what is said now has turned already."""
    decision = decided("deliver", 1.0, 80.0, 0.5, "empty", False)
    assert decision is not None
    calm = assess(MAPE, scene(6.0, 80.0, 0.5, "empty", False))
    assert keeping(MAPE, UNFILTERED, replace(decision, assessment=calm), (BUMPED,)) == ()


def test_where_no_single_change_helps_none_is_told() -> None:
    assert found("deliver", 1.0, 3.0, 0.5, "full", True) == {}


def test_the_first_choice_left_nothing_to_be_kept() -> None:
    _, decision, _ = choose(MAPE, COURSE, CourseState(), assess(MAPE, scene(6.0, 80.0, 0.5, "empty", False)), 0.0)
    assert decision is not None
    assert keeping(MAPE, COURSE, decision) == ()


def test_an_unknown_input_is_asked_what_it_would_have_had_to_be() -> None:
    changes = found("deliver", None, 80.0, 0.5, "empty", False)
    assert changes[Changed.INPUT].value is None
    assert changes[Changed.INPUT].name == "person_distance"
    assert float(changes[Changed.INPUT].other) > 2.0


distances, levels, drains = st.floats(0, 10), st.floats(0, 100), st.floats(0, 5)


@given(st.sampled_from(COURSE.choose), st.tuples(distances, levels, drains, st.sampled_from(LOADS), st.booleans()))
def test_what_is_told_would_have_kept_the_course(before: str, values: tuple[Value, ...]) -> None:
    decision = decided(before, *values)
    if decision is None:
        return
    for change in keeping(MAPE, UNFILTERED, decision, (BUMPED,)):
        if change.kind is Changed.INPUT:
            seen = Observation(variable=change.name, value=change.other)
            other = assess(MAPE, {**scene(*values), change.name: seen})
        else:
            stage = decision.assessment.actions
            outputs = tuple(
                replace(each, value=float(change.other)) if each.name == change.name else each for each in stage.outputs
            )
            other = replace(decision.assessment, actions=replace(stage, outputs=outputs))
        assert would_keep(UNFILTERED, other, before, decision.instant_s)
        assert not would_keep(UNFILTERED, decision.assessment, before, decision.instant_s)


@given(distances, levels)
def test_no_smaller_change_of_that_input_would_have_kept_it(distance: float, level: float) -> None:
    values = (distance, level, 0.5, "empty", False)
    decision = decided("deliver", *values)
    change = (
        next((each for each in keeping(MAPE, UNFILTERED, decision) if each.kind is Changed.INPUT), None)
        if decision
        else None
    )
    if change is None or not isinstance(change.value, float) or not isinstance(change.other, float):
        return
    for part in (0.25, 0.5, 0.75, 0.99):
        nearer = change.value + (change.other - change.value) * part
        other = assess(MAPE, {**scene(*values), change.name: Observation(variable=change.name, value=nearer)})
        assert not would_keep(UNFILTERED, other, "deliver", 10.0)
