"""The context manager: declaring, expecting, skills, deciding, slots for the main execution."""

from __future__ import annotations

import math

import numpy as np
import pytest

from codra_dsl.runtime import (
    CallError,
    ContextManager,
    Kind,
    NotDeclaredError,
    NotOfTypeError,
    Reason,
    SimClock,
    UnknownNameError,
    UnknownValueError,
)
from codra_dsl.runtime.values.model import SkillModel, real
from tests.runtime.door import GIVEN_NEAR, Door, started
from tests.runtime.forests import World, events, forest, given, observer, seen, takes, variable
from tests.runtime.forests import started as started_forest


def must_not_look() -> object:
    raise AssertionError("the robot looked although the context knew the value")


# Declaring


def test_no_observer_runs_before_a_declaration() -> None:
    door = Door()
    with started(door) as (manager, clock):
        clock.sleep(10)
        assert manager.running() == set()
    assert door.calls == []


def test_declaring_starts_the_needed_observers_and_withdrawing_stops_them() -> None:
    with started(Door()) as (manager, clock):
        manager.declare("open")
        assert manager.running() == {"door_distance", "door_lid"}
        assert manager.declared() == {"open"}
        assert manager.in_force() == {"localized", "near", "open"}
        clock.sleep(2)
        manager.withdraw("open")
        assert manager.running() == set()
        assert manager.in_force() == set()


def test_declaring_twice_needs_one_withdrawal() -> None:
    with started(Door()) as (manager, _):
        manager.declare("near")
        manager.declare("near")
        manager.withdraw("near")
        manager.withdraw("near")
        assert manager.running() == set()


def test_declarations_of_a_skill_stay_when_the_main_execution_withdraws_its_own() -> None:
    with started(Door()) as (manager, _), manager.skill("drive"):
        manager.declare("near")
        manager.withdraw("near")
        assert manager.running() == {"door_distance"}


def test_a_declared_value_is_known_at_once() -> None:
    with started(Door()) as (manager, _):
        manager.declare("open", value=False)
        reading = manager.get("open")
    assert (reading.value, reading.source) == (False, "main_execution")


def test_declaring_a_value_of_another_type_does_not_declare_the_variable() -> None:
    with started(Door()) as (manager, _):
        with pytest.raises(NotOfTypeError, match=r"'wide' is not of type bool"):
            manager.declare("open", value="wide")
        assert manager.declared() == set()


def test_closing_stops_all_observers_and_cancels_their_jobs() -> None:
    door = Door(duration_s=2.0)
    with started(door) as (manager, clock):
        manager.expect("open_door")
        manager.declare("near")
        clock.sleep(1)
    assert manager.running() == manager.declared() == set()
    assert events(manager, Kind.JOB, "look") == ["started", "cancelled"]
    calls = len(door.calls)
    clock.sleep(10)
    assert len(door.calls) == calls


def test_without_a_with_statement_it_works_until_it_is_closed_and_then_refuses_declarations() -> None:
    clock = SimClock()
    manager = ContextManager[str, str](GIVEN_NEAR, clock=clock, resources={"door": Door(angle_rad=1.0)})
    manager.set("near", True)
    manager.declare("open")
    clock.sleep(1)
    assert manager.get("open").value is True
    manager.close()
    manager.close()
    assert manager.get("open").value is True
    for declare in (lambda: manager.declare("open"), lambda: manager.expect("drive")):
        with pytest.raises(RuntimeError, match=r"the context manager is closed: start\(\) creates a new one"):
            declare()
    with pytest.raises(RuntimeError, match=r"closed"), manager.skill("drive"):
        pass
    assert manager.running() == set()


# Names


def test_a_wrong_name_is_reported_with_a_suggestion() -> None:
    with started(Door()) as (manager, _):
        for call in (manager.get, manager.declare, manager.withdraw, manager.history):
            with pytest.raises(UnknownNameError, match=r"the spec has no variable 'opne': did you mean 'open'\?"):
                call("opne")
        with pytest.raises(UnknownNameError, match=r"no variable 'opne'"):
            manager.decide("opne", must_not_look)
        with pytest.raises(UnknownNameError, match=r"no skill 'open_dor': did you mean 'open_door'\?"):
            manager.expect("drive", "open_dor")
        assert manager.declared() == set()
        with pytest.raises(UnknownNameError, match=r"no resource 'visoin'"), manager.slot("visoin"):
            pass


