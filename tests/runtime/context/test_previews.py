"""The preview of a skill as one decision: holds, violated or unknown, with the reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from codra_dsl.logic import Value
from codra_dsl.runtime import (
    DecisionState,
    Journal,
    Kind,
    NotOfTypeError,
    PreviewAnswer,
    PreviewOutcome,
    Reading,
    Reason,
    SimClock,
    UnknownNameError,
)
from codra_dsl.runtime.context.decisions import PreviewContext
from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.fields import preview_schema
from codra_dsl.runtime.observers.urgency import Urgency
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import age, choose, value
from codra_dsl.runtime.values.model import PreviewCondition, SkillModel
from codra_dsl.runtime.values.previews import evaluate
from codra_dsl.runtime.why import explain
from tests.runtime.cycler import HOLDS, MODEL, OBSERVED, OPEN_CYCLER, Manager, cycler
from tests.runtime.door import Door
from tests.runtime.journal.journals import messages, read


def answer_for(values: Mapping[str, Value | None]) -> PreviewAnswer:
    with cycler(values) as (manager, _):
        return manager.preview("open_cycler")


# The answer


def test_a_preview_holds_if_all_conditions_hold_and_names_alone_are_known() -> None:
    answer = answer_for(HOLDS)
    assert (answer.outcome, answer.holds, str(answer)) == (PreviewOutcome.HOLDS, True, "holds")


def test_a_violated_condition_decides_the_preview_although_another_is_unknown() -> None:
    answer = answer_for({**HOLDS, "battery": 10.0, "rotor_in_pos_1": None})
    assert str(answer) == "violated: battery > 20 percent"
    assert answer.undecided == ("rotor_in_pos_1 == true",)


def test_an_unknown_variable_of_five_conditions_is_named_with_its_reason() -> None:
    answer = answer_for({**HOLDS, "rotor_in_pos_1": None})
    assert str(answer) == "unknown: rotor_in_pos_1 (never_observed: only main_execution may write it)"
    assert [variable.name for variable in answer.unknown] == ["rotor_in_pos_1"]


def test_an_unknown_variable_that_the_conditions_do_not_need_is_no_reason() -> None:
    assert answer_for({**HOLDS, "level": None}).holds
    assert [variable.name for variable in answer_for({**HOLDS, "gap": None}).unknown] == ["gap"]
    assert [variable.name for variable in answer_for({**HOLDS, "tube": None}).unknown] == ["tube"]


def test_a_variable_on_which_no_undecided_condition_depends_is_no_reason() -> None:
    terms = {
        "a or (b and c)": value("a") | (value("b") & value("c")),
        "c if b else a": choose(value("c"), value("b"), value("a")),
    }
    for text, term in terms.items():
        condition = PreviewCondition(text=text, condition=term)
        skill = SkillModel(name="go", preview=("a", "b", "c"), preview_conditions=(condition,))
        unknown: Reading[Value] = Reading(name="a", reason=Reason.NEVER_OBSERVED)
        readings = {"a": unknown, "b": replace(unknown, name="b", content=False, reason=None)}
        readings["c"] = replace(unknown, name="c")
        answer = evaluate(skill, PreviewContext(readings, readings.keys() - {"a", "c"}, {}, 0.0))
        assert [variable.name for variable in answer.unknown] == ["a"]


def test_an_answer_has_no_truth_value() -> None:
    with pytest.raises(TypeError, match=r"use \.holds, \.violated or \.unknown"):
        bool(answer_for(HOLDS))


def test_an_unknown_skill_is_an_error_with_a_suggestion() -> None:
    with cycler() as (manager, _), pytest.raises(UnknownNameError, match="open_cycler"):
        manager.preview("open_cylcer")


def test_values_that_went_stale_are_unknown() -> None:
    with cycler() as (manager, clock):
        clock.sleep(59.0)
        assert manager.preview("open_cycler").holds
        clock.sleep(2.0)
        answer = manager.preview("open_cycler")
    assert {variable.reason for variable in answer.unknown} == {"stale"}
    assert len(answer.unknown) == len(HOLDS)


def test_values_from_old_evidence_are_unknown_if_the_preview_asks_for_newer_evidence() -> None:
    with cycler() as (manager, clock):
        clock.sleep(5.0)
        manager.set("gap", 0.02)
        too_old = manager.preview("open_cycler", max_age_s=4.0)
        before_action = manager.preview("open_cycler", since_s={"battery": 1.0, "gap": 1.0})
        assert manager.preview("open_cycler", since_s=0.0).holds
    assert {variable.name for variable in too_old.unknown} == {"locked", "battery", "rotor_in_pos_1", "tube"}
    assert [(variable.name, variable.reason) for variable in before_action.unknown] == [("battery", "too_old")]
    with cycler() as (manager, _), pytest.raises(ValueError, match="NaN"):
        manager.preview("open_cycler", max_age_s=math.nan)


BOOLEANS = some.sampled_from([None, True, False])


@settings(max_examples=20)
@given(
    some.fixed_dictionaries(
        {
            "locked": BOOLEANS,
            "battery": some.sampled_from([None, 10.0, 20.0, 80.0]),
            "rotor_in_pos_1": BOOLEANS,
            "level": some.sampled_from([None, "low", "high"]),
            "gap": some.sampled_from([None, 0.01, 0.5]),
            "tube": BOOLEANS,
        }
    )
)
def test_an_answer_is_what_every_completion_of_the_unknown_values_gives(values: Mapping[str, Value | None]) -> None:
    """Each condition of this preview reads a variable once, so Kleene's logic is exact."""
    domains: dict[str, list[Value]] = {"locked": [True, False], "rotor_in_pos_1": [True, False], "battery": [0.0, 90.0]}
    domains |= {"level": ["low", "high"], "gap": [0.0, 1.0]}
    truths: set[Value | None] = {True}
    for condition in MODEL.skills[0].preview_conditions:
        possible: list[dict[str, Value]] = [{}]
        for name in sorted(condition.condition.variables()):
            known = values[name]
            choices = domains[name] if known is None else [known]
            possible = [{**scope, name: choice} for scope in possible for choice in choices]
        results = {condition.condition.evaluate(_Values(scope)) for scope in possible}
        truths.add(results.pop() if len(results) == 1 else None)
    truths.add(True if values["tube"] is not None else None)
    expected = (
        PreviewOutcome.VIOLATED
        if False in truths
        else PreviewOutcome.UNKNOWN
        if None in truths
        else PreviewOutcome.HOLDS
    )
    assert answer_for(values).outcome is expected


