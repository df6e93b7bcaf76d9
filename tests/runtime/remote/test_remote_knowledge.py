"""Agents in other programs, with real sockets, processes and time: the handles are those of one process."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from codra_dsl.runtime import (
    ContextManager,
    NotASourceError,
    NotOfTypeError,
    UnknownNameError,
    WallClock,
)
from codra_dsl.runtime.geometry import FrameError, Pose
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.knowledge import (
    AbsentError,
    AgentTakenError,
    ConflictError,
    OutrankedError,
    PresentError,
    Request,
    RuleError,
    path,
    some,
)
from codra_dsl.runtime.remote import RemoteContext, Server
from generated import store as other_version
from tests.runtime.remote import shared_store
from tests.runtime.remote.shared_store import manager
from tests.runtime.remote.test_server import PATIENCE_S, ROOT, eventually

FORK = """
import sys
from codra_dsl.runtime.knowledge import path
from codra_dsl.runtime.remote import RemoteContext
from tests.runtime.remote import shared_store

knowledge = RemoteContext(sys.argv[1]).knowledge(shared_store)
fork = knowledge.as_agent("fork")
assert knowledge.wait_for(path("robot", "wants", "lifting"), timeout_s=60.0)
fork.acknowledge(knowledge.snapshot().handover("lifting").request)
print("executing", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def codra() -> Iterator[ContextManager[str, str]]:
    with WallClock() as clock, manager(clock) as codra:
        yield codra


@pytest.fixture
def server(codra: ContextManager[str, str], tmp_path: Path) -> Iterator[Server]:
    with Server(codra, tmp_path / "codra.sock") as server:
        yield server


@pytest.fixture
def remote(server: Server) -> Iterator[RemoteContext]:
    with RemoteContext(server.address) as remote:
        yield remote


def test_a_handle_writes_and_its_copy_has_each_write_at_once(
    remote: RemoteContext, codra: ContextManager[str, str]
) -> None:
    knowledge = remote.knowledge(shared_store)
    with knowledge.as_agent("navigation") as navigation:
        navigation.set("battery", "charge", 12.5)
        navigation.place("world", "robot_pose", "robot", Pose.of((1.0, 2.0, 0.0)))
        navigation.insert_edge("robot", "in", "area_1")
        assert knowledge.get("battery", "charge").value == 12.5
        assert knowledge.transform("world", "robot").pose.translation_m == (1.0, 2.0, 0.0)
        assert knowledge.snapshot().has_edge("robot", "in", "area_1")
        navigation.delete_edge("robot", "in", "area_1")
        assert not knowledge.snapshot().has_edge("robot", "in", "area_1")
        with navigation.transaction() as change:
            change.set("battery", "charge", 99)
            assert knowledge.get("battery", "charge").value == 12.5
        assert knowledge.get("battery", "charge").value == 99.0
    assert codra.get("charge").source == "navigation"
    assert remote.knowledge(shared_store) is knowledge


def test_evidence_of_a_copy_is_never_in_the_future_of_the_manager(remote: RemoteContext) -> None:
    knowledge = remote.knowledge(shared_store)
    with knowledge.as_agent("navigation") as navigation:
        for level in range(100):
            navigation.set("battery", "charge", level, evidence_s=knowledge.snapshot().instant_s)
        reading = knowledge.get("battery", "charge")

    assert reading.value == 99.0
    assert reading.evidence_s <= reading.identified_s


def test_tasks_are_handed_over_between_programs(server: Server, codra: ContextManager[str, str]) -> None:
    with RemoteContext(server.address) as first, RemoteContext(server.address) as second:
        requester, executor = first.knowledge(shared_store), second.knowledge(shared_store)
        requests: queue.Queue[Request] = queue.Queue()
        with executor.as_agent("fork") as fork, requester.as_agent("picking") as picking:
            fork.on_wake(lambda change: requests.put(change.snapshot.handover("lifting").request))
            request = picking.request("lifting")
            assert requests.get(timeout=PATIENCE_S) == request
            with fork.acting("lift") as rule, rule.transaction() as change:
                change.acknowledge(request)
                change.finish(request, "ok")
            assert str(rule.state) == "fulfilled"
            assert requester.wait_for(path("robot", "finished", "lifting"), timeout_s=PATIENCE_S)
            assert requester.snapshot().handover("lifting").result == "ok"
            with picking.transaction() as change:
                again = change.request("lifting")
            picking.abort(again)
    assert codra.knowledge.snapshot().handover("lifting").reason == "requester"
    whats = [event.what for event in codra.record.of(Kind.KNOWLEDGE) if event.name == "fork.lift"]
    assert whats == ["begun", "fulfilled"]


def test_errors_are_those_of_the_graph_in_one_process(server: Server, codra: ContextManager[str, str]) -> None:
    codra.agent("container_detection").graph.insert_node("box", "roll_container")
    codra.agent("picker_page").graph.set("box", "locked", value=True)
    with RemoteContext(server.address) as first, RemoteContext(server.address) as second:
        knowledge = first.knowledge(shared_store)
        fork = knowledge.as_agent("fork")
        picking = second.knowledge(shared_store).as_agent("picking")
        with pytest.raises(NotASourceError, match=r"'battery.charge' may be written by navigation, not by 'fork'"):
            fork.set("battery", "charge", 1.0)
        with pytest.raises(OutrankedError, match="wrote it with a higher priority"):
            fork.set("box", "locked", value=False)
        with pytest.raises(UnknownNameError, match="did you mean 'locked'"):
            fork.set("box", "lokked", value=True)
        with pytest.raises(NotOfTypeError, match="is not of type bool"):
            fork.set("robot", "docked", "no")
        with pytest.raises(NotOfTypeError, match="a value is a text, a number, or true or false"):
            fork.set("robot", "docked", [1])
        with pytest.raises(AbsentError, match="the node 'bax' does not exist"):
            fork.place("robot", "carried", "bax", Pose.of((0, 0, 0)))
        with pytest.raises(FrameError):
            knowledge.transform("world", "box")
        with pytest.raises(ValueError, match="needs a Pose"):
            fork.place("robot", "carried", "box", (0, 0, 0))
        with pytest.raises(RuleError, match="the rule 'lift' of 'fork' cannot begin"), fork.acting("lift"):
            pass
        with pytest.raises(UnknownNameError, match="did you mean 'lift'"):
            fork.acting("lifd")
        with pytest.raises(ConflictError, match="is not the latest request"):
            fork.acknowledge(Request("lifting", 7))
        with pytest.raises(TypeError, match="expected the return value of request"):
            fork.acknowledge(7)
        with pytest.raises(NotASourceError):
            picking.finish(picking.request("lifting"), "ok")
    with RemoteContext(server.address) as third:
        detection = third.knowledge(shared_store).as_agent("person_detection")
        with pytest.raises(PresentError, match="already exists"):
            detection.insert_node("box", "person")
    assert {refusal.agent for refusal in codra.knowledge.refusals()} == {"fork", "picking"}


def test_a_caught_error_in_a_transaction_leaves_the_graph_as_it_was(remote: RemoteContext) -> None:
    knowledge = remote.knowledge(shared_store)
    fork = knowledge.as_agent("fork")

    def write(
        attributes: tuple[tuple[str, str], ...], failure: type[Exception] | None, do: Callable[[], None] = lambda: None
    ) -> None:
        with fork.transaction() as change:
            for name, attribute in attributes:
                with suppress(NotASourceError):
                    change.set(name, attribute, value=True)
            do()
            if failure is not None:
                raise failure

    with pytest.raises(NotASourceError):
        write((("robot", "docked"), ("battery", "charge")), None)
    with pytest.raises(ZeroDivisionError):
        write((("robot", "docked"),), ZeroDivisionError)
    with fork.transaction() as change:
        pass
    with pytest.raises(PermissionError, match="this transaction is over"):
        change.set("robot", "docked", value=True)

    with pytest.raises(PermissionError, match="this handle of the agent 'fork' is closed"):
        write((("robot", "docked"),), None, fork.close)

    assert not knowledge.get("robot", "docked").known
    with pytest.raises(PermissionError, match="this handle of the agent 'fork' is closed"):
        fork.set("robot", "docked", value=True)
    knowledge.as_agent("fork").set("robot", "docked", value=True)
    assert knowledge.get("robot", "docked").value is True


def test_a_subscription_gets_changes_of_other_programs(remote: RemoteContext, codra: ContextManager[str, str]) -> None:
    knowledge, boxes = remote.knowledge(shared_store), queue.Queue[tuple[str, ...]]()
    with knowledge.subscribe(
        lambda change: boxes.put(tuple(match.node("box") for match in change.new)),
        path("world", "container_pose", some("roll_container", called="box")),
    ):
        with codra.agent("container_detection").graph.transaction() as change:
            change.insert_node("box", "roll_container")
            change.place("world", "container_pose", "box", Pose.of((1, 0, 0)))
        assert boxes.get(timeout=PATIENCE_S) == ("box",)
    assert knowledge.snapshot().node("box").writer == "container_detection"


def test_one_connection_speaks_for_one_agent(server: Server, codra: ContextManager[str, str]) -> None:
    with RemoteContext(server.address) as remote, RemoteContext(server.address) as other:
        knowledge = remote.knowledge(shared_store)
        knowledge.as_agent("fork")
        with pytest.raises(AgentTakenError, match="already speaks for the agent 'fork'"):
            knowledge.as_agent("picking")
        with pytest.raises(AgentTakenError, match="already has an open handle"):
            other.knowledge(shared_store).as_agent("fork")
        with pytest.raises(AgentTakenError):
            codra.agent("fork")
        with pytest.raises(UnknownNameError, match="did you mean 'fork'"):
            knowledge.as_agent("forks")


def test_a_killed_executor_ends_its_task_and_another_program_takes_over(
    server: Server, codra: ContextManager[str, str]
) -> None:
    picking = codra.agent("picking").graph
    for _ in range(2):
        picking.request("lifting")
        process = subprocess.Popen(
            [sys.executable, "-c", FORK, str(server.address)],
            cwd=ROOT,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert process.stdout is not None
        assert process.stdout.readline() == "executing\n"
        assert codra.knowledge.snapshot().handover("lifting").stage == "is"
        process.kill()
        process.communicate(timeout=PATIENCE_S)
        eventually(lambda: codra.knowledge.snapshot().handover("lifting").stage == "aborted")
        assert codra.knowledge.snapshot().handover("lifting").reason == "executor_lost"


def test_a_copy_without_its_manager_is_never_read(codra: ContextManager[str, str], tmp_path: Path) -> None:
    server = Server(codra, tmp_path / "codra.sock")
    remote = RemoteContext(server.address)
    knowledge = remote.knowledge(shared_store)
    fork = knowledge.as_agent("fork")
    errors = queue.Queue[BaseException]()

    def wait() -> None:
        try:
            knowledge.wait_for(path("robot", "wants", "lifting"), timeout_s=PATIENCE_S)
        except ConnectionError as error:
            errors.put(error)

    threading.Thread(target=wait).start()
    server.close()
    assert "the manager has closed" in remote.wait_until_lost(PATIENCE_S)
    assert isinstance(errors.get(timeout=PATIENCE_S), ConnectionError)
    reads: list[Any] = [knowledge.snapshot, lambda: knowledge.get("battery", "charge"), lambda: knowledge.at(0.0)]
    reads += [lambda: knowledge.transform("world", "robot", 0.0), lambda: fork.set("robot", "docked", value=True)]
    for read in reads:
        with pytest.raises(ConnectionError, match="the manager has closed"):
            read()
    fork.close()
    remote.close()


def test_a_copy_is_not_read_for_longer_than_the_lease(remote: RemoteContext) -> None:
    knowledge = remote.knowledge(shared_store)
    knowledge._manager_clock.last_answer_asked_s -= 4.0
    assert "robot" in knowledge.snapshot()
    knowledge._manager_clock.last_answer_asked_s -= 4.0
    with pytest.raises(ConnectionError, match="the manager has not answered for 5 s"):
        knowledge.snapshot()


def test_another_version_of_the_spec_is_refused_and_a_spec_without_a_graph_has_none(remote: RemoteContext) -> None:
    without_graph: Any = SimpleNamespace(MODEL=shared_store.MODEL)
    with pytest.raises(LookupError, match="the spec 'store' declares no knowledge graph"):
        remote.knowledge(without_graph)
    with pytest.raises(ValueError, match="this program has another version of the spec than the manager"):
        remote.knowledge(other_version)


def test_a_graph_that_could_not_be_read_is_read_by_the_next_call(
    remote: RemoteContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lose_answer(*_: object, **__: object) -> Any:
        raise ConnectionError("the manager did not answer within 5 s")

    with monkeypatch.context() as patch:
        patch.setattr(remote, "_ask", lose_answer)
        with pytest.raises(ConnectionError, match="did not answer"):
            remote.knowledge(shared_store)

    assert "robot" in remote.knowledge(shared_store).snapshot()


def test_changes_follow_a_large_graph_while_a_program_reads_it(server: Server, codra: ContextManager[str, str]) -> None:
    detection = codra.agent("person_detection").graph
    with detection.transaction() as change:
        for number in range(4_000):
            change.insert_node(f"person {number:05} {'x' * 200}", "person")
    is_over = threading.Event()

    def write() -> None:
        height_m = 0.0
        while not is_over.wait(0.0005):
            height_m = 3.0 - height_m
            detection.set(f"person 00000 {'x' * 200}", "height", height_m)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        with RemoteContext(server.address) as remote:
            knowledge = remote.knowledge(shared_store)
            version = knowledge.snapshot().version
            eventually(lambda: knowledge.snapshot().version > version + 20)
            assert len(knowledge.snapshot().nodes("person")) == 4_000
    finally:
        is_over.set()
        writer.join()
