"""A graph of ours that begins with one of others: what it holds, what it keeps beside, and what it tells afterwards."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation

from codra_dsl.bridges.networkx import from_networkx, to_networkx
from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.exchange import (
    DsrEdge,
    DsrGraph,
    DsrNode,
    DsrValue,
    Start,
    begun_with,
    dsr_of,
    dsr_text,
    parse_dsr,
    read_dsr,
    write_dsr,
)
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.knowledge.declarations import (
    AttributeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeTypeModel,
    by,
)
from codra_dsl.runtime.model import integer, real
from codra_dsl.runtime.replay import replay
from tests.runtime.exchange.test_dsr_json import graphs, parts
from tests.runtime.journals import read as read_journal
from tests.runtime.knowledge.manager import KNOWLEDGE, MODEL, manager
from tests.runtime.knowledge.store import STORE

EVERY_TYPE = Path(__file__).parents[2] / "data/dsr_every_type.json"

ROBOCOMP = KnowledgeModel(
    name="robocomp",
    node_types=(
        *(NodeTypeModel(name=name) for name in ("world", "robot")),
        NodeTypeModel(
            name="battery",
            attributes=(AttributeModel(name="battery_load", type=real(0, 100), sources=by("base")),),
        ),
        NodeTypeModel(
            name="roll_container",
            sources=by("base"),
            attributes=(AttributeModel(name="mass", type=integer(0, 500), sources=by("base")),),
        ),
    ),
    edge_types=(
        EdgeTypeModel(name="has", origins=("robot",), targets=("battery",), sources=by("base")),
        EdgeTypeModel(name="pose", origins=("world",), targets=("robot",), sources=by("base"), motion=Motion()),
        EdgeTypeModel(
            name="stands", origins=("world", "robot"), targets=("roll_container",), sources=by("base"), motion=Motion()
        ),
        EdgeTypeModel(
            name="close_to",
            origins=("robot",),
            targets=("roll_container",),
            sources=by("base"),
            attributes=(AttributeModel(name="distance_to_robot", type=real(0, 10)),),
        ),
    ),
)


def number(code: int, value: object) -> DsrValue:
    return DsrValue(code=code, value=value)


def rt(origin: int, target: int, x_mm: float = 0.0, yaw_rad: float = 0.0, **more: DsrValue) -> DsrEdge:
    attributes = {
        "rt_translation": number(3, (x_mm, 0.0, 0.0)),
        "rt_rotation_euler_xyz": number(3, (0.0, 0.0, yaw_rad)),
    }
    return DsrEdge(origin=origin, label="RT", target=target, attributes=attributes | more)


WORLD, ROBOT = DsrNode(number=1, name="world", type="world"), DsrNode(number=2, name="robot", type="robot")
BATTERY = DsrNode(
    number=3,
    name="battery",
    type="battery",
    attributes={"battery_load": number(2, 80.0), "colour": number(0, "red")},
)
CONTAINER = DsrNode(number=7, name="box", type="roll_container", attributes={"mass": number(8, 30.0)})
DRONE = DsrNode(number=9, name="drone", type="drone", extra={"pilot": "nobody"})
SHOP = DsrGraph(
    nodes=(WORLD, ROBOT, BATTERY, CONTAINER, DRONE),
    edges=(
        rt(1, 2, 2000.0, math.pi / 2),
        rt(1, 7, 3000.0),
        rt(1, 9),
        DsrEdge(origin=2, label="has", target=3, extra={"note": 1}),
        DsrEdge(origin=2, label="likes", target=3),
        DsrEdge(origin=2, label="close_to", target=7, attributes={"distance_to_robot": number(2, 0.5)}),
    ),
    extra={"written_by": "hand"},
)


def begun(document: DsrGraph = SHOP, model: KnowledgeModel = ROBOCOMP) -> tuple[Start, Knowledge]:
    start = begun_with(model, document)
    return start, Knowledge(start.model, clock=SimClock())


def test_what_is_declared_is_in_the_graph_and_the_rest_is_told() -> None:
    start, knowledge = begun()
    seen = knowledge.snapshot()
    assert [node.name for node in seen.nodes()] == ["world", "robot", "battery", "box"]
    assert (seen.get("battery", "battery_load").value, seen.get("battery", "battery_load").source) == (80.0, "")
    assert seen.get_of_edge("robot", "close_to", "box", "distance_to_robot").value == 0.5
    np.testing.assert_allclose(seen.transform("robot", "box").pose.translation_m, (0.0, -1.0, 0.0), atol=1e-12)
    assert [str(each) for each in start.foreign] == [
        "battery.colour: no such attribute is declared",
        "box.mass: 30.0 is no int",
        "node 'drone': the spec has no type of nodes 'drone'",
        "edge world -RT-> drone: one of its nodes is not held",
        "edge robot -likes-> battery: no edges with this label are declared",
    ]


def test_what_has_not_changed_is_told_as_it_was_read_whether_it_is_declared_or_not() -> None:
    start, knowledge = begun()
    assert dsr_of(knowledge, start) == SHOP


def test_the_file_with_every_type_goes_through_a_graph_with_nothing_lost() -> None:
    document = read_dsr(EVERY_TYPE)
    for model in (ROBOCOMP, replace(STORE, nodes=(), edges=(), tasks=(), agents=())):
        start, knowledge = begun(document, model)
        assert len(knowledge.snapshot()) >= 3
        told = dsr_of(knowledge, start)
        assert json.loads(dsr_text(told)) == json.loads(EVERY_TYPE.read_bytes())


def test_the_newest_pose_of_a_ring_counts_wherever_its_head_points() -> None:
    _, knowledge = begun(read_dsr(EVERY_TYPE))
    pose = knowledge.transform("world", "robot").pose
    np.testing.assert_allclose(pose.translation_m, (1.4, 0.2505, 0.0), atol=1e-12)
    assert pose.angle_rad(Pose.about((0.0, 0.0, 1.0), 1.5707963705062866)) == pytest.approx(0.0, abs=1e-9)


@given(graph=graphs())
def test_any_graph_goes_through_one_of_ours_that_declares_nothing(graph: DsrGraph) -> None:
    start, knowledge = begun(graph, KnowledgeModel(name="empty"))
    assert parts(dsr_of(knowledge, start)) == parts(graph)
    assert len({each.subject for each in start.foreign}) >= len(graph.nodes)


def test_what_agents_wrote_is_told_with_the_types_that_were_there() -> None:
    start, knowledge = begun()
    with knowledge.as_agent("base") as base:
        base.set("battery", "battery_load", 55.5)
        base.insert_edge("robot", "close_to", "box", distance_to_robot=1)
        base.place("robot", "stands", "box", Pose.about((1.0, 0.0, 0.0), 0.3, (0.1, 0.2, 0.3)))
        base.insert_node("cage", "roll_container", mass=12)
        base.place("robot", "stands", "cage", Pose())
    told = dsr_of(knowledge, start)
    assert told.node("battery").attributes == {"battery_load": number(2, 55.5), "colour": number(0, "red")}
    cage = told.node("cage")
    assert cage.attributes == {"mass": number(1, 12), "parent": number(7, 2), "level": number(1, 2)}
    assert told.node("box").attributes == {"mass": number(8, 30.0), "parent": number(7, 2), "level": number(1, 2)}
    edges = {edge.key: edge.attributes for edge in told.edges}
    assert (1, "RT", 7) not in edges
    assert edges[2, "close_to", 7] == {"distance_to_robot": number(2, 1.0)}
    np.testing.assert_allclose(numbers(edges[2, "RT", 7]["rt_translation"]), (100.0, 200.0, 300.0))
    np.testing.assert_allclose(numbers(edges[2, "RT", 7]["rt_rotation_euler_xyz"]), (0.3, 0.0, 0.0), atol=1e-12)
    again, same = begun(parse_dsr(dsr_text(told)))
    assert same.transform("world", "box").pose.distance_m(knowledge.transform("world", "box").pose) < 1e-12
    assert dsr_of(same, again) == parse_dsr(dsr_text(told))


def numbers(value: DsrValue) -> Any:
    return value.value


def test_what_was_deleted_is_not_told_nor_what_hung_on_it() -> None:
    document = replace(SHOP, edges=(*SHOP.edges, DsrEdge(origin=9, label="sees", target=7)))
    start, knowledge = begun(document)
    base = knowledge.as_agent("base")
    base.delete_node("box")
    base.delete_edge("robot", "has", "battery")
    told = dsr_of(knowledge, start)
    assert [node.name for node in told.nodes] == ["world", "robot", "battery", "drone"]
    assert [edge.key for edge in told.edges] == [(1, "RT", 2), (1, "RT", 9), (2, "likes", 3)]


def test_a_graph_that_began_with_nothing_is_told_with_numbers_of_its_own() -> None:
    knowledge = Knowledge(STORE, clock=SimClock())
    knowledge.as_agent("decision_maker").request("navigating", goal_x=2.5, goal_y=1.0)
    told = dsr_of(knowledge, unit_m=1.0)
    assert [node.number for node in told.nodes] == list(range(1, len(told.nodes) + 1))
    (wants,) = [edge for edge in told.edges if edge.label == "wants"]
    task = next(node for node in told.nodes if node.number == wants.target)
    assert (task.name, task.type, task.attributes["goal_x"]) == ("navigating", "task", number(8, 2.5))
    mount = next(edge for edge in told.edges if edge.label == "RT")
    np.testing.assert_allclose(numbers(mount.attributes["rt_translation"]), (0.2, 0.0, 1.0))
    start = begun_with(replace(STORE, nodes=(), edges=()), told, unit_m=1.0)
    subjects = {each.subject for each in start.foreign}
    assert subjects == {*(f"node {task.name!r}" for task in STORE.tasks), "edge robot -wants-> navigating"}
    assert parts(dsr_of(Knowledge(start.model, clock=SimClock()), start)) == parts(told)


def test_a_step_of_a_task_that_was_read_is_not_told_any_more_when_the_task_is_asked_for() -> None:
    knowledge = Knowledge(STORE, clock=SimClock())
    knowledge.as_agent("decision_maker").request("navigating")
    start, again = begun(dsr_of(knowledge), STORE)
    assert [edge.label for edge in dsr_of(again, start).edges if edge.label in {"wants", "aborted"}] == ["wants"]
    decider = again.as_agent("decision_maker")
    decider.abort(decider.request("navigating"))
    assert [edge.label for edge in dsr_of(again, start).edges if edge.label in {"wants", "aborted"}] == ["aborted"]


TWO_WAYS = replace(
    ROBOCOMP,
    edge_types=(
        EdgeTypeModel(name="held", origins=("robot",), targets=("roll_container",), motion=Motion()),
        EdgeTypeModel(
            name="pushed", origins=("robot",), targets=("roll_container",), sources=by("base"), motion=Motion()
        ),
    ),
)


def test_an_edge_of_which_the_label_leaves_a_choice_tells_its_type() -> None:
    document = DsrGraph(nodes=(ROBOT, CONTAINER), edges=(rt(2, 7),))
    start, knowledge = begun(document, TWO_WAYS)
    assert str(start.foreign[-1]) == "edge robot -RT-> box: it may be a held or a pushed: say which as 'codra_type'"
    knowledge.as_agent("base").place("robot", "pushed", "box", Pose())
    told = dsr_of(knowledge, start)
    assert told.edges[0].attributes["codra_type"] == number(0, "pushed")
    start, again = begun(told, TWO_WAYS)
    assert again.snapshot().has_edge("robot", "pushed", "box")
    assert dsr_of(again, start) == told


@pytest.mark.parametrize(
    ("edges", "why"),
    [
        ((rt(1, 2), rt(1, 7), rt(2, 7)), "edge robot -RT-> box: 'box' stands in 'world' already"),
        ((rt(2, 1),), "edge robot -RT-> world: edges with this label do not go from robot to world"),
        (
            (DsrEdge(origin=1, label="RT", target=2, attributes={"rt_translation": number(3, (1.0, 2.0))}),),
            "edge world -RT-> robot: it has no pose: three numbers each as rt_translation and rt_rotation_euler_xyz",
        ),
        (
            (rt(1, 2, rt_timestamps=number(9, (1, 2))),),
            "edge world -RT-> robot: it has no pose: three numbers each as rt_translation and rt_rotation_euler_xyz",
        ),
    ],
)
def test_rt_edges_that_are_no_tree_are_kept_and_told(edges: tuple[DsrEdge, ...], why: str) -> None:
    document = DsrGraph(nodes=(WORLD, ROBOT, CONTAINER), edges=edges)
    start, knowledge = begun(document)
    assert str(start.foreign[-1]) == why
    assert dsr_of(knowledge, start) == document


def test_frames_that_stand_in_themselves_are_kept_and_told() -> None:
    anything = EdgeTypeModel(name="on", origins=("robot",), targets=("robot",), motion=Motion())
    model = KnowledgeModel(name="ring", node_types=(NodeTypeModel(name="robot"),), edge_types=(anything,))
    nodes = tuple(DsrNode(number=at, name=f"r{at}", type="robot") for at in range(3))
    document = DsrGraph(nodes=nodes, edges=(rt(0, 1), rt(1, 2), rt(2, 0), rt(1, 1)))
    start, knowledge = begun(document, model)
    assert [str(each) for each in start.foreign] == [
        "edge r2 -RT-> r0: 'r0' would stand in itself",
        "edge r1 -RT-> r1: 'r1' would stand in itself",
    ]
    assert dsr_of(knowledge, start) == document


angles = some.floats(-math.pi, math.pi)


@given(turned=some.tuples(angles, angles | some.sampled_from([math.pi / 2, -math.pi / 2]), angles))
def test_euler_angles_are_those_of_robocomp_and_give_the_same_turn_back(turned: tuple[float, float, float]) -> None:
    edge = DsrEdge(
        origin=1,
        label="RT",
        target=2,
        attributes={
            "rt_translation": number(3, (1.0, 2.0, 3.0)),
            "rt_rotation_euler_xyz": number(3, turned),
        },
    )
    _, knowledge = begun(DsrGraph(nodes=(WORLD, ROBOT), edges=(edge,)))
    expected = Rotation.from_euler("XYZ", turned).as_matrix()
    matrix = np.array(knowledge.transform("world", "robot").pose.matrix())[:3, :3]
    np.testing.assert_allclose(matrix, expected, atol=1e-9)
    told = next(each for each in dsr_of(knowledge).edges if each.label == "RT")
    back = Rotation.from_euler("XYZ", numbers(told.attributes["rt_rotation_euler_xyz"])).as_matrix()
    np.testing.assert_allclose(back, expected, atol=1e-9)


def test_a_graph_of_many_nodes_is_read_as_it_was_told_and_a_context_manager_begins_with_it(tmp_path: Path) -> None:
    with manager(SimClock()) as codra:
        codra.agent("navigation").set("charge", 55.5)
        detection = codra.agent("container_detection").graph
        for number in range(12):
            detection.insert_node(f"box_{number}", "roll_container")
            detection.place("world", "container_pose", f"box_{number}", Pose.of((number, 0.0, 0.0)))
        told = dsr_of(codra.knowledge)
    write_dsr(tmp_path / "shop.json", told)
    read = read_dsr(tmp_path / "shop.json")
    assert read == told
    assert from_networkx(to_networkx(told)) == told
    assert read != replace(told, nodes=told.nodes[1:])

    start = begun_with(KNOWLEDGE, read)
    journal = tmp_path / "run.mcap"
    with ContextManager[str, str](
        MODEL, clock=SimClock(), resources={}, record=Journal(journal), knowledge=start.model
    ) as codra:
        assert codra.get("charge").value == 55.5
        assert codra.knowledge.snapshot().distance_m("world", "box_11") == 11.0
        codra.agent("navigation").set("charge", 50.0)
    head, events = read_journal(journal)
    assert replay(head, events, MODEL, ContextManager[str, str], None, start.model).difference is None
