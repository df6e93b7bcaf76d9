"""Context-variables are attributes of nodes: the context and the graph share their readings, order and lock."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime import ContextManager, Kind, NotASourceError, NotOfTypeError, SimClock, WallClock
from codra_dsl.runtime.knowledge import AgentTakenError, Knowledge, Transaction
from codra_dsl.runtime.remote import open_session
from codra_dsl.runtime.values.conditions import value
from tests.runtime.knowledge.manager import MODEL, manager
from tests.runtime.knowledge.store import STORE


def test_a_write_on_either_side_is_one_reading_on_both() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        navigation = codra.agent("navigation")
        navigation.set("charge", 50.0)
        assert codra.knowledge.get("battery", "charge") is codra.get("charge")
        clock.sleep(1.0)
        navigation.graph.set("battery", "charge", 40.0, evidence_s=0.5)
        reading = codra.get("charge")
        assert codra.knowledge.get("battery", "charge") is reading
        assert (reading.value, reading.source, reading.evidence_s, reading.identified_s) == (40.0, "navigation", 0.5, 1)
        assert (reading.expires_s, reading.name) == (60.5, "charge")


def test_a_variable_without_a_node_is_an_attribute_of_the_node_context() -> None:
    with manager(SimClock()) as codra:
        codra.set("light", True)
        assert codra.knowledge.get("context", "light") is codra.get("light")


def test_a_value_expires_on_both_sides_at_one_instant() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        codra.agent("navigation").graph.set("battery", "charge", 40.0)
        clock.sleep(59.9)
        assert codra.get("charge").known
        assert codra.knowledge.get("battery", "charge").known
        clock.sleep(0.1)
        assert codra.get("charge").reason is codra.knowledge.get("battery", "charge").reason is not None


_STEPS = st.lists(
    st.tuples(
        st.sampled_from(["context", "graph", "transaction", "none"]),
        st.floats(0, 100),
        st.floats(0, 20),
        st.floats(0, 8),
    ),
    max_size=25,
)


@settings(max_examples=40, deadline=None)
@given(_STEPS)
def test_both_sides_have_the_same_history_for_every_order_of_writes(
    steps: list[tuple[str, float, float, float]],
) -> None:
    clock = SimClock(100.0)
    with manager(clock) as codra, codra.agent("navigation").graph as graph:
        for side, level, age_s, pause_s in steps:
            evidence_s = clock.now_s() - age_s
            if side == "context":
                codra.commands.write("charge", level, "navigation", evidence_s)
            elif side == "transaction":
                with graph.transaction() as transaction:
                    transaction.set("battery", "charge", level, evidence_s=evidence_s)
                    transaction.set("robot", "docked", True)
            else:
                graph.set("battery", "charge", level if side == "graph" else None, evidence_s=evidence_s)
            clock.sleep(pause_s)
            snapshot = codra.knowledge.snapshot()
            assert snapshot.history("battery", "charge") == codra.history("charge")
            present, other = codra.get("charge"), snapshot.get("battery", "charge")
            assert (present.content, present.reason, present.evidence_s) == (
                other.content,
                other.reason,
                other.evidence_s,
            )


def test_a_snapshot_does_not_change_when_the_context_does() -> None:
    with manager(SimClock()) as codra:
        codra.set("light", True)
        before = codra.knowledge.snapshot()
        codra.set("light", False)
        assert before.get("context", "light").value is True
        assert [reading.value for reading in before.history("context", "light")] == [True]
        assert codra.knowledge.get("context", "light").value is False


def test_a_change_of_the_context_notifies_subscribers_of_patterns() -> None:
    clock, new_match_counts = SimClock(), []
    with manager(clock) as codra:
        codra.knowledge.subscribe(
            lambda change: new_match_counts.append(len(change.new)), value("battery.charge") < 20.0
        )
        navigation = codra.agent("navigation")
        for level in (50.0, 10.0, 5.0, 30.0, 15.0):
            navigation.set("charge", level)
            clock.sleep(1.0)
    assert new_match_counts == [1, 0, 1]


def test_an_agents_write_to_the_graph_notifies_subscribers_of_the_variable() -> None:
    clock, values = SimClock(), []
    with manager(clock) as codra:
        codra.subscribe("docked", lambda reading: values.append(reading.content))
        codra.agent("fork").graph.set("robot", "docked", True)
        assert codra.wait_for("docked", 1.0)
        clock.sleep(1.0)
    assert values == [None, True]


def test_snapshots_never_contain_a_part_of_a_shared_transaction() -> None:
    seen: set[tuple[object, bool]] = set()
    with WallClock() as clock, manager(clock) as codra, codra.agent("container_detection").graph as detection:
        over = threading.Event()
        navigation = codra.agent("navigation")

        def read() -> None:
            while not over.is_set():
                snapshot = codra.knowledge.snapshot()
                seen.add((snapshot.get("robot", "docked").content, snapshot.has_edge("robot", "in", "area_1")))

        readers = [threading.Thread(target=read) for _ in range(3)]
        for reader in readers:
            reader.start()
        for number in range(300):
            with navigation.graph.transaction() as both:
                both.set("robot", "docked", number % 2 == 0)
                (both.insert_edge if number % 2 == 0 else both.delete_edge)("robot", "in", "area_1")
            detection.insert_node(f"box_{number}", "roll_container")
            codra.set("light", number % 2 == 0)
        over.set()
        for reader in readers:
            reader.join(60.0)
    assert seen <= {(None, False), (True, True), (False, False)}


def test_a_transaction_that_fails_leaves_the_context_as_it_was() -> None:
    with manager(SimClock()) as codra:
        navigation = codra.agent("navigation")
        both = navigation.graph.transaction()
        with pytest.raises(NotASourceError), both as writes:
            _charge_and_insert(writes)
        assert not codra.get("charge").known
        assert not codra.history("charge")


def _charge_and_insert(writes: Transaction) -> None:
    writes.set("battery", "charge", 10.0)
    writes.insert_node("box", "roll_container")


@pytest.mark.parametrize(
    "write",
    [
        lambda codra: codra.agent("fork").graph.set("battery", "charge", 1.0),
        lambda codra: codra.agent("fork").set("charge", 1.0),
    ],
    ids=["graph", "context"],
)
def test_a_foreign_write_of_a_variable_is_refused_on_either_side_and_recorded(
    write: Callable[[ContextManager[str, str]], object],
) -> None:
    with manager(SimClock()) as codra:
        with pytest.raises(NotASourceError, match="may be written by navigation, not by 'fork'"):
            write(codra)
        assert not codra.get("charge").known
        assert [refusal.agent for refusal in codra.knowledge.refusals()] == ["fork"]
        (event,) = codra.record.of(Kind.VARIABLE)
        assert (event.name, event.what, event.details) == ("charge", "refused", {"value": 1.0, "source": "fork"})


def test_a_value_that_a_variable_cannot_have_is_refused_on_either_side() -> None:
    with manager(SimClock()) as codra:
        navigation = codra.agent("navigation")
        for write in (lambda: navigation.set("charge", 101.0), lambda: navigation.graph.set("battery", "charge", 101)):
            with pytest.raises(NotOfTypeError):
                write()
        assert not codra.get("charge").known


def test_an_agent_has_one_open_handle_on_both_sides() -> None:
    with manager(SimClock()) as codra:
        navigation = codra.agent("navigation")
        for take in (codra.agent, codra.knowledge.as_agent):
            with pytest.raises(AgentTakenError):
                take("navigation")
        navigation.close()
        with pytest.raises(PermissionError, match="closed"):
            navigation.set("charge", 1.0)
        codra.agent("navigation").set("charge", 2.0)
        assert codra.get("charge").value == 2.0


@pytest.mark.parametrize("name", ["observer", "nobody"])
def test_observers_and_undeclared_agents_get_no_handle(name: str) -> None:
    with manager(SimClock()) as codra:
        for take in (codra.agent, codra.knowledge.as_agent):
            with pytest.raises(LookupError, match="has no agent"):
                take(name)


def test_the_node_of_a_variable_cannot_be_deleted() -> None:
    with manager(SimClock()) as codra, pytest.raises(PermissionError):
        codra.agent("navigation").graph.delete_node("battery")


def test_without_knowledge_there_is_no_graph() -> None:
    with ContextManager[str, str](MODEL, clock=SimClock(), resources={}) as codra:
        with pytest.raises(LookupError, match="declares no knowledge graph"):
            codra.knowledge.snapshot()
        with pytest.raises(LookupError, match="declares no knowledge graph"):
            codra.agent("fork").graph.delete_node("box")


def test_eight_threads_write_both_sides_and_no_foreign_write_gets_through() -> None:
    """Every agent writes its own subjects, those of others, and the context; there is no deadlock."""
    agents = ["navigation", "fork", "picker_page", "person_detection", "container_detection", "picking"]
    refused: list[str] = []
    with WallClock() as clock, manager(clock) as codra:

        def run(number: int) -> None:
            if number >= len(agents):
                for turn in range(200):
                    codra.set("light", turn % 2 == 0)
                    codra.knowledge.snapshot().match(value("battery.charge") < 50.0)
                return
            agent = codra.agent(agents[number])
            for turn in range(200):
                level = float(turn % 100)
                for write in (
                    partial(agent.set, "charge", level),
                    partial(agent.graph.set, "battery", "charge", level),
                    partial(agent.graph.set, "battery", "level", level),
                ):
                    try:
                        write()
                    except NotASourceError:
                        refused.append(agent.name)

        threads = [threading.Thread(target=run, args=(number,)) for number in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(120.0)
            assert not thread.is_alive()
        sources = {reading.source for reading in codra.history("charge")}
        audited = [refusal.agent for refusal in codra.knowledge.refusals()]
        recorded = codra.record.of(Kind.VARIABLE, "charge")
    assert sources == {"navigation"}
    assert len(refused) == 5 * 600
    assert sorted(audited) == sorted(refused)
    assert len([event for event in recorded if event.what == "refused"]) == 5 * 400


def test_the_main_execution_is_an_agent_if_it_is_a_source_and_has_one_owner_at_a_time() -> None:
    with manager(SimClock()) as codra:
        main = codra.agent("main_execution")
        with main.graph.transaction() as transaction:
            transaction.set("context", "light", True)
        assert (codra.get("light").value, codra.get("light").source) == (True, "main_execution")
        main.set("light", False)
        codra.set("light", True)
        with pytest.raises(NotASourceError):
            main.graph.set("battery", "charge", 1.0)
        for take in (codra.agent, codra.knowledge.as_agent):
            with pytest.raises(AgentTakenError):
                take("main_execution")
        main.close()
        assert codra.knowledge.as_agent("main_execution").name == "main_execution"


def test_the_main_execution_is_not_an_agent_of_a_graph_that_does_not_name_it() -> None:
    with pytest.raises(LookupError, match="has no agent 'main_execution'"):
        Knowledge(STORE, clock=SimClock()).as_agent("main_execution")


def test_without_knowledge_the_error_states_where_to_declare_it() -> None:
    with ContextManager[str, str](MODEL, clock=SimClock(), resources={}) as codra:
        with pytest.raises(LookupError, match="the spec 'store' declares no knowledge graph: add `knowledge` to it"):
            _ = codra.knowledge
        navigation = codra.agent("navigation")
        with pytest.raises(LookupError, match="declares no knowledge graph: add `knowledge` to it"):
            _ = navigation.graph
        with pytest.raises(LookupError, match="declares no knowledge graph"):
            navigation.on_wake(print)


def test_a_session_has_an_agent_from_its_first_write_to_its_end() -> None:
    replies: list[dict[str, Any]] = []
    written = {"codra": 1, "id": 1, "ask": "set", "variable": "charge", "value": 50.0, "agent": "navigation"}
    with manager(SimClock()) as codra:
        session, another = open_session(codra, replies.append), open_session(codra, replies.append)
        program = codra.agent("navigation")
        session.receive(written)
        program.close()
        session.receive(written)
        another.receive(written)
        with pytest.raises(AgentTakenError):
            codra.agent("navigation")
        session.close()
        another.receive(written)

        kinds = [reply["error"]["kind"] if "error" in reply else "answer" for reply in replies]
        assert kinds == ["agent_taken", "answer", "agent_taken", "answer"]
