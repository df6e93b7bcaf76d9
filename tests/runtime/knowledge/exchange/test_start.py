"""Import of DSR graphs into knowledge graphs: the content, the parts that are kept beside it, and the export."""

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

from codra_dsl.integrations.networkx import from_networkx, to_networkx
from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.knowledge.declarations import AttributeModel, EdgeTypeModel, KnowledgeModel, NodeTypeModel, by
from codra_dsl.runtime.knowledge.exchange import (
    DsrEdge,
    DsrGraph,
    DsrImport,
    DsrNode,
    DsrValue,
    dsr_text,
    export_dsr,
    import_dsr,
    parse_dsr,
    read_dsr,
    write_dsr,
)
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.model import integer, real
from tests.runtime.journal.journals import read as read_journal
from tests.runtime.knowledge.exchange.test_dsr_json import graphs, parts
from tests.runtime.knowledge.manager import KNOWLEDGE, MODEL, manager
from tests.runtime.knowledge.store import STORE

EVERY_TYPE = Path(__file__).parents[3] / "data/dsr_every_type.json"

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


def import_graph(document: DsrGraph = SHOP, model: KnowledgeModel = ROBOCOMP) -> tuple[DsrImport, Knowledge]:
    start = import_dsr(model, document)
    return start, Knowledge(start.model, clock=SimClock())


def test_declared_parts_are_imported_and_the_others_are_reported() -> None:
    start, knowledge = import_graph()
    seen = knowledge.snapshot()
    assert [node.name for node in seen.nodes()] == ["world", "robot", "battery", "box"]
    assert (seen.get("battery", "battery_load").value, seen.get("battery", "battery_load").source) == (80.0, "")
    assert seen.get_of_edge("robot", "close_to", "box", "distance_to_robot").value == 0.5
    np.testing.assert_allclose(seen.transform("robot", "box").pose.translation_m, (0.0, -1.0, 0.0), atol=1e-12)
    assert [str(part) for part in start.skipped_parts] == [
        "battery.colour: no such attribute is declared",
        "box.mass: 30.0 is not of type int",
        "node 'drone': the spec has no type of nodes 'drone'",
        "edge world -RT-> drone: one of its nodes is not in the graph",
        "edge robot -likes-> battery: no edges with this label are declared",
    ]


def test_unchanged_parts_are_exported_as_they_were_read_declared_or_not() -> None:
    start, knowledge = import_graph()
    assert export_dsr(knowledge, start) == SHOP


def test_the_file_with_every_type_is_imported_and_exported_without_loss() -> None:
    document = read_dsr(EVERY_TYPE)
    for model in (ROBOCOMP, replace(STORE, nodes=(), edges=(), tasks=(), agents=())):
        start, knowledge = import_graph(document, model)
        assert len(knowledge.snapshot()) >= 3
        exported_graph = export_dsr(knowledge, start)
        assert json.loads(dsr_text(exported_graph)) == json.loads(EVERY_TYPE.read_bytes())


def test_the_newest_pose_of_a_ring_counts_regardless_of_its_head() -> None:
    _, knowledge = import_graph(read_dsr(EVERY_TYPE))
    pose = knowledge.transform("world", "robot").pose
    np.testing.assert_allclose(pose.translation_m, (1.4, 0.2505, 0.0), atol=1e-12)
    assert pose.angle_rad(Pose.about((0.0, 0.0, 1.0), 1.5707963705062866)) == pytest.approx(0.0, abs=1e-9)


@given(graph=graphs())
def test_any_graph_is_imported_and_exported_without_declarations(graph: DsrGraph) -> None:
    start, knowledge = import_graph(graph, KnowledgeModel(name="empty"))
    assert parts(export_dsr(knowledge, start)) == parts(graph)
    assert len({part.subject for part in start.skipped_parts}) >= len(graph.nodes)


def test_values_of_agents_are_exported_with_the_imported_types() -> None:
    start, knowledge = import_graph()
    with knowledge.as_agent("base") as base:
        base.set("battery", "battery_load", 55.5)
        base.insert_edge("robot", "close_to", "box", distance_to_robot=1)
        base.place("robot", "stands", "box", Pose.about((1.0, 0.0, 0.0), 0.3, (0.1, 0.2, 0.3)))
        base.insert_node("cage", "roll_container", mass=12)
        base.place("robot", "stands", "cage", Pose())
    exported_graph = export_dsr(knowledge, start)
    assert exported_graph.node("battery").attributes == {"battery_load": number(2, 55.5), "colour": number(0, "red")}
    cage = exported_graph.node("cage")
    assert cage.attributes == {"mass": number(1, 12), "parent": number(7, 2), "level": number(1, 2)}
    assert exported_graph.node("box").attributes == {
        "mass": number(8, 30.0),
        "parent": number(7, 2),
        "level": number(1, 2),
    }
    edges = {edge.key: edge.attributes for edge in exported_graph.edges}
    assert (1, "RT", 7) not in edges
    assert edges[2, "close_to", 7] == {"distance_to_robot": number(2, 1.0)}
    np.testing.assert_allclose(numbers(edges[2, "RT", 7]["rt_translation"]), (100.0, 200.0, 300.0))
    np.testing.assert_allclose(numbers(edges[2, "RT", 7]["rt_rotation_euler_xyz"]), (0.3, 0.0, 0.0), atol=1e-12)
    again, same = import_graph(parse_dsr(dsr_text(exported_graph)))
    assert same.transform("world", "box").pose.distance_m(knowledge.transform("world", "box").pose) < 1e-12
    assert export_dsr(same, again) == parse_dsr(dsr_text(exported_graph))


