"""A copy of a graph that another program makes from messages equals the graph, whatever happens to the graph."""

from __future__ import annotations

from contextlib import suppress
from random import Random
from typing import Any

import pytest

from codra_dsl.runtime import ContextManager, SimClock
from codra_dsl.runtime.geometry import FrameError, Pose
from codra_dsl.runtime.journal.encoding import json_text, parse_json
from codra_dsl.runtime.knowledge import Knowledge, Snapshot, path
from codra_dsl.runtime.knowledge.graph_copy import DivergedError, GraphCopy
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.plain_graph import plain_change, plain_state
from codra_dsl.runtime.knowledge.shared_graph import GraphChange, SharedGraph
from tests.runtime.knowledge.manager import KNOWLEDGE, MODEL, manager

NODES = ("anna", "ben", "box", "robot")
ERRORS = (LookupError, ValueError, PermissionError, RuntimeError)


class ReadableCopy(GraphCopy):
    """A copy that is only read."""

    def as_agent(self, name: str) -> Any:
        raise NotImplementedError(name)

    _apply_verb = _transaction = _check_rule = record_rule_state = _release_handle = as_agent  # type: ignore[assignment]


def over_the_wire(plain: dict[str, Any]) -> dict[str, Any]:
    return dict(parse_json(json_text(plain)))


def copy_of(knowledge: Knowledge, clock: SimClock) -> GraphCopy:
    """Return a copy that follows the graph; its changes are sent before its state, as a slow manager would do."""
    copy = ReadableCopy(GraphSchema(KNOWLEDGE, MODEL.variables), clock=clock, check_current=lambda: None)
    state, _ = knowledge.follow_changes(lambda change: copy.receive(over_the_wire(plain_change(change))))
    copy.join(over_the_wire(plain_state(state)))
    return copy


def facts(snapshot: Snapshot) -> dict[str, object]:
    """Return everything that the graph says, apart from the objects that say it."""
    elements = [*snapshot.nodes(), *snapshot.edges()]
    names = {*NODES, *(node.name for node in snapshot.nodes())}
    return {
        "version": snapshot.version,
        "elements": [element._replace(histories={}) for element in elements],
        "attributes": [dict(element.attributes) for element in elements],
        "histories": {
            (node.name, name): snapshot.history(node.name, name) for node in snapshot.nodes() for name in node.histories
        },
        "tasks": [snapshot.handover(task.name) for task in KNOWLEDGE.tasks],
        "poses": {name: _pose(snapshot, name, ago_s) for name in names for ago_s in (0.0, 0.7, 30.0)},
        "matches": snapshot.match(path("robot", "wants", "lifting")),
    }


def _pose(snapshot: Snapshot, name: str, ago_s: float) -> object:
    try:
        return snapshot.transform("world", name, snapshot.instant_s - ago_s)
    except FrameError as error:
        return str(error)


class Agents:
    """Programs that do random things with a graph, many of which are refused."""

    def __init__(self, codra: ContextManager[str, str], clock: SimClock, random: Random) -> None:
        self.codra, self.clock, self.random = codra, clock, random
        names = ("navigation", "fork", "picking", "person_detection", "container_detection", "picker_page")
        self.handles = {name: codra.agent(name).graph for name in names}

    def act(self) -> None:
        random, handle = self.random, self.handles[self.random.choice(sorted(self.handles))]
        past_s = self.clock.now_s() - random.choice([0.0, 0.0, 1.0, 3.0])
        node, other = random.choice(NODES), random.choice(NODES)
        handover = self.codra.knowledge.snapshot().handover("lifting")
        pose = Pose.of((random.uniform(-5, 5), random.uniform(-5, 5), 0.0))
        match random.randrange(16):
            case 0:
                handle.insert_node(node, "person", height=random.choice([1.5, None, 2.5]))
            case 1:
                handle.insert_node(node, "roll_container")
            case 2:
                handle.delete_node(node)
            case 3:
                handle.set(node, "height", random.choice([1.0, None, 9.0]), evidence_s=past_s)
            case 4:
                handle.set("box", "locked", random.choice([True, False, None]))
            case 5:
                handle.insert_edge(node, "close_to", "robot", distance=random.choice([float("inf"), 2.0, None]))
            case 6:
                handle.delete_edge(node, random.choice(["close_to", "container_pose", "carried"]), other)
            case 7 | 8:
                handle.place("world", "robot_pose", "robot", pose, stamp_s=past_s)
            case 9:
                handle.place("world", "container_pose", node, pose, stamp_s=past_s)
            case 10:
                handle.place("robot", "carried", node, pose)
            case 11:
                handle.set("battery", "charge", random.uniform(0, 100), evidence_s=past_s)
            case 12:
                self.codra.set("light", random.choice([True, False]))
            case 13:
                value = random.choice([True, None])
                self.codra.override("docked", value, for_s=random.choice([0.5, 5.0]), reason="test")
            case 14:
                self.handles["picking"].request("lifting")
            case _:
                self._work(handover)

    def _work(self, handover: Any) -> None:
        fork, choice = self.handles["fork"], self.random.randrange(4)
        if choice == 0:
            self.codra.knowledge.abandon_tasks("fork")
        elif choice == 1:
            self.handles["picking"].abort(handover.request)
        elif choice == 2:
            fork.acknowledge(handover.request)
        else:
            with fork.transaction() as change:
                change.finish(handover.request, "ok")
                change.set("robot", "docked", value=True)