class _Values:
    def __init__(self, values: Mapping[str, Value]) -> None:
        self._values = values

    def value(self, name: str) -> Value | None:
        return self._values[name]

    def age_s(self, name: str) -> float | None:
        raise AssertionError(name)


# Looks of the main execution


def test_the_main_execution_looks_only_until_the_preview_is_decided() -> None:
    looked: list[str] = []

    def look(name: str) -> object:
        looked.append(name)
        return {"battery": 80.0, "rotor_in_pos_1": False}[name]

    with cycler({**HOLDS, "battery": None, "rotor_in_pos_1": None, "gap": None, "tube": None}) as (manager, _):
        answer = manager.preview("open_cycler", look)
        assert manager.get("battery").value == 80.0
        assert manager.get("battery").source == "main_execution"
    assert looked == ["battery", "rotor_in_pos_1"]
    assert answer.violated == ("rotor_in_pos_1 == true",)


def test_a_preview_that_context_decides_calls_no_look() -> None:
    def must_not_look(name: str) -> object:
        raise AssertionError(name)

    with cycler() as (manager, _):
        assert manager.preview("open_cycler", must_not_look).holds
        manager.set("locked", True)
        assert manager.preview("open_cycler", must_not_look).violated == ("locked == false",)


@pytest.mark.parametrize("nothing", [None, math.nan])
def test_a_look_without_a_value_leaves_the_preview_unknown(nothing: float | None) -> None:
    with cycler({**HOLDS, "gap": None}) as (manager, _):
        answer = manager.preview("open_cycler", lambda _: nothing)
    assert [variable.name for variable in answer.unknown] == ["gap"]


