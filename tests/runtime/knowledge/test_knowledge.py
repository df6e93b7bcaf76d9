"""The graph: its content, its permissions, and its snapshots."""

from __future__ import annotations

import gc
import math
import threading
from collections.abc import Iterable

import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import NotASourceError, NotOfTypeError, Reason, SimClock, UnknownNameError, WallClock
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import (
    AbsentError,
    AgentTakenError,
    Edge,
    Knowledge,
    Node,
    OutrankedError,
    PresentError,
)
from codra_dsl.runtime.knowledge.declarations import (
    AttributeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    TaskModel,
    by,
    path,
)
from codra_dsl.runtime.values.model import integer
from tests.runtime.knowledge.store import STORE, store

HERE = Pose.of((1.0, 2.0, 0.0))


def names(elements: Iterable[Node | Edge]) -> list[str]:
    return [element.name if isinstance(element, Node) else str(element) for element in elements]


# Nodes and edges


def test_declared_nodes_and_edges_exist_from_the_start() -> None:
    seen = store(SimClock(100.0)).snapshot()
    assert names(seen.nodes())[:7] == ["world", "robot", "camera", "people", "battery", "area_1", "area_2"]
    assert names(seen.edges(origin="robot")) == ["robot -has-> battery", "robot -RT-> camera"]
    reading = seen.get("battery", "level")
    assert (reading.value, reading.source, reading.evidence_s) == (80.0, "", 100.0)


def test_two_nodes_can_have_one_edge_per_label() -> None:
    knowledge = store()
    people, detection = knowledge.as_agent("person_detection"), knowledge.as_agent("container_detection")
    people.insert_node("anna", "person")
    people.insert_edge("anna", "close_to", "robot", distance=2.0)
    people.insert_edge("anna", "close_to", "robot", distance=1.5)
    people.insert_edge("people", "is_not", "robot")
    detection.insert_node("box", "roll_container")
    detection.place("world", "container_pose", "box", HERE)
    detection.insert_edge("box", "close_to", "robot")
    seen = knowledge.snapshot()
    assert names(seen.edges(target="robot")) == [
        "anna -close_to-> robot",
        "people -is_not-> robot",
        "box -close_to-> robot",
    ]
    assert seen.get_of_edge("anna", "close_to", "robot", "distance").value == 1.5
    assert [seen.edge("world", name, "box").type for name in ("RT", "container_pose")] == ["container_pose"] * 2


def test_nodes_are_selected_by_type_and_attributes() -> None:
    knowledge = store()
    people = knowledge.as_agent("person_detection")
    for name, height_m in (("zoe", 1.9), ("anna", 1.6), ("bob", 1.8)):
        people.insert_node(name, "person", height=height_m)
    people.insert_node("new", "person")
    seen = knowledge.snapshot()
    assert names(seen.nodes("person")) == ["zoe", "anna", "bob", "new"]
    assert names(seen.nodes("person", where=value("height") > 1.7)) == ["zoe", "bob"]
    assert names(seen.nodes("person", where=~(value("height") > 1.7))) == ["anna"]
    with pytest.raises(UnknownNameError, match="did you mean 'height'"):
        seen.nodes("person", where=value("hight") > 1.7)


def test_a_node_is_deleted_with_all_its_edges_regardless_of_their_writers() -> None:
    knowledge = store()
    detection, fork = knowledge.as_agent("container_detection"), knowledge.as_agent("fork")
    detection.insert_node("box", "roll_container")
    detection.insert_edge("box", "close_to", "robot")
    fork.place("robot", "carried", "box", HERE)
    detection.delete_node("box")
    seen = knowledge.snapshot()
    assert "box" not in seen
    assert names(seen.edges()) == ["robot -has-> battery", "robot -RT-> camera"]
    with pytest.raises(AbsentError, match="the node 'box' does not exist"):
        seen.get("box", "load")


def test_a_new_node_of_the_same_name_has_no_earlier_values() -> None:
    knowledge = store()
    people = knowledge.as_agent("person_detection")
    people.insert_node("anna", "person", height=1.7)
    with pytest.raises(PresentError, match="the node 'anna' already exists"):
        people.insert_node("anna", "person")
    people.delete_node("anna")
    people.insert_node("anna", "person")
    assert knowledge.get("anna", "height").reason is Reason.NEVER_OBSERVED


