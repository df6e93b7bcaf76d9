"""Explanations of variables: from the value to the evidence, or from unknown to the missing conditions."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import FrozenInstanceError, replace
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.logic import Term, age, known, value
from codra_dsl.runtime import ContextManager, ContextModel, EventLog, Journal, Kind, NotASourceError, Reason, SimClock
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.values.model import SkillModel, integer, member, real
from codra_dsl.runtime.why import MissingChange, Why, explain
from tests.runtime.door import MODEL, Door
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, seen, started, takes, variable
from tests.runtime.journal.journals import read, run_door

YES = {"seen": True}


def door(instant_s: float, **settings: Any) -> Callable[[str], Why]:
    """Run a door's observers until an instant; return the manager's `why`."""
    clock = SimClock()
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door(**settings)})
    manager.declare("open")
    manager.set("localized", True)
    clock.sleep(instant_s)
    return manager.why


# From a value to its evidence


def test_a_value_leads_over_its_job_and_the_preconditions_to_the_first_writer() -> None:
    assert str(door(1.6, angle_rad=1.0)("open")) == "\n".join(
        [
            "open is true at 1.6 s",
            "  identified at 1.5 s from evidence taken at 1 s",
            "  observer door_lid has been running since 0 s",
            "  declared since 0 s for main_execution",
            "  perception look saw angle = 1 rad, markers = 4 (job 1)",
            "    by the rule: angle > 0.6",
            "    near is true at 1 s",
            "      identified at 1 s from evidence taken at 1 s",
            "      observer door_distance has been running since 0 s",
            "      perception measure_distance saw distance = 1 m (job 1)",
            "        by the rule: distance < 1.5",
            "        localized is true at 1 s",
            "          written by main_execution at 0 s",
        ]
    )


def test_an_explanation_consists_of_immutable_values() -> None:
    why = door(1.6, angle_rad=1.0)("open")

    assert why.look is not None
    assert (why.reading.value, why.look.algorithm, why.look.index, why.look.stamp_s) == (True, "look", 1, 1.0)
    assert why.look.values == {"angle": 1.0, "markers": 4}
    (near,) = why.look.under
    assert (near.text, near.holds, near.because[0].variable) == ("near", True, "near")
    with pytest.raises(FrozenInstanceError):
        why.at_s = 2.0  # type: ignore[misc]


def test_the_preconditions_of_a_value_are_those_at_the_time_of_its_evidence() -> None:
    seen_door = Door(angle_rad=1.0)
    clock = SimClock()
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": seen_door})
    manager.declare("open")
    manager.set("localized", True)
    clock.sleep(1.6)
    seen_door.distance_m = 9.0
    clock.sleep(1.0)
    why = manager.why("open")

    assert why.known
    assert why.look is not None
    assert why.look.under[0].holds is True
    (way,) = why.ways
    (blocked,) = way.blocked_by
    assert (blocked.text, blocked.holds) == ("near", False)
    assert why.missing == (MissingChange(variable="near", condition="near", value=True),)


def test_looks_that_were_rejected_since_are_counted() -> None:
    seen_door = Door(angle_rad=1.0)
    clock = SimClock()
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": seen_door})
    manager.declare("open")
    manager.set("localized", True)
    clock.sleep(1.6)
    seen_door.markers = 2
    clock.sleep(3.0)

    assert "  3 looks rejected since then, the last at 4.5 s: not markers >= 3 (look)" in str(manager.why("open"))


def test_a_value_of_an_agent_is_explained_with_its_writer_evidence_and_validity() -> None:
    model = forest(
        [variable("near", sources=("observer", "house"), valid_for_s=5.0)], observer("o", seen("eye", "near"))
    )
    clock = SimClock(10.0)
    with started(model, World({"eye": takes(9.0, YES)}), clock) as manager:
        manager.agent("house").set("near", True, evidence_s=8.0)

        assert manager.why("near").story == (
            "written by agent house at 10 s, from evidence taken at 8 s",
            "valid until 13 s",
            "observer o has not run",
        )


def test_refused_writes_and_older_evidence_are_reported() -> None:
    model = forest([given("near"), variable("far", sources=("house",))])
    clock = SimClock(10.0)
    with started(model, World(), clock) as manager:
        manager.set("near", True)
        manager.set("near", False, evidence_s=9.0)
        with pytest.raises(NotASourceError):
            manager.agent("house").set("near", False)

        assert manager.why("near").story[1:] == (
            "1 value with older evidence arrived since then, at 10 s from main_execution",
            "1 write by house refused, at 10 s",
        )


# From unknown to the missing conditions


def test_unknown_leads_over_the_conditions_that_do_not_hold_to_the_missing_writer() -> None:
    clock = SimClock()
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()})
    manager.declare("open")
    clock.sleep(3.0)

    assert str(manager.why("open")) == "\n".join(
        [
            "open is unknown (never_observed) at 3 s",
            "  not identified yet",
            "  observer door_lid has been running since 0 s",
            "  declared since 0 s for main_execution",
            "  perception look cannot look",
            "    near is unknown (never_observed) at 3 s",
            "      not identified yet",
            "      observer door_distance has been running since 0 s",
            "      perception measure_distance cannot look",
            "        localized is unknown (never_observed) at 3 s",
            "          not written yet; main_execution writes it",
            "  missing: near = true",
        ]
    )


def test_a_skill_that_changes_a_variable_is_named() -> None:
    clock = SimClock()
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door(angle_rad=1.0, duration_s=0.2)})
    manager.set("localized", True)
    with manager.skill("open_door") as skill:
        clock.sleep(1.0)
        with skill.acting():
            clock.sleep(0.1)
        story = manager.why("open").story

    assert story[:2] == (
        "skill open_door, which changes it, acted at 1 s: only newer evidence counts",
        "it was true before, from look at 0.2 s",
    )


@pytest.mark.parametrize(
    ("find", "story"),
    [
        ({"seen": None}, "rejected at 0 s: the result has no value for it (eye)"),
        (lambda _: 1 // 0, "failed at 0 s: ZeroDivisionError: integer division or modulo by zero (eye)"),
        (takes(60.0, YES), "timed_out at 0.5 s: no result within 0.5 s (eye)"),
    ],
)
def test_a_failed_look_is_reported_with_its_reason(find: object, story: str) -> None:
    clock = SimClock()
    model = forest([variable("a")], observer("o", seen("eye", "a", timeout_s=0.5), period_s=5.0))
    with started(model, World({"eye": find}), clock) as manager:
        manager.declare("a")
        clock.sleep(1.0)

        assert manager.why("a").story[0] == story


def test_stale_forgotten_and_withdrawn_values_are_reported_with_instant_and_cause() -> None:
    model = forest(
        [given("near"), variable("a", valid_for_s=0.5), variable("b", when_unobservable="forget")],
        observer("o", seen("eye", "a", when=[value("near")]), period_s=60.0),
        observer("p", seen("ear", "b", when=[value("near")])),
    )
    clock = SimClock()
    with started(model, World({"eye": YES, "ear": YES}), clock) as manager:
        manager.declare("a")
        manager.declare("b")
        manager.set("near", True)
        clock.sleep(1.0)
        assert manager.why("a").story[:2] == (
            "its evidence, taken at 0 s, was valid for 0.5 s",
            "it was true before, from eye at 0 s",
        )
        manager.withdraw("b")
        assert manager.why("b").story[0] == "its observer p stopped at 1 s"
        manager.declare("b")
        clock.sleep(0.5)
        manager.set("near", False)
        clock.sleep(0.0)
        assert manager.why("b").story[0] == "forgotten at 1.5 s, because this condition did not hold: value('near')"


def test_every_algorithm_is_explained_and_the_one_with_the_fewest_changes_is_missing() -> None:
    model = forest(
        [given("light"), given("near"), given("still"), variable("a")],
        observer("o", seen("eye", "a", when=[value("light"), value("near")]), seen("ear", "a", when=[value("still")])),
    )
    clock = SimClock()
    with started(model, World({"eye": YES, "ear": YES}), clock) as manager:
        manager.declare("a")
        clock.sleep(1.0)
        why = manager.why("a")

        assert [(way.algorithm, len(way.missing)) for way in why.ways] == [("eye", 2), ("ear", 1)]
        assert why.missing == (MissingChange(variable="still", condition="value('still')", value=True),)


def test_an_observer_that_is_not_declared_is_missing_too() -> None:
    with started(forest([variable("a")], observer("o", seen("eye", "a"))), World()) as manager:
        assert [str(missing) for missing in manager.why("a").missing] == ["declare a: o is not running"]


def test_a_condition_that_time_will_fulfil_is_reported_with_its_instant() -> None:
    model = forest([given("seen_it"), variable("a")], observer("o", seen("eye", "a", when=[age("seen_it") > 10.0])))
    clock = SimClock()
    with started(model, World({"eye": YES}), clock) as manager:
        manager.declare("a")
        clock.sleep(1.0)
        manager.set("seen_it", True)
        clock.sleep(2.0)
        (missing,) = manager.why("a").missing

        assert missing.value is None
        assert missing.from_s == pytest.approx(11.0)


def test_joined_algorithms_are_explained_per_variable() -> None:
    model = forest(
        [given("near"), variable("a"), variable("b")],
        observer("o", seen("eye", "a"), seen("ear", "b"), joined_when=[value("near")]),
    )
    with started(model, World()) as manager:
        manager.declare("a")
        assert [way.algorithm for way in manager.why("b").ways] == ["ear"]
        assert [missing.variable for missing in manager.why("b").missing] == ["near"]


def test_feedback_is_explained_once_and_ends() -> None:
    model = forest(
        [variable("a"), variable("b")],
        observer("o", seen("eye", "a", when=[~known("b") | (age("b") > 1.0)])),
        observer("p", seen("ear", "b", when=[~known("a") | (age("a") > 1.0)])),
    )
    clock = SimClock()
    with started(model, World({"eye": YES, "ear": YES}), clock) as manager:
        manager.declare("a")
        clock.sleep(60.0)

        assert len(str(manager.why("a")).splitlines()) < 60


# At another time, and from a file


def test_the_past_is_explained_as_it_was() -> None:
    why = door(5.0, angle_rad=1.0)
    assert why("open").known
    assert ContextManager.why is not None
    clock = SimClock()
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door(angle_rad=1.0)})
    manager.declare("open")
    manager.set("localized", True)
    clock.sleep(0.4)
    then = str(manager.why("open"))
    clock.sleep(5.0)

    assert str(manager.why("open", at_s=0.4)) == then
    with pytest.raises(ValueError, match=r"it is 5\.4 now"):
        manager.why("open", at_s=6.0)


def test_instants_dropped_from_a_short_event_log_are_refused_and_the_present_is_complete() -> None:
    clock = SimClock()
    record = EventLog(limit=20)
    manager = ContextManager[str, str](MODEL, clock=clock, resources={"door": Door(angle_rad=1.0)}, record=record)
    manager.declare("open")
    manager.set("localized", True)
    clock.sleep(60.0)

    assert 20 <= len(record) < 40
    assert "written by main_execution at 0 s" in str(manager.why("open"))
    with pytest.raises(ValueError, match="read the journal"):
        manager.why("open", at_s=1.0)


def test_a_journal_gives_the_same_explanations_as_the_running_manager(tmp_path: Path) -> None:
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    seen_door = Door(angle_rad=1.0)
    explanation_texts: dict[tuple[str, float], str] = {}
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": seen_door}, record=journal) as manager:
        for step in range(30):
            seen_door.markers, seen_door.distance_m = (4, 1, 4)[step % 3], (1.0, 1.0, 1.0, 9.0)[step % 4]
            if step == 1:
                manager.declare("localized", True)
            if step in (3, 9):
                manager.expect("open_door")
            if step in (7, 20):
                with manager.skill("open_door") as skill, skill.acting():
                    clock.sleep(0.3)
            clock.sleep(0.37)
            explanation_texts |= {(name, clock.now_s()): str(manager.why(name)) for name in manager.modelled()}
            clock.sleep(0.01)
    header, events = read(journal.path)

    for (name, at_s), text in explanation_texts.items():
        assert str(explain(header.summary, lambda until_s: LatestEvents.of(events, until_s), name, at_s)) == text
    assert len(set(explanation_texts.values())) > 60


def test_a_value_that_a_decision_looked_for_is_explained_with_the_state_before_the_look(tmp_path: Path) -> None:
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()}, record=journal) as manager:
        manager.expect("open_door")
        clock.sleep(0.5)
        manager.decide("open", otherwise=lambda: True, wait_up_to_s=1.0)
        (decision,) = manager.record.of(Kind.DECISION)
        why, why_before = manager.why("open"), manager.why("open", before=decision)
        assert why.story[:2] == (
            "found by a look of main_execution at 1.5 s",
            "context could not answer the decision of 0.5 s: never_observed: near",
        )
        assert (why_before.at_s, why_before.reading.reason) == (1.5, Reason.NEVER_OBSERVED)
        with pytest.raises(ValueError, match="the event log has no such event: decision open fell_back"):
            manager.why("open", before=replace(decision, instant_s=0.7))
        clock.sleep(0.5)
        manager.set("open", True)
        assert manager.why("open").story[0] == "written by main_execution at 2 s"
    header, events = read(journal.path)
    assert explain(header.summary, lambda until_s: LatestEvents.of(events, until_s), "open", 1.5).story == why.story


def test_instants_since_1970_are_printed_as_dates(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=1, start_s=1_795_245_633.25)
    header, events = read(tmp_path / "run.mcap")
    why = explain(header.summary, lambda until_s: LatestEvents.of(events, until_s), "localized", events[-1].instant_s)

    assert why.story[0] == "written by main_execution at 2026-11-21 07:20:33.250 UTC"


# Supplying the missing conditions helps


def unlike(seed: int) -> ContextModel:
    """Return a model with conditions of many forms over variables of all types."""
    chance = random.Random(seed)
    names = [f"v{number}" for number in range(12)]
    kinds = {name: chance.choice(["bool", "int", "float", "enum"]) for name in names}
    types = {
        "bool": None,
        "int": integer(0, 12),
        "float": real(-5.0, 50.0, unit="m"),
        "enum": member("idle", "busy", "done"),
    }
    forms: dict[str, Sequence[Callable[[Term], Term]]] = {
        "bool": [lambda one: one, lambda one: ~one],
        "int": [lambda one: one >= 3, lambda one: (one > 1) & (one < 3), lambda one: one + 2 == 9],
        "float": [lambda one: abs(one) < 0.5, lambda one: one * 2.0 > 70.0, lambda one: (one > 0.1) & (one <= 0.3)],
        "enum": [lambda one: one == "done", lambda one: one.is_in("idle", "busy"), lambda one: one != "idle"],
    }

    def condition(name: str, other: str) -> Term:
        first = chance.choice(forms[kinds[name]])(value(name))
        second = chance.choice(forms[kinds[other]])(value(other))
        return chance.choice([first, first, first & second, first | ~second, known(name), known(other) & first])

    observers, variables = [], []
    for number, name in enumerate(names):
        settings: dict[str, Any] = {} if types[kinds[name]] is None else {"type": types[kinds[name]]}
        if number < 4:
            variables.append(given(name, **settings))
            continue
        variables.append(variable(name, valid_for_s=chance.choice([1.0, 60.0]), **settings))
        returned = types[kinds[name]] or variables[-1].type
        looks = [
            Look(
                algorithm(f"look_{name}_{rank}", {"seen": returned}),
                {name: value("seen")},
                [
                    condition(*chance.sample(name_group, 2))
                    for name_group in (names[: number // 2], names[number // 2 : number])
                ],
            )
            for rank in range(chance.choice([1, 1, 2]))
        ]
        observers.append(observer(f"o_{name}", *looks))
    return forest(variables, *observers, skills=[SkillModel(name="s", changes=tuple(names[4:6]))])


def some_value(name: str, model: ContextModel, chance: random.Random) -> object:
    value_type = next(variable_model.type for variable_model in model.variables if variable_model.name == name)
    options: dict[str, list[object]] = {
        "bool": [True, False],
        "int": [0, 2, 3, 7],
        "float": [-0.2, 0.2, 40.0],
        "enum": list(value_type.members),
    }
    return chance.choice(options[value_type.kind])


def run_until(model: ContextModel, seed: int, end_s: float) -> ContextManager[str, str]:
    """Run a model with random writes, declarations and actions; the run is the same for the same seed."""
    chance, clock = random.Random(seed), SimClock()
    world = World({look.algorithm: None for look in ()})
    for observer_model in model.observers:
        for name in observer_model.identifies:
            world.finds |= {f"look_{name}_{rank}": _finder(name, model, chance.random()) for rank in range(2)}
    manager = ContextManager[str, str](model, clock=clock, resources={"world": world}, seed=seed)
    names = manager.modelled()
    while clock.now_s() < end_s:
        manager.declare(chance.choice(names[4:]))
        if chance.random() < 0.7:
            name = chance.choice(names[:4])
            manager.set(name, some_value(name, model, chance))
        if chance.random() < 0.1:
            with manager.skill("s") as skill, skill.acting():
                pass
        clock.sleep(min(0.4, end_s - clock.now_s()))
    return manager


def _finder(name: str, model: ContextModel, seed: float) -> Callable[[Any], object]:
    def find(job: Any) -> object:
        job.sleep(0.1)
        return {"seen": some_value(name, model, random.Random(f"{seed} {job.index}"))}

    return find


def test_supplying_missing_conditions_makes_a_variable_observable() -> None:
    """Test 40 random variables and instants in 40 random forests."""
    blocked = 0
    for point in range(40):
        chance, model = random.Random(f"point {point}"), unlike(point % 40)
        end_s, name = chance.uniform(0.0, 12.0), f"v{chance.randrange(4, 12)}"
        missing = run_until(model, point, end_s).why(name).missing
        manager = run_until(model, point, end_s)
        blocked += bool(manager.obstacle(name))
        assert bool(missing) is bool(manager.obstacle(name))
        for change in missing:
            manager.declare(change.variable, change.value)

        assert manager.obstacle(name) == "", f"point {point}: {name} at {end_s}: {missing}"
    assert 10 < blocked < 40