def test_a_look_that_fails_or_has_another_type_ends_the_preview_and_is_recorded() -> None:
    with cycler({**HOLDS, "gap": None}) as (manager, _):
        with pytest.raises(ZeroDivisionError):
            manager.preview("open_cycler", lambda _: 1 // 0)
        with pytest.raises(NotOfTypeError):
            manager.preview("open_cycler", lambda _: "wide")
        raised = [event.details["raised"] for event in manager.record.of(Kind.PREVIEW)]
    assert raised == ["ZeroDivisionError", "NotOfTypeError"]


def test_a_value_is_not_kept_if_a_skill_has_changed_the_variable_meanwhile() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door()}) as manager:
        manager.set("localized", True)
        manager.expect("pass_door")

        def look(_: str) -> bool:
            clock.sleep(1.0)
            with manager.skill("pass_door") as skill, skill.acting():
                clock.sleep(1.0)
            return True

        manager.preview("pass_door", look)
        assert not manager.get("open").known


# Waiting


def test_a_preview_waits_for_observers_and_ends_as_soon_as_it_is_decided() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door(angle_rad=1.0)}) as manager:
        manager.set("localized", True)
        manager.expect("pass_door")
        assert manager.declared() == {"open", "near"}
        assert manager.preview("pass_door", wait_up_to_s=60.0).holds
        assert clock.now_s() < 2.0


def test_a_preview_that_nobody_decides_waits_for_its_time() -> None:
    clock = SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": Door(markers=0)}) as manager:
        manager.set("localized", True)
        manager.expect("pass_door")
        pending = manager.ask_preview("pass_door", wait_up_to_s=3.0)
        assert (pending.state, pending.missing) == (DecisionState.WAITING, ())
        assert manager.commands.urgency("door_lid") is Urgency.WAITED_FOR
        assert pending.wait(math.inf) is DecisionState.ANSWERED
        assert pending.answer.outcome is PreviewOutcome.UNKNOWN
        assert manager.commands.urgency("door_lid") is Urgency.EXPECTED
        assert clock.now_s() == 3.0


def test_in_steps_a_preview_looks_for_one_variable_after_the_other() -> None:
    with cycler({**HOLDS, "gap": None, "tube": None}) as (manager, _):
        pending = manager.ask_preview("open_cycler", looks=True)
        assert (pending.state, pending.missing) == (DecisionState.LOOKING, ("gap", "tube"))
        assert pending.record_result(0.02) is DecisionState.LOOKING
        assert pending.record_result(True) is DecisionState.ANSWERED
        assert pending.answer.holds
        with pytest.raises(RuntimeError, match="answered"):
            pending.record_result(True)
        pending.abandon("over")
        assert len(manager.record.of(Kind.PREVIEW)) == 1


# The journal


def run_previews(path: Path) -> Journal:
    """Run a robot that asks for previews: answered, waited for, looked for, unanswered and abandoned."""
    journal, door, clock = Journal(path), Door(angle_rad=1.0), SimClock()
    with Manager(OBSERVED, clock=clock, resources={"door": door}, record=journal) as manager:
        manager.set("localized", True)
        manager.preview("pass_door")
        manager.preview("pass_door", lambda name: name == "near")
        manager.expect("pass_door")
        manager.preview("pass_door", wait_up_to_s=5.0, since_s={"open": 0.1})
        with manager.skill("pass_door") as skill, skill.acting():
            clock.sleep(2.0)
        manager.ask_preview("pass_door", looks=True, since_s=clock.now_s()).abandon("preempted")
        door.markers = 0
        manager.preview("pass_door", lambda _: None, wait_up_to_s=1.0, max_age_s=0.1)
    return journal


def test_a_preview_is_one_event_that_states_who_decided_it(tmp_path: Path) -> None:
    run_previews(tmp_path / "run.mcap")
    header, events = read(tmp_path / "run.mcap")
    previews = [event for event in events if event.kind is Kind.PREVIEW]

    assert [event.what for event in previews] == ["unanswered", "fell_back", "answered", "unanswered", "fell_back"]
    assert [event.details["outcome"] for event in previews] == ["unknown", "violated", "holds", "unknown", "unknown"]
    assert previews[1].details["violated"] == ["open == true"]
    assert dict(zip(previews[2].details["variables"], previews[2].details["sources"], strict=True)) == {
        "open": "look",
        "near": "measure_distance",
    }
    assert previews[3].details["raised"] == "preempted"
    assert [event for event in events if event.kind is Kind.DECISION] == []
    _, schema = preview_schema("pass_door", header.summary)
    contents = [
        content for topic, content, *_ in messages(tmp_path / "run.mcap") if topic == "/codra/preview/pass_door"
    ]
    assert len(contents) == len(previews)
    for content in contents:
        jsonschema.validate(content, schema)


