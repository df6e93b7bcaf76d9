"""Agents are woken by the graph and execute their rules: before is enforced, during and after are observed."""

from __future__ import annotations

import copy
import gc
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from codra_dsl.runtime import ContextManager, Journal, Kind, SimClock, UnknownNameError, WallClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AgentTakenError, Change, RuleError, RuleState, Stage
from codra_dsl.runtime.knowledge.declarations import AgentModel, RuleModel, absent, path, some
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import value
from tests.runtime.journal.journals import read
from tests.runtime.knowledge.manager import KNOWLEDGE, MODEL

DETECT = RuleModel(
    name="detect",
    before=(path("robot", "wants", "detecting"), absent(some("person"), "close_to", "robot")),
    during=(path("robot", "is", "detecting"),),
    after=(value("detecting.result") == "ok", path("world", "container_pose", some("roll_container"))),
)
AT_WORK = replace(
    KNOWLEDGE,
    agents=(
        AgentModel(
            name="container_detection",
            wakes=(path("robot", "wants", "detecting"), value("battery.charge") < 10.0),
            rules=(DETECT,),
        ),
        AgentModel(name="navigation"),
        AgentModel(name="person_detection"),
    ),
)


def store(clock: SimClock | WallClock, journal: Journal | None = None) -> ContextManager[str, str]:
    return ContextManager[str, str](MODEL, clock=clock, resources={}, record=journal, knowledge=AT_WORK)


def test_every_pattern_in_wakes_wakes_its_agent_independently() -> None:
    clock, calls = SimClock(), []
    with store(clock) as codra:
        codra.agent("container_detection").on_wake(lambda change: calls.append((clock.now_s(), len(change.new))))
        clock.sleep(1.0)
        picking = codra.agent("picking")
        picking.graph.request("detecting")
        clock.sleep(0.5)
        codra.agent("navigation").set("charge", 5.0)
        codra.agent("navigation").set("charge", 4.0)
        clock.sleep(5.0)
        picking.graph.request("detecting")
        clock.sleep(0.1)
    assert calls == [(1.0, 1), (1.5, 1), (6.5, 1)]


def test_a_second_request_of_a_task_wakes_its_executor_again() -> None:
    clock, handovers = SimClock(), []
    with store(clock) as codra:
        codra.agent("container_detection").on_wake(
            lambda change: handovers.append(change.snapshot.handover("detecting"))
        )
        picking = codra.agent("picking")
        first = picking.graph.request("detecting")
        clock.sleep(0.1)
        picking.graph.abort(first)
        picking.graph.request("detecting")
        clock.sleep(0.1)
    assert [handover.number for handover in handovers] == [1, 2]


def test_an_agent_without_wakes_is_called_once_and_stays_active() -> None:
    clock, calls = SimClock(), []
    with store(clock) as codra:
        codra.agent("navigation").on_wake(calls.append)
        clock.sleep(1.0)
        codra.agent("picking").graph.request("detecting")
        clock.sleep(1.0)
    assert len(calls) == 1


def test_an_agent_with_a_closed_handle_is_not_woken_and_begins_no_rule() -> None:
    clock, calls = SimClock(), []
    with store(clock) as codra:
        detection, picking = codra.agent("container_detection"), codra.agent("picking").graph
        detection.on_wake(lambda _: calls.append("the first"))
        detection.close()
        again = codra.agent("container_detection")
        again.on_wake(lambda _: calls.append("the next"))
        picking.request("detecting")
        clock.sleep(1.0)
        assert calls == ["the next"]
        for begin in (lambda: detection.on_wake(print), lambda: detection.graph.transaction().__enter__()):
            with pytest.raises(PermissionError, match="is closed"):
                begin()


def test_a_copy_of_an_agent_is_closed_with_its_original() -> None:
    with store(SimClock()) as codra:
        detection = codra.agent("container_detection")
        copied = copy.copy(detection)
        detection.close()
        codra.agent("container_detection")

        with pytest.raises(PermissionError, match="is closed"):
            copied.graph.insert_node("box", "roll_container")
        assert "box" not in {node.name for node in codra.knowledge.snapshot().nodes()}