def test_a_handle_that_no_algorithm_reads_is_reported_before_an_observer_runs() -> None:
    model = forest([], slots={"vision": 1})
    with pytest.raises(CallError, match=r"the spec has no resource 'wrold': did you mean 'world'\?"):
        ContextManager(model, clock=SimClock(), resources={"wrold": World()})
    with pytest.raises(CallError, match=r"resource 'vision' has slots, so it needs no handle: leave it out"):
        ContextManager(model, clock=SimClock(), resources={"world": World(), "vision": None})


def test_a_missing_handle_is_reported_before_an_observer_runs() -> None:
    with pytest.raises(CallError, match=r"perception 'eye' reads resource 'world': pass its handle to start\(\)"):
        ContextManager(forest([variable("a")], observer("o", seen("eye", "a"))), clock=SimClock(), resources={})


# Writing


def test_the_main_execution_writes_its_own_or_declared_variables() -> None:
    with started(Door()) as (manager, _):
        manager.set("localized", False)
        with pytest.raises(
            NotDeclaredError, match=r"by observer: the main execution may write the variable only while"
        ):
            manager.set("open", True)
        manager.declare("open")
        manager.set("open", True)
        assert manager.get("open").value is True


def test_the_newest_evidence_wins_and_older_evidence_is_only_in_the_history() -> None:
    """The lid is observed at 0 s and reported at 2 s; the main execution writes newer evidence at 1 s."""
    with started(Door(duration_s=2.0, angle_rad=1.0), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(1)
        manager.set("open", False)
        clock.sleep(1)
        assert manager.get("open").value is False
        assert [(reading.evidence_s, reading.value) for reading in manager.history("open")] == [
            (0.0, True),
            (1.0, False),
        ]


def test_numpy_scalars_are_converted_to_numbers() -> None:
    with started_forest(forest([given("x", type=real(0, 10))]), World()) as manager:
        manager.set("x", np.float32(0.5))
        assert repr(manager.get("x").value) == "0.5"
        manager.set("x", np.float64("nan"))
        assert manager.get("x").reason is Reason.REJECTED


# Skills


def test_the_preview_of_an_expected_skill_is_declared_during_another_skill() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        manager.expect("open_door")
        assert manager.declared() == {"open"}
        with manager.skill("drive"):
            clock.sleep(5)
        with manager.skill("open_door"):
            assert manager.declared() == {"open", "near"}
            assert manager.decide("open", must_not_look) is True
        assert manager.declared() == set()


def test_a_skill_that_begins_is_no_longer_expected_and_others_still_are() -> None:
    with started(Door()) as (manager, _):
        manager.expect("drive", "open_door")
        with manager.skill("drive"):
            pass
        assert manager.declared() == {"open"}
        with manager.skill("open_door"):
            pass
        assert manager.declared() == set()


def test_expecting_other_skills_withdraws_the_earlier_previews() -> None:
    with started(Door()) as (manager, _):
        manager.expect("open_door")
        manager.expect("drive")
        assert manager.declared() == {"near"}
        manager.expect()
        assert manager.declared() == set()


def test_an_observer_keeps_running_from_the_expectation_to_the_skill() -> None:
    with started(Door()) as (manager, clock):
        manager.expect("open_door")
        clock.sleep(0.5)
        with manager.skill("open_door"):
            clock.sleep(0.5)
    assert events(manager, Kind.OBSERVER, "door_lid") == ["started", "stopped"]


def test_a_skill_that_fails_withdraws_its_declarations() -> None:
    with started(Door()) as (manager, _):
        with pytest.raises(ZeroDivisionError), manager.skill("open_door"):
            raise ZeroDivisionError
        assert manager.declared() == set()


def test_one_skill_can_be_under_way_twice() -> None:
    with started(Door()) as (manager, _), manager.skill("drive"):
        with manager.skill("drive"):
            pass
        assert manager.declared() == {"near"}


def test_acting_invalidates_the_variables_that_the_skill_changes() -> None:
    with started(Door(angle_rad=1.0), GIVEN_NEAR) as (manager, clock), manager.skill("open_door") as skill:
        clock.sleep(0.9)
        assert manager.get("open").known
        with skill.acting():
            reading = manager.get("open")
            assert (reading.reason, reading.detail) == (Reason.INVALIDATED, "open_door")


@pytest.mark.parametrize("snapshot", [False, True])
def test_evidence_that_starts_before_an_invalidation_never_counts(snapshot: bool) -> None:
    """Evidence that was complete by then is only in the history; evidence that was being taken is dropped."""
    door = Door(angle_rad=1.0, duration_s=0.9, snapshot=snapshot)
    with started(door, GIVEN_NEAR) as (manager, clock), manager.skill("open_door") as skill:
        clock.sleep(0.5)
        with skill.acting():
            clock.sleep(1)
            assert manager.get("open").reason is Reason.INVALIDATED
            known = [reading.evidence_s for reading in manager.history("open") if reading.known]
            assert known == ([0.0] if snapshot else [])
            clock.sleep(1)
            assert manager.get("open").known
            assert manager.get("open").evidence_s >= 1.0


def test_evidence_that_starts_at_the_instant_of_an_invalidation_does_not_count() -> None:
    with started(Door(angle_rad=1.0, duration_s=0.2), GIVEN_NEAR) as (manager, clock):
        with manager.skill("open_door") as skill:
            clock.sleep(1)
            with skill.acting():
                clock.sleep(0.5)
                assert manager.get("open").reason is Reason.INVALIDATED
                clock.sleep(1)
                assert manager.get("open").evidence_s == 2.0
        assert events(manager, Kind.VARIABLE, "open") == ["identified", "unknown", "too_old", "identified"]


def test_a_failed_look_that_began_before_the_invalidation_leaves_its_reason() -> None:
    def fails(job: object) -> object:
        job.sleep(0.9)  # type: ignore[attr-defined]
        raise ValueError

    with started(Door(instead=fails), GIVEN_NEAR) as (manager, clock), manager.skill("open_door") as skill:
        clock.sleep(0.5)
        with skill.acting():
            clock.sleep(0.45)
            assert manager.get("open").reason is Reason.INVALIDATED
            clock.sleep(1)
            assert manager.get("open").reason is Reason.FAILED


def test_a_changing_variable_is_forgotten_when_unobservable_and_kept_otherwise() -> None:
    with started(Door(angle_rad=1.0), GIVEN_NEAR) as (manager, clock), manager.skill("open_door") as skill:
        clock.sleep(2)
        with skill.acting():
            clock.sleep(3)
            assert manager.get("open").known
            manager.set("near", False)
            clock.sleep(0.1)
            reading = manager.get("open")
            assert (reading.reason, reading.detail) == (Reason.FORGOTTEN, "near")
            manager.set("near", True)
            clock.sleep(3)
        manager.set("near", False)
        clock.sleep(3)
        assert manager.get("open").known


def test_a_value_from_the_main_execution_counts_while_it_acts() -> None:
    with started(Door(), GIVEN_NEAR) as (manager, _), manager.skill("open_door") as skill, skill.acting():
        manager.set("open", True)
        assert manager.get("open").value is True


# Deciding


def test_a_decision_that_context_knows_is_answered() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        manager.declare("open")
        clock.sleep(3)
        assert manager.decide("open", must_not_look) is True
        (decision,) = manager.record.of(Kind.DECISION)
    assert (decision.what, decision.details["value"], decision.details["source"]) == ("answered", True, "look")


def test_a_decision_without_an_answer_falls_back_and_keeps_the_result() -> None:
    with started(Door()) as (manager, clock):
        manager.declare("open")

        def look_at_the_lid() -> bool:
            clock.sleep(2.0)
            return True

        manager.set("localized", False)
        assert manager.decide("open", look_at_the_lid) is True
        assert manager.get("open").evidence_s == 2.0
        assert manager.decide("open", must_not_look) is True
        first, _ = manager.record.of(Kind.DECISION)
    assert (first.what, first.details["reason"], first.instant_s) == ("fell_back", Reason.NEVER_OBSERVED, 2.0)


@pytest.mark.parametrize("shadow", [False, True])
@pytest.mark.parametrize("result", ["a pose", 7, object(), np.zeros(3)])
def test_a_result_of_another_type_is_an_error_and_recorded(result: object, shadow: bool) -> None:
    with started(Door()) as (manager, _):
        manager.declare("open")
        with pytest.raises(NotOfTypeError, match=r"is not of type bool"):
            manager.decide("open", lambda: result, shadow=shadow)
        assert manager.get("open").reason is Reason.NEVER_OBSERVED
        (decision,) = manager.record.of(Kind.DECISION)
        assert manager.record.text().count("fell_back") == 1
    assert decision.details["raised"] == "NotOfTypeError"


def test_a_look_without_a_result_returns_none_and_keeps_no_value() -> None:
    with started(Door()) as (manager, _):
        manager.declare("open")
        assert manager.decide("open", lambda: None) is None
        assert manager.get("open").reason is Reason.NEVER_OBSERVED
        (decision,) = manager.record.of(Kind.DECISION)
    assert (decision.details["found"], decision.details["kept"]) == (None, False)


@pytest.mark.parametrize("shadow", [False, True])
@pytest.mark.parametrize("nan", [math.nan, np.float32("nan")])
def test_a_look_that_returns_nan_has_found_no_value(nan: object, shadow: bool) -> None:
    with started_forest(forest([given("level", type=real())]), World()) as manager:
        manager.declare("level")
        assert manager.decide("level", lambda: nan, shadow=shadow) is None
        assert manager.get("level").reason is Reason.NEVER_OBSERVED
        (decision,) = manager.record.of(Kind.DECISION)
    assert (decision.what, decision.details["found"]) == ("fell_back", None)


def test_a_look_that_fails_raises_in_the_main_execution_and_is_recorded() -> None:
    with started(Door()) as (manager, _):
        with pytest.raises(ZeroDivisionError):
            manager.decide("open", lambda: 1 // 0)
        (decision,) = manager.record.of(Kind.DECISION)
    assert (decision.what, decision.details["raised"]) == ("fell_back", "ZeroDivisionError")


def test_the_result_for_an_undeclared_variable_is_not_kept() -> None:
    with started(Door()) as (manager, _):
        assert manager.decide("open", lambda: True) is True
        assert not manager.get("open").known
        manager.declare("open")
        manager.decide("open", lambda: True)
        kept_flags = [event.details["kept"] for event in manager.record.of(Kind.DECISION)]
    assert kept_flags == [False, True]


def test_a_decision_waits_for_observers_up_to_a_time() -> None:
    with started(Door(angle_rad=1.0, duration_s=2.0)) as (manager, clock):
        manager.declare("open")
        assert manager.decide("open", lambda: None, wait_up_to_s=1.5) is None
        assert clock.now_s() == 1.5
        assert manager.decide("open", must_not_look, wait_up_to_s=1.5) is True
        assert clock.now_s() == 2.0


def test_a_decision_does_not_take_evidence_that_is_too_old() -> None:
    with started(Door(angle_rad=1.0), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(0.9)
        manager.set("near", False)
        clock.sleep(2.1)
        assert manager.decide("open", must_not_look, max_age_s=3.0) is True
        assert manager.decide("open", lambda: None, max_age_s=2.9) is None
        manager.set("near", True)
        assert manager.decide("open", must_not_look, max_age_s=0.5, wait_up_to_s=1.0) is True
        assert clock.now_s() == 3.5


def test_a_decision_does_not_take_evidence_that_began_before_an_instant() -> None:
    """A look that began during an action does not count, even if it ends after the action."""
    for snapshot in (True, False):
        with started(Door(angle_rad=1.0, duration_s=2.0, snapshot=snapshot), GIVEN_NEAR) as (manager, clock):
            manager.declare("open")
            clock.sleep(1.5)
            assert manager.decide("open", must_not_look, since_s=1.5, wait_up_to_s=9.0) is True
            assert clock.now_s() == 4.0
            assert manager.get("open").start_s == 2.0
            assert manager.get("open").evidence_s == (2.0 if snapshot else 4.0)
            assert manager.decide("open", lambda: None, since_s=2.1) is None


def test_a_value_that_the_main_execution_wrote_at_an_instant_counts_since_then() -> None:
    with started(Door()) as (manager, clock):
        clock.sleep(1)
        manager.declare("open", value=True)
        assert manager.decide("open", must_not_look, since_s=1.0) is True


def test_shadow_mode_looks_in_any_case_and_records_whether_context_agrees() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        manager.declare("open")
        clock.sleep(2)
        for result in (True, False, np.True_, None):
            assert manager.decide("open", lambda result=result: result, shadow=True) is result
        agreements = [(event.what, event.details.get("agrees")) for event in manager.record.of(Kind.DECISION)]
        assert manager.record.text().count("shadowed") == 4
    assert agreements == [("shadowed", True), ("shadowed", False), ("shadowed", True), ("shadowed", None)]


def test_shadow_mode_does_not_write_to_the_context() -> None:
    """Otherwise it would measure how often the old perception agrees with itself."""
    with started(Door()) as (manager, _):
        manager.declare("open")
        assert manager.decide("open", lambda: True, shadow=True) is True
        assert not manager.get("open").known
        assert events(manager, Kind.DECISION) == ["fell_back"]


def test_an_unknown_value_cannot_be_taken_for_false() -> None:
    with started(Door()) as (manager, _):
        manager.declare("open")
        reading = manager.get("open")
        with pytest.raises(UnknownValueError, match=r"open is unknown \(never_observed: near\)"):
            _ = reading.value
        with pytest.raises(TypeError, match=r"a reading has no truth value: use \.known"):
            bool(reading)


# Slots


def test_the_main_execution_goes_first_when_slots_become_free() -> None:
    world = World({"eye": takes(2.0, {"seen": True}), "ear": takes(2.0, {"seen": True})})
    model = forest(
        [variable("a"), variable("b")],
        observer("o", seen("eye", "a", slots=("one",)), priority=99),
        observer("p", seen("ear", "b", slots=("one",)), priority=98),
        slots={"one": 1},
    )
    clock = SimClock()
    with started_forest(model, world, clock) as manager:
        manager.declare("a")
        manager.declare("b")
        clock.sleep(0.5)
        with manager.slot("one"):
            assert clock.now_s() == 2.0
            clock.sleep(5)
            assert world.calls == [("eye", 0.0)]
        clock.sleep(1)
        assert world.calls == [("eye", 0.0), ("eye", 7.0)]


def test_a_resource_without_slots_is_refused() -> None:
    message_pattern = r"'world' has no slots: use its handle"
    with (
        started_forest(forest([]), World()) as manager,
        pytest.raises(UnknownNameError, match=message_pattern),
        manager.slot("world"),
    ):
        pass


def test_waiting_for_slots_that_cannot_become_free_is_an_error_in_simulated_time() -> None:
    model = forest([], slots={"one": 1})
    with started_forest(model, World()) as manager:
        manager.commands.request_slots(("one",), lambda: None)
        for _ in range(2):
            with pytest.raises(RuntimeError, match=r"wait forever"), manager.slot("one"):
                pass


def test_previews_of_several_skills_are_declared_together() -> None:
    skills = [SkillModel(name=name, preview=(name.upper(),)) for name in "abc"]
    model = forest([given("A"), given("B"), given("C")], skills=skills)
    with started_forest(model, World()) as manager:
        manager.expect("a", "c")
        assert manager.declared() == {"A", "C"}


def test_a_decision_sees_the_end_of_validity_at_its_instant() -> None:
    model = forest([given("x", valid_for_s=2.0)])
    clock = SimClock()
    with started_forest(model, World(), clock) as manager:
        manager.set("x", True)
        clock.sleep(2)
        assert manager.decide("x", lambda: None) is None
        (decision,) = manager.record.of(Kind.DECISION)
    assert decision.details["reason"] is Reason.STALE