def test_a_snapshot_keeps_its_nodes_and_edges_after_thousands_of_changes() -> None:
    knowledge = store()
    people = knowledge.as_agent("person_detection")
    kept = []
    for number in range(3000):
        name = f"person_{number % 1700}"
        people.insert_node(name, "person")
        people.insert_edge(name, "close_to", "robot")
        if number % 500 == 0:
            kept.append((name, knowledge.snapshot()))
        people.delete_node(name)
    people.insert_node("anna", "person")
    for name, seen in kept:
        assert names(seen.nodes("person")) == [name]
        assert names(seen.edges(target="robot")) == [f"{name} -close_to-> robot"]
        assert seen.holds(path(name, "close_to", "robot"))
    assert names(knowledge.snapshot().nodes("person")) == ["anna"]
    assert not knowledge.snapshot().edges("close_to")


# Attributes


def test_an_attribute_has_a_stamp_a_writer_and_a_history() -> None:
    clock = SimClock()
    knowledge = store(clock)
    navigation = knowledge.as_agent("navigation")
    for level in (70.0, 60.0):
        clock.sleep(10.0)
        navigation.set("battery", "level", level)
    navigation.set("battery", "level", 75.0, evidence_s=5.0)
    history = [
        (reading.evidence_s, reading.value, reading.source)
        for reading in knowledge.snapshot().history("battery", "level")
    ]
    assert history == [
        (0.0, 80.0, ""),
        (5.0, 75.0, "navigation"),
        (10.0, 70.0, "navigation"),
        (20.0, 60.0, "navigation"),
    ]
    assert knowledge.get("battery", "level").value == 60.0


def test_an_attribute_is_unknown_when_it_expires_and_when_its_writer_makes_it_unknown() -> None:
    clock = SimClock()
    knowledge = store(clock)
    clock.sleep(60.0)
    assert knowledge.get("battery", "level").reason is Reason.STALE
    navigation = knowledge.as_agent("navigation")
    navigation.set("battery", "level", 50)
    assert knowledge.get("battery", "level").value == 50.0
    navigation.set("battery", "level", math.nan)
    assert knowledge.get("battery", "level").reason is Reason.REJECTED


def test_the_history_of_an_attribute_is_a_ring() -> None:
    knowledge = store()
    navigation = knowledge.as_agent("navigation")
    kept = [knowledge.snapshot()]
    for step in range(1000):
        navigation.set("battery", "level", step / 10)
        kept.append(knowledge.snapshot())
    assert [reading.value for reading in kept[-1].history("battery", "level")] == [
        step / 10 for step in range(900, 1000)
    ]
    assert [snapshot.get("battery", "level").value for snapshot in kept] == [80.0, *(step / 10 for step in range(1000))]
    assert [len(snapshot.history("battery", "level")) for snapshot in (kept[0], kept[5], kept[500])] == [1, 6, 100]


@pytest.mark.parametrize(
    ("level", "message"),
    [
        ("full", r"battery\.level: 'full' is not of type float"),
        (101.0, r"battery\.level: 101\.0 lies outside \[0, 100\]"),
    ],
)
def test_a_value_of_another_type_or_out_of_range_is_refused(level: object, message: str) -> None:
    knowledge = store()
    with pytest.raises(NotOfTypeError, match=message):
        knowledge.as_agent("navigation").set("battery", "level", level)
    assert knowledge.get("battery", "level").value == 80.0


def test_future_evidence_is_refused() -> None:
    with pytest.raises(ValueError, match=r"battery\.level cannot be from 1\.0: the present instant is 0\.0"):
        store().as_agent("navigation").set("battery", "level", 1.0, evidence_s=1.0)


def test_undeclared_names_are_reported_with_suggestions() -> None:
    navigation = store().as_agent("navigation")
    with pytest.raises(UnknownNameError, match="no attribute of 'battery' 'levle': did you mean 'level'"):
        navigation.set("battery", "levle", 1.0)
    with pytest.raises(UnknownNameError, match="no type of edges 'robot_pse': did you mean 'robot_pose'"):
        navigation.place("world", "robot_pse", "robot", HERE)
    with pytest.raises(UnknownNameError, match="no type of nodes 'persn': did you mean 'person'"):
        navigation.insert_node("anna", "persn")


