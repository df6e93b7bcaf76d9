"""The expectations of skills while they act: met, violated or not seen, and when the outcome is recorded."""

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
    def sees(name: str, value_at: Any) -> Any:
        return lambda job: {} if name == blind else {"seen": value_at(job.now_s())}

    return World(
        {
            "see_open": sees("open", lambda now_s: now_s >= opens_at_s),
            "see_lit": sees("lit", lambda now_s: now_s < dark_at_s),
        }
    )


def outcomes(manager: Manager) -> list[tuple[str, str, float]]:
    return [(event.name, event.what, event.instant_s) for event in manager.record.of(Kind.EXPECTATION)]


def must_not_look(variable: str) -> object:
    raise AssertionError(f"the robot looked for {variable} although the context knew it")


# becomes


def test_becoming_true_in_time_is_met_at_the_instant_of_observation() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=4.5), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        with skill.acting():
            clock.sleep(2.0)
        verification = skill.verify(must_not_look, wait_up_to_s=20.0)
        assert clock.now_s() == 5.0
    assert outcomes(manager) == [("open", "met", 5.0)]
    assert verification.all_met
    assert verification.verdicts == (
        Verdict(skill="pull", variable="open", expected=OPEN.text, outcome=Outcome.MET, instant_s=5.0, value=True),
    )
    (event,) = manager.record.of(Kind.EXPECTATION)
    assert event.details["acting_s"] == 1.5


def test_a_value_that_is_false_at_the_deadline_is_violated_without_a_query() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=13.0), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        with skill.acting():
            clock.sleep(2.0)
        clock.sleep(30.0)
        assert skill.verify(must_not_look).violated[0].instant_s == 11.5
    assert outcomes(manager) == [("open", "violated", 11.5)]


def test_without_an_observation_before_the_deadline_the_first_later_one_decides() -> None:
    clock = SimClock()
    world = a_world(blind="open")
    with started(a_model(OPEN), world, clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(12.0)
        assert skill.verify().not_seen[0].instant_s == 10.0
        world.finds["see_open"] = {"seen": True}
        clock.sleep(1.0)
        assert skill.verify().all_met
    assert outcomes(manager) == [("open", "not_seen", 10.0), ("open", "met", 13.0)]


def test_evidence_from_before_acting_does_not_meet_an_expectation_of_a_changed_variable() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=0.0), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        assert manager.get("open").value is True
        with skill.acting():
            assert [verdict.outcome for verdict in skill.verify().verdicts] == [Outcome.NOT_SEEN]
            clock.sleep(1.0)
    assert outcomes(manager) == [("open", "met", 2.0)]


def test_an_expectation_of_an_unchanged_variable_may_be_met_at_once() -> None:
    clock = SimClock()
    world = a_world(opens_at_s=0.0)
    with started(a_model(OPEN, changes=()), world, clock) as manager, manager.skill("pull") as skill:
        clock.sleep(1.5)
        with skill.acting():
            clock.sleep(1.0)
    assert outcomes(manager) == [("open", "met", 1.5)]


def test_before_the_deadline_an_expectation_is_not_violated_and_a_known_variable_is_not_observed() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=8.0), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(2.5)
        verification = skill.verify(must_not_look)
        assert (verification.violated, [verdict.value for verdict in verification.not_seen]) == ((), [False])
        clock.sleep(6.0)
        assert skill.verify(must_not_look).all_met


def test_an_expectation_may_be_a_comparison() -> None:
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
    assert outcomes(manager) == [("weight", "met", 3.0)]


# stays


def test_staying_true_while_the_skill_acts_is_met_at_the_end() -> None:
    clock = SimClock()
    with started(a_model(LIT), a_world(), clock) as manager, manager.skill("pull") as skill:
        clock.sleep(0.5)
        with skill.acting():
            clock.sleep(5.0)
        assert skill.verify(must_not_look).all_met
    assert outcomes(manager) == [("lit", "met", 5.5)]