def numbers(value: DsrValue) -> Any:
    return value.value


def test_deleted_nodes_and_their_edges_are_not_exported() -> None:
    document = replace(SHOP, edges=(*SHOP.edges, DsrEdge(origin=9, label="sees", target=7)))
    start, knowledge = import_graph(document)
    base = knowledge.as_agent("base")
    base.delete_node("box")
    base.delete_edge("robot", "has", "battery")
    exported_graph = export_dsr(knowledge, start)
    assert [node.name for node in exported_graph.nodes] == ["world", "robot", "battery", "drone"]
    assert [edge.key for edge in exported_graph.edges] == [(1, "RT", 2), (1, "RT", 9), (2, "likes", 3)]


def test_a_graph_without_an_import_is_exported_with_new_numbers() -> None:
    knowledge = Knowledge(STORE, clock=SimClock())
    knowledge.as_agent("decision_maker").request("navigating", goal_x=2.5, goal_y=1.0)
    exported_graph = export_dsr(knowledge, unit_m=1.0)
    assert [node.number for node in exported_graph.nodes] == list(range(1, len(exported_graph.nodes) + 1))
    (wants,) = [edge for edge in exported_graph.edges if edge.label == "wants"]
    task = next(node for node in exported_graph.nodes if node.number == wants.target)
    assert (task.name, task.type, task.attributes["goal_x"]) == ("navigating", "task", number(8, 2.5))
    mount = next(edge for edge in exported_graph.edges if edge.label == "RT")
    np.testing.assert_allclose(numbers(mount.attributes["rt_translation"]), (0.2, 0.0, 1.0))
    start = import_dsr(replace(STORE, nodes=(), edges=()), exported_graph, unit_m=1.0)
    subjects = {part.subject for part in start.skipped_parts}
    assert subjects == {*(f"node {task.name!r}" for task in STORE.tasks), "edge robot -wants-> navigating"}
    assert parts(export_dsr(Knowledge(start.model, clock=SimClock()), start)) == parts(exported_graph)


def test_an_imported_step_of_a_task_is_not_exported_once_the_task_is_requested() -> None:
    knowledge = Knowledge(STORE, clock=SimClock())
    knowledge.as_agent("decision_maker").request("navigating")
    start, again = import_graph(export_dsr(knowledge), STORE)
    assert [edge.label for edge in export_dsr(again, start).edges if edge.label in {"wants", "aborted"}] == ["wants"]
    decider = again.as_agent("decision_maker")
    decider.abort(decider.request("navigating"))
    assert [edge.label for edge in export_dsr(again, start).edges if edge.label in {"wants", "aborted"}] == ["aborted"]


TWO_WAYS = replace(
    ROBOCOMP,
    edge_types=(
        EdgeTypeModel(name="held", origins=("robot",), targets=("roll_container",), motion=Motion()),
        EdgeTypeModel(
            name="pushed", origins=("robot",), targets=("roll_container",), sources=by("base"), motion=Motion()
        ),
    ),
)


def test_an_edge_whose_label_leaves_a_choice_states_its_type() -> None:
    document = DsrGraph(nodes=(ROBOT, CONTAINER), edges=(rt(2, 7),))
    start, knowledge = import_graph(document, TWO_WAYS)
    assert str(start.skipped_parts[-1]) == (
        "edge robot -RT-> box: its type may be 'held' or 'pushed': state the type in the attribute 'codra_type'"
    )
    knowledge.as_agent("base").place("robot", "pushed", "box", Pose())
    exported_graph = export_dsr(knowledge, start)
    assert exported_graph.edges[0].attributes["codra_type"] == number(0, "pushed")
    start, again = import_graph(exported_graph, TWO_WAYS)
    assert again.snapshot().has_edge("robot", "pushed", "box")
    assert export_dsr(again, start) == exported_graph