def test_an_edge_between_wrong_types_is_refused() -> None:
    navigation = store().as_agent("navigation")
    with pytest.raises(NotOfTypeError, match="go from robot to picking_area, not from robot 'robot' to world 'world'"):
        navigation.insert_edge("robot", "in", "world")
    with pytest.raises(NotOfTypeError, match="go from world to robot, not from world 'world' to battery 'battery'"):
        navigation.place("world", "robot_pose", "battery", HERE)


# Permissions


@pytest.mark.parametrize(
    ("write", "why"),
    [
        (lambda agent: agent.set("battery", "level", 1.0), "'battery.level' may be written by navigation"),
        (
            lambda agent: agent.insert_node("anna", "person"),
            "'nodes of type person' may be written by person_detection",
        ),
        (lambda agent: agent.delete_node("robot"), "'nodes of type robot' may be written by no agent"),
        (
            lambda agent: agent.insert_edge("robot", "close_to", "robot"),
            "'edges of type close_to' may be written by container_detection or person_detection",
        ),
        (lambda agent: agent.delete_edge("robot", "has", "battery"), "'edges of type has' may be written by no agent"),
        (lambda agent: agent.place("world", "robot_pose", "robot", HERE), "may be written by navigation"),
        (
            lambda agent: agent.insert_edge("robot", "wants", "detecting"),
            "'edges of type wants' may be written by no agent",
        ),
        (lambda agent: agent.set("detecting", "result", "ok"), "'detecting.result' may be written by no agent"),
        (lambda agent: agent.request("rotating"), "'a request of rotating' may be written by picking"),
    ],
)
def test_a_write_without_permission_is_refused_and_audited(write: object, why: str) -> None:
    knowledge = store(SimClock(3.0))
    before = knowledge.snapshot()
    assert callable(write)
    with pytest.raises(NotASourceError) as refused:
        write(knowledge.as_agent("picker_page"))
    assert why in str(refused.value)
    (refusal,) = knowledge.refusals()
    assert (refusal.instant_s, refusal.agent, refusal.why) == (3.0, "picker_page", str(refused.value))
    assert knowledge.snapshot().version == before.version


def test_an_agent_has_one_open_handle_at_a_time() -> None:
    knowledge = store()
    navigation = knowledge.as_agent("navigation")
    with pytest.raises(AgentTakenError, match="the agent 'navigation' already has an open handle"):
        knowledge.as_agent("navigation")
    assert [refusal.agent for refusal in knowledge.refusals()] == ["navigation"]
    navigation.close()
    with pytest.raises(PermissionError, match="this handle of the agent 'navigation' is closed"):
        navigation.set("battery", "level", 1.0)
    with knowledge.as_agent("navigation") as again:
        again.set("battery", "level", 2.0)
    forgotten = knowledge.as_agent("navigation")
    del forgotten
    gc.collect()
    assert knowledge.as_agent("navigation").name == "navigation"


def test_an_undeclared_agent_gets_no_handle() -> None:
    with pytest.raises(UnknownNameError, match="no agent 'navigaton': did you mean 'navigation'"):
        store().as_agent("navigaton")
    with pytest.raises(UnknownNameError, match="no agent ''"):
        store().as_agent("")


def test_the_name_of_a_handle_cannot_be_changed() -> None:
    handle = store().as_agent("navigation")
    with pytest.raises(AttributeError):
        handle.name = "picker_page"  # type: ignore[misc]


def test_the_value_of_the_higher_priority_wins_while_it_is_valid() -> None:
    clock = SimClock()
    knowledge = store(clock)
    knowledge.as_agent("container_detection").insert_node("box", "roll_container")
    page, fork = knowledge.as_agent("picker_page"), knowledge.as_agent("fork")
    fork.set("box", "locked", True)
    page.set("box", "locked", False)
    with pytest.raises(OutrankedError, match=r"'fork' cannot overwrite 'box\.locked': 'picker_page' wrote it"):
        fork.set("box", "locked", True)
    assert [refusal.agent for refusal in knowledge.refusals()] == ["fork"]
    clock.sleep(5.0)
    fork.set("box", "locked", True)
    assert knowledge.get("box", "locked").source == "fork"


