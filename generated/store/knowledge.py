"""The declared knowledge of 'store', and who may write it.

Made by codra from specs/store.yaml; edits are lost. Renew: codra compile specs/store.yaml
"""

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Literal, Never, overload

from codra_dsl.runtime.generated_api import (
    AgentHandle,
    AgentModel,
    AttributeModel,
    Edge,
    EdgeModel,
    EdgeTypeModel,
    Handover,
    Knowledge,
    KnowledgeModel,
    Motion,
    Node,
    NodeModel,
    NodeTypeModel,
    Phase,
    Pose,
    Reading,
    Request,
    RuleExecution,
    RuleModel,
    Snapshot,
    TaskModel,
    Term,
    Transaction,
    ViewModel,
    boolean,
    by,
    integer,
    member,
    path,
    real,
    some,
)

AgentName = Literal[
    "localisation",
    "camera_agent",
    "lasers",
    "person_detection",
    "container_detection",
    "wheel_check",
    "navigation",
    "turning",
    "fork",
    "picker_page",
    "mission",
    "picking",
    "adaptation",
    "analysis",
]
AttributeName = Literal[
    "kind",
    "cancelled",
    "state",
    "battery_level",
    "charging",
    "camera_steady",
    "person_distance",
    "front_gap",
    "back_gap",
    "strange_gap",
    "bumped",
    "speed",
    "pose_spread",
    "loaded",
    "container_load",
    "max_speed",
    "goal_way",
    "base_notice",
    "battery_drain",
    "full_on_fork",
    "people_at_container",
    "crowded",
    "crowding",
    "order_open",
    "picking_up",
    "safety",
    "mission_completion",
    "power_autonomy",
    "weight_of_pick",
    "weight_of_deliver",
    "weight_of_start",
    "weight_of_dock",
    "course",
    "filtered_weight_of_pick",
    "filtered_weight_of_deliver",
    "filtered_weight_of_start",
    "filtered_weight_of_dock",
    "request",
    "requester",
    "result",
    "reason",
]
EdgeName = Literal[
    "has",
    "near",
    "carries",
    "of_area",
    "to_area",
    "robot_pose",
    "person_pose",
    "container_pose",
    "goal_pose",
    "camera_at",
    "laser_front_left_at",
    "laser_front_right_at",
    "laser_back_at",
    "start_at",
    "dock_at",
    "area_1_pose_1_at",
    "area_1_pose_2_at",
    "area_1_approach_at",
    "area_1_delivery_at",
    "area_2_pose_1_at",
    "area_2_pose_2_at",
    "area_2_approach_at",
    "area_2_delivery_at",
    "area_3_pose_1_at",
    "area_3_pose_2_at",
    "area_3_approach_at",
    "area_3_delivery_at",
    "area_4_pose_1_at",
    "area_4_pose_2_at",
    "area_4_approach_at",
    "area_4_delivery_at",
    "supply_pose_1_at",
    "supply_approach_at",
    "supply_delivery_at",
    "delivery_pose_1_at",
    "delivery_approach_at",
    "delivery_delivery_at",
    "RT",
    "aborted",
    "finished",
    "is",
    "wants",
]
NodeTypeName = Literal[
    "camera",
    "person",
    "roll_container",
    "order",
    "world",
    "robot",
    "battery",
    "goal",
    "base",
    "tentative_actions",
    "laser",
    "picking_area",
    "depot",
    "pose",
    "task",
    "context",
]
TaskName = Literal["navigating", "detecting", "rotating", "checking", "lifting", "lowering", "fetching"]

