"""Decisions in steps have the same results as decisions in one call."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.logic import Value
from codra_dsl.runtime import ContextManager, DecisionState, Journal, Kind, NotOfTypeError, SimClock, WallClock
from codra_dsl.runtime.context.decisions import DecisionContext
from codra_dsl.runtime.observers.urgency import Urgency
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import real
from tests.runtime.door import GIVEN_NEAR, MODEL, Door, Manager, started
from tests.runtime.forests import World, forest, variable
from tests.runtime.forests import started as started_forest
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error
from tests.runtime.journal.journals import read


def decide_in_steps(manager: Manager, clock: SimClock, seen: bool | None, wait_s: float, shadow: bool) -> object:
    pending_decision = manager.ask("open", wait_up_to_s=wait_s, shadow=shadow)
    while pending_decision.poll() is DecisionState.WAITING:
        pending_decision.wait(0.3)
    if pending_decision.state is DecisionState.ANSWERED:
        return pending_decision.value
    clock.sleep(2.0)
    pending_decision.record_result(seen)
    return seen


def decide_at_once(manager: Manager, clock: SimClock, seen: bool | None, wait_s: float, shadow: bool) -> object:
    def look() -> bool | None:
        clock.sleep(2.0)
        return seen

    return manager.decide("open", look, wait_up_to_s=wait_s, shadow=shadow)


@given(
    markers=st.sampled_from([0, 4]),
    declared=st.booleans(),
    before_s=st.sampled_from([0.0, 0.2, 3.0]),
    seen=st.sampled_from([True, False, None]),
    wait_s=st.sampled_from([0.0, 0.4, 5.0]),
    shadow=st.booleans(),
)
def test_in_steps_or_at_once_a_decision_has_the_same_answer_and_the_same_events(
    *, markers: int, declared: bool, before_s: float, seen: bool | None, wait_s: float, shadow: bool
) -> None:
    results = []
    for decide in (decide_in_steps, decide_at_once):
        with started(Door(angle_rad=1.0, markers=markers)) as (manager, clock):
            if declared:
                manager.declare("open")
            clock.sleep(before_s)
            answer = decide(manager, clock, seen, wait_s, shadow)
            results.append((answer, clock.now_s(), manager.record.text()))

    assert results[0] == results[1]


def test_a_result_of_another_type_is_refused_and_recorded() -> None:
    with started(Door()) as (manager, _):
        pending_decision = manager.ask("open")
        with pytest.raises(NotOfTypeError):
            pending_decision.record_result("wide")

        (event,) = manager.record.of(Kind.DECISION)
        assert (event.what, event.details["raised"]) == ("fell_back", "NotOfTypeError")


@pytest.mark.parametrize(
    ("found", "accepted"), [(None, None), (math.nan, None), (np.float32("nan"), None), (2, 2.0), (np.float32(0.5), 0.5)]
)
def test_the_accepted_result_has_the_type_of_the_variable_and_nan_is_no_result(found: object, accepted: object) -> None:
    level = variable("level", type=real(), sources=("main_execution",))
    with started_forest(forest([level]), World()) as manager:
        result = manager.ask("level").record_result(found)
    assert (result, type(result)) == (accepted, type(accepted))


def test_a_result_is_refused_if_no_look_was_requested() -> None:
    with started(Door()) as (manager, _):
        manager.declare("open", value=True)
        pending_decision = manager.ask("open")
        assert pending_decision.value is True
        with pytest.raises(RuntimeError, match="no look was requested"):
            pending_decision.record_result(False)
        with pytest.raises(RuntimeError, match="has not answered"):
            _ = manager.ask("open", since_s=math.inf).value


def test_a_decision_that_was_abandoned_while_it_waited_is_no_longer_urgent() -> None:
    with started(Door()) as (manager, _):
        manager.declare("open")
        urgency = manager.commands.urgency
        assert {urgency(name) for name in manager.running()} == {Urgency.DECLARED}
        pending_decision = manager.ask("open", since_s=math.inf, wait_up_to_s=5.0)
        assert Urgency.WAITED_FOR in {urgency(name) for name in manager.running()}
        pending_decision.abandon("interrupted")
        assert {urgency(name) for name in manager.running()} == {Urgency.DECLARED}


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_a_look_that_raises_a_hostile_exception_ends_its_decision(kind: str) -> None:
    error, text = hostile_error(kind), HOSTILE_ERRORS[kind]

    def look() -> bool:
        raise error

    with started(Door()) as (manager, _):
        with pytest.raises(type(error)) as error_info:
            manager.decide("open", look)
        assert error_info.value is error
        decision = manager.record.of(Kind.DECISION)[-1]
        assert decision.details["raised"] == text.partition(":")[0]


def test_a_run_with_abandoned_decisions_replays(tmp_path: Path) -> None:
    clock, path = SimClock(), tmp_path / "run.mcap"
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()}, record=Journal(path)) as manager:
        manager.ask("open", wait_up_to_s=5.0).abandon("interrupted")
        pending_decision = manager.ask("open")
        clock.sleep(1.0)
        pending_decision.abandon("interrupted")
        pending_decision.abandon("interrupted")
        log_text = manager.record.text()

    assert log_text.count("interrupted") == 2
    header, events = read(path)
    assert replay(header, events, MODEL, ContextManager[str, str], None).difference is None


@pytest.mark.parametrize("limit", ["max_age_s", "since_s", "wait_up_to_s"])
def test_a_limit_of_a_decision_must_not_be_nan(limit: str) -> None:
    """JSON has no NaN, so a journal could not record such a decision."""
    with started(Door()) as (codra, _clock):
        with pytest.raises(ValueError, match="must not be NaN"):
            codra.decide("open", lambda: True, **{limit: math.nan})
        assert codra.record.of(Kind.DECISION) == ()


@pytest.mark.parametrize("wait_up_to_s", [30.0, math.inf])
def test_a_decision_whose_clock_was_closed_looks(wait_up_to_s: float) -> None:
    clock = WallClock()
    with ContextManager[str, str](GIVEN_NEAR, clock=clock, resources={"door": Door()}) as codra:
        clock.close()
        codra.declare("open")
        assert codra.decide("open", lambda: True, wait_up_to_s=wait_up_to_s) is True
        assert [event.what for event in codra.record.of(Kind.DECISION)] == ["fell_back"]


class Flickering:
    """A context in which a variable is known while a waiting thread checks it for the second time, and never again."""

    def __init__(self, context: DecisionContext) -> None:
        self._context = context
        self._check_count = 0

    def reading(self, name: str) -> Reading[Value]:
        self._check_count += 1
        reading = self._context.reading(name)
        return replace(reading, content=True, reason=None) if self._check_count == 2 else reading

    def has_evidence_since(self, reading: Reading[Value], since_s: Mapping[str, float]) -> bool:
        return self._context.has_evidence_since(reading, since_s)


def test_a_wait_goes_on_if_the_answer_is_lost_before_the_decision_reads_it() -> None:
    with started(Door(markers=0)) as (manager, clock):
        pending_decision = manager.ask("open", wait_up_to_s=5.0)
        pending_decision._context = Flickering(pending_decision._context)
        assert pending_decision.wait(math.inf) is DecisionState.LOOKING
        assert clock.now_s() == 5.0
