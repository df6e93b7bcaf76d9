"""Agents in other programs, as messages: what a session may do with the knowledge graph, and how it ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.remote import VERSION
from codra_dsl.runtime.remote.agents import agent_session
from codra_dsl.runtime.remote.agents.agent_session import MAX_CHANGES, agents_of_manager
from codra_dsl.runtime.remote.json_lines import line_of, message_of
from codra_dsl.runtime.remote.permissions import Permissions
from codra_dsl.runtime.remote.protocol import AGENT_REQUESTS, FieldType
from codra_dsl.runtime.remote.session import open_session
from codra_dsl.runtime.replay import replay
from tests.runtime.journal.journals import read
from tests.runtime.remote.shared_store import KNOWLEDGE, MODEL, manager
from tests.runtime.remote.test_messages import Program, anything, fitting, running_program


@contextmanager
def store() -> Iterator[tuple[ContextManager[str, str], SimClock]]:
    clock = SimClock()
    with manager(clock) as codra:
        yield codra, clock


def agent(codra: ContextManager[str, str], clock: SimClock, name: str) -> Program:
    """Return a program that speaks for an agent."""
    program = Program(codra, clock)
    program.ask("hello", lease_s=3600.0)
    assert program.ask("enter", agent=name) == {}
    return program


def test_an_agent_elsewhere_writes_what_the_spec_lets_it_write_and_nothing_else() -> None:
    with store() as (codra, clock):
        detection = agent(codra, clock, "person_detection")
        assert detection.ask("insert_node", name="anna", type="person", values=[{"name": "height", "value": 1.7}]) == {}
        assert detection.ask("set_attribute", name="anna", attribute="height", value=1.8) == {}
        assert detection.ask("insert_edge", origin="anna", type="close_to", target="robot", values=[]) == {}
        refused = detection.ask("set_attribute", name="battery", attribute="charge", value=1.0)

        assert refused["kind"] == "not_a_source"
        assert codra.knowledge.refusals()[-1].agent == "person_detection"
        assert codra.knowledge.snapshot().get("anna", "height").value == 1.8
        assert codra.knowledge.snapshot().node("anna").writer == "person_detection"
        assert codra.get("charge").source != "person_detection"


def test_each_error_of_the_graph_has_a_kind_of_its_own() -> None:
    edge = {"origin": "anna", "type": "close_to", "target": "robot"}
    pose = {"origin": "world", "type": "robot_pose", "target": "robot", "pose": [0, 0, 0, 1, 0, 0, 0]}
    with store() as (codra, clock):
        detection, navigation = agent(codra, clock, "person_detection"), agent(codra, clock, "navigation")
        picking = agent(codra, clock, "picking")
        fork, page = agent(codra, clock, "fork"), agent(codra, clock, "picker_page")
        containers = agent(codra, clock, "container_detection")
        containers.ask("insert_node", name="box", type="roll_container")
        page.ask("set_attribute", name="box", attribute="locked", value=True)
        number = picking.ask("request_task", task="lifting")["number"]
        kinds = [
            detection.ask("delete_node", name="anna"),
            detection.ask("insert_node", name="robot", type="person"),
            detection.ask("insert_node", name="anna", type="persona"),
            detection.ask("insert_edge", **edge),
            fork.ask("set_attribute", name="box", attribute="locked", value=False),
            picking.ask("request_task", task="lifting"),
            fork.ask("finish_task", task="lifting", number=number, result="ok"),
            navigation.ask("place", **{**pose, "origin": "camera"}),
            navigation.ask("place", **pose, stamp_s=5.0),
            navigation.ask("place", **{**pose, "pose": [0] * 7}),
            navigation.ask("set_attribute", name="battery", attribute="charge", value="full"),
            fork.ask("begin_change", rule="lifd"),
        ]

    assert [error["kind"] for error in kinds] == [
        "absent", "present", "unknown_name", "absent", "outranked", "conflict", "conflict", "not_of_type",
        "not_allowed", "not_allowed", "not_of_type", "unknown_name",
    ]  # fmt: skip


def test_a_session_speaks_for_one_agent_and_an_agent_has_one_session() -> None:
    with store() as (codra, clock):
        fork, other = agent(codra, clock, "fork"), Program(codra, clock)

        assert other.ask("enter", agent="fork")["kind"] == "agent_taken"
        assert fork.ask("enter", agent="picking")["kind"] == "agent_taken"
        assert other.ask("delete_node", name="robot")["kind"] == "not_permitted"
        assert other.ask("begin_change")["kind"] == "not_permitted"
        assert other.ask("enter", agent="forc")["kind"] == "unknown_name"
        assert fork.ask("exit") == {}
        assert fork.ask("set", variable="docked", value=True, agent="fork") == {}
        assert fork.ask("enter", agent="fork") == {}
        fork.ask("leave")
        assert other.ask("enter", agent="fork") == {}


def test_on_a_network_a_user_speaks_only_for_the_agent_of_its_name() -> None:
    with store() as (codra, _clock):
        received: list[dict[str, Any]] = []
        permissions = Permissions(user="fork", agents={"fork", "picking"})
        session = open_session(codra, received.append, permissions)
        for message in ({"ask": "enter", "agent": "picking"}, {"ask": "enter", "agent": "fork"}, {"ask": "graph"}):
            session.receive({"codra": VERSION, **message})
        other = open_session(codra, received.append, Permissions(user="arm_pc", agents={"fork"}))
        other.receive({"codra": VERSION, "ask": "graph"})
        other.receive({"codra": VERSION, "ask": "delete_node", "name": "robot"})

    kinds = [message.get("error", {}).get("kind", "answer") for message in received]
    assert kinds == ["not_permitted", "answer", "answer", "answer", "not_permitted"]
    assert received[0]["error"]["message"] == "user 'fork' may not request `enter` as agent 'picking'"


def test_agents_that_write_no_variable_are_users_as_well() -> None:
    with store() as (codra, _clock):
        assert agents_of_manager(codra) == {
            "navigation",
            "fork",
            "picking",
            "picker_page",
            "decision_maker",
            "person_detection",
            "container_detection",
        }
        assert "picking" not in codra.model.agents


def test_a_transaction_is_visible_at_its_end_and_not_at_all_if_one_operation_is_refused() -> None:
    with store() as (codra, clock):
        detection = agent(codra, clock, "person_detection")
        change = detection.ask("begin_change")["change"]
        detection.ask("insert_node", name="anna", type="person", change=change)
        assert "anna" not in codra.knowledge.snapshot()
        assert detection.ask("end_change", change=change) == {}
        assert "anna" in codra.knowledge.snapshot()

        change = detection.ask("begin_change")["change"]
        detection.ask("delete_node", name="anna", change=change)
        assert detection.ask("delete_node", name="robot", change=change)["kind"] == "not_a_source"
        assert detection.ask("end_change", change=change)["kind"] == "not_a_source"
        assert detection.ask("end_change", change=change)["kind"] == "malformed"

        discarded = detection.ask("begin_change")["change"]
        detection.ask("delete_node", name="anna", change=discarded)
        assert detection.ask("end_change", change=discarded, discard=True) == {}
        assert "anna" in codra.knowledge.snapshot()


def test_a_rule_is_enforced_by_the_manager() -> None:
    with store() as (codra, clock):
        fork, picking = agent(codra, clock, "fork"), agent(codra, clock, "picking")
        assert fork.ask("check_rule", rule="lift")["kind"] == "rule"
        early_change = fork.ask("begin_change", rule="lift")["change"]
        fork.ask("set_attribute", name="robot", attribute="docked", value=True, change=early_change)
        assert fork.ask("end_change", change=early_change)["kind"] == "rule"
        picking.ask("request_task", task="lifting")
        assert fork.ask("check_rule", rule="lift") == {}
        assert fork.ask("record_rule", rule="lift", state="begun") == {}
        assert fork.ask("record_rule", rule="lift", state="flown")["kind"] == "malformed"
        assert picking.ask("record_rule", rule="lift", state="begun")["kind"] == "unknown_name"


@pytest.mark.parametrize("end", ["leave", "lease", "lost"])
def test_when_a_session_ends_the_tasks_that_its_agent_executes_fail_with_a_reason(end: str) -> None:
    with store() as (codra, clock):
        picking, fork = agent(codra, clock, "picking"), agent(codra, clock, "fork")
        fork.ask("hello", lease_s=2.0)
        change = fork.ask("begin_change")["change"]
        fork.ask("set_attribute", name="robot", attribute="docked", value=True, change=change)
        number = picking.ask("request_task", task="lifting")["number"]
        fork.ask("acknowledge_task", task="lifting", number=number)
        if end == "leave":
            fork.ask("leave")
        elif end == "lost":
            fork.session.close("the connection was lost")
        clock.sleep(2.0)

        handover = codra.knowledge.snapshot().handover("lifting")
        assert (handover.stage, handover.reason) == ("aborted", "executor_lost")
        assert not codra.get("docked").known
        assert fork.ask("finish_task", task="lifting", number=number, result="ok")["kind"] == "lease_over"
        successor = agent(codra, clock, "fork")
        number = picking.ask("request_task", task="lifting")["number"]
        assert successor.ask("acknowledge_task", task="lifting", number=number) == {}


def test_an_agent_that_exits_leaves_no_task_that_nobody_can_finish() -> None:
    with store() as (codra, clock):
        picking, fork = agent(codra, clock, "picking"), agent(codra, clock, "fork")
        number = picking.ask("request_task", task="lifting")["number"]
        fork.ask("acknowledge_task", task="lifting", number=number)
        fork.ask("exit")

        handover = codra.knowledge.snapshot().handover("lifting")
        assert (handover.stage, handover.reason) == ("aborted", "executor_lost")
        assert "number" in picking.ask("request_task", task="lifting")


def test_a_deadline_ends_a_task_whose_executor_is_cut_off() -> None:
    with store() as (codra, clock):
        picking, fork = agent(codra, clock, "picking"), agent(codra, clock, "fork")
        number = picking.ask("request_task", task="lifting")["number"]
        fork.ask("acknowledge_task", task="lifting", number=number)
        clock.sleep(60.0)

        assert codra.knowledge.snapshot().handover("lifting").reason == "overdue"
        assert fork.ask("finish_task", task="lifting", number=number, result="ok")["kind"] == "conflict"


def test_a_run_with_agents_elsewhere_is_replayed_from_its_journal(tmp_path: Any) -> None:
    clock, journal = SimClock(), tmp_path / "run.mcap"
    with manager(clock, Journal(journal)) as codra:
        picking, fork = agent(codra, clock, "picking"), agent(codra, clock, "fork")
        number = picking.ask("request_task", task="lifting")["number"]
        fork.ask("acknowledge_task", task="lifting", number=number)
        fork.session.close("the connection was lost")
        clock.sleep(1.0)

    assert replay(*read(journal), MODEL, ContextManager[str, str], None, KNOWLEDGE).difference is None


def test_the_limits_of_a_session_hold_for_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(agent_session, "MAX_OPERATIONS", 5)
    with store() as (codra, clock):
        detection = agent(codra, clock, "person_detection")
        changes = [detection.ask("begin_change")["change"] for _ in range(MAX_CHANGES)]
        assert detection.ask("begin_change")["kind"] == "not_allowed"
        write = {"name": "robot", "type": "person", "change": changes[0]}
        assert detection.ask("insert_node", **write)["kind"] == "present"
        detection.ask("insert_node", name="anna", type="person", change=changes[1])
        for _ in range(4):
            assert detection.ask("set_attribute", name="anna", attribute="height", change=changes[1]) == {}
        assert detection.ask("delete_node", name="anna", change=changes[1])["kind"] == "not_allowed"
        assert detection.ask("end_change", change=changes[1]) == {}
        assert detection.ask("exit") == {}
        assert detection.ask("enter", agent="person_detection") == {}
        assert detection.ask("end_change", change=changes[2])["kind"] == "malformed"


def test_a_session_has_one_copy_of_the_graph_and_a_spec_without_a_graph_has_none() -> None:
    with store() as (codra, clock):
        reader = Program(codra, clock)
        assert reader.ask("graph", digest="of another version")["kind"] == "not_allowed"
        assert reader.ask("graph")["graph"]["version"] == codra.knowledge.snapshot().version
        assert reader.ask("graph")["kind"] == "not_allowed"
        codra.set("light", value=True)
        assert [change["reading"][1] for change in reader.notices("change")] == [True]
        reader.ask("leave")
        codra.set("light", value=False)
        assert len(reader.notices("change")) == 1
    with running_program() as (reader, _codra, _clock):
        assert reader.ask("graph")["kind"] == "unknown_name"
        assert reader.ask("enter", agent="fork")["kind"] == "unknown_name"


NAMES = [
    "robot",
    "anna",
    "battery",
    "charge",
    "person",
    "close_to",
    "robot_pose",
    "lifting",
    "fork",
    "lift",
    "ok",
    "begun",
]


@some.composite
def agent_requests(draw: some.DrawFn) -> dict[str, object]:
    """Return a request of agents, whose fields often name something that exists."""
    ask = draw(some.sampled_from(sorted(AGENT_REQUESTS)))
    kinds = fitting | {FieldType.TEXT: some.sampled_from(NAMES)}
    fields: dict[str, object] = {}
    for name, kind in sorted({**AGENT_REQUESTS[ask].required, **AGENT_REQUESTS[ask].optional}.items()):
        if name in AGENT_REQUESTS[ask].required or draw(some.booleans()):
            fields[name] = draw(kinds[kind] if draw(some.integers(0, 9)) else anything)
    return {"codra": VERSION, "id": 1, "ask": ask, **fields}


@settings(max_examples=60, deadline=None)
@given(requests=some.lists(agent_requests(), max_size=40), name=some.sampled_from(["fork", "navigation", "picking"]))
def test_hostile_requests_of_agents_are_answered_and_change_only_what_the_agent_may_write(
    requests: list[dict[str, Any]], name: str
) -> None:
    with store() as (codra, clock):
        program = agent(codra, clock, name)
        before = len(program.received_messages)
        for request in requests:
            program.session.receive(request)
        answers = [message for message in program.received_messages[before:] if "notice" not in message]

        assert len(answers) == len(requests)
        assert all(message_of(line_of(answer)) for answer in answers)
        assert codra.knowledge.snapshot().get("battery", "charge").source in ({name} & {"navigation"} | {""})
        snapshot = codra.knowledge.snapshot()
        writers = {node.writer for node in snapshot.nodes()} | {edge.writer for edge in snapshot.edges()}
        assert writers <= {"", name}
        program.session.close()
        assert not [task for task in KNOWLEDGE.tasks if codra.knowledge.snapshot().handover(task.name).stage == "is"]