@pytest.mark.parametrize("seed", range(12))
def test_a_copy_equals_its_graph_after_any_changes(seed: int) -> None:
    clock, random = SimClock(), Random(seed)
    with manager(clock) as codra:
        agents = Agents(codra, clock, random)
        copies: list[GraphCopy] = []
        for step in range(300):
            if step % 100 == 0:
                copies.append(copy_of(codra.knowledge, clock))
            with suppress(*ERRORS):
                agents.act()
            if random.random() < 0.3:
                clock.sleep(random.choice([0.2, 0.5, 2.0]))
        original = facts(codra.knowledge.snapshot())

        assert len(original["elements"]) > 18  # type: ignore[arg-type]
        for copy in copies:
            assert facts(copy.snapshot()) == original


def test_the_past_of_a_copy_begins_when_it_joins() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        clock.sleep(1.0)
        codra.set("light", value=True)
        copy = copy_of(codra.knowledge, clock)
        clock.sleep(1.0)
        codra.set("light", value=False)

        assert copy.at(1.5).get("context", "light").value is True
        assert copy.get("context", "light").value is False
        with pytest.raises(ValueError, match="the graph is kept only from"):
            copy.at(0.5)


def test_a_subscription_to_a_copy_is_called_for_changes_of_the_graph_and_for_values_that_expire() -> None:
    clock, levels = SimClock(), list[object]()
    with manager(clock) as codra:
        copy: SharedGraph = copy_of(codra.knowledge, clock)
        copy.follow("battery", "charge", lambda reading: levels.append(reading.content))
        clock.sleep(0.0)
        codra.agent("navigation").graph.set("battery", "charge", 50.0)
        clock.sleep(61.0)

    assert levels == [None, 50.0, None]


def test_changes_that_arrive_before_the_state_are_applied_once() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        copy = ReadableCopy(GraphSchema(KNOWLEDGE, MODEL.variables), clock=clock, check_current=lambda: None)
        codra.knowledge.follow_changes(lambda change: copy.receive(over_the_wire(plain_change(change))))
        codra.set("light", value=True)
        state, _ = codra.knowledge.follow_changes(lambda _: None)
        codra.set("light", value=False)
        copy.join(over_the_wire(plain_state(state)))
        codra.set("light", value=True)

        assert facts(copy.snapshot()) == facts(codra.knowledge.snapshot())


def test_a_copy_forgets_the_poses_of_a_deleted_node_when_the_graph_does() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        detection = codra.agent("container_detection").graph
        for name in ("box", "bin"):
            detection.insert_node(name, "roll_container")
            detection.place("world", "container_pose", name, Pose.of((1.0, 0.0, 0.0)))
        clock.sleep(1.0)
        detection.delete_node("box")
        copy = copy_of(codra.knowledge, clock)
        assert copy.transform("world", "box", 0.5) == codra.knowledge.transform("world", "box", 0.5)
        clock.sleep(20.0)
        detection.delete_node("bin")

        for knowledge in (codra.knowledge, copy):
            with pytest.raises(FrameError, match="there is no frame 'box'"):
                knowledge.transform("world", "box", 0.5)


def test_a_change_that_does_not_follow_the_state_of_a_copy_is_refused() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        copy = copy_of(codra.knowledge, clock)
        version = copy.snapshot().version
        late_change = GraphChange(version + 2, 0.0, "navigation")
        with pytest.raises(DivergedError, match="differs from the manager's graph"):
            copy.receive(over_the_wire(plain_change(late_change)))
        for wrong in ({}, {"version": version + 1}, {**plain_change(late_change), "operations": [["fly", "robot"]]}):
            with pytest.raises(DivergedError):
                copy.receive(wrong)
        with pytest.raises(DivergedError, match="does not fit to the declarations"):
            copy.join({"nodes": [["x", "unicorn", 0, "", 0.0, [["horn", [], None]]]], "edges": []})


def test_a_lost_executor_aborts_only_the_tasks_that_it_has_begun() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        fork, picking = codra.agent("fork").graph, codra.agent("picking").graph
        fork.acknowledge(picking.request("lifting"))
        waiting = picking.request("detecting")
        codra.knowledge.abandon_tasks("fork")
        codra.knowledge.abandon_tasks("container_detection")
        snapshot = codra.knowledge.snapshot()

        assert (snapshot.handover("lifting").stage, snapshot.handover("lifting").reason) == ("aborted", "executor_lost")
        assert snapshot.get("lifting", "reason").value == "executor_lost"
        assert snapshot.handover("detecting").request == waiting
        assert snapshot.handover("detecting").stage == "wants"