def test_eight_threads_write_and_every_foreign_write_is_refused_and_audited() -> None:
    owners = [f"agent_{number}" for number in range(8)]
    knowledge = Knowledge(_counters(owners), clock=(clock := WallClock()))
    refused: list[tuple[str, str]] = []
    wrong: list[str] = []

    def run(number: int) -> None:
        agent = knowledge.as_agent(owners[number])
        for step in range(400):
            agent.set(f"node_{number}", "count", step)
            other = owners[(number + 1 + step % 7) % 8]
            try:
                agent.set(other.replace("agent", "node"), "count", -1)
            except NotASourceError:
                refused.append((agent.name, other))
            reading = knowledge.get(f"node_{number}", "count")
            if (reading.value, reading.source) != (step, agent.name):
                wrong.append(agent.name)

    _all(threading.Thread(target=run, args=(number,)) for number in range(8))
    clock.close()
    audited = [(refusal.agent, refusal.why.split("by ")[1].split(",")[0]) for refusal in knowledge.refusals()]
    assert wrong == []
    assert len(refused) == 8 * 400
    assert sorted(audited) == sorted(refused)
    assert [knowledge.get(f"node_{number}", "count").value for number in range(8)] == [399] * 8


# Transactions and snapshots


def test_a_transaction_becomes_visible_as_one() -> None:
    knowledge = store()
    detection = knowledge.as_agent("container_detection")
    before = knowledge.snapshot()
    with detection.transaction() as write:
        write.insert_node("box", "roll_container")
        write.place("world", "container_pose", "box", HERE)
        write.insert_edge("box", "close_to", "robot", distance=2.0)
        assert "box" not in knowledge.snapshot()
    after = knowledge.snapshot()
    assert after.version == before.version + 1
    assert "box" in after
    assert after.has_edge("box", "close_to", "robot")
    assert "box" not in before


@pytest.mark.parametrize("is_caught", [True, False])
def test_a_transaction_with_a_refused_part_has_no_effect(is_caught: bool) -> None:
    knowledge = store()
    detection = knowledge.as_agent("container_detection")

    def run_transaction() -> None:
        with detection.transaction() as write:
            write.insert_node("box", "roll_container")
            try:
                write.set("battery", "level", 0.0)
            except NotASourceError:
                if not is_caught:
                    raise

    with pytest.raises(NotASourceError, match=r"'battery\.level' may be written by navigation"):
        run_transaction()
    assert "box" not in knowledge.snapshot()
    assert len(knowledge.refusals()) == 1


def test_an_interrupted_transaction_has_no_effect() -> None:
    knowledge = store()
    detection = knowledge.as_agent("container_detection")

    def run_transaction() -> None:
        with detection.transaction() as write:
            write.insert_node("box", "roll_container")
            raise TimeoutError

    with pytest.raises(TimeoutError):
        run_transaction()
    assert "box" not in knowledge.snapshot()


def test_a_failed_transaction_leaves_no_readings() -> None:
    knowledge = store()
    navigation = knowledge.as_agent("navigation")

    def run_transaction() -> None:
        with navigation.transaction() as write:
            write.set("battery", "level", 1.0)
            raise TimeoutError

    with pytest.raises(TimeoutError):
        run_transaction()
    navigation.set("battery", "level", 2.0)
    assert [reading.value for reading in knowledge.snapshot().history("battery", "level")] == [80.0, 2.0]


def test_a_transaction_is_applied_again_after_other_writes() -> None:
    knowledge = store()
    detection, people = knowledge.as_agent("container_detection"), knowledge.as_agent("person_detection")
    with detection.transaction() as write:
        write.insert_node("box", "roll_container")
        people.insert_node("anna", "person")
    assert {"box", "anna"} <= {node.name for node in knowledge.snapshot().nodes()}

    def run_transaction() -> None:
        with detection.transaction() as write:
            write.insert_node("crate", "roll_container")
            write.insert_node("case", "roll_container")
            detection.insert_node("crate", "roll_container")

    with pytest.raises(PresentError, match="the node 'crate' already exists"):
        run_transaction()
    assert "case" not in knowledge.snapshot()