def test_a_subscription_to_wakes_keeps_the_handle_of_its_agent_open() -> None:
    clock, calls = SimClock(), []
    with store(clock) as codra:
        waiting = codra.agent("container_detection").on_wake(lambda _: calls.append("the first"))
        gc.collect()
        with pytest.raises(AgentTakenError):
            codra.agent("container_detection")
        codra.agent("picking").graph.request("detecting")
        clock.sleep(0.1)
        waiting.unsubscribe()
        codra.agent("container_detection").on_wake(lambda _: calls.append("the next"))
        clock.sleep(0.1)
    assert calls == ["the first", "the next"]


def test_a_woken_agent_executes_its_rule_and_the_journal_records_it(tmp_path: Path) -> None:
    clock = SimClock()
    with store(clock, Journal(tmp_path / "run.mcap")) as codra:
        detection = codra.agent("container_detection").graph

        def detect(change: Change) -> None:
            request = change.snapshot.handover("detecting").request
            with detection.acting("detect") as acting:
                detection.acknowledge(request)
                detection.insert_node("box", "roll_container")
                detection.place("world", "container_pose", "box", Pose.of((3.0, 0.0, 0.0)))
                detection.finish(request, "ok")
            assert acting.state is RuleState.FULFILLED

        detection.on_wake(detect)
        clock.sleep(1.0)
        codra.agent("picking").graph.request("detecting")
        clock.sleep(1.0)
        events = codra.record.of(Kind.KNOWLEDGE, "container_detection.detect")
        assert [(event.instant_s, event.what) for event in events] == [(1.0, "begun"), (1.0, "fulfilled")]
        assert "rule detect of agent container_detection fulfilled" in str(codra.why("container_detection.detect"))
    head, events = read(tmp_path / "run.mcap")
    assert replay(head, events, MODEL, ContextManager[str, str], None, AT_WORK).difference is None


def test_an_action_whose_before_does_not_hold_is_refused_and_audited() -> None:
    with store(SimClock()) as codra:
        detection, people = codra.agent("container_detection").graph, codra.agent("person_detection").graph
        with pytest.raises(RuleError, match="cannot begin: robot -wants-> detecting does not hold"):
            detection.acting("detect").__enter__()
        codra.agent("picking").graph.request("detecting")
        people.insert_node("him", "person")
        people.insert_edge("him", "close_to", "robot")
        there = "not some person -close_to-> robot does not hold: there is him -close_to-> robot"
        with pytest.raises(RuleError, match=there):
            detection.acting("detect").__enter__()
        assert there in str(codra.why("container_detection.detect"))
        assert [refusal.agent for refusal in codra.knowledge.refusals()] == ["container_detection"] * 2
        events = codra.record.of(Kind.KNOWLEDGE, "container_detection.detect")
        assert [event.what for event in events] == ["refused", "refused"]


def test_no_write_comes_between_the_check_of_a_rule_and_its_first_changes(tmp_path: Path) -> None:
    with store(SimClock(), Journal(tmp_path / "run.mcap")) as codra:
        detection, people = codra.agent("container_detection").graph, codra.agent("person_detection").graph
        people.insert_node("him", "person")
        request = codra.agent("picking").graph.request("detecting")
        with detection.acting("detect") as acting:

            def begin_during_another_write() -> None:
                with acting.transaction() as first:
                    first.acknowledge(request)
                    people.insert_edge("him", "close_to", "robot")

            with pytest.raises(RuleError, match="not some person -close_to-> robot does not hold"):
                begin_during_another_write()
            assert codra.knowledge.snapshot().handover("detecting").stage is Stage.WANTS
            people.delete_edge("him", "close_to", "robot")
            with acting.transaction() as first:
                first.acknowledge(request)
                first.insert_node("box", "roll_container")
        states = [event.what for event in codra.record.of(Kind.KNOWLEDGE, "container_detection.detect")]
        assert states == ["begun", "refused", "unfulfilled"]
        why = codra.why("container_detection.detect")
        assert str(why).startswith("container_detection.detect is 'unfulfilled' at 0 s")
        assert "unfulfilled at 0 s: detecting.result == 'ok' does not hold" in str(why)
        assert codra.knowledge.snapshot().handover("detecting").stage is Stage.IS
    head, events = read(tmp_path / "run.mcap")
    assert replay(head, events, MODEL, ContextManager[str, str], None, AT_WORK).difference is None


