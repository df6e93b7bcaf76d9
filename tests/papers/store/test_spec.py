"""specs/store.yaml agrees with the world's knowledge, element by element."""

from __future__ import annotations

from functools import cache
from math import inf
from pathlib import Path

import pytest

from codra_dsl.language.load import load_text
from codra_dsl.language.model import Spec
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AttributeModel, Knowledge, KnowledgeModel
from codra_dsl.runtime.knowledge.declarations import TASK
from codra_papers.store.knowledge import floor_pose_of, named_floor_poses, pose_of, store_knowledge

PATH = Path(__file__).parents[3] / "specs" / "store.yaml"
MODEL = store_knowledge()
LOOP_TASKS = {"fetching"}
"""The tasks between the two trees, which the world's own agents do not know."""
LOOP_NODES = {"tentative_actions": "tentative_actions"}
"""The node of the recommendations, which the world's own agents do not know."""


@cache
def spec() -> Spec:
    loaded, _ = load_text(PATH.read_text("utf-8"), "specs/store.yaml", PATH.parents[1])
    assert loaded is not None
    return loaded


def names(writers: object) -> set[str]:
    return {getattr(writer, "name", None) or writer.agent for writer in writers}  # type: ignore[attr-defined]


def test_the_same_nodes_edges_tasks_and_agents_are_declared() -> None:
    nodes_of_world = {node.name: node.type for node in MODEL.nodes}
    assert {node.name: node.type.name for node in spec().nodes} == nodes_of_world | LOOP_NODES
    assert {edge.name for edge in spec().edges} == {edge.name for edge in MODEL.edge_types}
    assert {task.name for task in spec().tasks} == {task.name for task in MODEL.tasks} | LOOP_TASKS
    assert {agent.name for agent in spec().agents} == {agent.name for agent in MODEL.agents} | {"analysis"}


def test_edges_have_the_same_ends_writers_and_motions() -> None:
    types = {edge_type.name: edge_type for edge_type in MODEL.edge_types}
    for edge in spec().edges:
        model = types[edge.name]
        assert {node_type.name for node_type in edge.origins} == set(model.origins), edge.name
        assert {node_type.name for node_type in edge.targets} == set(model.targets), edge.name
        assert names(edge.sources) == names(model.sources), edge.name
        assert (edge.motion is None) == (model.motion is None), edge.name
        if edge.motion is not None and model.motion is not None:
            assert edge.motion.is_static == model.motion.is_static, edge.name
            assert (edge.motion.valid_for_s or inf) == model.motion.valid_for_s, edge.name
            assert (edge.motion.extrapolate_s or 0.0) == model.motion.extrapolate_s, edge.name


def test_poses_from_the_start_are_those_of_the_world() -> None:
    of_model = {edge.type: edge.pose for edge in MODEL.edges}
    for edge in spec().edges:
        if edge.pose is None:
            continue
        roll_rad, pitch_rad, yaw_rad = edge.pose.rotation_rad
        turns = [Pose.about(axis, turn) for axis, turn in (((0, 0, 1), yaw_rad), ((0, 1, 0), pitch_rad))]
        rotated_pose = turns[0] @ turns[1] @ Pose.about((1, 0, 0), roll_rad)
        stated_pose = Pose(edge.pose.translation_m, rotated_pose.rotation)
        assert stated_pose.distance_m(of_model[edge.name]) < 1e-6, edge.name
        assert stated_pose.angle_rad(of_model[edge.name]) < 1e-5, edge.name


def test_tasks_have_the_same_executors_requesters_results_and_deadlines() -> None:
    of_model = {task.name: task for task in MODEL.tasks}
    for task in spec().tasks:
        if task.name in LOOP_TASKS:
            continue
        model = of_model[task.name]
        assert task.by.name == model.by
        assert {agent.name for agent in task.requesters} == set(model.requesters)
        assert [result.name for result in task.results] == list(model.results)
        assert (task.acknowledge_s, task.finish_s) == (model.acknowledge_s, model.finish_s)


def test_attributes_of_certain_nodes_are_the_variables_of_the_context() -> None:
    types = {node_type.name: node_type for node_type in MODEL.node_types}
    of_model: dict[tuple[str, str], AttributeModel] = {
        (node.name, attribute.name): attribute for node in MODEL.nodes for attribute in types[node.type].attributes
    }
    variables = {(variable.node, variable.name): variable for variable in spec().context}

    assert variables.keys() > of_model.keys()
    assert {name for _, name in variables.keys() - of_model.keys()} >= {"order_open", "picking_up", "safety", "course"}
    for key, model in of_model.items():
        variable = variables[key]
        assert names(variable.sources) == names(model.sources), key
        assert variable.valid_for_s == model.valid_for_s, key
        assert variable.type.kind == model.type.kind, key
        assert variable.type.unit == model.type.unit, key
        assert tuple(variable.type.values or ()) == tuple(model.type.members or ()), key


def test_every_agent_has_a_handle_and_the_graph_opens() -> None:
    knowledge = Knowledge(MODEL, clock=SimClock())

    for agent in MODEL.agents:
        knowledge.as_agent(agent.name).close()
    assert {node.name for node in knowledge.snapshot().nodes(TASK)} == {task.name for task in MODEL.tasks}


@pytest.mark.parametrize("name", named_floor_poses())
def test_a_floor_pose_survives_the_conversion_to_a_pose_and_back(name: str) -> None:
    floor_pose = named_floor_poses()[name]
    converted_pose = floor_pose_of(pose_of(floor_pose))

    assert converted_pose.distance_m(floor_pose) < 1e-9
    assert abs(converted_pose.turned(-floor_pose.heading_rad).heading_rad) < 1e-9


def test_declarations_are_frozen() -> None:
    assert store_knowledge() == MODEL
    assert isinstance(MODEL, KnowledgeModel)
