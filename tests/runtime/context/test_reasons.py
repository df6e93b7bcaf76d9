"""Why a variable is unknown: the reason in a reading, and the reasons in the event log."""

from __future__ import annotations

from codra_dsl.logic import value
from codra_dsl.runtime import Kind, Reason, SimClock
from codra_dsl.runtime.values.model import integer
from tests.runtime.door import Door, started
from tests.runtime.forests import Look as Looking
from tests.runtime.forests import World, algorithm, forest, given, observer, seen, takes, variable
from tests.runtime.forests import started as started_forest

YES = {"seen": True}


def test_a_variable_that_was_never_observed_names_the_precondition_that_does_not_hold() -> None:
    with started(Door(distance_m=9.0)) as (manager, clock):
        manager.declare("open")
        clock.sleep(3.0)
        reading = manager.get("open")
        assert (reading.reason, reading.detail) == (Reason.NEVER_OBSERVED, "near")


def test_an_undeclared_variable_reports_that_its_observer_does_not_run() -> None:
    with started(Door()) as (manager, _):
        assert manager.get("open").detail == "door_lid does not run: declare open"


def test_a_variable_without_an_observer_names_its_sources() -> None:
    model = forest([variable("light", sources=("main_execution", "house"))])
    with started_forest(model, World()) as manager:
        assert manager.get("light").detail == "only main_execution or house may write it"


def test_all_obstacles_of_alternatives_are_reported_unless_one_of_them_can_look() -> None:
    first, second = seen("eye", "a", when=[value("x")]), seen("ear", "a", when=[value("y")])
    model = forest([given("x"), given("y"), variable("a")], observer("o", first, second))
    clock = SimClock()
    with started_forest(model, World({"eye": YES, "ear": takes(2.0, YES)}), clock) as manager:
        manager.declare("a")
        assert manager.get("a").detail == "value('x'); value('y')"
        manager.set("y", True)
        clock.sleep(1.0)
        assert (manager.get("a").reason, manager.get("a").detail) == (Reason.NEVER_OBSERVED, "")


def test_a_stale_variable_reports_why_it_was_not_observed_again() -> None:
    eye = seen("eye", "a", when=[value("x")])
    model = forest([given("x"), variable("a", valid_for_s=5.0)], observer("o", eye))
    clock = SimClock()
    with started_forest(model, World({"eye": YES}), clock) as manager:
        manager.declare("a")
        manager.set("x", True)
        clock.sleep(1.5)
        manager.set("x", False)
        clock.sleep(9.0)
        reading = manager.get("a")
    assert (reading.reason, reading.detail) == (Reason.STALE, "value('x')")


def test_the_obstacle_of_a_variable_is_reported_whether_known_or_not() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        manager.declare("open")
        clock.sleep(1.0)
        assert (manager.get("open").value, manager.obstacle("open")) == (True, "")
        manager.set("localized", False)
        clock.sleep(1.0)
        assert (manager.get("open").value, manager.obstacle("open")) == (True, "near")
        assert (manager.get("near").detail, manager.obstacle("near")) == ("localized", "localized")
        assert manager.obstacle("localized") == "only main_execution may write it"


def test_a_decision_that_fell_back_records_the_obstacle() -> None:
    with started(Door(distance_m=9.0)) as (manager, clock):
        manager.declare("open")
        clock.sleep(3.0)
        manager.decide("open", lambda: False)
        (decision,) = manager.record.of(Kind.DECISION)
    assert (decision.details["reason"], decision.details["detail"]) == (Reason.NEVER_OBSERVED, "near")


def test_a_rejected_result_is_recorded_although_the_variable_keeps_its_value() -> None:
    door = Door(angle_rad=1.0)
    with started(door) as (manager, clock):
        manager.declare("open")
        clock.sleep(0.9)
        door.markers = 1
        clock.sleep(1.0)
        assert manager.get("open").value is True
        (event,) = [event for event in manager.record.of(Kind.JOB) if event.what == "rejected"]
    assert (event.name, event.details["variables"], event.details["message"]) == ("look", ["open"], "not markers >= 3")
    assert (event.details["index"], event.details["reason"]) == (1, Reason.REJECTED)


def test_a_result_without_a_value_for_one_variable_is_rejected_for_that_one() -> None:
    door = Door(angle_rad=None)
    with started(door) as (manager, clock):
        manager.declare("open")
        clock.sleep(0.9)
        (event,) = [event for event in manager.record.of(Kind.JOB) if event.what == "rejected"]
    assert (event.details["variables"], event.details["message"]) == (["open"], "the result has no value for it")


def test_a_value_outside_the_range_is_recorded_with_the_error() -> None:
    returns = {"count": integer()}
    look = Looking(algorithm("eye", returns), {"a": value("count")})
    model = forest([variable("a", type=integer(0, 3))], observer("o", look))
    clock = SimClock()
    with started_forest(model, World({"eye": {"count": 7}}), clock) as manager:
        manager.declare("a")
        clock.sleep(0.5)
        (event,) = [event for event in manager.record.of(Kind.JOB) if event.what == "rejected"]
    assert (event.details["reason"], event.details["message"]) == (Reason.FAILED, "7 lies outside [0, 3]")


def test_the_result_of_a_look_from_before_a_change_is_not_kept() -> None:
    with started(Door()) as (manager, clock):

        def look_then_act() -> bool:
            clock.sleep(0.1)
            with manager.skill("open_door") as skill, skill.acting():
                clock.sleep(0.1)
            return False

        manager.declare("open")
        assert manager.decide("open", look_then_act) is False
        assert (manager.get("open").reason, manager.get("open").detail) == (Reason.INVALIDATED, "open_door")
        assert manager.record.of(Kind.DECISION)[-1].details["kept"] is False
