"""Which inputs of a loop follow from its own results, and when a loop that depends on them has to wait."""

from __future__ import annotations

from dataclasses import replace

from codra_dsl.runtime.loops.declarations import LoopModel, MapeModel
from codra_dsl.runtime.loops.self_dependence import MAX_CHANGES_IN_A_ROW, SelfDependence, fed_back_inputs
from codra_dsl.runtime.values.conditions import value
from tests.runtime.forests import given, variable
from tests.runtime.loops.shop import SPEED

OWN, OUTSIDE = "own", "outside"


def changed_in_a_row(dependence: SelfDependence, cause: str, count: int, start_s: float = 0.0) -> list[str]:
    """Let one input cause some analyses, at different instants, each of which changes a result; return the reports."""
    reports = []
    for number in range(count):
        dependence.note_input(cause)
        dependence.begin_analysis()
        reports += dependence.end_analysis(["speed"], start_s + number)
    dependence.note_input(cause)
    return reports


def test_results_return_to_a_loop_through_derived_variables_and_other_loops() -> None:
    set_speed = LoopModel(name="set_speed", adapt=("speed",))
    set_light = LoopModel(name="set_light", adapt=("light",))
    parameters = (replace(SPEED, name="speed", variable="speed"), replace(SPEED, name="light", variable="light"))
    variables = [given("person"), given("speed"), given("light"), variable("fast", derived=value("speed") > 1.0)]

    def fed_back(**watches: tuple[str, ...]) -> dict[str, set[str]]:
        model = MapeModel(loops=(set_speed, set_light), parameters=parameters)
        return {name: set(inputs) for name, inputs in fed_back_inputs(model, watches, variables).items()}

    assert fed_back(set_speed=("person",), set_light=("speed",)) == {"set_speed": set(), "set_light": set()}
    assert fed_back(set_speed=("person", "fast"), set_light=())["set_speed"] == {"fast"}
    assert fed_back(set_speed=("person", "light"), set_light=("fast",)) == {
        "set_speed": {"light"},
        "set_light": {"fast"},
    }


def test_a_loop_waits_after_ten_changes_that_its_own_results_caused() -> None:
    dependence = SelfDependence(frozenset({OWN}))
    assert changed_in_a_row(dependence, OWN, MAX_CHANGES_IN_A_ROW - 1) == []
    assert not dependence.must_pause(60.0)
    assert changed_in_a_row(dependence, OWN, 3, start_s=60.0) == ["speed"]
    assert dependence.must_pause(90.0)


def test_changes_from_outside_never_make_a_loop_wait() -> None:
    dependence = SelfDependence(frozenset({OWN}))
    assert changed_in_a_row(dependence, OUTSIDE, 100) == []
    assert not dependence.must_pause(200.0)


def test_a_change_from_outside_is_analysed_at_once_even_if_results_change_without_an_end() -> None:
    dependence = SelfDependence(frozenset({OWN}))
    changed_in_a_row(dependence, OWN, 20)
    assert dependence.must_pause(60.0)
    dependence.note_input(OUTSIDE)
    assert not dependence.must_pause(60.0)


def test_a_loop_that_has_settled_does_not_wait_and_can_be_reported_again() -> None:
    dependence = SelfDependence(frozenset({OWN}))
    assert changed_in_a_row(dependence, OWN, 20) == ["speed"]
    dependence.begin_analysis()
    assert dependence.end_analysis([], 60.0) == []
    dependence.note_input(OWN)
    assert not dependence.must_pause(61.0)
    assert changed_in_a_row(dependence, OWN, 20, start_s=70.0) == ["speed"]


def test_changes_at_one_simulated_instant_count_whatever_caused_them() -> None:
    dependence = SelfDependence(frozenset())
    for _ in range(MAX_CHANGES_IN_A_ROW):
        dependence.note_input(OUTSIDE)
        dependence.begin_analysis()
        dependence.end_analysis(["speed"], 5.0)
    dependence.note_input(OUTSIDE)
    assert dependence.must_pause(5.0)
    assert not dependence.must_pause(5.1)
