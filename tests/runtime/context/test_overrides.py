"""Overrides: the operator's reading hides those of all sources for some time, and ends to the instant."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.logic import value
from codra_dsl.runtime import (
    Clock,
    ContextManager,
    Journal,
    Kind,
    NotOfTypeError,
    Reason,
    SimClock,
    UnknownNameError,
    WallClock,
)
from codra_dsl.runtime.clock import Timer
from codra_dsl.runtime.journal.events_in_file import EventsInFile
from codra_dsl.runtime.journal.reader import JournalReader
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Cell
from codra_dsl.runtime.values.conditions_held import has_held
from codra_dsl.runtime.values.declarations import OPERATOR
from codra_dsl.runtime.values.model import SkillModel, integer, real
from codra_dsl.runtime.why import explain
from tests.runtime import forests
from tests.runtime.door import Door, started
from tests.runtime.forests import World, events, forest, observer, seen, takes, variable
from tests.runtime.journal.journals import read

DOOR_CHECK = forest(
    [variable("open", valid_for_s=30.0), variable("clear")],
    observer("look", seen("look", "open")),
    observer("pass", seen("pass", "clear", when=[value("open")])),
    skills=[SkillModel(name="go", preview=("open",), changes=("open",))],
)

VALID_FOR_S = 6.0
CHARGE = forest(
    [variable("charge", type=integer(0, 9), sources=("main_execution",), valid_for_s=VALID_FOR_S, history=100)]
)


def raises(_: Any) -> object:
    raise RuntimeError("no picture")


# The value of an overridden variable


def test_an_override_outranks_every_source_until_it_expires() -> None:
    world = World({"look": {"seen": False}})
    with forests.started(DOOR_CHECK, world) as codra:
        codra.declare("open")
        codra.clock.sleep(2.5)
        codra.override("open", True, for_s=10.0, reason="sensor broken")
        reading = codra.get("open")
        assert (reading.value, reading.source, reading.detail) == (True, "operator", "sensor broken")
        assert (reading.evidence_s, reading.identified_s, reading.expires_s) == (2.5, 2.5, 12.5)
        codra.set("open", False)
        codra.clock.sleep(9.999)
        assert codra.get("open").value is True
        codra.clock.sleep(0.001)
        reading = codra.get("open")
        assert (reading.value, reading.source, reading.evidence_s) == (False, "look", 12.0)


def test_a_cleared_override_gives_way_at_once_to_evidence_that_may_be_stale() -> None:
    model = forest([variable("charge", type=real(0.0, 100.0), sources=("main_execution",), valid_for_s=5.0)])
    with forests.started(model, World()) as codra:
        codra.set("charge", 40.0)
        codra.override("charge", 90.0, for_s=60.0, reason="calibrated")
        codra.clock.sleep(4.0)
        codra.clear_override("charge")
        assert (codra.get("charge").value, codra.get("charge").evidence_s) == (40.0, 0.0)
        codra.override("charge", 80.0, for_s=60.0, reason="calibrated")
        codra.clock.sleep(2.0)
        codra.clear_override("charge")
        codra.clear_override("charge")
        assert (codra.get("charge").reason, codra.get("charge").evidence_s) == (Reason.STALE, 0.0)


def test_an_override_without_a_value_makes_a_variable_unknown_for_a_reason_of_its_own() -> None:
    with started(Door()) as (codra, clock):
        codra.override("localized", None, for_s=3.0, reason="the map is wrong")
        reading = codra.get("localized")
        assert (reading.reason, reading.detail) == (Reason.OVERRIDDEN, "the map is wrong")
        clock.sleep(3.0)
        assert codra.get("localized").value is True


def test_a_second_override_replaces_the_first_with_its_end() -> None:
    with started(Door()) as (codra, clock):
        codra.override("near", True, for_s=5.0, reason="first")
        clock.sleep(2.0)
        codra.override("near", False, for_s=10.0, reason="second")
        clock.sleep(9.5)
        assert (codra.get("near").value, codra.get("near").detail) == (False, "second")
        clock.sleep(0.5)
        assert codra.get("near").reason is Reason.NEVER_OBSERVED
    assert events(codra, Kind.OVERRIDE) == ["begun", "begun", "expired"]


def test_an_override_survives_the_changes_of_a_skill() -> None:
    with forests.started(DOOR_CHECK, World({"look": {"seen": False}})) as codra:
        codra.override("open", True, for_s=60.0, reason="held open")
        with codra.skill("go") as skill, skill.acting():
            assert codra.get("open").value is True
            codra.clear_override("open")
            assert codra.get("open").reason is Reason.INVALIDATED


def test_observers_go_on_beneath_an_override_of_their_variable() -> None:
    world = World({"look": {"seen": False}})
    with forests.started(DOOR_CHECK, world) as codra:
        codra.declare("open")
        codra.override("open", True, for_s=5.0, reason="sensor broken")
        codra.clock.sleep(4.5)
        assert world.asked_s("look") == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_variable_that_is_observed_on_events_is_due_by_its_own_evidence_and_not_by_the_override() -> None:
    model = forest([variable("open", refresh="on_event")], observer("look", seen("look", "open")))
    world = World({"look": {"seen": False}})
    with forests.started(model, world) as codra:
        codra.override("open", True, for_s=10.0, reason="sensor broken")
        codra.declare("open")
        codra.clock.sleep(5.0)
        assert world.asked_s("look") == [0.0]
        codra.clear_override("open")
        assert (codra.get("open").value, codra.get("open").source) == (False, "look")


@pytest.mark.parametrize("make_clock", [SimClock, WallClock])
def test_overrides_that_are_cleared_or_replaced_need_no_memory_and_wake_nothing_at_their_ends(
    make_clock: Callable[[], Clock],
) -> None:
    gc.collect()
    count_before = count_of_timers()
    with ContextManager[str, str](NUMBERS, clock=make_clock(), resources={"world": 0}) as codra:
        for number in range(3_000):
            codra.override("level", 3, for_s=600.0 - number / 10, reason="test")
            if number % 2:
                codra.clear_override("level")
        assert count_of_timers() - count_before < 2_100  # each of the two clocks removes them by the thousand
        if isinstance(codra.clock, SimClock):
            step_count = codra._clock.step_count
            codra.clock.sleep(700.0)
            assert codra._clock.step_count == step_count


def count_of_timers() -> int:
    return sum(isinstance(thing, Timer) for thing in gc.get_objects())


# Whatever reads the variable


def test_a_precondition_follows_an_override_and_its_end() -> None:
    world = World({"look": {"seen": False}, "pass": takes(0.5, {"seen": True})})
    with forests.started(DOOR_CHECK, world) as codra:
        codra.declare("clear")
        codra.clock.sleep(1.5)
        codra.override("open", True, for_s=2.0, reason="held open")
        codra.clock.sleep(5.0)
    assert world.asked_s("pass") == [1.5, 2.5]


@pytest.mark.parametrize(("is_cleared_at_once", "end"), [(False, "cancelled"), (True, "voided")])
def test_evidence_does_not_count_if_an_override_broke_a_precondition_while_it_was_taken(
    is_cleared_at_once: bool, end: str
) -> None:
    world = World({"look": {"seen": True}, "pass": takes(0.5, {"seen": True})})
    with forests.started(DOOR_CHECK, world) as codra:
        codra.declare("clear")
        codra.clock.sleep(0.2)
        codra.override("open", None, for_s=0.1, reason="test")
        if is_cleared_at_once:
            codra.clear_override("open")
        codra.clock.sleep(0.4)
        assert events(codra, Kind.JOB, "pass")[:2] == ["started", end]


def test_subscribers_and_waiting_conditions_see_the_beginning_and_the_end_of_an_override() -> None:
    readings: list[tuple[float, object, str]] = []
    with started(Door()) as (codra, clock):
        codra.subscribe("localized", lambda r: readings.append((clock.now_s(), r.content, r.source)))
        clock.sleep(1.0)
        codra.override("localized", False, for_s=4.0, reason="lost")
        assert codra.wait_for(value("localized"), 10.0)
        clock.sleep(0.0)
        assert clock.now_s() == 5.0
    assert readings == [(0.0, True, "main_execution"), (1.0, False, "operator"), (5.0, True, "main_execution")]


def test_an_expectation_is_judged_by_an_override_and_the_outcome_names_the_operator() -> None:
    with started(Door()) as (codra, clock), codra.skill("open_door") as skill, skill.acting():
        clock.sleep(0.1)
        codra.override("open", True, for_s=1.0, reason="seen by eye")
        (event,) = codra.record.of(Kind.EXPECTATION, "open")
    assert (event.what, event.details["source"], event.details["detail"]) == ("met", "operator", "seen by eye")


def test_the_history_ends_with_the_override_while_it_lasts() -> None:
    with started(Door()) as (codra, clock):
        clock.sleep(1.0)
        codra.override("localized", False, for_s=2.0, reason="lost")
        clock.sleep(1.0)
        codra.set("localized", True)
        assert [reading.source for reading in codra.history("localized")] == ["main_execution", "operator"]
        clock.sleep(1.0)
        assert [reading.source for reading in codra.history("localized")] == ["main_execution", "main_execution"]


# Decisions


def test_a_decision_that_an_override_answers_is_recorded_as_such() -> None:
    with started(Door()) as (codra, clock):
        codra.override("open", True, for_s=10.0, reason="sensor broken")
        clock.sleep(4.0)
        assert codra.decide("open", lambda: pytest.fail("it looked"), max_age_s=4.0) is True
        (event,) = codra.record.of(Kind.DECISION)
    assert event.what == "answered"
    assert (event.details["source"], event.details["detail"]) == ("operator", "sensor broken")


def test_an_override_never_answers_a_request_for_evidence_since_an_instant() -> None:
    with started(Door()) as (codra, clock):
        clock.sleep(5.0)
        codra.override("open", True, for_s=10.0, reason="sensor broken")
        assert codra.decide("open", lambda: False, since_s=1.0, wait_up_to_s=2.0) is False
        assert codra.decide("open", lambda: False, since_s=-1e300) is False
        clock.sleep(1.0)
        assert codra.decide("open", lambda: False, max_age_s=0.5) is False


def test_a_waiting_decision_is_answered_by_an_override_and_by_its_end() -> None:
    with started(Door()) as (codra, clock):
        pending = codra.ask("open", wait_up_to_s=9.0)
        clock.sleep(1.0)
        codra.override("open", True, for_s=1.0, reason="seen")
        assert (pending.poll(), pending.value) == ("answered", True)
        codra.override("localized", None, for_s=3.0, reason="lost")
        pending = codra.ask("localized", wait_up_to_s=9.0)
        assert (pending.wait(math.inf), clock.now_s(), pending.value) == ("answered", 4.0, True)


# Real time


def test_an_override_ends_to_the_instant_even_if_its_event_is_late(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with (
        WallClock() as clock,
        ContextManager[str, str](CHARGE, clock=clock, resources={"world": 0}, record=Journal(path)) as codra,
    ):
        codra.set("charge", 1)
        with codra._lock:  # no event can happen
            codra.override("charge", 2, for_s=0.05, reason="gauge broken")
            override = codra.get("charge")
            clock.sleep(0.1)
            assert codra.get("charge").value == 1
            assert codra._store.cells["charge"].reading is override
        assert clock.wait_until(lambda: codra._store.cells["charge"].reading is not override, 60.0)
    header, recorded_events = read(path)
    assert [event.what for event in recorded_events if event.kind is Kind.OVERRIDE] == ["begun", "expired"]
    result = replay(header, recorded_events, CHARGE, ContextManager, Journal(path.with_suffix(".again")))
    assert result.difference is None


# What is refused

NUMBERS = forest([variable("level", type=integer(0, 9), sources=("main_execution",)), variable("charge", type=real())])


@pytest.mark.parametrize(
    ("wrong_value", "message"), [(10, "outside"), (True, "not of type int"), ("3", "not of type int"), (2.5, "int")]
)
def test_an_overriding_value_is_checked_like_a_written_one(wrong_value: object, message: str) -> None:
    with forests.started(NUMBERS, World()) as codra:
        with pytest.raises(NotOfTypeError, match=message):
            codra.override("level", wrong_value, for_s=1.0, reason="test")
        assert codra.get("level").source == ""


@pytest.mark.parametrize("wrong_duration", [0, -1.0, 86_400.1, math.inf, -math.inf, math.nan, "10", None, True, [5]])
def test_an_override_lasts_more_than_zero_seconds_and_at_most_a_day(wrong_duration: Any) -> None:
    with forests.started(NUMBERS, World()) as codra:
        with pytest.raises(ValueError, match=r"more than 0 s and at most 24 h|not of type"):
            codra.override("level", 3, for_s=wrong_duration, reason="test")
        assert codra.get("level").reason is Reason.NEVER_OBSERVED


@pytest.mark.parametrize("wrong_reason", ["", "  ", None, 7, "x" * 10_001, "half \ud800"])
def test_an_override_needs_a_reason_that_a_file_can_hold(wrong_reason: Any) -> None:
    message = r"needs a reason|not of type|too long|half a character"
    with forests.started(NUMBERS, World()) as codra, pytest.raises(ValueError, match=message):
        codra.override("level", 3, for_s=1.0, reason=wrong_reason)


def test_only_declared_variables_can_be_overridden() -> None:
    with forests.started(NUMBERS, World()) as codra:
        with pytest.raises(UnknownNameError, match="did you mean 'level'"):
            codra.override("levle", 3, for_s=1.0, reason="test")
        with pytest.raises(UnknownNameError):
            codra.clear_override("levle")


def test_numbers_of_numpy_are_accepted_and_nan_makes_a_variable_unknown() -> None:
    with forests.started(NUMBERS, World()) as codra:
        codra.override("level", np.int64(3), for_s=np.float64(2.0), reason="test")
        assert (codra.get("level").value, codra.get("level").expires_s) == (3, 2.0)
        codra.override("charge", math.nan, for_s=2, reason="test")
        assert codra.get("charge").reason is Reason.OVERRIDDEN


# Decisions, why, journal and replay agree (an override over a failing observer)


def test_decisions_why_journal_and_replay_agree_on_an_override_over_a_failing_observer(tmp_path: Path) -> None:
    world, clock, path = World({"look": {"seen": False}}), SimClock(100.0), tmp_path / "run.mcap"
    states: dict[float, tuple[object, str]] = {}
    with ContextManager[str, str](DOOR_CHECK, clock=clock, resources={"world": world}, record=Journal(path)) as codra:
        codra.declare("open")
        clock.sleep(1.5)
        world.finds["look"] = raises
        clock.sleep(1.0)
        assert codra.get("open").reason is Reason.FAILED
        codra.override("open", True, for_s=10.0, reason="camera dead")
        for pause_s in (0.0, 4.0, 5.999, 0.001, 2.0):
            clock.sleep(pause_s)
            answer = codra.decide("open", lambda: None)
            states[clock.now_s()] = (answer, codra.get("open").source)
        whys = {at_s: codra.why("open", at_s=at_s) for at_s in states}
    assert states == {
        102.5: (True, "operator"),
        106.5: (True, "operator"),
        112.499: (True, "operator"),
        112.5: (None, "look"),
        114.5: (None, "look"),
    }
    assert {at_s: (why.reading.content, why.reading.source) for at_s, why in whys.items()} == states
    assert str(whys[106.5]).splitlines()[:5] == [
        "open is true at 106.5 s",
        "  overridden by the operator since 102.5 s until 112.5 s: camera dead",
        "  without the override:",
        "    open is unknown (failed) at 106.5 s",
        "      failed at 102 s: RuntimeError: no picture (look)",
    ]
    with JournalReader(path) as reader:
        summary = reader.header().summary
        in_file = EventsInFile(reader, summary)
        assert {at_s: explain(summary, in_file.latest_events, "open", at_s) for at_s in states} == whys
    header, recorded_events = read(path)
    answers = [(e.instant_s, e.what, e.details["source"]) for e in recorded_events if e.kind is Kind.DECISION]
    assert [(at_s, source) for at_s, _, source in answers] == [(at_s, source) for at_s, (_, source) in states.items()]
    assert [what for _, what, _ in answers] == ["answered"] * 3 + ["fell_back"] * 2
    overrides = [event for event in recorded_events if event.kind is Kind.OVERRIDE]
    assert [(event.instant_s, event.what) for event in overrides] == [(102.5, "begun"), (112.5, "expired")]
    result = replay(header, recorded_events, DOOR_CHECK, ContextManager, Journal(tmp_path / "again.mcap"))
    assert result.difference is None
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()


# Any order of overrides, ends and evidence agrees with a plain model

_levels = st.integers(0, 3)
_STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("override"), st.none() | _levels, st.integers(1, 8)),
        st.tuples(st.just("clear"), st.none(), st.just(0)),
        st.tuples(st.just("write"), _levels, st.integers(0, 9)),
        st.tuples(st.just("pass"), st.none(), st.integers(1, 5)),
    ),
    max_size=20,
)
State = tuple[int | None, Reason | None, str]


@dataclass
class PlainModel:
    """All overrides with their ends, and all evidence in the order of its arrival."""

    overrides: list[tuple[float, float, int | None]] = field(default_factory=list)
    evidence: list[tuple[float, int]] = field(default_factory=list)

    def override(self, level: int | None, now_s: float, for_s: float) -> None:
        self.clear(now_s)
        self.overrides.append((now_s, now_s + for_s, level))

    def clear(self, now_s: float) -> None:
        self.overrides = [(begin_s, min(end_s, now_s), level) for begin_s, end_s, level in self.overrides]

    def state(self, at_s: float) -> State:
        """Return the value, the reason and the source at an instant, according to all that has arrived."""
        for begin_s, end_s, level in reversed(self.overrides):
            if begin_s <= at_s < end_s:
                return level, Reason.OVERRIDDEN if level is None else None, OPERATOR
        arrived = [(evidence_s, order, level) for order, (evidence_s, level) in enumerate(self.evidence)]
        evidence_s, _, level = max((entry for entry in arrived if entry[0] <= at_s), default=(None, 0, 0))
        if evidence_s is None:
            return None, Reason.NEVER_OBSERVED, ""
        is_stale = at_s >= evidence_s + VALID_FOR_S
        return (None, Reason.STALE, "main_execution") if is_stale else (level, None, "main_execution")


def state_of(reading: Any) -> State:
    return reading.content, reading.reason, reading.source


@settings(max_examples=24, deadline=None)
@given(_STEPS)
def test_any_order_of_overrides_ends_and_evidence_agrees_with_a_plain_model(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[str, int | None, int]]
) -> None:
    path, clock, model = tmp_path_factory.mktemp("run") / "run.mcap", SimClock(20.0), PlainModel()
    states: dict[float, State] = {}
    with ContextManager[str, str](CHARGE, clock=clock, resources={"world": 0}, record=Journal(path)) as codra:
        for step in steps:
            take(step, codra, model)
            now_s = clock.now_s()
            states[now_s] = model.state(now_s)
            assert state_of(codra.get("charge")) == states[now_s]
            decision = codra.ask("charge")
            assert (state_of(decision.reading), decision.state == "answered") == (
                states[now_s],
                states[now_s][1] is None,
            )
            decision.abandon("the test goes on")
        check_past(codra._store.cells, model, clock.now_s())
        assert {at_s: state_of(codra.why("charge", at_s=at_s).reading) for at_s in states} == states
    header, recorded_events = read(path)
    result = replay(header, recorded_events, CHARGE, ContextManager, Journal(path.with_suffix(".again")))
    assert result.difference is None
    assert path.with_suffix(".again").read_bytes() == path.read_bytes()


def take(step: tuple[str, int | None, int], codra: ContextManager[str, str], model: PlainModel) -> None:
    """Take a step with the context manager and with the model."""
    (verb, level, number), now_s = step, codra.clock.now_s()
    if verb == "override":
        codra.override("charge", level, for_s=number, reason="test")
        model.override(level, now_s, number)
    elif verb == "clear":
        codra.clear_override("charge")
        model.clear(now_s)
    elif verb == "write":
        codra.set("charge", level, evidence_s=now_s - number)
        model.evidence.append((now_s - number, level or 0))
    else:
        codra.clock.sleep(number)


def check_past(cells: Mapping[str, Cell], model: PlainModel, now_s: float) -> None:
    """Compare the past, as it is known today, with the model; a condition has held only if it held at each instant."""
    instants = [number / 2 for number in range(20, int(2 * now_s) + 1)]
    assert [state_of(cells["charge"].at(at_s))[:2] for at_s in instants] == [model.state(at_s)[:2] for at_s in instants]
    condition = value("charge") >= 2
    held = [(model.state(at_s)[0] or 0) >= 2 for at_s in instants]
    for first in range(0, len(instants), 5):
        for last in range(first, min(first + 12, len(instants)), 3):
            if has_held(condition, cells, instants[first], instants[last]):
                assert all(held[first : last + 1])