KNOWLEDGE = KnowledgeModel(
    name="store",
    node_types=(
        NodeTypeModel(
            name="camera",
            view=ViewModel(
                horizontal_rad=1.5184364492350666,
                vertical_rad=1.0122909661567112,
                nearest_m=0.3,
                farthest_m=6.0,
            ),
        ),
        NodeTypeModel(name="person", sources=by("person_detection")),
        NodeTypeModel(name="roll_container", sources=by("container_detection")),
        NodeTypeModel(
            name="order",
            sources=by("picker_page"),
            attributes=(
                AttributeModel(name="kind", type=member("provide", "collect", "move"), sources=by("picker_page")),
                AttributeModel(name="cancelled", type=boolean(), sources=by("picker_page")),
                AttributeModel(
                    name="state",
                    type=member("open", "done", "aborted", "failed", "cancelled"),
                    sources=by("mission"),
                ),
            ),
        ),
        NodeTypeModel(name="world"),
        NodeTypeModel(name="robot"),
        NodeTypeModel(name="battery"),
        NodeTypeModel(name="goal"),
        NodeTypeModel(name="base"),
        NodeTypeModel(name="tentative_actions"),
        NodeTypeModel(name="laser"),
        NodeTypeModel(name="picking_area"),
        NodeTypeModel(name="depot"),
        NodeTypeModel(name="pose"),
        NodeTypeModel(name="context"),
    ),
    edge_types=(
        EdgeTypeModel(name="has", origins=("robot",), targets=("battery",)),
        EdgeTypeModel(
            name="near",
            origins=("person",),
            targets=("robot", "roll_container"),
            sources=by("person_detection"),
        ),
        EdgeTypeModel(name="carries", origins=("robot",), targets=("roll_container",), sources=by("fork")),
        EdgeTypeModel(name="of_area", origins=("order",), targets=("picking_area", "depot"), sources=by("picker_page")),
        EdgeTypeModel(name="to_area", origins=("order",), targets=("picking_area", "depot"), sources=by("picker_page")),
        EdgeTypeModel(
            name="robot_pose",
            label="RT",
            origins=("world",),
            targets=("robot",),
            sources=by("localisation"),
            motion=Motion(extrapolate_s=0.2, valid_for_s=2.0),
        ),
        EdgeTypeModel(
            name="person_pose",
            label="RT",
            origins=("world",),
            targets=("person",),
            sources=by("person_detection"),
            motion=Motion(extrapolate_s=0.2, valid_for_s=2.0),
        ),
        EdgeTypeModel(
            name="container_pose",
            label="RT",
            origins=("world", "robot"),
            targets=("roll_container",),
            sources=by("container_detection", "wheel_check", "fork"),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="goal_pose",
            label="RT",
            origins=("world",),
            targets=("goal",),
            sources=by("mission", "picking"),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="camera_at",
            label="RT",
            origins=("robot",),
            targets=("camera",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="laser_front_left_at",
            label="RT",
            origins=("robot",),
            targets=("laser_front_left",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="laser_front_right_at",
            label="RT",
            origins=("robot",),
            targets=("laser_front_right",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="laser_back_at",
            label="RT",
            origins=("robot",),
            targets=("laser_back",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="start_at",
            label="RT",
            origins=("world",),
            targets=("start",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(name="dock_at", label="RT", origins=("world",), targets=("dock",), motion=Motion(is_static=True)),
        EdgeTypeModel(
            name="area_1_pose_1_at",
            label="RT",
            origins=("world",),
            targets=("area_1_pose_1",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_1_pose_2_at",
            label="RT",
            origins=("world",),
            targets=("area_1_pose_2",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_1_approach_at",
            label="RT",
            origins=("world",),
            targets=("area_1_approach",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_1_delivery_at",
            label="RT",
            origins=("world",),
            targets=("area_1_delivery",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_2_pose_1_at",
            label="RT",
            origins=("world",),
            targets=("area_2_pose_1",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_2_pose_2_at",
            label="RT",
            origins=("world",),
            targets=("area_2_pose_2",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_2_approach_at",
            label="RT",
            origins=("world",),
            targets=("area_2_approach",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_2_delivery_at",
            label="RT",
            origins=("world",),
            targets=("area_2_delivery",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_3_pose_1_at",
            label="RT",
            origins=("world",),
            targets=("area_3_pose_1",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_3_pose_2_at",
            label="RT",
            origins=("world",),
            targets=("area_3_pose_2",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_3_approach_at",
            label="RT",
            origins=("world",),
            targets=("area_3_approach",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_3_delivery_at",
            label="RT",
            origins=("world",),
            targets=("area_3_delivery",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_4_pose_1_at",
            label="RT",
            origins=("world",),
            targets=("area_4_pose_1",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_4_pose_2_at",
            label="RT",
            origins=("world",),
            targets=("area_4_pose_2",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_4_approach_at",
            label="RT",
            origins=("world",),
            targets=("area_4_approach",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="area_4_delivery_at",
            label="RT",
            origins=("world",),
            targets=("area_4_delivery",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="supply_pose_1_at",
            label="RT",
            origins=("world",),
            targets=("supply_pose_1",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="supply_approach_at",
            label="RT",
            origins=("world",),
            targets=("supply_approach",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="supply_delivery_at",
            label="RT",
            origins=("world",),
            targets=("supply_delivery",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="delivery_pose_1_at",
            label="RT",
            origins=("world",),
            targets=("delivery_pose_1",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="delivery_approach_at",
            label="RT",
            origins=("world",),
            targets=("delivery_approach",),
            motion=Motion(is_static=True),
        ),
        EdgeTypeModel(
            name="delivery_delivery_at",
            label="RT",
            origins=("world",),
            targets=("delivery_delivery",),
            motion=Motion(is_static=True),
        ),
    ),
    nodes=(
        NodeModel(name="world", type="world"),
        NodeModel(
            name="robot",
            type="robot",
            attributes=(
                AttributeModel(
                    name="person_distance",
                    type=real(0, 10, unit="m"),
                    sources=by("person_detection"),
                    valid_for_s=15.0,
                    label="Nearest person",
                ),
                AttributeModel(
                    name="front_gap",
                    type=real(0, 10, unit="m"),
                    sources=by("lasers"),
                    valid_for_s=2.0,
                    label="Nearest thing in front",
                ),
                AttributeModel(
                    name="back_gap",
                    type=real(0, 10, unit="m"),
                    sources=by("lasers"),
                    valid_for_s=2.0,
                    label="Nearest thing behind",
                ),
                AttributeModel(
                    name="strange_gap",
                    type=real(0, 10, unit="m"),
                    sources=by("lasers"),
                    valid_for_s=2.0,
                    label="Nearest thing around that is not on the map",
                ),
                AttributeModel(
                    name="bumped",
                    type=boolean(),
                    sources=by("navigation"),
                    valid_for_s=5.0,
                    label="Bumped",
                ),
                AttributeModel(
                    name="speed",
                    type=real(-1.5, 1.5, unit="m/s"),
                    sources=by("navigation"),
                    valid_for_s=5.0,
                    label="Speed",
                ),
                AttributeModel(
                    name="pose_spread",
                    type=real(0, 10, unit="m"),
                    sources=by("localisation"),
                    valid_for_s=5.0,
                    label="Spread of the pose",
                ),
                AttributeModel(name="loaded", type=boolean(), sources=by("fork"), label="Something on the fork"),
                AttributeModel(
                    name="container_load",
                    type=member("empty", "loading", "full"),
                    sources=by("picker_page"),
                    label="Load of the container",
                ),
                AttributeModel(
                    name="max_speed",
                    type=real(0, 1.5, unit="m/s"),
                    sources=by("adaptation"),
                    valid_for_s=5.0,
                    label="Maximum speed",
                ),
                AttributeModel(
                    name="full_on_fork",
                    type=boolean(),
                    sources=by("observer"),
                    label="A full container on the fork",
                ),
                AttributeModel(
                    name="people_at_container",
                    type=integer(0, 20),
                    sources=by("observer"),
                    label="People near a container",
                ),
                AttributeModel(
                    name="crowded",
                    type=boolean(),
                    sources=by("observer"),
                    history=300,
                    label="Somebody at the pick-up",
                ),
                AttributeModel(
                    name="crowding",
                    type=real(0, 1),
                    sources=by("analysis"),
                    label="Share of time with somebody at the pick-up",
                ),
                AttributeModel(
                    name="order_open",
                    type=boolean(),
                    sources=by("mission"),
                    label="An order can be served now",
                ),
                AttributeModel(name="picking_up", type=boolean(), sources=by("picking"), label="Picking up"),
            ),
        ),
        NodeModel(
            name="battery",
            type="battery",
            attributes=(
                AttributeModel(
                    name="battery_level",
                    type=real(0, 100, unit="percent"),
                    sources=by("navigation"),
                    valid_for_s=60.0,
                    history=241,
                    label="Battery",
                ),
                AttributeModel(
                    name="charging",
                    type=boolean(),
                    sources=by("navigation"),
                    valid_for_s=60.0,
                    label="Charging",
                ),
                AttributeModel(
                    name="battery_drain",
                    type=real(0, 20, unit="percent/min"),
                    sources=by("analysis"),
                    label="Drain of the battery",
                ),
            ),
        ),
        NodeModel(
            name="camera",
            type="camera",
            attributes=(
                AttributeModel(
                    name="camera_steady",
                    type=boolean(),
                    sources=by("camera_agent"),
                    valid_for_s=2.0,
                    label="Camera steady",
                ),
            ),
        ),
        NodeModel(
            name="goal",
            type="goal",
            attributes=(
                AttributeModel(
                    name="goal_way",
                    type=member("forward", "backward"),
                    sources=by("mission", "picking"),
                    label="Way to the goal",
                ),
            ),
        ),
        NodeModel(
            name="base",
            type="base",
            attributes=(
                AttributeModel(
                    name="base_notice",
                    type=member("none", "container_not_found", "container_not_placed", "mission_aborted"),
                    sources=by("mission", "picking"),
                    label="Notice to the base",
                ),
            ),
        ),
        NodeModel(
            name="tentative_actions",
            type="tentative_actions",
            attributes=(
                AttributeModel(
                    name="weight_of_pick",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Weight of Fetch and bring",
                ),
                AttributeModel(
                    name="weight_of_deliver",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Weight of Bring to the general delivery pose",
                ),
                AttributeModel(
                    name="weight_of_start",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Weight of Return to the start",
                ),
                AttributeModel(
                    name="weight_of_dock",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Weight of Go and charge",
                ),
                AttributeModel(
                    name="course",
                    type=member("pick", "deliver", "start", "dock"),
                    sources=by("adaptation"),
                    label="Course of the mission",
                ),
                AttributeModel(
                    name="filtered_weight_of_pick",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Filtered weight of Fetch and bring",
                ),
                AttributeModel(
                    name="filtered_weight_of_deliver",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Filtered weight of Bring to the general delivery pose",
                ),
                AttributeModel(
                    name="filtered_weight_of_start",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Filtered weight of Return to the start",
                ),
                AttributeModel(
                    name="filtered_weight_of_dock",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Filtered weight of Go and charge",
                ),
            ),
        ),
        NodeModel(name="laser_front_left", type="laser"),
        NodeModel(name="laser_front_right", type="laser"),
        NodeModel(name="laser_back", type="laser"),
        NodeModel(name="area_1", type="picking_area"),
        NodeModel(name="area_2", type="picking_area"),
        NodeModel(name="area_3", type="picking_area"),
        NodeModel(name="area_4", type="picking_area"),
        NodeModel(name="supply", type="depot"),
        NodeModel(name="delivery", type="depot"),
        NodeModel(name="start", type="pose"),
        NodeModel(name="dock", type="pose"),
        NodeModel(name="area_1_pose_1", type="pose"),
        NodeModel(name="area_1_pose_2", type="pose"),
        NodeModel(name="area_1_approach", type="pose"),
        NodeModel(name="area_1_delivery", type="pose"),
        NodeModel(name="area_2_pose_1", type="pose"),
        NodeModel(name="area_2_pose_2", type="pose"),
        NodeModel(name="area_2_approach", type="pose"),
        NodeModel(name="area_2_delivery", type="pose"),
        NodeModel(name="area_3_pose_1", type="pose"),
        NodeModel(name="area_3_pose_2", type="pose"),
        NodeModel(name="area_3_approach", type="pose"),
        NodeModel(name="area_3_delivery", type="pose"),
        NodeModel(name="area_4_pose_1", type="pose"),
        NodeModel(name="area_4_pose_2", type="pose"),
        NodeModel(name="area_4_approach", type="pose"),
        NodeModel(name="area_4_delivery", type="pose"),
        NodeModel(name="supply_pose_1", type="pose"),
        NodeModel(name="supply_approach", type="pose"),
        NodeModel(name="supply_delivery", type="pose"),
        NodeModel(name="delivery_pose_1", type="pose"),
        NodeModel(name="delivery_approach", type="pose"),
        NodeModel(name="delivery_delivery", type="pose"),
        NodeModel(
            name="context",
            type="context",
            attributes=(
                AttributeModel(name="safety", type=real(0.0, 1.0), sources=by("analysis"), label="Safety"),
                AttributeModel(
                    name="mission_completion",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Mission completion",
                ),
                AttributeModel(
                    name="power_autonomy",
                    type=real(0.0, 1.0),
                    sources=by("analysis"),
                    label="Power autonomy",
                ),
            ),
        ),
    ),
    edges=(
        EdgeModel(origin="robot", type="has", target="battery"),
        EdgeModel(
            origin="robot",
            type="camera_at",
            target="camera",
            pose=Pose.of((0.45, 0.0, 0.0), (0.5, -0.5, 0.5, -0.5)),
        ),
        EdgeModel(
            origin="robot",
            type="laser_front_left_at",
            target="laser_front_left",
            pose=Pose.of((0.45, 0.35, 0.0), (0.819152044289, 0.0, 0.0, 0.573576436351)),
        ),
        EdgeModel(
            origin="robot",
            type="laser_front_right_at",
            target="laser_front_right",
            pose=Pose.of((0.45, -0.35, 0.0), (0.819152044289, 0.0, 0.0, -0.573576436351)),
        ),
        EdgeModel(
            origin="robot",
            type="laser_back_at",
            target="laser_back",
            pose=Pose.of((-0.75, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ),
        EdgeModel(
            origin="world",
            type="start_at",
            target="start",
            pose=Pose.of((8.2, 2.0, 0.0), (0.707106781187, 0.0, 0.0, 0.707106781187)),
        ),
        EdgeModel(origin="world", type="dock_at", target="dock", pose=Pose.of((1.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))),
        EdgeModel(
            origin="world",
            type="area_1_pose_1_at",
            target="area_1_pose_1",
            pose=Pose.of((4.6, 5.1, 0.0), (0.497571047892, 0.0, 0.0, 0.867423225594)),
        ),
        EdgeModel(
            origin="world",
            type="area_1_pose_2_at",
            target="area_1_pose_2",
            pose=Pose.of((4.6, 11.0, 0.0), (0.434966728819, 0.0, 0.0, -0.900446525242)),
        ),
        EdgeModel(origin="world", type="area_1_approach_at", target="area_1_approach", pose=Pose.of((4.6, 9.4, 0.0))),
        EdgeModel(origin="world", type="area_1_delivery_at", target="area_1_delivery", pose=Pose.of((3.0, 9.4, 0.0))),
        EdgeModel(
            origin="world",
            type="area_2_pose_1_at",
            target="area_2_pose_1",
            pose=Pose.of((8.2, 5.1, 0.0), (0.497571047892, 0.0, 0.0, 0.867423225594)),
        ),
        EdgeModel(
            origin="world",
            type="area_2_pose_2_at",
            target="area_2_pose_2",
            pose=Pose.of((8.2, 11.0, 0.0), (0.434966728819, 0.0, 0.0, -0.900446525242)),
        ),
        EdgeModel(origin="world", type="area_2_approach_at", target="area_2_approach", pose=Pose.of((8.2, 9.4, 0.0))),
        EdgeModel(origin="world", type="area_2_delivery_at", target="area_2_delivery", pose=Pose.of((6.6, 9.4, 0.0))),
        EdgeModel(
            origin="world",
            type="area_3_pose_1_at",
            target="area_3_pose_1",
            pose=Pose.of((11.8, 5.1, 0.0), (0.497571047892, 0.0, 0.0, 0.867423225594)),
        ),
        EdgeModel(
            origin="world",
            type="area_3_pose_2_at",
            target="area_3_pose_2",
            pose=Pose.of((11.8, 11.0, 0.0), (0.434966728819, 0.0, 0.0, -0.900446525242)),
        ),
        EdgeModel(origin="world", type="area_3_approach_at", target="area_3_approach", pose=Pose.of((11.8, 9.4, 0.0))),
        EdgeModel(origin="world", type="area_3_delivery_at", target="area_3_delivery", pose=Pose.of((10.2, 9.4, 0.0))),
        EdgeModel(
            origin="world",
            type="area_4_pose_1_at",
            target="area_4_pose_1",
            pose=Pose.of((15.4, 5.1, 0.0), (0.497571047892, 0.0, 0.0, 0.867423225594)),
        ),
        EdgeModel(
            origin="world",
            type="area_4_pose_2_at",
            target="area_4_pose_2",
            pose=Pose.of((15.4, 11.0, 0.0), (0.434966728819, 0.0, 0.0, -0.900446525242)),
        ),
        EdgeModel(origin="world", type="area_4_approach_at", target="area_4_approach", pose=Pose.of((15.4, 9.4, 0.0))),
        EdgeModel(origin="world", type="area_4_delivery_at", target="area_4_delivery", pose=Pose.of((13.8, 9.4, 0.0))),
        EdgeModel(
            origin="world",
            type="supply_pose_1_at",
            target="supply_pose_1",
            pose=Pose.of((19.0, 5.9, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ),
        EdgeModel(origin="world", type="supply_approach_at", target="supply_approach", pose=Pose.of((19.0, 5.9, 0.0))),
        EdgeModel(origin="world", type="supply_delivery_at", target="supply_delivery", pose=Pose.of((17.4, 5.9, 0.0))),
        EdgeModel(
            origin="world",
            type="delivery_pose_1_at",
            target="delivery_pose_1",
            pose=Pose.of((19.0, 9.9, 0.0), (0.0, 0.0, 0.0, 1.0)),
        ),
        EdgeModel(
            origin="world",
            type="delivery_approach_at",
            target="delivery_approach",
            pose=Pose.of((19.0, 9.9, 0.0)),
        ),
        EdgeModel(
            origin="world",
            type="delivery_delivery_at",
            target="delivery_delivery",
            pose=Pose.of((17.4, 9.9, 0.0)),
        ),
    ),
    tasks=(
        TaskModel(
            name="navigating",
            origin="robot",
            by="navigation",
            requesters=("mission", "picking"),
            results=("arrived", "blocked", "unreachable", "bumped"),
            acknowledge_s=1.0,
            finish_s=300.0,
        ),
        TaskModel(
            name="detecting",
            origin="robot",
            by="container_detection",
            requesters=("mission", "picking"),
            results=("found", "lost"),
            acknowledge_s=1.0,
            finish_s=10.0,
        ),
        TaskModel(
            name="rotating",
            origin="robot",
            by="turning",
            requesters=("mission", "picking"),
            results=("turned", "blocked", "bumped"),
            acknowledge_s=1.0,
            finish_s=40.0,
        ),
        TaskModel(
            name="checking",
            origin="robot",
            by="wheel_check",
            requesters=("mission", "picking"),
            results=("found", "lost"),
            acknowledge_s=1.0,
            finish_s=10.0,
        ),
        TaskModel(
            name="lifting",
            origin="robot",
            by="fork",
            requesters=("mission", "picking"),
            results=("lifted", "empty"),
            acknowledge_s=1.0,
            finish_s=10.0,
        ),
        TaskModel(
            name="lowering",
            origin="robot",
            by="fork",
            requesters=("mission", "picking"),
            results=("lowered",),
            acknowledge_s=1.0,
            finish_s=10.0,
        ),
        TaskModel(
            name="fetching",
            origin="robot",
            by="picking",
            requesters=("mission",),
            results=("fetched", "not_found", "failed"),
            acknowledge_s=1.0,
            finish_s=600.0,
        ),
    ),
    agents=(
        AgentModel(name="localisation", phase=Phase.MONITOR, owns=("robot.pose_spread", "robot_pose")),
        AgentModel(name="camera_agent", phase=Phase.MONITOR, owns=("camera.camera_steady",)),
        AgentModel(
            name="lasers",
            phase=Phase.MONITOR,
            owns=("robot.front_gap", "robot.back_gap", "robot.strange_gap"),
            reads=("container_pose",),
        ),
        AgentModel(
            name="person_detection",
            phase=Phase.MONITOR,
            owns=("robot.person_distance", "person", "near", "person_pose"),
            reads=("container_pose",),
        ),
        AgentModel(
            name="container_detection",
            phase=Phase.MONITOR,
            wakes=(path("robot", "wants", "detecting"),),
            owns=("roll_container", "container_pose"),
            reads=("detecting",),
            rules=(
                RuleModel(
                    name="detecting",
                    before=(path("robot", "wants", "detecting"),),
                    during=(path("robot", "is", "detecting"),),
                    after=(
                        path("robot", "finished", "detecting"),
                        path("world", "container_pose", some("roll_container")),
                    ),
                ),
            ),
        ),
        AgentModel(
            name="wheel_check",
            phase=Phase.MONITOR,
            wakes=(path("robot", "wants", "checking"),),
            owns=("container_pose",),
            reads=("checking",),
            rules=(
                RuleModel(
                    name="checking",
                    before=(path("robot", "wants", "checking"),),
                    during=(path("robot", "is", "checking"),),
                    after=(
                        path("robot", "finished", "checking"),
                        path("world", "container_pose", some("roll_container")),
                    ),
                ),
            ),
        ),
        AgentModel(
            name="navigation",
            phase=Phase.EXECUTE,
            owns=("battery.battery_level", "battery.charging", "robot.bumped", "robot.speed"),
            reads=("goal_pose", "goal.goal_way", "container_pose", "person_pose", "robot.max_speed", "navigating"),
            rules=(
                RuleModel(
                    name="navigating",
                    before=(path("robot", "wants", "navigating"),),
                    during=(path("robot", "is", "navigating"),),
                    after=(path("robot", "finished", "navigating"),),
                ),
            ),
        ),
        AgentModel(
            name="turning",
            phase=Phase.EXECUTE,
            wakes=(path("robot", "wants", "rotating"),),
            reads=("rotating",),
            rules=(
                RuleModel(
                    name="rotating",
                    before=(path("robot", "wants", "rotating"),),
                    during=(path("robot", "is", "rotating"),),
                    after=(path("robot", "finished", "rotating"),),
                ),
            ),
        ),
        AgentModel(
            name="fork",
            phase=Phase.EXECUTE,
            wakes=(path("robot", "wants", "lifting"), path("robot", "wants", "lowering")),
            owns=("robot.loaded", "carries", "container_pose"),
            reads=("container_pose", "lifting", "lowering"),
            rules=(
                RuleModel(
                    name="lifting",
                    before=(path("robot", "wants", "lifting"),),
                    during=(path("robot", "is", "lifting"),),
                    after=(path("robot", "finished", "lifting"), path("robot", "carries", some("roll_container"))),
                ),
                RuleModel(
                    name="lowering",
                    before=(path("robot", "wants", "lowering"),),
                    during=(path("robot", "is", "lowering"),),
                    after=(path("robot", "finished", "lowering"),),
                ),
            ),
        ),
        AgentModel(
            name="picker_page",
            owns=("robot.container_load", "order", "order.kind", "order.cancelled", "of_area", "to_area"),
        ),
        AgentModel(
            name="mission",
            phase=Phase.PLAN,
            owns=("goal.goal_way", "base.base_notice", "robot.order_open", "order.state", "goal_pose"),
            reads=("order", "of_area", "to_area", "base.base_notice", "robot.loaded"),
        ),
        AgentModel(
            name="picking",
            phase=Phase.PLAN,
            owns=("goal.goal_way", "base.base_notice", "robot.picking_up", "goal_pose"),
            reads=("container_pose",),
        ),
        AgentModel(
            name="adaptation",
            phase=Phase.PLAN,
            owns=("robot.max_speed", "tentative_actions.course"),
            reads=("robot.person_distance", "robot.front_gap", "battery.battery_level"),
        ),
        AgentModel(
            name="analysis",
            phase=Phase.ANALYSE,
            owns=(
                "battery.battery_drain",
                "robot.crowding",
                "context.safety",
                "context.mission_completion",
                "context.power_autonomy",
                "tentative_actions.weight_of_pick",
                "tentative_actions.weight_of_deliver",
                "tentative_actions.weight_of_start",
                "tentative_actions.weight_of_dock",
                "tentative_actions.filtered_weight_of_pick",
                "tentative_actions.filtered_weight_of_deliver",
                "tentative_actions.filtered_weight_of_start",
                "tentative_actions.filtered_weight_of_dock",
            ),
        ),
    ),
    counts=(path(some("person"), "near", some("roll_container")),),
)

if TYPE_CHECKING:

    class _LocalisationWrites:
        """What agent 'localisation' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self, name: str, attribute: Literal["pose_spread"], value: object, *, evidence_s: float | None = None
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["robot_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["robot_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class LocalisationTransaction(_LocalisationWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'localisation' that become visible together."""

    class LocalisationHandle(_LocalisationWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'localisation'."""

        def transaction(self) -> AbstractContextManager[LocalisationTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[LocalisationTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _CameraAgentWrites:
        """What agent 'camera_agent' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self, name: str, attribute: Literal["camera_steady"], value: object, *, evidence_s: float | None = None
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Never, target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class CameraAgentTransaction(_CameraAgentWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'camera_agent' that become visible together."""

    class CameraAgentHandle(_CameraAgentWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'camera_agent'."""

        def transaction(self) -> AbstractContextManager[CameraAgentTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[CameraAgentTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _LasersWrites:
        """What agent 'lasers' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal["front_gap", "back_gap", "strange_gap"],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Never, target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class LasersTransaction(_LasersWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'lasers' that become visible together."""

    class LasersHandle(_LasersWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'lasers'."""

        def transaction(self) -> AbstractContextManager[LasersTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[LasersTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _PersonDetectionWrites:
        """What agent 'person_detection' may write."""

        def insert_node(self, name: str, type: Literal["person"], /, **values: object) -> None: ...

        def set(
            self, name: str, attribute: Literal["person_distance"], value: object, *, evidence_s: float | None = None
        ) -> None: ...

        def insert_edge(self, origin: str, type: Literal["near"], target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["near", "person_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["person_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class PersonDetectionTransaction(_PersonDetectionWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'person_detection' that become visible together."""

    class PersonDetectionHandle(_PersonDetectionWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'person_detection'."""

        def transaction(self) -> AbstractContextManager[PersonDetectionTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[PersonDetectionTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _ContainerDetectionWrites:
        """What agent 'container_detection' may write."""

        def insert_node(self, name: str, type: Literal["roll_container"], /, **values: object) -> None: ...

        def set(self, name: str, attribute: Never, value: object, *, evidence_s: float | None = None) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["container_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["container_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Literal["found", "lost"]) -> None: ...

    class ContainerDetectionTransaction(_ContainerDetectionWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'container_detection' that become visible together."""

    class ContainerDetectionHandle(_ContainerDetectionWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'container_detection'."""

        def transaction(self) -> AbstractContextManager[ContainerDetectionTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Literal["detecting"]) -> RuleExecution[ContainerDetectionTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _WheelCheckWrites:
        """What agent 'wheel_check' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(self, name: str, attribute: Never, value: object, *, evidence_s: float | None = None) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["container_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["container_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Literal["found", "lost"]) -> None: ...

    class WheelCheckTransaction(_WheelCheckWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'wheel_check' that become visible together."""

    class WheelCheckHandle(_WheelCheckWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'wheel_check'."""

        def transaction(self) -> AbstractContextManager[WheelCheckTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Literal["checking"]) -> RuleExecution[WheelCheckTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _NavigationWrites:
        """What agent 'navigation' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal["battery_level", "charging", "bumped", "speed"],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Never, target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Literal["arrived", "blocked", "unreachable", "bumped"]) -> None: ...

    class NavigationTransaction(_NavigationWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'navigation' that become visible together."""

    class NavigationHandle(_NavigationWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'navigation'."""

        def transaction(self) -> AbstractContextManager[NavigationTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Literal["navigating"]) -> RuleExecution[NavigationTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _TurningWrites:
        """What agent 'turning' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(self, name: str, attribute: Never, value: object, *, evidence_s: float | None = None) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Never, target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Literal["turned", "blocked", "bumped"]) -> None: ...

    class TurningTransaction(_TurningWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'turning' that become visible together."""

    class TurningHandle(_TurningWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'turning'."""

        def transaction(self) -> AbstractContextManager[TurningTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Literal["rotating"]) -> RuleExecution[TurningTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _ForkWrites:
        """What agent 'fork' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self, name: str, attribute: Literal["loaded"], value: object, *, evidence_s: float | None = None
        ) -> None: ...

        def insert_edge(self, origin: str, type: Literal["carries"], target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["carries", "container_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["container_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Literal["lifted", "empty", "lowered"]) -> None: ...

    class ForkTransaction(_ForkWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'fork' that become visible together."""

    class ForkHandle(_ForkWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'fork'."""

        def transaction(self) -> AbstractContextManager[ForkTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Literal["lifting", "lowering"]) -> RuleExecution[ForkTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _PickerPageWrites:
        """What agent 'picker_page' may write."""

        def insert_node(self, name: str, type: Literal["order"], /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal["container_load", "kind", "cancelled"],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(
            self, origin: str, type: Literal["of_area", "to_area"], target: str, /, **values: object
        ) -> None: ...

        def delete_edge(self, origin: str, type: Literal["of_area", "to_area"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class PickerPageTransaction(_PickerPageWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'picker_page' that become visible together."""

    class PickerPageHandle(_PickerPageWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'picker_page'."""

        def transaction(self) -> AbstractContextManager[PickerPageTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[PickerPageTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _MissionWrites:
        """What agent 'mission' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal["goal_way", "base_notice", "order_open", "state"],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["goal_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["goal_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(
            self,
            task: Literal["navigating", "detecting", "rotating", "checking", "lifting", "lowering", "fetching"],
            /,
            **values: object,
        ) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class MissionTransaction(_MissionWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'mission' that become visible together."""

    class MissionHandle(_MissionWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'mission'."""

        def transaction(self) -> AbstractContextManager[MissionTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[MissionTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _PickingWrites:
        """What agent 'picking' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal["goal_way", "base_notice", "picking_up"],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Literal["goal_pose"], target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(
            self, origin: str, type: Literal["goal_pose"], target: str, pose: Pose, *, stamp_s: float | None = None
        ) -> None: ...

        def request(
            self,
            task: Literal["navigating", "detecting", "rotating", "checking", "lifting", "lowering"],
            /,
            **values: object,
        ) -> Request: ...

        def finish(self, request: Request, result: Literal["fetched", "not_found", "failed"]) -> None: ...

    class PickingTransaction(_PickingWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'picking' that become visible together."""

    class PickingHandle(_PickingWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'picking'."""

        def transaction(self) -> AbstractContextManager[PickingTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[PickingTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _AdaptationWrites:
        """What agent 'adaptation' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal["max_speed", "course"],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Never, target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class AdaptationTransaction(_AdaptationWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'adaptation' that become visible together."""

    class AdaptationHandle(_AdaptationWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'adaptation'."""

        def transaction(self) -> AbstractContextManager[AdaptationTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[AdaptationTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _AnalysisWrites:
        """What agent 'analysis' may write."""

        def insert_node(self, name: str, type: Never, /, **values: object) -> None: ...

        def set(
            self,
            name: str,
            attribute: Literal[
                "battery_drain",
                "crowding",
                "safety",
                "mission_completion",
                "power_autonomy",
                "weight_of_pick",
                "weight_of_deliver",
                "weight_of_start",
                "weight_of_dock",
                "filtered_weight_of_pick",
                "filtered_weight_of_deliver",
                "filtered_weight_of_start",
                "filtered_weight_of_dock",
            ],
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def insert_edge(self, origin: str, type: Never, target: str, /, **values: object) -> None: ...

        def delete_edge(self, origin: str, type: Never, target: str) -> None: ...

        def set_of_edge(
            self,
            origin: str,
            type: Never,
            target: str,
            attribute: Never,
            value: object,
            *,
            evidence_s: float | None = None,
        ) -> None: ...

        def place(self, origin: str, type: Never, target: str, pose: Pose, *, stamp_s: float | None = None) -> None: ...

        def request(self, task: Never, /, **values: object) -> Request: ...

        def finish(self, request: Request, result: Never) -> None: ...

    class AnalysisTransaction(_AnalysisWrites, Transaction):  # type: ignore[misc]  # takes fewer names, on purpose
        """Changes of agent 'analysis' that become visible together."""

    class AnalysisHandle(_AnalysisWrites, AgentHandle):  # type: ignore[misc]  # takes fewer names, on purpose
        """The handle of agent 'analysis'."""

        def transaction(self) -> AbstractContextManager[AnalysisTransaction]:
            """Begin changes that become visible together, or not at all."""

        def acting(self, rule: Never) -> RuleExecution[AnalysisTransaction]:  # type: ignore[override]  # takes fewer names, on purpose
            """Begin an action that a rule describes, for a `with` statement."""

    class _Reads:
        """The methods that read."""

        def nodes(self, type_name: NodeTypeName | Literal[""] = "", where: Term | None = None) -> tuple[Node, ...]: ...

        def edge(self, origin: str, edge: EdgeName, target: str) -> Edge: ...

        def has_edge(self, origin: str, edge: EdgeName, target: str) -> bool: ...

        def edges(
            self, edge: EdgeName | Literal[""] = "", *, origin: str = "", target: str = ""
        ) -> tuple[Edge, ...]: ...

        def get(self, name: str, attribute: AttributeName) -> Reading[Any]: ...

        def handover(self, task: TaskName) -> Handover: ...

    class StoreSnapshot(_Reads, Snapshot):  # type: ignore[misc]  # takes fewer names, on purpose
        """The graph of 'store' at one instant."""

    class _Graph:
        """Access for agents, and the methods that read."""

        @overload
        def as_agent(self, name: Literal["localisation"]) -> LocalisationHandle: ...

        @overload
        def as_agent(self, name: Literal["camera_agent"]) -> CameraAgentHandle: ...

        @overload
        def as_agent(self, name: Literal["lasers"]) -> LasersHandle: ...

        @overload
        def as_agent(self, name: Literal["person_detection"]) -> PersonDetectionHandle: ...

        @overload
        def as_agent(self, name: Literal["container_detection"]) -> ContainerDetectionHandle: ...

        @overload
        def as_agent(self, name: Literal["wheel_check"]) -> WheelCheckHandle: ...

        @overload
        def as_agent(self, name: Literal["navigation"]) -> NavigationHandle: ...

        @overload
        def as_agent(self, name: Literal["turning"]) -> TurningHandle: ...

        @overload
        def as_agent(self, name: Literal["fork"]) -> ForkHandle: ...

        @overload
        def as_agent(self, name: Literal["picker_page"]) -> PickerPageHandle: ...

        @overload
        def as_agent(self, name: Literal["mission"]) -> MissionHandle: ...

        @overload
        def as_agent(self, name: Literal["picking"]) -> PickingHandle: ...

        @overload
        def as_agent(self, name: Literal["adaptation"]) -> AdaptationHandle: ...

        @overload
        def as_agent(self, name: Literal["analysis"]) -> AnalysisHandle: ...

        def as_agent(self, name: Any) -> Any: ...

        def snapshot(self) -> StoreSnapshot: ...

        def get(self, name: str, attribute: AttributeName) -> Reading[Any]: ...

    class StoreKnowledge(_Graph, Knowledge):  # type: ignore[misc]  # takes fewer names, on purpose
        """The graph of 'store'."""
else:
    LocalisationTransaction = Transaction
    LocalisationHandle = AgentHandle
    CameraAgentTransaction = Transaction
    CameraAgentHandle = AgentHandle
    LasersTransaction = Transaction
    LasersHandle = AgentHandle
    PersonDetectionTransaction = Transaction
    PersonDetectionHandle = AgentHandle
    ContainerDetectionTransaction = Transaction
    ContainerDetectionHandle = AgentHandle
    WheelCheckTransaction = Transaction
    WheelCheckHandle = AgentHandle
    NavigationTransaction = Transaction
    NavigationHandle = AgentHandle
    TurningTransaction = Transaction
    TurningHandle = AgentHandle
    ForkTransaction = Transaction
    ForkHandle = AgentHandle
    PickerPageTransaction = Transaction
    PickerPageHandle = AgentHandle
    MissionTransaction = Transaction
    MissionHandle = AgentHandle
    PickingTransaction = Transaction
    PickingHandle = AgentHandle
    AdaptationTransaction = Transaction
    AdaptationHandle = AgentHandle
    AnalysisTransaction = Transaction
    AnalysisHandle = AgentHandle
    StoreSnapshot = Snapshot
    StoreKnowledge = Knowledge