def test_not_staying_true_is_violated_at_the_observation_and_final() -> None:
    clock = SimClock()
    world = a_world(dark_at_s=2.5)
    with started(a_model(LIT), world, clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(3.5)
            world.finds["see_lit"] = {"seen": True}
            clock.sleep(3.0)
        assert [verdict.value for verdict in skill.verify(must_not_look).violated] == [False]
    assert outcomes(manager) == [("lit", "violated", 3.0)]


def test_a_variable_that_is_unknown_at_the_end_of_acting_is_not_seen() -> None:
    clock = SimClock()
    with started(a_model(LIT), a_world(blind="lit"), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(3.5)
        assert [verdict.variable for verdict in skill.verify().not_seen] == ["lit"]
    assert outcomes(manager) == [("lit", "not_seen", 3.5)]


# verify


def test_the_robot_itself_looks_for_variables_that_were_not_seen_and_the_values_are_stored_and_judged() -> None:
    clock, looked_names = SimClock(), []

    def look(name: str) -> bool | None:
        looked_names.append(name)
        clock.sleep(0.5)
        return name == "lit" or None

    model, world = a_model(OPEN, LIT), World({"see_open": {}, "see_lit": {}})
    with started(model, world, clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(2.0)
        verification = skill.verify(look)
        assert manager.get("lit").source == "main_execution"
    assert looked_names == ["open", "lit"]
    assert (
        [verdict.variable for verdict in verification.met],
        [verdict.variable for verdict in verification.not_seen],
    ) == (["lit"], ["open"])
    assert outcomes(manager) == [("lit", "not_seen", 2.0), ("lit", "met", 3.0), ("open", "not_seen", 3.0)]


def test_after_the_deadline_a_look_of_the_robot_detects_a_violation() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(blind="open"), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(11.0)
        assert [verdict.outcome for verdict in skill.verify(lambda _: False).verdicts] == [Outcome.VIOLATED]


def test_a_look_must_return_a_value_of_the_variable() -> None:
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
        with pytest.raises(TypeError, match=r"no truth value: use \.all_met"):
            bool(skill.verify())


def test_a_skill_without_expectations_has_all_met() -> None:
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


def test_a_skill_that_ends_before_the_deadline_has_the_outcome_not_seen() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=5.0), clock) as manager:
        with manager.skill("pull") as skill, skill.acting():
            clock.sleep(2.0)
        clock.sleep(20.0)
    assert outcomes(manager) == [("open", "not_seen", 2.0)]


def test_acting_again_restarts_the_expectations() -> None:
    clock = SimClock()
    with started(a_model(OPEN), a_world(opens_at_s=11.0), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(5.5)
        with skill.acting():
            clock.sleep(8.0)
        assert skill.verify().all_met
    assert outcomes(manager) == [("open", "not_seen", 5.5), ("open", "met", 11.0)]


def test_two_concurrent_runs_of_one_skill_are_judged_separately() -> None:
    clock = SimClock()
    model, world = a_model(OPEN), a_world(opens_at_s=5.0)
    with started(model, world, clock) as manager, manager.skill("pull") as first, first.acting():
        clock.sleep(4.0)
        with manager.skill("pull") as second, second.acting():
            clock.sleep(3.0)
            assert (first.verify().all_met, second.verify().all_met) == (True, True)
    assert outcomes(manager) == [("open", "met", 5.0), ("open", "met", 5.0)]


def test_an_error_while_acting_ends_the_acting() -> None:
    clock = SimClock()

    def act(manager: Manager) -> None:
        with manager.skill("pull") as skill, skill.acting():
            clock.sleep(1.0)
            raise ValueError("stuck")

    with started(a_model(LIT), a_world(), clock) as manager, pytest.raises(ValueError, match="stuck"):
        act(manager)
    assert outcomes(manager) == [("lit", "met", 1.0)]


# Subscription and explanation


def test_a_violation_is_reported_while_the_skill_still_acts() -> None:
    clock, verdicts = SimClock(), []
    with started(a_model(OPEN, LIT), a_world(dark_at_s=2.5), clock) as manager, manager.skill("pull") as skill:
        skill.subscribe(lambda verdict: verdicts.append((clock.now_s(), verdict.variable, verdict.outcome)))
        with skill.acting():
            clock.sleep(5.0)
            assert verdicts == [(3.0, "lit", Outcome.VIOLATED)]


def test_after_unsubscribing_the_callback_is_not_called() -> None:
    clock, verdicts = SimClock(), list[Verdict]()
    model, world = a_model(LIT), a_world(dark_at_s=2.5)
    with started(model, world, clock) as manager, manager.skill("pull") as skill, skill.acting():
        skill.subscribe(verdicts.append).unsubscribe()
        clock.sleep(5.0)
    assert verdicts == []


def test_why_reports_the_expectation_of_a_skill() -> None:
    clock = SimClock()
    with started(a_model(LIT), a_world(dark_at_s=2.5), clock) as manager, manager.skill("pull") as skill:
        with skill.acting():
            clock.sleep(5.0)
        assert "skill pull expected: lit stays true; violated at 3 s" in str(manager.why("lit"))


def test_a_replay_derives_the_same_expectations_from_a_journal(tmp_path: Path) -> None:
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
    header, events = read(path)
    kinds = [event.what for event in events if event.kind is Kind.EXPECTATION]
    copy = Journal(tmp_path / "copy.mcap")
    replayed = replay(header, events, model, ContextManager, copy)
    assert (replayed.difference, replayed.derived[Kind.EXPECTATION]) == (None, len(kinds))
    assert {"met", "violated"} <= set(kinds)
    assert (tmp_path / "copy.mcap").read_bytes() == path.read_bytes()


# Comparison with the recorded values of the variables


def outcomes_by_hand(states: list[tuple[float, bool | None]], acting_s: float, acted_s: float, end_s: float) -> Any:
    """Return the outcomes of "becomes true within 2.05 s" and of "stays true", from the states of a variable."""

    def expected_outcomes(deadline_s: float, by_deadline: dict[bool | None, str], at_once: bool) -> list[str]:
        outcome_names: list[str] = []
        moments = [(at_s, state) for at_s, state in states if at_s < end_s]
        before = [state for at_s, state in moments if at_s <= acting_s]
        timeline = [(acting_s, before[-1] if before else None), *(moment for moment in moments if moment[0] > acting_s)]
        last: bool | None = None
        is_over = False
        for at_s, state in [*timeline, (end_s, None)]:
            if outcome_names[-1:] in (["met"], ["violated"]):
                break
            if not is_over and at_s > deadline_s:
                is_over = True
                outcome_names.append(by_deadline[last])
            if at_s == end_s or outcome_names[-1:] in (["met"], ["violated"]):
                break
            last = state
            if state is at_once:
                outcome_names.append("met" if at_once else "violated")
            elif state is not None and is_over:
                outcome_names.append("violated" if at_once else "met")
        return outcome_names if outcome_names else ["not_seen"]

    becomes = expected_outcomes(acting_s + 2.05, {False: "violated", None: "not_seen", True: "met"}, at_once=True)
    stays = expected_outcomes(acted_s, {True: "met", None: "not_seen", False: "violated"}, at_once=False)
    return becomes, stays


STEPS = st.lists(st.tuples(st.sampled_from(["open", "shut", "wait"]), st.sampled_from([0.3, 0.7, 1.1])), max_size=8)


@settings(deadline=None)
@given_values(before=STEPS, during=STEPS, after=STEPS)
def test_outcomes_follow_from_the_recorded_values_of_the_context(
    before: list[tuple[str, float]], during: list[tuple[str, float]], after: list[tuple[str, float]]
) -> None:
    becomes = ExpectationModel(text="open becomes true", condition=value("open"), within_s=2.05)
    stays = ExpectationModel(text="open stays true", condition=value("open"))
    skill = SkillModel(name="pull", monitor=("open",), changes=("open",), expects=(becomes, stays))
    model, clock = forest([given("open", valid_for_s=1.93)], skills=[skill]), SimClock()

    def play(manager: Manager, steps: list[tuple[str, float]]) -> None:
        for action, pause_s in steps:
            if action != "wait":
                manager.set("open", action == "open")
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
        recorded_outcomes = [
            [event.what for event in expectations if event.details["expected"] == expectation.text]
            for expectation in (becomes, stays)
        ]
    assert tuple(recorded_outcomes) == outcomes_by_hand(states, acting_s, acted_s, end_s)
