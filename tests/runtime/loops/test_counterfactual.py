"""Counterfactuals: changes that would have kept the course are verified, and the smallest ones."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import assess
from codra_dsl.runtime.loops.counterfactual import ChangeKind, Counterfactual, smallest_changes, would_keep_course
from codra_dsl.runtime.loops.course_filters import FilterState, TrackedAction
from codra_dsl.runtime.loops.courses import CourseState, Decision, choose
from codra_dsl.runtime.loops.declarations import InputModel
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds
from codra_dsl.runtime.loops.observations import Observation
from tests.runtime.loops.shop import COURSE, LOADS, MAPE, UNFILTERED

NAMES = ("person_distance", "battery_level", "battery_drain", "container_load", "bumped")
BUMPED = InputModel(variable="bumped", range=Bounds(0.0, 1.0), members=("false", "true"))


def scene(*values: Value | None) -> dict[str, Observation]:
    """Return observations in the order of NAMES."""
    return {name: Observation(variable=name, value=value) for name, value in zip(NAMES, values, strict=True)}


def decided(before: str, *values: Value | None) -> Decision | None:
    """Return the decision to leave an action, if these values lead to one."""
    running = {action: TrackedAction(weight=0.0, smoothed_weight=0.0) for action in UNFILTERED.choose}
    course_state = CourseState(state=FilterState(instant_s=0.0, action=before, since_s=0.0, tracked_actions=running))
    _, decision, _ = choose(MAPE, UNFILTERED, course_state, assess(MAPE, scene(*values)), 10.0)
    return decision


def changes_by_kind(before: str, *values: Value | None) -> dict[ChangeKind, Counterfactual]:
    """Return the changes that would have kept an action, by the kind of the changed value."""
    decision = decided(before, *values)
    assert decision is not None
    return {change.kind: change for change in smallest_changes(MAPE, UNFILTERED, decision, (BUMPED,))}


def test_a_larger_distance_would_have_kept_the_delivery() -> None:
    changes = changes_by_kind("deliver", 1.0, 80.0, 0.5, "empty", False)
    assert changes[ChangeKind.INPUT].name == "person_distance"
    assert changes[ChangeKind.INPUT].other == pytest.approx(2.015, abs=0.01)
    assert changes[ChangeKind.WEIGHT].name == "start"
    assert changes[ChangeKind.WEIGHT].other == pytest.approx(0.339, abs=0.01)


@pytest.mark.parametrize("distance", [1, 0, None])
def test_a_variable_with_whole_numbers_would_have_kept_the_course_with_a_whole_number(distance: int | None) -> None:
    decision = decided("deliver", distance, 80.0, 0.5, "empty", False)
    assert decision is not None
    changes = {change.kind: change for change in smallest_changes(MAPE, UNFILTERED, decision, (), {"person_distance"})}
    assert repr(changes[ChangeKind.INPUT].other) == "3"


def test_after_a_hard_rule_the_change_is_about_its_condition() -> None:
    changes = changes_by_kind("deliver", 6.0, 80.0, 0.5, "empty", True)
    assert set(changes) == {ChangeKind.INPUT}
    assert (changes[ChangeKind.INPUT].name, changes[ChangeKind.INPUT].other) == ("bumped", False)


def test_actions_that_the_course_does_not_choose_from_do_not_compete() -> None:
    """The battery is empty, so dock has the highest weight; a course without it considers only start."""
    course = replace(UNFILTERED, choose=("deliver", "start"))
    decision = decided("deliver", 1.0, 80.0, 0.5, "empty", False)
    assert decision is not None
    actions = decision.assessment.actions
    heavy = tuple(replace(output, value=1.0) if output.name == "dock" else output for output in actions.outputs)
    assessment = replace(decision.assessment, actions=replace(actions, outputs=heavy))
    kept = smallest_changes(MAPE, course, replace(decision, assessment=assessment))
    (weight,) = [change for change in kept if change.kind is ChangeKind.WEIGHT]
    assert weight.share < 0.5


def test_if_the_present_readings_would_have_kept_the_course_there_is_no_change() -> None:
    """A smoothed weight led for the hold time, but the present weights have already turned."""
    decision = decided("deliver", 1.0, 80.0, 0.5, "empty", False)
    assert decision is not None
    calm = assess(MAPE, scene(6.0, 80.0, 0.5, "empty", False))
    assert smallest_changes(MAPE, UNFILTERED, replace(decision, assessment=calm), (BUMPED,)) == ()


def test_if_no_single_change_helps_there_is_none() -> None:
    assert changes_by_kind("deliver", 1.0, 3.0, 0.5, "full", True) == {}


def test_the_first_choice_has_no_counterfactuals() -> None:
    _, decision, _ = choose(MAPE, COURSE, CourseState(), assess(MAPE, scene(6.0, 80.0, 0.5, "empty", False)), 0.0)
    assert decision is not None
    assert smallest_changes(MAPE, COURSE, decision) == ()


def test_for_an_unknown_input_the_change_is_a_value_that_keeps_the_course() -> None:
    changes = changes_by_kind("deliver", None, 80.0, 0.5, "empty", False)
    assert changes[ChangeKind.INPUT].value is None
    assert changes[ChangeKind.INPUT].name == "person_distance"
    assert float(changes[ChangeKind.INPUT].other) > 2.0


distances, levels, drains = st.floats(0, 10), st.floats(0, 100), st.floats(0, 5)


@given(st.sampled_from(COURSE.choose), st.tuples(distances, levels, drains, st.sampled_from(LOADS), st.booleans()))
def test_every_reported_change_would_have_kept_the_course(before: str, values: tuple[Value, ...]) -> None:
    decision = decided(before, *values)
    if decision is None:
        return
    for change in smallest_changes(MAPE, UNFILTERED, decision, (BUMPED,)):
        if change.kind is ChangeKind.INPUT:
            seen = Observation(variable=change.name, value=change.other)
            other = assess(MAPE, {**scene(*values), change.name: seen})
        else:
            stage = decision.assessment.actions
            outputs = tuple(
                replace(output, value=float(change.other)) if output.name == change.name else output
                for output in stage.outputs
            )
            other = replace(decision.assessment, actions=replace(stage, outputs=outputs))
        assert would_keep_course(UNFILTERED, other, before, decision.instant_s)
        assert not would_keep_course(UNFILTERED, decision.assessment, before, decision.instant_s)


@given(distances, levels)
def test_no_smaller_change_of_that_input_would_have_kept_it(distance: float, level: float) -> None:
    values = (distance, level, 0.5, "empty", False)
    decision = decided("deliver", *values)
    change = (
        next(
            (
                candidate
                for candidate in smallest_changes(MAPE, UNFILTERED, decision)
                if candidate.kind is ChangeKind.INPUT
            ),
            None,
        )
        if decision
        else None
    )
    if change is None or not isinstance(change.value, float) or not isinstance(change.other, float):
        return
    for part in (0.25, 0.5, 0.75, 0.99):
        nearer = change.value + (change.other - change.value) * part
        other = assess(MAPE, {**scene(*values), change.name: Observation(variable=change.name, value=nearer)})
        assert not would_keep_course(UNFILTERED, other, "deliver", 10.0)