def test_snapshots_never_contain_a_part_of_a_transaction() -> None:
    owners = [f"agent_{number}" for number in range(4)]
    knowledge = Knowledge(_counters(owners), clock=(clock := WallClock()))
    halves: list[tuple[object, ...]] = []
    over = threading.Event()

    def write(number: int) -> None:
        agent = knowledge.as_agent(owners[number])
        for step in range(300):
            with agent.transaction() as both:
                both.set(f"node_{number}", "count", step)
                both.set(f"node_{number}", "copy", step)
                both.place("root", "stands", f"node_{number}", Pose.of((step, 0.0, 0.0)), stamp_s=float(step))

    def read() -> None:
        while not over.is_set():
            seen = knowledge.snapshot()
            for number in range(4):
                name = f"node_{number}"
                count_and_copy = (seen.get(name, "count").content, seen.get(name, "copy").content)
                where_m = (
                    seen.transform("root", name, 1e9).pose.translation_m[0] if count_and_copy[0] is not None else None
                )
                if not count_and_copy[0] == count_and_copy[1] == where_m:
                    halves.append((*count_and_copy, where_m))

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    _all(threading.Thread(target=write, args=(number,)) for number in range(4))
    over.set()
    for reader in readers:
        reader.join(60.0)
    clock.close()
    assert halves == []
    assert [knowledge.get(f"node_{number}", "copy").value for number in range(4)] == [299] * 4


def test_a_snapshot_never_changes() -> None:
    clock = SimClock()
    knowledge = store(clock)
    seen = knowledge.snapshot()
    clock.sleep(100.0)
    knowledge.as_agent("navigation").set("battery", "level", 1.0)
    assert (seen.get("battery", "level").value, knowledge.get("battery", "level").value) == (80.0, 1.0)


# Contradictory declarations


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (KnowledgeModel(name="x", node_types=(NodeTypeModel(name="a"),) * 2), "type of nodes 'a' is declared twice"),
        (
            KnowledgeModel(
                name="x",
                node_types=(NodeTypeModel(name="task"),),
                tasks=(TaskModel(name="t", origin="r", by="a", requesters=("b",), results=("ok",)),),
            ),
            "'task' is declared twice, or is reserved for tasks",
        ),
        (
            KnowledgeModel(
                name="x", edge_types=(EdgeTypeModel(name="e", label="near", origins=(), targets=(), motion=Motion()),)
            ),
            "edges of type 'e' must either have a motion and the label RT, or neither",
        ),
        (KnowledgeModel(name="x", nodes=(NodeModel(name="a", type="thing"),)), "no type of nodes 'thing'"),
    ],
)
def test_contradictory_declarations_are_reported(model: KnowledgeModel, message: str) -> None:
    with pytest.raises((ValueError, LookupError), match=message):
        Knowledge(model, clock=SimClock())


def test_every_declared_writer_is_an_agent() -> None:
    knowledge = Knowledge(STORE, clock=SimClock())
    for name in ("navigation", "decision_maker", "fork", "picker_page", "picking"):
        assert knowledge.as_agent(name).name == name


def _counters(owners: list[str]) -> KnowledgeModel:
    """Declare a root, and for every owner a node with two counts and a pose of its own."""
    nodes = [owner.replace("agent", "node") for owner in owners]
    return KnowledgeModel(
        name="counters",
        node_types=(NodeTypeModel(name="root"), NodeTypeModel(name="counter")),
        edge_types=(
            EdgeTypeModel(
                name="stands",
                origins=("root",),
                targets=("counter",),
                sources=by(*owners),
                motion=Motion(history_s=math.inf),
            ),
        ),
        nodes=(
            NodeModel(name="root", type="root"),
            *(
                NodeModel(
                    name=node,
                    type="counter",
                    attributes=tuple(
                        AttributeModel(name=name, type=integer(), sources=by(owner)) for name in ("count", "copy")
                    ),
                )
                for node, owner in zip(nodes, owners, strict=True)
            ),
        ),
    )


def _all(threads: Iterable[threading.Thread]) -> None:
    """Run threads until they end."""
    running = list(threads)
    for thread in running:
        thread.start()
    for thread in running:
        thread.join(120.0)
        assert not thread.is_alive()