def test_a_run_with_previews_is_derived_again_byte_for_byte(tmp_path: Path) -> None:
    run_previews(tmp_path / "run.mcap")
    header, events = read(tmp_path / "run.mcap")
    copy = Journal(tmp_path / "run.again")
    replayed = replay(header, events, OBSERVED, Manager, copy)

    assert (replayed.difference, replayed.derived[Kind.PREVIEW]) == (None, 5)
    assert (tmp_path / "run.again").read_bytes() == (tmp_path / "run.mcap").read_bytes()
    assert all(message_of(event) for event in events)


STEPS = some.one_of(
    some.tuples(some.just("sleep"), some.sampled_from([0.3, 1.0, 4.0])),
    some.tuples(some.just("angle"), some.sampled_from([0.0, 1.0, None])),
    some.tuples(some.just("preview"), some.sampled_from([0.0, 0.7, 5.0])),
    some.tuples(some.just("look"), some.sampled_from([True, False, None])),
    some.tuples(some.just("act"), some.just(None)),
)


def run_steps(path: Path, steps: list[tuple[str, object]]) -> list[str]:
    """Run a robot at a door; return the answers to its previews."""
    door, clock, answers = Door(angle_rad=1.0), SimClock(), []
    with Manager(OBSERVED, clock=clock, resources={"door": door}, record=Journal(path)) as manager:
        manager.set("localized", True)
        manager.expect("pass_door")
        for what, argument in steps:
            match what, argument:
                case "sleep", float(duration_s):
                    clock.sleep(duration_s)
                case "angle", float() | None as angle_rad:
                    door.angle_rad = angle_rad
                case "preview", float(wait_s):
                    answers.append(str(manager.preview("pass_door", wait_up_to_s=wait_s, max_age_s=2.0)))
                case "look", found:
                    since_s = {"open": clock.now_s()}
                    answers.append(str(manager.preview("pass_door", lambda _, found=found: found, since_s=since_s)))
                case _:
                    with manager.skill("pass_door") as skill, skill.acting():
                        clock.sleep(0.5)
                    manager.expect("pass_door")
    return answers


@settings(max_examples=8)
@given(some.lists(STEPS, max_size=6))
def test_any_sequence_of_previews_is_derived_again_and_recorded_with_its_answers(
    steps: list[tuple[str, object]],
) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder, "run.mcap")
        answers = run_steps(path, steps)
        header, events = read(path)
        replayed = replay(header, events, OBSERVED, Manager, None)

    outcomes = [event.details["outcome"] for event in events if event.kind is Kind.PREVIEW]
    assert replayed.difference is None
    assert outcomes == [answer.partition(":")[0] for answer in answers]


def test_why_explains_a_preview_at_any_instant_of_a_journal(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "run.mcap")
    with cycler({**HOLDS, "battery": 10.0, "tube": None}, journal) as (manager, clock):
        violated = str(manager.why("open_cycler"))
        clock.sleep(5.0)
        manager.set("battery", 60.0)
        unknown = manager.why("open_cycler")
    header, _ = read(tmp_path / "run.mcap")

    assert violated.splitlines()[:4] == [
        "open_cycler is 'violated' at 0 s",
        "  the preview is violated: battery > 20 percent",
        "  battery > 20 percent does not hold",
        "    battery is 10 percent at 0 s",
    ]
    assert not unknown.known
    assert "  tube is unknown (never_observed) at 5 s" in str(unknown).splitlines()
    assert str(explain(header.summary, journal.latest_events, "open_cycler", 0.0)) == violated


