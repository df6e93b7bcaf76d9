"""Steady values: results between `enter` and `leave`, and values that several results must confirm."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from hypothesis import given as hypothesis_given
from hypothesis import strategies as st

from codra_dsl.logic import Term, value
from codra_dsl.runtime import Kind, Reading, Reason, SimClock
from codra_dsl.runtime.values.conditions import between, confirmed
from codra_dsl.runtime.values.model import SkillModel, real
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, started, takes, variable

GAP = {"gap": real(optional=True)}
BAND = between(value("gap") > 6.0, value("gap") < 4.0)


def gaps(*results: float | None) -> Any:
    """Return a perception function that returns these gaps one by one, and then always the last gap."""
    remaining_gaps = list(results)
    return lambda _: {"gap": remaining_gaps.pop(0) if len(remaining_gaps) > 1 else remaining_gaps[0]}


def make_model(term: Term, *, when: Sequence[Term] = (), **settings: Any) -> Any:
    look = Look(algorithm("look", GAP), {"open": term}, when)
    skills = [SkillModel(name="push", monitor=("open",), changes=("open",))]
    return forest([given("near"), variable("open", **settings)], observer("o", look), skills=skills)


def states_after_looks(model: Any, *results: float | None) -> list[bool | Reason | None]:
    """Return the variable's value, or the reason why it is unknown, after each look; there is a look every second."""
    clock = SimClock()
    with started(model, World({"look": gaps(*results)}), clock) as manager:
        manager.declare("open")
        states: list[bool | Reason | None] = []
        for _ in results:
            clock.sleep(0.5)
            reading = manager.get("open")
            states.append(reading.value if reading.known else reading.reason)
            clock.sleep(0.5)
    return states


# Between enter and leave


def test_between_enter_and_leave_it_is_as_before() -> None:
    assert states_after_looks(make_model(BAND), 7, 5, 3, 5, 4, 6, 6.1) == [True, True, False, False, False, False, True]


def test_between_enter_and_leave_it_is_unknown_before_any_value() -> None:
    assert states_after_looks(make_model(BAND), 5, 5, 3, 5) == [Reason.REJECTED, Reason.REJECTED, False, False]


def test_a_look_between_enter_and_leave_is_evidence_for_the_value_before() -> None:
    clock = SimClock()
    with started(make_model(BAND, valid_for_s=2.5), World({"look": gaps(7, 5)}), clock) as manager:
        manager.declare("open")
        clock.sleep(20.3)
        assert (manager.get("open").value, manager.get("open").evidence_s) == (True, 20.0)


def test_a_stale_value_does_not_count_as_the_value_before() -> None:
    states = states_after_looks(make_model(BAND, valid_for_s=1.7), 7, None, None, 5, 3)
    assert states == [True, True, Reason.REJECTED, Reason.REJECTED, False]


def test_a_result_without_the_value_is_not_between() -> None:
    assert states_after_looks(make_model(BAND, when_unobservable="forget"), 7, 5, None, 5) == [
        True,
        True,
        Reason.REJECTED,
        Reason.REJECTED,
    ]


def test_a_variable_that_a_skill_changed_has_no_value_before() -> None:
    clock = SimClock()
    with started(make_model(BAND), World({"look": gaps(7, 7, 5)}), clock) as manager:
        manager.declare("open")
        clock.sleep(1.5)
        with manager.skill("push") as skill, skill.acting():
            clock.sleep(3)
        reading = manager.get("open")
    assert (reading.reason, reading.detail) == (
        Reason.REJECTED,
        "between enter and leave, and it was unknown before",
    )


# Confirmation


def test_one_result_of_two_needed_is_unconfirmed_with_the_count() -> None:
    clock = SimClock()
    with started(make_model(confirmed(value("gap") > 6.0, 2, 3)), World({"look": gaps(7)}), clock) as manager:
        manager.declare("open")
        clock.sleep(0.5)
        reading = manager.get("open")
        assert (reading.reason, reading.detail) == (
            Reason.UNCONFIRMED,
            "true in 1 of the last 3 results, 2 are needed",
        )
        clock.sleep(1.0)
        assert manager.get("open").value is True
        rejection_events = [event for event in manager.record.of(Kind.JOB) if event.what == "rejected"]
    assert [(event.details["reason"], event.details["variables"]) for event in rejection_events] == [
        (Reason.UNCONFIRMED, ["open"])
    ]


def test_a_value_needs_the_stated_number_of_the_last_results() -> None:
    model = make_model(confirmed(value("gap") > 6.0, 2, 3))
    unconfirmed = Reason.UNCONFIRMED
    assert states_after_looks(model, 7, 3, 7, 3, 3, 7, 7) == [unconfirmed, unconfirmed, True, False, False, False, True]


def test_a_kept_value_stays_until_the_contrary_is_confirmed() -> None:
    model = make_model(confirmed(value("gap") > 6.0, 3, 3))
    assert states_after_looks(model, 7, 7, 7, 3, 3, 7, 3, 3, 3)[2:] == [True] * 6 + [False]


