"""The declarations of P2's store for the tests of knowledge."""

from __future__ import annotations

import math

from codra_dsl.runtime import Clock, SimClock
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.knowledge.declarations import (
    AgentModel,
    AttributeModel,
    EdgeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    Phase,
    TaskModel,
    ViewModel,
    by,
    path,
    ranked,
)
from codra_dsl.runtime.values.model import boolean, member, real

CAMERA_ON_ROBOT = Pose.about((0.0, 1.0, 0.0), math.pi / 2, (0.2, 0.0, 1.0))
"""The camera looks along the robot's x-axis."""

NODE_TYPES = (
    *(NodeTypeModel(name=name) for name in ("world", "robot", "picking_area")),
    NodeTypeModel(
        name="battery",
        attributes=(
            AttributeModel(name="level", type=real(0, 100, unit="percent"), sources=by("navigation"), valid_for_s=60.0),
        ),
    ),
    NodeTypeModel(name="camera", view=ViewModel(horizontal_rad=1.2, vertical_rad=0.9, farthest_m=4.0)),
    NodeTypeModel(name="people"),
    NodeTypeModel(
        name="person",
        sources=by("person_detection"),
        attributes=(AttributeModel(name="height", type=real(0, 3, unit="m"), sources=by("person_detection")),),
    ),
    NodeTypeModel(
        name="roll_container",
        sources=by("container_detection"),
        attributes=(
            AttributeModel(name="load", type=member("empty", "loading", "full"), sources=by("picker_page")),
            AttributeModel(name="locked", type=boolean(), sources=ranked("picker_page", "fork"), valid_for_s=5.0),
        ),
    ),
)

EDGE_TYPES = (
    EdgeTypeModel(name="has", origins=("robot",), targets=("battery",)),
    EdgeTypeModel(name="in", origins=("robot",), targets=("picking_area",), sources=by("navigation")),
    EdgeTypeModel(
        name="close_to",
        origins=("roll_container", "person"),
        targets=("robot",),
        sources=by("container_detection", "person_detection"),
        attributes=(AttributeModel(name="distance", type=real(0, 100, unit="m")),),
    ),
    EdgeTypeModel(name="is_not", origins=("people",), targets=("robot",), sources=by("person_detection")),
    EdgeTypeModel(
        name="robot_pose",
        origins=("world",),
        targets=("robot",),
        sources=by("navigation"),
        motion=Motion(history_s=10.0, extrapolate_s=0.2, valid_for_s=5.0),
    ),
    EdgeTypeModel(
        name="container_pose",
        origins=("world",),
        targets=("roll_container",),
        sources=by("container_detection"),
        motion=Motion(history_s=10.0),
    ),
    EdgeTypeModel(
        name="carried",
        origins=("robot",),
        targets=("roll_container",),
        sources=by("fork"),
        motion=Motion(is_static=True),
    ),
    EdgeTypeModel(name="mount", origins=("robot",), targets=("camera",), motion=Motion(is_static=True)),
)

_DECIDER, _PICKING = "decision_maker", "picking"


GOAL = tuple(AttributeModel(name=f"goal_{axis}", type=real(unit="m")) for axis in ("x", "y"))


def _task(
    name: str,
    by_agent: str,
    *requesters: str,
    results: tuple[str, ...] = ("ok", "failed"),
    attributes: tuple[AttributeModel, ...] = (),
) -> TaskModel:
    return TaskModel(
        name=name,
        origin="robot",
        by=by_agent,
        requesters=requesters,
        results=results,
        attributes=attributes,
        acknowledge_s=1.0,
        finish_s=60.0,
    )


TASKS = (
    _task("navigating", "navigation", _DECIDER, _PICKING, attributes=GOAL),
    _task("detecting", "container_detection", _DECIDER, _PICKING, results=("ok", "lost")),
    _task("picking_up", _PICKING, _DECIDER),
    _task("rotating", "navigation", _PICKING),
    _task("approaching", "navigation", _PICKING, _DECIDER),
    _task("lifting", "fork", _PICKING),
)

STORE = KnowledgeModel(
    name="store",
    node_types=NODE_TYPES,
    edge_types=EDGE_TYPES,
    nodes=(
        *(NodeModel(name=name, type=name) for name in ("world", "robot", "camera", "people")),
        NodeModel(name="battery", type="battery", values={"level": 80.0}),
        *(NodeModel(name=name, type="picking_area") for name in ("area_1", "area_2")),
    ),
    edges=(
        EdgeModel(origin="robot", type="has", target="battery"),
        EdgeModel(origin="robot", type="mount", target="camera", pose=CAMERA_ON_ROBOT),
    ),
    tasks=TASKS,
    agents=(
        AgentModel(name="navigation", phase=Phase.EXECUTE),
        AgentModel(name="person_detection", phase=Phase.MONITOR),
        AgentModel(name="container_detection", phase=Phase.MONITOR, wakes=(path("robot", "wants", "detecting"),)),
        AgentModel(name="picker_page"),
    ),
)


def store(clock: Clock | None = None) -> Knowledge:
    """Return the initial graph of the store."""
    return Knowledge(STORE, clock=SimClock() if clock is None else clock)