def test_why_explains_every_condition_of_a_preview_that_holds_and_the_variables_named_alone() -> None:
    with cycler() as (manager, clock):
        manager.override("battery", 60.0, for_s=600.0, reason="gauge broken")
        clock.sleep(5.0)
        why = manager.why("open_cycler")
    assert [(condition.text, condition.holds) for condition in why.conditions] == [
        *((condition.text, True) for condition in OPEN_CYCLER.preview_conditions),
        ("tube", True),
    ]
    lines = str(why).splitlines()
    assert lines[0] == "open_cycler is 'holds' at 5 s"
    assert "    battery is 60 percent at 5 s" in lines
    assert "      overridden by the operator since 0 s until 600 s: gauge broken" in lines
    assert "  tube is false at 5 s" in lines


def test_why_names_a_variable_once_and_finds_a_preview_whose_skill_shares_its_name() -> None:
    conditions = (
        PreviewCondition(text="tube or gap < 3 cm", condition=value("tube") | (value("gap") < 0.03)),
        PreviewCondition(text="tube", condition=value("tube") == value("tube")),  # named alone as well
    )
    skill = SkillModel(name="locked", preview=("tube", "gap"), preview_conditions=conditions)
    with Manager(replace(MODEL, skills=(skill,)), clock=SimClock(), resources={}) as manager:
        lines = str(manager.why("preview of locked")).splitlines()
        assert lines[1].startswith("  the preview is unknown: tube (never_observed), gap (never_observed)")
        assert [line for line in lines if line.startswith("  tube ")] == [
            "  tube or gap < 3 cm is unknown",
            "  tube is unknown (never_observed) at 0 s, as explained above",
        ]
        assert manager.why("locked").reading.name == "locked"
        assert str(manager.why("locked")).startswith("locked is unknown (never_observed) at 0 s")


def test_a_look_that_a_changed_spec_does_not_need_is_no_evidence_in_a_replay(tmp_path: Path) -> None:
    with cycler({**HOLDS, "tube": None}, Journal(tmp_path / "run.mcap")) as (manager, _):
        assert manager.preview("open_cycler", otherwise=lambda _: True).holds
    header, events = read(tmp_path / "run.mcap")
    skill = replace(OPEN_CYCLER, preview=OPEN_CYCLER.preview[:-1])  # without the tube
    replayed = replay(header, events, replace(MODEL, skills=(skill,)), Manager, None)

    assert (replayed.derived[Kind.PREVIEW], replayed.derived[Kind.VARIABLE]) == (1, len(HOLDS) - 1)
    assert replayed.skipped_inputs == {}


def test_a_preview_ends_its_wait_when_an_age_decides_it() -> None:
    condition = PreviewCondition(text="tube or age(gap) > 3 s", condition=value("tube") | (age("gap") > 3.0))
    skill = SkillModel(name="open_cycler", preview=("tube", "gap"), preview_conditions=(condition,))
    clock = SimClock()
    with Manager(replace(MODEL, skills=(skill,)), clock=clock, resources={}) as manager:
        manager.set("gap", 0.1)
        assert manager.preview("open_cycler", wait_up_to_s=30.0).holds
        assert clock.now_s() == pytest.approx(3.0)


def test_a_preview_ends_its_wait_when_the_age_of_a_value_that_arrived_meanwhile_decides_it() -> None:
    condition = PreviewCondition(text="tube or age(gap) > 3 s", condition=value("tube") | (age("gap") > 3.0))
    skill = SkillModel(name="open_cycler", preview=("tube", "gap"), preview_conditions=(condition,))
    clock = SimClock()
    with Manager(replace(MODEL, skills=(skill,)), clock=clock, resources={}) as manager:
        clock.call_at(1.0, lambda: manager.set("gap", 0.1))
        assert manager.preview("open_cycler", wait_up_to_s=30.0).holds
        assert clock.now_s() == pytest.approx(4.0)


def test_a_value_that_was_found_by_a_look_ages_during_the_looks_that_follow() -> None:
    condition = PreviewCondition(text="age(near) < 2 s", condition=age("near") < 2.0)
    skill = SkillModel(name="pass_door", preview=("near", "open"), preview_conditions=(condition,))
    clock = SimClock()
    with Manager(replace(OBSERVED, skills=(skill,)), clock=clock, resources={"door": Door()}) as manager:

        def look(_: str) -> bool:
            clock.sleep(5.0)
            return True

        assert manager.preview("pass_door", look).violated == ("age(near) < 2 s",)