def test_a_rule_that_needs_a_type_reports_that_there_is_no_such_node() -> None:
    looks = RuleModel(name="detect", before=(path("robot", "close_to", some("roll_container")),))
    model = replace(AT_WORK, agents=(AgentModel(name="container_detection", rules=(looks,)),))
    with ContextManager[str, str](MODEL, clock=SimClock(), resources={}, knowledge=model) as codra:
        detection = codra.agent("container_detection").graph
        unmet_text = "robot -close_to-> some roll_container does not hold"
        with pytest.raises(RuleError, match=f"{unmet_text}: there is no roll_container$"):
            detection.acting("detect").__enter__()
        detection.insert_node("box", "roll_container")
        with pytest.raises(RuleError, match=f"{unmet_text}$"):
            detection.acting("detect").__enter__()


def test_a_pattern_with_a_misspelt_type_is_an_error() -> None:
    with store(SimClock()) as codra:
        now = codra.knowledge.snapshot()
        for pattern in (path("robot", "close_to", some("persn")), absent(some("persn"), "close_to", "robot")):
            with pytest.raises(UnknownNameError, match="no type of nodes 'persn': did you mean 'person'"):
                now.holds(pattern)


def test_why_asks_for_a_name_where_a_pattern_would_ask_for_some_of_a_type() -> None:
    with store(SimClock()) as codra:
        with pytest.raises(
            UnknownNameError, match="ask about one roll_container by its name; there was none until then"
        ):
            codra.why("robot -close_to-> some roll_container")
        detection = codra.agent("container_detection").graph
        detection.insert_node("crate", "roll_container")
        detection.insert_node("box", "roll_container")
        with pytest.raises(
            UnknownNameError, match=r"'some roll_container' names no single node or edge.*; there were box, crate$"
        ):
            codra.why("some roll_container")


def test_a_broken_during_pattern_is_noticed_while_the_action_continues() -> None:
    clock = SimClock()
    with store(clock) as codra:
        detection, picking = codra.agent("container_detection").graph, codra.agent("picking").graph
        request = picking.request("detecting")
        with detection.acting("detect") as acting:
            detection.acknowledge(request)
            clock.sleep(1.0)
            assert acting.may_go_on
            picking.abort(request)
            clock.sleep(1.0)
            assert not acting.may_go_on
        assert acting.state is RuleState.UNFULFILLED
        events = codra.record.of(Kind.KNOWLEDGE, "container_detection.detect")
        assert [event.what for event in events] == ["begun", "broken", "unfulfilled"]
        assert events[1].details["message"] == "robot -is-> detecting does not hold"


def test_an_unknown_rule_is_reported_with_a_suggestion() -> None:
    with store(SimClock()) as codra, pytest.raises(UnknownNameError, match="did you mean 'detect'"):
        codra.agent("container_detection").graph.acting("detcet")


def test_a_callback_that_blocks_or_raises_delays_no_other() -> None:
    """In real time, one agent sleeps in its callback, another raises an exception, and eight writers continue."""
    hold, woken = threading.Event(), threading.Event()
    with WallClock() as clock, store(clock) as codra:

        def hang(_: Change) -> None:
            woken.set()
            hold.wait(60.0)

        def fail(_: Change) -> None:
            raise ValueError("on purpose")

        codra.agent("container_detection").on_wake(hang)
        codra.agent("navigation").on_wake(fail)
        picking = codra.agent("picking")
        picking.graph.request("detecting")
        assert woken.wait(30.0)
        threads = [
            threading.Thread(target=lambda: [codra.set("light", turn % 2 == 0) for turn in range(100)])
            for _ in range(8)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30.0)
            assert not thread.is_alive()
        assert codra.knowledge.get("context", "light").known
        hold.set()


def test_the_same_program_wakes_its_agents_in_the_same_order() -> None:
    def record() -> str:
        clock = SimClock()
        with store(clock) as codra:
            for name in ("container_detection", "navigation", "person_detection"):
                handle = codra.agent(name)
                handle.on_wake(lambda _, handle=handle: handle.graph.check_open() or codra.set("light", True))
            codra.agent("picking").graph.request("detecting")
            clock.sleep(3.0)
            return codra.record.text()

    assert record() == record()