def test_a_value_that_is_forgotten_stays_while_the_last_results_confirm_it() -> None:
    model = make_model(confirmed(value("gap") > 6.0, 2, 3), when_unobservable="forget")
    assert states_after_looks(model, 7, 7, 3, 7, 7)[1:] == [True, True, True, True]


def test_a_value_that_is_forgotten_is_unconfirmed_once_too_few_results_agree() -> None:
    model = make_model(confirmed(value("gap") > 6.0, 3, 3), when_unobservable="forget")
    assert states_after_looks(model, 7, 7, 7, 3, 7)[2:] == [True, Reason.UNCONFIRMED, Reason.UNCONFIRMED]


def test_a_kept_value_that_is_not_confirmed_again_goes_stale_and_is_then_unconfirmed() -> None:
    model = make_model(confirmed(value("gap") > 6.0, 2, 2), valid_for_s=2.2)
    states = states_after_looks(model, 7, 7, 3, 7, 3, 7)
    assert states == [Reason.UNCONFIRMED, True, True, Reason.STALE, Reason.UNCONFIRMED, Reason.UNCONFIRMED]


def test_rejected_results_do_not_count() -> None:
    model = make_model(confirmed(value("gap") > 6.0, 2, 2))
    assert states_after_looks(model, 7, None, 7)[-1] is True


def test_evidence_from_before_an_action_does_not_confirm() -> None:
    clock = SimClock()
    model = make_model(confirmed(value("gap") > 6.0, 2, 3))
    with started(model, World({"look": gaps(7)}), clock) as manager:
        manager.declare("open")
        clock.sleep(2.5)
        with manager.skill("push") as skill, skill.acting():
            clock.sleep(1.0)
            assert manager.get("open").reason is Reason.UNCONFIRMED
            clock.sleep(1.0)
            assert (manager.get("open").value, manager.get("open").start_s) == (True, 3.0)


def test_the_evidence_of_a_confirmed_value_starts_with_the_first_look_that_it_needs() -> None:
    clock = SimClock()
    model = make_model(confirmed(value("gap") > 6.0, 2, 3))
    with started(model, World({"look": takes(0.2, {"gap": 7.0})}), clock) as manager:
        manager.declare("open")
        assert manager.decide("open", lambda: False, since_s=0.5, wait_up_to_s=9.0) is True
        assert (clock.now_s(), manager.get("open").start_s, manager.get("open").evidence_s) == (2.2, 1.0, 2.2)


def test_results_from_before_the_observer_stopped_do_not_confirm() -> None:
    clock = SimClock()
    model = make_model(confirmed(value("gap") > 6.0, 2, 3))
    with started(model, World({"look": gaps(7)}), clock) as manager:
        manager.declare("open")
        clock.sleep(0.5)
        manager.withdraw("open")
        manager.declare("open")
        clock.sleep(0.9)
        assert manager.get("open").reason is Reason.UNCONFIRMED


def out_of_sight_for_a_while(**settings: Any) -> Reading[Any]:
    clock = SimClock()
    model = make_model(confirmed(value("gap") > 6.0, 2, 3), when=[value("near")], **settings)
    with started(model, World({"look": gaps(7)}), clock) as manager:
        manager.set("near", True)
        manager.declare("open")
        clock.sleep(0.5)
        manager.set("near", False)
        clock.sleep(5.0)
        manager.set("near", True)
        clock.sleep(0.5)
        return manager.get("open")


def test_results_from_before_an_unobservable_period_confirm_only_a_kept_value() -> None:
    assert out_of_sight_for_a_while(when_unobservable="keep").known
    assert out_of_sight_for_a_while(when_unobservable="forget").reason is Reason.UNCONFIRMED


def test_results_older_than_valid_for_do_not_confirm() -> None:
    assert out_of_sight_for_a_while(valid_for_s=5.0).reason is Reason.UNCONFIRMED
    assert out_of_sight_for_a_while(valid_for_s=7.0).known


@hypothesis_given(st.lists(st.booleans(), min_size=1, max_size=12), st.integers(1, 4), st.integers(0, 3))
def test_a_value_is_known_only_if_enough_of_the_last_results_agree(
    results: list[bool], needed: int, extra_votes: int
) -> None:
    among = needed + extra_votes
    model = make_model(confirmed(value("gap") > 6.0, needed, among), when_unobservable="forget")
    states = states_after_looks(model, *(7.0 if result else 3.0 for result in results))
    for number, state in enumerate(states):
        last_result_counts = Counter(results[max(0, number + 1 - among) : number + 1])
        if isinstance(state, bool):
            assert last_result_counts[state] >= needed
        else:
            assert state is Reason.UNCONFIRMED
            assert last_result_counts[results[number]] < needed


def test_the_reason_of_an_unconfirmed_variable_is_explained() -> None:
    clock = SimClock()
    with started(make_model(confirmed(BAND, 2, 3)), World({"look": gaps(7)}), clock) as manager:
        manager.declare("open")
        clock.sleep(0.5)
        text = str(manager.why("open"))
        clock.sleep(1.0)
        later = str(manager.why("open"))
    assert "unconfirmed at 0 s: true in 1 of the last 3 results, 2 are needed (look)" in text
    assert "by the rule: enter: gap > 6.0, leave: gap < 4.0, confirm: 2 of 3" in later
