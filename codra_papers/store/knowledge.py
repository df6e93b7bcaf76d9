"""The knowledge of the store's robot: the declarations of `specs/store.yaml` for the runtime (P2, sections 3 to 5).

All poses lie in the plane of the floor, and so does the axis of the camera.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, pi

from codra_dsl.runtime import ValueType, boolean, member, real
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import (
    AgentModel,
    AttributeModel,
    EdgeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    Phase,
    RuleModel,
    TaskModel,
    ViewModel,
    Writer,
    by,
    path,
    some,
)
from codra_papers.store.body import (
    CAMERA_FARTHEST_M,
    CAMERA_NEAREST_M,
    CAMERA_POSE,
    CAMERA_VIEW_HEIGHT_RAD,
    CAMERA_VIEW_RAD,
    LASER_POSES,
    Side,
    Way,
)
from codra_papers.store.geometry import Pose2D, wrapped
from codra_papers.store.layout import AREAS, DELIVERY, DOCK, PICKING_AREAS, START, SUPPLY

DEPOTS = (SUPPLY.name, DELIVERY.name)
PLANNERS = ("mission", "picking")
LOADS = ("empty", "loading", "full")
NOTICES = ("none", "container_not_found", "container_not_placed", "mission_aborted")
FARTHEST_M = 10.0
"""Largest distance in the graph, and the distance in the graph if no object is seen."""


def named_floor_poses() -> dict[str, Pose2D]:
    """Return the named poses of the map: a mapping from names to poses (P2, Figure 8)."""
    poses = {"start": START, "dock": DOCK}
    for area in AREAS.values():
        for number, pose in enumerate(area.observation_poses, start=1):
            poses[f"{area.name}_pose_{number}"] = pose
        poses[f"{area.name}_approach"] = area.approach
        poses[f"{area.name}_delivery"] = area.delivery
    return poses


def pose_of(floor_pose: Pose2D) -> Pose:
    """Return a pose on the floor as a pose in space."""
    return Pose.about((0.0, 0.0, 1.0), wrapped(floor_pose.heading_rad), (floor_pose.x_m, floor_pose.y_m, 0.0))


def floor_pose_of(pose: Pose) -> Pose2D:
    """Return a pose in space as a pose on the floor."""
    x_m, y_m, _ = pose.translation_m
    east, north, _ = Pose((0.0, 0.0, 0.0), pose.rotation).apply((1.0, 0.0, 0.0))
    return Pose2D(x_m, y_m, atan2(north, east))


def store_knowledge() -> KnowledgeModel:
    """Return the declarations of the store."""
    static_transforms = tuple(_static_transforms())
    return KnowledgeModel(
        name="store",
        node_types=_node_types(),
        edge_types=(*_edge_types(), *(type_model for type_model, _ in static_transforms)),
        nodes=_nodes(),
        edges=(EdgeModel(origin="robot", type="has", target="battery"), *(edge for _, edge in static_transforms)),
        tasks=_tasks(),
        agents=_agents(),
    )


def _attribute(name: str, type: ValueType, *sources: str, valid_for_s: float = float("inf")) -> AttributeModel:
    return AttributeModel(name=name, type=type, sources=by(*sources), valid_for_s=valid_for_s)


def _distance_type() -> ValueType:
    return real(0, FARTHEST_M, unit="m")


def _node_types() -> tuple[NodeTypeModel, ...]:
    return (
        NodeTypeModel(name="world"),
        NodeTypeModel(name="robot", attributes=_robot_attributes()),
        NodeTypeModel(
            name="battery",
            attributes=(
                _attribute("battery_level", real(0, 100, unit="percent"), "navigation", valid_for_s=60.0),
                _attribute("charging", boolean(), "navigation", valid_for_s=60.0),
            ),
        ),
        NodeTypeModel(
            name="camera",
            view=ViewModel(
                horizontal_rad=CAMERA_VIEW_RAD,
                vertical_rad=CAMERA_VIEW_HEIGHT_RAD,
                nearest_m=CAMERA_NEAREST_M,
                farthest_m=CAMERA_FARTHEST_M,
            ),
            attributes=(_attribute("camera_steady", boolean(), "camera_agent", valid_for_s=2.0),),
        ),
        NodeTypeModel(name="laser"),
        NodeTypeModel(name="goal", attributes=(_attribute("goal_way", member(*Way), *PLANNERS),)),
        NodeTypeModel(
            name="base",
            attributes=(_attribute("base_notice", member(*NOTICES), *PLANNERS),),
        ),
        NodeTypeModel(name="pose"),
        NodeTypeModel(name="picking_area"),
        NodeTypeModel(name="depot"),
        NodeTypeModel(name="person", sources=by("person_detection")),
        NodeTypeModel(name="roll_container", sources=by("container_detection")),
        NodeTypeModel(
            name="order",
            sources=by("picker_page"),
            attributes=(
                _attribute("kind", member("provide", "collect", "move"), "picker_page"),
                _attribute("cancelled", boolean(), "picker_page"),
                _attribute("state", member("open", "done", "aborted", "failed", "cancelled"), "mission"),
            ),
        ),
    )


def _robot_attributes() -> tuple[AttributeModel, ...]:
    return (
        _attribute("person_distance", _distance_type(), "person_detection", valid_for_s=15.0),
        _attribute("front_gap", _distance_type(), "lasers", valid_for_s=2.0),
        _attribute("back_gap", _distance_type(), "lasers", valid_for_s=2.0),
        _attribute("strange_gap", _distance_type(), "lasers", valid_for_s=2.0),
        _attribute("bumped", boolean(), "navigation", valid_for_s=5.0),
        _attribute("speed", real(-1.5, 1.5, unit="m/s"), "navigation", valid_for_s=5.0),
        _attribute("pose_spread", real(0, 10, unit="m"), "localisation", valid_for_s=5.0),
        _attribute("loaded", boolean(), "fork"),
        _attribute("container_load", member(*LOADS), "picker_page"),
        _attribute("max_speed", real(0, 1.5, unit="m/s"), "adaptation", valid_for_s=5.0),
    )


def _edge_types() -> tuple[EdgeTypeModel, ...]:
    continuous_motion = Motion(history_s=10.0, extrapolate_s=0.2, valid_for_s=2.0)
    stepwise_motion = Motion(history_s=60.0, is_static=True)
    container_sources = (Writer(agent="container_detection"), Writer(agent="wheel_check"), Writer(agent="fork"))
    return (
        EdgeTypeModel(name="has", origins=("robot",), targets=("battery",)),
        EdgeTypeModel(
            name="near", origins=("person",), targets=("robot", "roll_container"), sources=by("person_detection")
        ),
        EdgeTypeModel(name="carries", origins=("robot",), targets=("roll_container",), sources=by("fork")),
        EdgeTypeModel(name="of_area", origins=("order",), targets=("picking_area", "depot"), sources=by("picker_page")),
        EdgeTypeModel(name="to_area", origins=("order",), targets=("picking_area", "depot"), sources=by("picker_page")),
        EdgeTypeModel(
            name="robot_pose",
            origins=("world",),
            targets=("robot",),
            sources=by("localisation"),
            motion=continuous_motion,
        ),
        EdgeTypeModel(
            name="person_pose",
            origins=("world",),
            targets=("person",),
            sources=by("person_detection"),
            motion=continuous_motion,
        ),
        EdgeTypeModel(
            name="container_pose",
            origins=("world", "robot"),
            targets=("roll_container",),
            sources=container_sources,
            motion=stepwise_motion,
        ),
        EdgeTypeModel(
            name="goal_pose", origins=("world",), targets=("goal",), sources=by(*PLANNERS), motion=stepwise_motion
        ),
    )


def _nodes() -> tuple[NodeModel, ...]:
    single_names = ("world", "robot", "battery", "camera", "goal", "base")
    areas = [NodeModel(name=name, type="picking_area") for name in PICKING_AREAS]
    depots = [NodeModel(name=name, type="depot") for name in DEPOTS]
    lasers = [NodeModel(name=f"laser_{side}", type="laser") for side in Side]
    poses = [NodeModel(name=name, type="pose") for name in named_floor_poses()]
    return (*(NodeModel(name=name, type=name) for name in single_names), *areas, *depots, *lasers, *poses)


def _static_transforms() -> Iterator[tuple[EdgeTypeModel, EdgeModel]]:
    """Yield the static transforms: named poses in the map, sensors on the robot."""
    for name, floor_pose in named_floor_poses().items():
        yield _static_transform("world", name, pose_of(floor_pose))
    optical_pose = Pose.about((0, 0, 1), -pi / 2) @ Pose.about((1, 0, 0), -pi / 2)
    yield _static_transform("robot", "camera", Pose.of((CAMERA_POSE.x_m, CAMERA_POSE.y_m, 0.0), optical_pose.rotation))
    for side, mount in LASER_POSES.items():
        yield _static_transform("robot", f"laser_{side}", pose_of(mount))


def _static_transform(origin: str, target: str, pose: Pose) -> tuple[EdgeTypeModel, EdgeModel]:
    name = f"{target}_at"
    motion = Motion(is_static=True)
    type_model = EdgeTypeModel(name=name, origins=(origin,), targets=(target,), motion=motion)
    return type_model, EdgeModel(origin=origin, type=name, target=target, pose=pose)


def _task(name: str, executor: str, finish_s: float, *results: str) -> TaskModel:
    return TaskModel(
        name=name,
        origin="robot",
        by=executor,
        requesters=PLANNERS,
        results=results,
        acknowledge_s=1.0,
        finish_s=finish_s,
    )


def _tasks() -> tuple[TaskModel, ...]:
    return (
        _task("navigating", "navigation", 300.0, "arrived", "blocked", "unreachable", "bumped"),
        _task("detecting", "container_detection", 10.0, "found", "lost"),
        _task("rotating", "turning", 40.0, "turned", "blocked", "bumped"),
        _task("checking", "wheel_check", 10.0, "found", "lost"),
        _task("lifting", "fork", 10.0, "lifted", "empty"),
        _task("lowering", "fork", 10.0, "lowered"),
    )


def _agents() -> tuple[AgentModel, ...]:
    monitors = ("localisation", "camera_agent", "lasers", "person_detection")
    executors = {
        "container_detection": ("detecting",),
        "wheel_check": ("checking",),
        "navigation": ("navigating",),
        "turning": ("rotating",),
        "fork": ("lifting", "lowering"),
    }
    return (
        *(AgentModel(name=name, phase=Phase.MONITOR) for name in monitors),
        *(
            AgentModel(
                name=name,
                phase=Phase.MONITOR if name in ("container_detection", "wheel_check") else Phase.EXECUTE,
                wakes=() if name == "navigation" else tuple(path("robot", "wants", task) for task in tasks),
                rules=tuple(_rule(task) for task in tasks),
            )
            for name, tasks in executors.items()
        ),
        AgentModel(name="picker_page"),
        *(AgentModel(name=name, phase=Phase.PLAN) for name in PLANNERS),
        AgentModel(name="adaptation", phase=Phase.PLAN),
    )


def _rule(task: str) -> RuleModel:
    """Return P2's triplet of an executor. Its last part contains the end and the other effects of the task."""
    effects = {
        "detecting": (path("world", "container_pose", some("roll_container")),),
        "lifting": (path("robot", "carries", some("roll_container")),),
    }
    return RuleModel(
        name=task,
        before=(path("robot", "wants", task),),
        during=(path("robot", "is", task),),
        after=(path("robot", "finished", task), *effects.get(task, ())),
    )
