"""A bay with a machine and a robot. An observer looks at the machine's lid while the robot is near and sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence as Several
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from codra_dsl.runtime import Clock, ContextManager, ContextModel, EventLog
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import KnowledgeModel
from codra_dsl.runtime.knowledge.declarations import (
    AgentModel,
    EdgeModel,
    EdgeTypeModel,
    NodeModel,
    NodeTypeModel,
    ViewModel,
    by,
    distance,
    in_view,
)
from codra_dsl.runtime.observers.behaviours import ControlFlag, DueOrRunning, Identify, Perceive, Precondition
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.values.conditions import known, value
from codra_dsl.runtime.values.declarations import POSES
from codra_dsl.runtime.values.model import Algorithm, ResourceModel, VariableModel, boolean, real

NEAR = "distance(robot, machine) < 0.9 m"
IN_VIEW = "in_view(cup, eye)"
CUP_NEAR = "distance(cup, machine) <= 1.7 m"
ASKED = "known(distance(cup, machine))"
VALID_FOR_S = 2.0

VIEW = ViewModel(horizontal_rad=1.2, vertical_rad=0.9, nearest_m=0.3, farthest_m=3.1)

LOOK = Algorithm(
    name="look",
    call="tests.runtime.knowledge.bay:look",
    handles=("lid",),
    returns={"gap": real(unit="m")},
    timeout_s=1.0,
)


@dataclass
class Lid:
    """The machine's lid, and the instants of all looks at it."""

    gap_m: float = 0.3
    looks_s: list[float] = field(default_factory=list)


def look(*, lid: Lid, job: object) -> dict[str, float]:
    lid.looks_s.append(job.now_s())  # type: ignore[attr-defined]
    return {"gap": lid.gap_m}


def look_at_lid(observer: Observer) -> Behaviour:
    perception = observer.branch(LOOK)
    return Sequence(
        name="look",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition(NEAR, value(NEAR), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("lid_open", value("gap") > 0.1, perception),
        ],
    )


MODEL = ContextModel(
    name="bay",
    variables=(
        VariableModel(name="lid_open", type=boolean(), when_unobservable="forget"),
        VariableModel(name=NEAR, type=boolean(), sources=(POSES,), pose_condition=distance("robot", "machine") < 0.9),
        VariableModel(name=IN_VIEW, type=boolean(), sources=(POSES,), pose_condition=in_view("cup", "eye")),
        VariableModel(
            name=CUP_NEAR, type=boolean(), sources=(POSES,), pose_condition=distance("cup", "machine") <= 1.7
        ),
        VariableModel(name=ASKED, type=boolean(), sources=(POSES,), pose_condition=known("distance(cup, machine)")),
    ),
    observers=(ObserverModel(name="look", identifies=("lid_open",), build=look_at_lid),),
    resources=(ResourceModel(name="lid"),),
)


def knowledge(extrapolate_s: float = 0.0) -> KnowledgeModel:
    """Return the declarations: the machine has a fixed pose, the robot and the cup are placed by agents."""
    return KnowledgeModel(
        name="bay",
        node_types=(
            *(NodeTypeModel(name=name) for name in ("world", "robot", "machine")),
            NodeTypeModel(name="cup", sources=by("people")),
            NodeTypeModel(name="camera", view=VIEW),
        ),
        edge_types=(
            EdgeTypeModel(
                name="robot_pose",
                label="RT",
                origins=("world",),
                targets=("robot",),
                sources=by("navigation"),
                motion=Motion(valid_for_s=VALID_FOR_S, extrapolate_s=extrapolate_s),
            ),
            EdgeTypeModel(
                name="cup_pose",
                label="RT",
                origins=("world", "robot"),
                targets=("cup",),
                sources=by("people"),
                motion=Motion(extrapolate_s=extrapolate_s),
            ),
            EdgeTypeModel(
                name="fixed",
                label="RT",
                origins=("world", "robot"),
                targets=("machine", "camera"),
                motion=Motion(is_static=True),
            ),
        ),
        nodes=(
            *(NodeModel(name=name, type=name) for name in ("world", "robot", "machine", "cup")),
            NodeModel(name="eye", type="camera"),
        ),
        edges=(
            EdgeModel(origin="world", type="fixed", target="machine", pose=Pose.of((4.0, 0.0, 0.0))),
            EdgeModel(origin="robot", type="fixed", target="eye"),
        ),
        agents=(
            AgentModel(name="navigation", owns=("robot_pose",)),
            AgentModel(name="people", owns=("cup_pose", "cup")),
        ),
    )


def manager(
    clock: Clock, lid: Lid, record: EventLog | None = None, extrapolate_s: float = 0.0
) -> ContextManager[str, str]:
    """Return a context manager with the initial graph of the bay."""
    return ContextManager[str, str](
        MODEL, clock=clock, resources={"lid": lid}, record=record, knowledge=knowledge(extrapolate_s)
    )


def sees(at_m: Several[float]) -> bool:
    """Return whether an unrotated camera with this view sees a point of its frame."""
    x_m, y_m, z_m = at_m
    return (
        VIEW.nearest_m <= z_m <= VIEW.farthest_m
        and abs(math.atan2(x_m, z_m)) <= VIEW.horizontal_rad / 2
        and abs(math.atan2(y_m, z_m)) <= VIEW.vertical_rad / 2
    )