@pytest.mark.parametrize(
    ("edges", "why"),
    [
        ((rt(1, 2), rt(1, 7), rt(2, 7)), "edge robot -RT-> box: 'box' already has the parent 'world'"),
        ((rt(2, 1),), "edge robot -RT-> world: edges with this label do not go from robot to world"),
        (
            (DsrEdge(origin=1, label="RT", target=2, attributes={"rt_translation": number(3, (1.0, 2.0))}),),
            "edge world -RT-> robot: it has no pose: rt_translation and rt_rotation_euler_xyz "
            "must have three finite numbers each, and rt_timestamps only numbers",
        ),
        (
            (rt(1, 2, rt_timestamps=number(9, (1, 2))),),
            "edge world -RT-> robot: it has no pose: rt_translation and rt_rotation_euler_xyz "
            "must have three finite numbers each, and rt_timestamps only numbers",
        ),
        (
            (rt(1, 2, rt_timestamps=number(3, (1.0, None))),),
            "edge world -RT-> robot: it has no pose: rt_translation and rt_rotation_euler_xyz "
            "must have three finite numbers each, and rt_timestamps only numbers",
        ),
        (
            (rt(1, 2, rt_timestamps=number(3, (math.nan, 1.0))),),
            "edge world -RT-> robot: it has no pose: rt_translation and rt_rotation_euler_xyz "
            "must have three finite numbers each, and rt_timestamps only numbers",
        ),
    ],
)
def test_rt_edges_that_do_not_form_a_tree_are_kept_and_exported(edges: tuple[DsrEdge, ...], why: str) -> None:
    document = DsrGraph(nodes=(WORLD, ROBOT, CONTAINER), edges=edges)
    start, knowledge = import_graph(document)
    assert str(start.skipped_parts[-1]) == why
    assert export_dsr(knowledge, start) == document


def test_frames_in_a_cycle_are_kept_and_exported() -> None:
    anything = EdgeTypeModel(name="on", origins=("robot",), targets=("robot",), motion=Motion())
    model = KnowledgeModel(name="ring", node_types=(NodeTypeModel(name="robot"),), edge_types=(anything,))
    nodes = tuple(DsrNode(number=at, name=f"r{at}", type="robot") for at in range(3))
    document = DsrGraph(nodes=nodes, edges=(rt(0, 1), rt(1, 2), rt(2, 0), rt(1, 1)))
    start, knowledge = import_graph(document, model)
    assert [str(part) for part in start.skipped_parts] == [
        "edge r2 -RT-> r0: 'r0' would be its own ancestor",
        "edge r1 -RT-> r1: 'r1' would be its own ancestor",
    ]
    assert export_dsr(knowledge, start) == document


angles = some.floats(-math.pi, math.pi)


@given(turned=some.tuples(angles, angles | some.sampled_from([math.pi / 2, -math.pi / 2]), angles))
def test_euler_angles_are_those_of_robocomp_and_give_the_same_rotation_again(
    turned: tuple[float, float, float],
) -> None:
    edge = DsrEdge(
        origin=1,
        label="RT",
        target=2,
        attributes={
            "rt_translation": number(3, (1.0, 2.0, 3.0)),
            "rt_rotation_euler_xyz": number(3, turned),
        },
    )
    _, knowledge = import_graph(DsrGraph(nodes=(WORLD, ROBOT), edges=(edge,)))
    expected = Rotation.from_euler("XYZ", turned).as_matrix()
    matrix = np.array(knowledge.transform("world", "robot").pose.matrix())[:3, :3]
    np.testing.assert_allclose(matrix, expected, atol=1e-9)
    exported_edge = next(exported_edge for exported_edge in export_dsr(knowledge).edges if exported_edge.label == "RT")
    back = Rotation.from_euler("XYZ", numbers(exported_edge.attributes["rt_rotation_euler_xyz"])).as_matrix()
    np.testing.assert_allclose(back, expected, atol=1e-9)


def test_a_graph_of_many_nodes_is_read_as_exported_and_a_context_manager_begins_with_it(tmp_path: Path) -> None:
    with manager(SimClock()) as codra:
        codra.agent("navigation").set("charge", 55.5)
        detection = codra.agent("container_detection").graph
        for number in range(12):
            detection.insert_node(f"box_{number}", "roll_container")
            detection.place("world", "container_pose", f"box_{number}", Pose.of((number, 0.0, 0.0)))
        exported_graph = export_dsr(codra.knowledge)
    write_dsr(tmp_path / "shop.json", exported_graph)
    read = read_dsr(tmp_path / "shop.json")
    assert read == exported_graph
    assert from_networkx(to_networkx(exported_graph)) == exported_graph
    assert read != replace(exported_graph, nodes=exported_graph.nodes[1:])

    start = import_dsr(KNOWLEDGE, read)
    journal = tmp_path / "run.mcap"
    with ContextManager[str, str](
        MODEL, clock=SimClock(), resources={}, record=Journal(journal), knowledge=start.model
    ) as codra:
        assert codra.get("charge").value == 55.5
        assert codra.knowledge.snapshot().distance_m("world", "box_11") == 11.0
        codra.agent("navigation").set("charge", 50.0)
    head, events = read_journal(journal)
    assert replay(head, events, MODEL, ContextManager[str, str], None, start.model).difference is None
