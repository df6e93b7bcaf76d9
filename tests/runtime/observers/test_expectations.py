"""What skills expect while they act: met, violated or not seen, and when that is told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given as given_values
from hypothesis import settings
from hypothesis import strategies as st

from codra_dsl.logic import value
from codra_dsl.runtime import ContextManager, ContextModel, Journal, Kind, NotOfTypeError, Outcome, SimClock, Verdict
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.model import ExpectationModel, SkillModel, real
from tests.runtime.forests import Manager, World, forest, given, observer, seen, started, variable
from tests.runtime.journal.journals import read

OPEN = ExpectationModel(text="open becomes true within 10 s", condition=value("open"), within_s=10.0)
LIT = ExpectationModel(text="lit stays true", condition=value("lit"))


def a_model(*expects: ExpectationModel, changes: tuple[str, ...] = ("open",)) -> ContextModel:
    return forest(
        [variable("open"), variable("lit")],
        observer("o", seen("see_open", "open")),
        observer("p", seen("see_lit", "lit")),
        skills=[SkillModel(name="pull", monitor=("open", "lit"), changes=changes, expects=expects)],
    )


def a_world(*, opens_at_s: float = 99.0, dark_at_s: float = 99.0, blind: str = "") -> World:
    def sees(name: str, found: Any) -> Any:
        return lambda job: {} if name == blind else {"seen": found(job.now_s())}

    return World(
        {
            "see_open": sees("open", lambda now_s: now_s >= opens_at_s),
            "see_lit": sees("lit", lambda now_s: now_s < dark_at_s),
        }
    )


def told(manager: Manager) -> list[tuple[str, str, float]]:
    return [(event.name, event.what, event.instant_s) for event in manager.record.of(Kind.EXPECTATION)]


def must_not_look(variable: str) -> object:
    raise AssertionError(f"the robot looked for {variable} although context knew")


# becomes


def test_what_becomes_true_in_time_is_met_at_the_instant_at_which_it_is_seen() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=4.5), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        with skill.acting():
            clock.sleep(2.0)
        found = skill.verify(must_not_look, wait_up_to_s=20.0)
        assert clock.now_s() == 5.0
    assert told(manager) == [("open", "met", 5.0)]
    assert found.all_met
    assert found.verdicts == (
        Verdict(skill="pull", variable="open", expected=OPEN.text, outcome=Outcome.MET, instant_s=5.0, value=True),
    )
    (event,) = manager.record.of(Kind.EXPECTATION)
    assert event.details["acting_s"] == 1.5


def test_what_is_seen_false_at_the_end_of_its_time_is_violated_though_nobody_asks() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=13.0), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        with skill.acting():
            clock.sleep(2.0)
        clock.sleep(30.0)
        assert skill.verify(must_not_look).violated[0].instant_s == 11.5
    assert told(manager) == [("open", "violated", 11.5)]


def test_what_nobody_sees_in_time_is_not_seen_and_what_is_seen_first_then_decides() -> None:
    clock = SimClock()
    world = a_world(blind="open")
    with started(a_model(OPEN), world, clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(12.0)
        assert skill.verify().not_seen[0].instant_s == 10.0
        world.finds["see_open"] = {"seen": True}
        clock.sleep(1.0)
        assert skill.verify().all_met
    assert told(manager) == [("open", "not_seen", 10.0), ("open", "met", 13.0)]


def test_evidence_from_before_acting_does_not_meet_what_the_skill_changes() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=0.0), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        assert manager.get("open").value is True
        with skill.acting():
            assert [each.outcome for each in skill.verify().verdicts] == [Outcome.NOT_SEEN]
            clock.sleep(1.0)
    assert told(manager) == [("open", "met", 2.0)]


def test_what_the_skill_does_not_change_may_be_so_already() -> None:
    clock = SimClock()
    world = a_world(opens_at_s=0.0)
    with started(a_model(OPEN, changes=()), world, clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        with skill.acting():
            clock.sleep(1.0)
    assert told(manager) == [("open", "met", 1.5)]


def test_while_there_is_time_left_nothing_is_violated_and_nobody_looks_at_what_is_known() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=8.0), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(2.5)
        found = skill.verify(must_not_look)
        assert (found.violated, [each.value for each in found.not_seen]) == ((), [False])
        clock.sleep(6.0)
        assert skill.verify(must_not_look).all_met


def test_a_comparison_is_expected_as_a_value_is() -> None:
    light = ExpectationModel(text="weight becomes < 0.5 within 5 s", condition=value("weight") < 0.5, within_s=5.0)
    model = forest(
        [given("weight", type=real())],
        skills=[SkillModel(name="pour", monitor=("weight",), changes=("weight",), expects=(light,))],
    )
    clock = SimClock()
    with started(model, World(), clock) as manager, manager.skill("pour") as skill, skill.acting():
        for weight in (2.0, 0.5, 0.4):
            clock.sleep(1.0)
            manager.set("weight", weight)
    assert told(manager) == [("weight", "met", 3.0)]


# stays


def test_what_stays_while_the_skill_acts_is_met_at_its_end() -> None:
    clock = SimClock()
    with started(a_model(LIT), a_world(), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(0.5)
        with skill.acting():
            clock.sleep(5.0)
        assert skill.verify(must_not_look).all_met
    assert told(manager) == [("lit", "met", 5.5)]


def test_what_does_not_stay_is_violated_once_it_is_seen_and_never_met_again() -> None:
    clock = SimClock()
    world = a_world(dark_at_s=2.5)
    with started(a_model(LIT), world, clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(3.5)
            world.finds["see_lit"] = {"seen": True}
            clock.sleep(3.0)
        assert [each.value for each in skill.verify(must_not_look).violated] == [False]
    assert told(manager) == [("lit", "violated", 3.0)]


def test_what_is_unknown_at_the_end_of_acting_is_not_seen() -> None:
    clock = SimClock()
    with started(a_model(LIT), a_world(blind="lit"), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(3.5)
        assert [each.variable for each in skill.verify().not_seen] == ["lit"]
    assert told(manager) == [("lit", "not_seen", 3.5)]


# verify


def test_for_what_nobody_saw_the_robot_looks_itself_and_what_it_finds_is_kept_and_judged() -> None:
    clock, asked = SimClock(), []

    def look(name: str) -> bool | None:
        asked.append(name)
        clock.sleep(0.5)
        return name == "lit" or None

    model, world = a_model(OPEN, LIT), World({"see_open": {}, "see_lit": {}})
    with started(model, world, clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(2.0)
        found = skill.verify(look)
        assert manager.get("lit").source == "main_execution"
    assert asked == ["open", "lit"]
    assert ([each.variable for each in found.met], [each.variable for each in found.not_seen]) == (["lit"], ["open"])
    assert told(manager) == [("lit", "not_seen", 2.0), ("lit", "met", 3.0), ("open", "not_seen", 3.0)]


def test_after_its_time_the_robot_finds_out_what_is_violated() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(blind="open"), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(11.0)
        assert [each.outcome for each in skill.verify(lambda _: False).verdicts] == [Outcome.VIOLATED]


def test_what_a_look_returns_must_be_a_value_of_the_variable() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(blind="open"), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            pass
        with pytest.raises(NotOfTypeError):
            skill.verify(lambda _: "wide")


def test_a_verification_has_no_truth_value() -> None:
    with started(a_model(OPEN), a_world()) as manager, manager.skill("pull") as skill:
        with skill.acting():
            pass
        with pytest.raises(TypeError, match=r"no truth value: ask \.all_met"):
            bool(skill.verify())


def test_a_skill_that_expects_nothing_has_all_of_it_met() -> None:
    with started(a_model(), a_world()) as manager, manager.skill("pull") as skill:
        with skill.acting():
            pass
        assert skill.verify(must_not_look).all_met


def test_before_acting_and_after_its_end_a_skill_cannot_be_verified() -> None:
    with started(a_model(OPEN), a_world()) as manager:
        with manager.skill("pull") as skill:
            with pytest.raises(RuntimeError, match=r"has not acted"):
                skill.verify()
            with skill.acting():
                pass
        with pytest.raises(RuntimeError, match=r"skill 'pull' has ended"):
            skill.verify()
        with pytest.raises(RuntimeError, match=r"a skill that has ended cannot act"), skill.acting():
            pass


def test_a_skill_that_ends_before_the_time_is_over_leaves_it_not_seen() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=5.0), clock) as manager:
        with manager.skill("pull") as skill, skill.acting():
            clock.sleep(2.0)
        clock.sleep(20.0)
    assert told(manager) == [("open", "not_seen", 2.0)]


def test_acting_again_counts_anew() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=11.0), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(5.5)
        with skill.acting():
            clock.sleep(8.0)
        assert skill.verify().all_met
    assert told(manager) == [("open", "not_seen", 5.5), ("open", "met", 11.0)]


def test_two_runs_of_one_skill_at_a_time_are_judged_apart() -> None:
    clock = SimClock()
    model, world = a_model(OPEN), a_world(opens_at_s=5.0)
    with started(model, world, clock) as manager, manager.skill("pull") as first, first.acting():
        clock.sleep(4.0)
        with manager.skill("pull") as second, second.acting():
            clock.sleep(3.0)
            assert (first.verify().all_met, second.verify().all_met) == (True, True)
    assert told(manager) == [("open", "met", 5.0), ("open", "met", 5.0)]


def test_an_error_while_acting_ends_the_acting() -> None:
    clock = SimClock()

    def act(manager: Manager) -> None:
        with manager.skill("pull") as skill, skill.acting():
            clock.sleep(1.0)
            raise ValueError("stuck")

    with started(a_model(LIT), a_world(), clock) as manager, pytest.raises(ValueError, match="stuck"):
        act(manager)
    assert told(manager) == [("lit", "met", 1.0)]


# Learning of it


def test_a_violation_is_told_while_the_skill_still_acts() -> None:
    clock, heard = SimClock(), []
    with started(a_model(OPEN, LIT), a_world(dark_at_s=2.5), clock) as manager, manager.skill("pull") as skill:
        skill.subscribe(lambda verdict: heard.append((clock.now_s(), verdict.variable, verdict.outcome)))
        with skill.acting():
            clock.sleep(5.0)
            assert heard == [(3.0, "lit", Outcome.VIOLATED)]


def test_who_does_not_want_to_hear_of_it_any_more_does_not() -> None:
    clock, heard = SimClock(), list[Verdict]()
    model, world = a_model(LIT), a_world(dark_at_s=2.5)
    with started(model, world, clock) as manager, manager.skill("pull") as skill, skill.acting():
        skill.subscribe(heard.append).unsubscribe()
        clock.sleep(5.0)
    assert heard == []


def test_why_tells_what_a_skill_expected_of_a_variable() -> None:
    clock = SimClock()
    with started(a_model(LIT), a_world(dark_at_s=2.5), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(5.0)
        assert "skill pull expected: lit stays true; violated at 3 s" in str(manager.why("lit"))


def test_expectations_are_derived_anew_from_a_journal(tmp_path: Path) -> None:
    model, clock = a_model(OPEN, LIT), SimClock()
    path = tmp_path / "run.mcap"
    world = a_world(opens_at_s=3.0, dark_at_s=12.0)
    with (
        ContextManager[str, str](model, clock=clock, resources={"world": world}, record=Journal(path)) as manager,
        manager.skill("pull") as skill,
    ):
        for _ in range(3):
            with skill.acting():
                clock.sleep(4.2)
            skill.verify(lambda _: True, wait_up_to_s=3.0)
    head, events = read(path)
    kinds = [event.what for event in events if event.kind is Kind.EXPECTATION]
    copy = Journal(tmp_path / "copy.mcap")
    replayed = replay(head, events, model, ContextManager, copy)
    assert (replayed.difference, replayed.derived[Kind.EXPECTATION]) == (None, len(kinds))
    assert {"met", "violated"} <= set(kinds)
    assert (tmp_path / "copy.mcap").read_bytes() == path.read_bytes()


# Against what the record says of the variables


def outcomes_by_hand(states: list[tuple[float, bool | None]], acting_s: float, acted_s: float, end_s: float) -> Any:
    """What comes of a variable that is to become true within 2.05 s, and of one that is to stay so, by its states."""

    def judged(deadline_s: float, by_deadline: dict[bool | None, str], at_once: bool) -> list[str]:
        told: list[str] = []
        moments = [(at_s, state) for at_s, state in states if at_s < end_s]
        before = [state for at_s, state in moments if at_s <= acting_s]
        timeline = [(acting_s, before[-1] if before else None), *(each for each in moments if each[0] > acting_s)]
        last: bool | None = None
        is_over = False
        for at_s, state in [*timeline, (end_s, None)]:
            if told[-1:] in (["met"], ["violated"]):
                break
            if not is_over and at_s > deadline_s:
                is_over = True
                told.append(by_deadline[last])
            if at_s == end_s or told[-1:] in (["met"], ["violated"]):
                break
            last = state
            if state is at_once:
                told.append("met" if at_once else "violated")
            elif state is not None and is_over:
                told.append("violated" if at_once else "met")
        return told if told else ["not_seen"]

    becomes = judged(acting_s + 2.05, {False: "violated", None: "not_seen", True: "met"}, at_once=True)
    stays = judged(acted_s, {True: "met", None: "not_seen", False: "violated"}, at_once=False)
    return becomes, stays


STEPS = st.lists(st.tuples(st.sampled_from(["open", "shut", "wait"]), st.sampled_from([0.3, 0.7, 1.1])), max_size=8)


@settings(deadline=None)
@given_values(before=STEPS, during=STEPS, after=STEPS)
def test_whatever_happens_outcomes_follow_from_what_context_held(
    before: list[tuple[str, float]], during: list[tuple[str, float]], after: list[tuple[str, float]]
) -> None:
    becomes = ExpectationModel(text="open becomes true", condition=value("open"), within_s=2.05)
    stays = ExpectationModel(text="open stays true", condition=value("open"))
    skill = SkillModel(name="pull", monitor=("open",), changes=("open",), expects=(becomes, stays))
    model, clock = forest([given("open", valid_for_s=1.93)], skills=[skill]), SimClock()

    def play(manager: Manager, steps: list[tuple[str, float]]) -> None:
        for what, pause_s in steps:
            if what != "wait":
                manager.set("open", what == "open")
            clock.sleep(pause_s)

    with started(model, World(), clock) as manager:
        with manager.skill("pull") as pull:
            play(manager, before)
            acting_s = clock.now_s()
            with pull.acting():
                clock.sleep(0.01)
                play(manager, during)
            acted_s = clock.now_s()
            clock.sleep(0.01)
            play(manager, after)
            end_s = clock.now_s()
        states = [(event.instant_s, event.details["value"]) for event in manager.record.of(Kind.VARIABLE)]
        expectations = manager.record.of(Kind.EXPECTATION)
        told = [
            [event.what for event in expectations if event.details["expected"] == each.text]
            for each in (becomes, stays)
        ]
    assert tuple(told) == outcomes_by_hand(states, acting_s, acted_s, end_s)
