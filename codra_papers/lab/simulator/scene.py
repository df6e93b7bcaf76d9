"""The laboratory as a MuJoCo model: the tags and joints of layout.py, bodies with the tags, a room and the robot.

The model has no physics: a `Stage` shows one state of the laboratory, either to draw the state or to cast rays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from math import atan, degrees, sqrt

import cv2
import mujoco
import numpy as np
from numpy.random import default_rng
from numpy.typing import NDArray

from codra_papers.lab.perception.layout import INTRINSICS, TILE_PER_TAG, Joint, Machine, Part, Shape, Tag
from codra_papers.lab.perception.poses import Array, Pose, columns, cross, length
from codra_papers.lab.perception.tags import tag_image
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory, PersonBefore
from codra_papers.lab.simulator.world import LabState

ROOM_M = (6.6, 6.0)
"""The size of the room in x and y. One corner of the room is at x = 0 and y = 0."""

CAMERA_NAME = "arm_camera"

PCR_CYCLER_HANDLE_M = (0.485, 0.210, -0.011)
"""Where a hand grips the PCR-cycler's lid, in the lid's frame: a bar to the right of the machine, clear of its tags.

The hand holds the PCR-cycler beside its tags, by this bar or by a stalk on the lever. So the camera on the hand sees
the complete machine while the hand holds it. The hand holds the centrifuge in the middle, so the camera then sees only
a part of the centrifuge."""

PCR_CYCLER_KNOB_M = (0.0, -0.025, 0.095)
"""Where a hand grips the PCR-cycler's lever, in the lever's frame: the end of a stalk that sticks out of the lever."""

_TEXELS_PER_CELL = 20
_TILE_THICKNESS_M = 0.004
_SHOULDER_M = (0.05, 0.0, 0.85)
_LINK_M = 0.65
ARM_LENGTH_M = 2 * _LINK_M
"""Largest distance of the robot's wrist from its shoulder."""

_WHITE = "0.86 0.87 0.88 1"
_GREY = "0.55 0.57 0.60 1"
_DARK = "0.22 0.23 0.25 1"
_ORANGE = "0.80 0.55 0.20 1"


class Stage:
    """The laboratory at one instant, for drawing and ray casts. Only one thread may use it at a time."""

    def __init__(self, laboratory: Laboratory = LABORATORY) -> None:
        self.model = mujoco.MjModel.from_xml_string(mjcf(laboratory), dict(textures(laboratory)))
        self.data = mujoco.MjData(self.model)
        self._joint_addresses = {
            (machine.name, joint.part): int(self.model.joint(_body_name(machine, joint.part)).qposadr[0])
            for machine in laboratory.machines
            for joint in machine.joints
        }
        movable_names = _MOCAP_BODIES + ((_PERSON,) if _has_visitors(laboratory) else ())
        self._mocap_ids = {name: int(self.model.body(name).mocapid[0]) for name in movable_names}
        self._angles_rad = self.data.qpos
        self._places_m, self._quaternions = self.data.mocap_pos, self.data.mocap_quat

    def place(self, state: LabState) -> None:
        """Move all bodies to their places in a state."""
        for key, angle_rad in state.joints_rad.items():
            self._angles_rad[self._joint_addresses[key.machine, key.part]] = angle_rad
        for name, pose in _robot_poses(state).items():
            self._put(name, pose)
        if _PERSON in self._mocap_ids:
            self._put(_PERSON, _translation(*state.person_m, 0.0))
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)

    def first_hit(self, origin_m: Array, points_m: Array) -> Array:
        """Return, for a ray from an origin to each point, the distance to the first hit divided by that to the point.

        Args:
            origin_m: shape (3,), in the map.
            points_m: shape (n, 3), in the map.

        Returns:
            The shares, shape (n,): 1 if the first hit is at the point, less than 1 if a body is in front of the point,
            more than 1 if the first hit is behind the point, and -1 if the ray hits nothing.
        """
        count = len(points_m)
        rays = np.ascontiguousarray(points_m - origin_m)
        shares = np.empty(count)
        geoms = np.empty(count, dtype=np.int32)
        mujoco.mj_multiRay(
            self.model, self.data, origin_m, rays.ravel(), None, True, -1, geoms, shares, None, count, 1e6
        )
        return shares

    def _put(self, name: str, pose: Pose) -> None:
        index = self._mocap_ids[name]
        self._places_m[index] = pose.translation_m
        mujoco.mju_mat2Quat(self._quaternions[index], pose.rotation.ravel())


@lru_cache(maxsize=2)
def textures(laboratory: Laboratory = LABORATORY) -> Mapping[str, bytes]:
    """Return the pictures of tags, floor and walls as a mapping from the name of each PNG file to its content."""
    tags = {
        f"tag_{tag.tag_id}.png": np.kron(
            tag_image(tag.tag_id), np.ones((_TEXELS_PER_CELL, _TEXELS_PER_CELL), dtype=np.uint8)
        )
        for machine in laboratory.machines
        for tag in machine.tags
    }
    pictures = tags | {"floor.png": _floor_picture(), "wall.png": _wall_picture()}
    return {name: cv2.imencode(".png", picture)[1].tobytes() for name, picture in pictures.items()}


def _floor_picture() -> NDArray[np.uint8]:
    """Return the picture of a speckled tile of 0.6 m with dark joints, so that even a view of the floor has edges."""
    random = default_rng(1)
    speckles = cv2.GaussianBlur(random.normal(150.0, 60.0, (512, 512)), (0, 0), 1.6)
    tile: NDArray[np.uint8] = np.clip(150.0 + 2.2 * (speckles - 150.0), 90.0, 205.0).astype(np.uint8)
    tile[:6, :] = 70
    tile[:, :6] = 70
    return tile


def _wall_picture() -> NDArray[np.uint8]:
    """Return the picture of a wall with cupboards, notices and sockets: rectangles in many greys, without tags."""
    random = default_rng(2)
    wall = np.full((512, 1024), 190, dtype=np.uint8)
    for _ in range(70):
        x, y = int(random.integers(0, 980)), int(random.integers(0, 470))
        width, height = int(random.integers(14, 110)), int(random.integers(14, 80))
        grey = int(random.integers(110, 240))
        cv2.rectangle(wall, (x, y), (x + width, y + height), grey, cv2.FILLED)
        cv2.rectangle(wall, (x, y), (x + width, y + height), max(grey - 70, 30), 2)
        for line in range(y + 8, y + height - 6, 7):
            cv2.line(wall, (x + 6, line), (x + 6 + int(random.integers(4, max(width - 8, 5))), line), grey - 60, 1)
    return wall


def mjcf(laboratory: Laboratory = LABORATORY) -> str:
    """Return the complete scene as MJCF, with machines and robot in their zero poses."""
    half_height_rad = atan(INTRINSICS.height / 2 / INTRINSICS.focal_px)
    tags = [tag for machine in laboratory.machines for tag in machine.tags]
    visitor = _visitor() if _has_visitors(laboratory) else ""
    return f"""
<mujoco model="laboratory">
  <compiler angle="radian"/>
  <option gravity="0 0 0"><flag contact="disable"/></option>
  <statistic extent="1" center="3 3 1"/>
  <visual>
    <global offwidth="{INTRINSICS.width}" offheight="{INTRINSICS.height}"/>
    <quality offsamples="0" shadowsize="0"/>
    <map znear="0.02" zfar="12"/>
    <headlight ambient="0.35 0.35 0.35" diffuse="0.15 0.15 0.15" specular="0 0 0"/>
  </visual>
  <asset>
    {"".join(_tag_material(tag) for tag in tags)}
    <texture name="floor" type="2d" file="floor.png"/>
    <material name="floor" texture="floor" texrepeat="11 10" specular="0"/>
    <texture name="wall" type="2d" file="wall.png"/>
    <material name="wall" texture="wall" specular="0"/>
  </asset>
  <worldbody>
    <light directional="true" pos="3 3 4" dir="0.3 0.2 -1" diffuse="0.35 0.35 0.35" specular="0 0 0"/>
    <light directional="true" pos="3 3 4" dir="-0.2 0.7 -0.5" diffuse="0.22 0.22 0.22" specular="0 0 0"/>
    <light directional="true" pos="3 3 4" dir="0.7 -0.3 -0.5" diffuse="0.22 0.22 0.22" specular="0 0 0"/>
    {_room()}
    {"".join(_machine(machine) for machine in laboratory.machines)}
    {"".join(_robot_bodies())}{visitor}
    <body name="camera" mocap="true"><camera name="{CAMERA_NAME}" xyaxes="1 0 0 0 -1 0"
      fovy="{2 * degrees(half_height_rad):.9f}"/></body>
  </worldbody>
</mujoco>"""


def _tag_material(tag: Tag) -> str:
    name = f"tag_{tag.tag_id}"
    return (
        f'<texture name="{name}" type="2d" file="{name}.png"/>'
        f'<material name="{name}" texture="{name}" specular="0" shininess="0"/>'
    )


def _room() -> str:
    x_m, y_m = ROOM_M[0] / 2, ROOM_M[1] / 2
    return "".join(
        (
            f'<geom type="plane" pos="{x_m} {y_m} 0" size="{x_m} {y_m} 0.1" material="floor"/>',
            _wall((x_m, 0.0), (1.0, 0.0), x_m),
            _wall((x_m, 2 * y_m), (-1.0, 0.0), x_m),
            _wall((0.0, y_m), (0.0, -1.0), y_m),
            _wall((2 * x_m, y_m), (0.0, 1.0), y_m),
        )
    )


def _wall(centre_m: tuple[float, float], along: tuple[float, float], half_m: float) -> str:
    return (
        f'<geom type="box" pos="{centre_m[0]} {centre_m[1]} 1.4" size="{half_m} 1.4 0.02" material="wall"'
        f' xyaxes="{along[0]} {along[1]} 0 0 0 1"/>'
    )


def _box(low_m: tuple[float, float, float], high_m: tuple[float, float, float], colour: str) -> str:
    """Return a box, as MJCF, between two opposite corners."""
    centre = [(low + high) / 2 for low, high in zip(low_m, high_m, strict=True)]
    half = [(high - low) / 2 for low, high in zip(low_m, high_m, strict=True)]
    return f'<geom type="box" pos="{_number_text(centre)}" size="{_number_text(half)}" rgba="{colour}"/>'


def _machine(machine: Machine) -> str:
    """Return a machine on its table as MJCF, with its moving parts as hinged bodies and a tile for each tag."""
    joints = "".join(_moving_part(machine, joint) for joint in machine.joints)
    tiles = "".join(_tile(tag) for tag in machine.tags_on(Part.BASE))
    place = _pose_attributes(machine.map_from_base)
    return f'<body name="{machine.name}" {place}>{_housing(machine)}{tiles}{joints}</body>'


def _moving_part(machine: Machine, joint: Joint) -> str:
    name = _body_name(machine, joint.part)
    tiles = "".join(_tile(tag) for tag in machine.tags_on(joint.part))
    hinge = f'<joint name="{name}" type="hinge" axis="{_number_text(joint.axis)}"/>'
    inertia = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    shape = _moving_shape(machine, joint.part)
    return f'<body name="{name}" {_pose_attributes(joint.base_from_part)}>{inertia}{hinge}{shape}{tiles}</body>'


def _body_name(machine: Machine, part: Part) -> str:
    return f"{machine.name}_{part}"


def _tile(tag: Tag) -> str:
    """Return a thin tile for a tag as MJCF. The upper face of the tile lies in the tag's plane."""
    half_m = tag.size_m * TILE_PER_TAG / 2
    tile_pose = tag.part_from_tag @ Pose(np.eye(3), np.array([0.0, 0.0, -_TILE_THICKNESS_M / 2]))
    size = _number_text((half_m, half_m, _TILE_THICKNESS_M / 2))
    return f'<geom type="box" {_pose_attributes(tile_pose)} size="{size}" material="tag_{tag.tag_id}"/>'


def _board(tag: Tag, centre_m: tuple[float, float], half_m: tuple[float, float]) -> str:
    """Return a board, as MJCF, under the tile of a tag.

    Args:
        tag: the tag. The board is parallel to its plane.
        centre_m: the centre of the board in the tag's frame: right, up.
        half_m: half the width and half the height of the board.
    """
    board_pose = tag.part_from_tag @ Pose(np.eye(3), np.array([*centre_m, -_TILE_THICKNESS_M - 0.008]))
    return f'<geom type="box" {_pose_attributes(board_pose)} size="{_number_text((*half_m, 0.008))}" rgba="{_WHITE}"/>'


def _housing(machine: Machine) -> str:
    """Return the fixed bodies of a machine as MJCF: the table, the housing and its front panel."""
    match machine.shape:
        case Shape.CENTRIFUGE:
            return _centrifuge_housing(machine)
        case Shape.PCR_CYCLER:
            return _pcr_cycler_housing(machine)
        case Shape.SHAKER:
            return _shaker_housing(machine)


def _centrifuge_housing(machine: Machine) -> str:
    front_left, _, mast = machine.tags_on(Part.BASE)
    return "".join(
        (
            _box((-0.40, -0.55, -0.04), (0.45, 0.55, 0.0), _GREY),
            _box((-0.34, -0.48, -0.50), (0.36, 0.48, -0.04), _DARK),
            _box((-0.30, -0.38, 0.0), (0.30, 0.38, 0.235), _WHITE),
            _box((-0.30, -0.38, 0.235), (0.30, -0.20, 0.32), _WHITE),
            _box((-0.30, 0.20, 0.235), (0.30, 0.38, 0.32), _WHITE),
            _box((0.20, -0.20, 0.235), (0.30, 0.20, 0.32), _WHITE),
            _box((-0.30, -0.20, 0.235), (-0.20, 0.20, 0.32), _WHITE),
            _board(front_left, (0.29, -0.045), (0.38, 0.12)),
            _box((-0.29, -0.335, 0.32), (-0.27, -0.295, 0.52), _DARK),
            _board(mast, (0.0, 0.0), (0.064, 0.064)),
        )
    )


def _pcr_cycler_housing(machine: Machine) -> str:
    front_left = machine.tags_on(Part.BASE)[0]
    return "".join(
        (
            _box((-0.30, -0.60, -0.04), (0.35, 0.60, 0.0), _GREY),
            _box((-0.25, -0.55, -0.72), (0.28, -0.50, -0.04), _DARK),
            _box((-0.25, 0.50, -0.72), (0.28, 0.55, -0.04), _DARK),
            _box((-0.18, -0.17, 0.0), (0.15, 0.17, 0.20), _WHITE),
            _board(front_left, (0.125, -0.042), (0.17, 0.098)),
        )
    )


def _shaker_housing(machine: Machine) -> str:
    front_left = machine.tags_on(Part.BASE)[0]
    return "".join(
        (
            _box((-0.30, -0.42, -0.04), (0.36, 0.42, 0.0), _GREY),
            _box((-0.25, -0.37, -0.64), (0.28, -0.32, -0.04), _DARK),
            _box((-0.25, 0.32, -0.64), (0.28, 0.37, -0.04), _DARK),
            _box((-0.22, -0.24, 0.0), (0.20, 0.24, 0.25), _WHITE),
            _board(front_left, (0.18, -0.05), (0.24, 0.11)),
        )
    )


def _moving_shape(machine: Machine, part: Part) -> str:
    """Return the geoms of a moving part as MJCF, in the part's own frame."""
    tag = machine.tags_on(part)[0]
    if part is Part.ROTOR:
        return f'<geom type="cylinder" pos="0 0 -0.024" size="0.17 0.02" rgba="{_GREY}"/>'
    if part is Part.LATCH:
        lever = _box((-0.012, -0.02, -0.012), (0.012, tag.part_from_tag.translation_m[1], -0.005), _DARK)
        return lever + _knob() if machine.shape is Shape.PCR_CYCLER else lever
    if machine.shape is Shape.SHAKER:
        return _shaker_lid(tag)
    if machine.shape is Shape.CENTRIFUGE:
        handle = _box((0.49, -0.07, 0.055), (0.53, 0.07, 0.075), _DARK)
        return (
            _box((0.0, -0.225, 0.0), (0.455, 0.225, 0.125), _WHITE) + _board(tag, (0.15, 0.0), (0.225, 0.065)) + handle
        )
    lid = _box((0.0, -0.145, 0.0), (0.32, 0.145, 0.10), _WHITE) + _board(tag, (0.095, 0.0), (0.145, 0.05))
    return lid + _handle_beside_the_lid()


def _shaker_lid(tag: Tag) -> str:
    handle = _box((0.41, -0.05, 0.045), (0.45, 0.05, 0.065), _DARK)
    return _box((0.0, -0.19, 0.0), (0.37, 0.19, 0.11), _WHITE) + _board(tag, (0.115, 0.0), (0.19, 0.056)) + handle


def _handle_beside_the_lid() -> str:
    """Return, as MJCF, a bar along the right side of the lid, with a cross-bar for the hand at the bar's front end."""
    x_m, y_m, z_m = PCR_CYCLER_HANDLE_M
    low_m, high_m = z_m - 0.006, z_m + 0.006
    return "".join(
        (
            _box((0.06, 0.145, low_m), (0.08, 0.172, high_m), _DARK),
            _box((0.06, 0.172, low_m), (x_m + 0.006, 0.184, high_m), _DARK),
            _box((x_m - 0.006, 0.184, low_m), (x_m + 0.006, y_m + 0.03, high_m), _DARK),
        )
    )


def _knob() -> str:
    """Return, as MJCF, a stalk that sticks out of the lever, for the hand."""
    x_m, y_m, z_m = PCR_CYCLER_KNOB_M
    return _box((x_m - 0.006, y_m - 0.006, -0.012), (x_m + 0.006, y_m + 0.006, z_m), _DARK)


# A visitor

_PERSON = "person"


def _has_visitors(laboratory: Laboratory) -> bool:
    return any(isinstance(disturbance, PersonBefore) for disturbance in laboratory.disturbances)


def _visitor() -> str:
    """Return, as MJCF, a person in a dark coat, 1.75 m tall, standing on the floor."""
    coat = '<geom type="capsule" fromto="0 0 0.35 0 0 1.28" size="0.21" rgba="0.20 0.24 0.34 1"/>'
    head = '<geom type="sphere" pos="0 0 1.63" size="0.12" rgba="0.78 0.62 0.52 1"/>'
    return f'<body name="{_PERSON}" mocap="true">{coat}{head}</body>'


# The robot. Its bodies are "mocap" bodies, which `Stage.place` puts into the poses of a state. In the hand's frame,
# x is right, y is down and z is forward, as in the camera's frame.

FINGER_TIP_M = (0.0, 0.06, 0.24)
"""The point where the fingers grip, in the camera's frame, if the hand is extended."""

_DRAWN_BACK_M = 0.30
"""How far the hand is drawn back if it is not extended. The camera then does not see the hand."""


def _robot_bodies() -> Iterator[str]:
    chassis = _box((-0.35, -0.25, 0.06), (0.25, 0.25, 0.30), _DARK) + _box(
        (-0.06, -0.1, 0.30), (0.16, 0.1, 0.85), _WHITE
    )
    link = f'<geom type="capsule" fromto="0 0 0 0 0 {_LINK_M}" size="0.05" rgba="{_ORANGE}"/>'
    finger = _box((-0.012, 0.048, 0.11), (0.012, 0.072, 0.24), _DARK)
    bodies = {
        "robot_base": chassis,
        "upper_arm": link,
        "forearm": link,
        "palm": _box((-0.06, 0.045, -0.10), (0.06, 0.11, 0.11), _ORANGE),
        "left_finger": finger,
        "right_finger": finger,
        "tray": _box((-0.07, 0.05, 0.20), (0.07, 0.08, 0.30), _GREY),
    }
    for name, shape in bodies.items():
        yield f'<body name="{name}" mocap="true">{shape}</body>'


_MOCAP_BODIES = ("robot_base", "upper_arm", "forearm", "palm", "left_finger", "right_finger", "tray", "camera")


def _robot_poses(state: LabState) -> dict[str, Pose]:
    """Return the pose of every body of the robot in the map."""
    map_from_robot = state.map_from_robot()
    hand = map_from_robot @ state.robot_from_hand() @ _translation(0.0, 0.0, (state.reach - 1.0) * _DRAWN_BACK_M)
    wrist_m = _wrist_m(state)
    elbow_m = _elbow_m(wrist_m)
    return {
        "robot_base": map_from_robot,
        "upper_arm": map_from_robot @ _pose_along(np.array(_SHOULDER_M), elbow_m),
        "forearm": map_from_robot @ _pose_along(elbow_m, wrist_m),
        "palm": hand,
        "left_finger": hand @ _translation(-state.opening_m / 2 - 0.012, 0.0, 0.0),
        "right_finger": hand @ _translation(state.opening_m / 2 + 0.012, 0.0, 0.0),
        "tray": hand if state.is_holding else _BELOW_THE_FLOOR,
        "camera": state.map_from_camera(),
    }


_IDENTITY = np.eye(3)
_BELOW_THE_FLOOR = Pose(_IDENTITY, np.array([0.0, 0.0, -5.0]))


def _translation(x_m: float, y_m: float, z_m: float) -> Pose:
    return Pose(_IDENTITY, np.array([x_m, y_m, z_m]))


def shoulder_to_wrist_m(state: LabState) -> float:
    """Return the distance from the shoulder to the wrist. Beyond `ARM_LENGTH_M`, a wrist is out of reach."""
    return float(np.linalg.norm(_wrist_m(state) - np.array(_SHOULDER_M)))


def _wrist_m(state: LabState) -> Array:
    """Return the wrist's position in the robot's base frame: behind and below the camera."""
    return state.robot_from_hand().apply(np.array([0.0, 0.08, -0.15]))


def _elbow_m(wrist_m: Array) -> Array:
    """Return the position of the elbow between shoulder and wrist.

    The two links have the same length. The elbow is bent up and back, or straight if the wrist is too far away.
    """
    shoulder_m = np.array(_SHOULDER_M)
    shoulder_to_wrist = wrist_m - shoulder_m
    forward = (
        np.array([shoulder_to_wrist[0], shoulder_to_wrist[1], 0.0])
        if shoulder_to_wrist[0] >= 0
        else -np.array([shoulder_to_wrist[0], shoulder_to_wrist[1], 0.0])
    )
    forward /= max(length(forward), 1e-9)
    up_and_back = -shoulder_to_wrist[2] * forward + float(shoulder_to_wrist @ forward) * np.array([0.0, 0.0, 1.0])
    length_m = max(length(shoulder_to_wrist), 1e-9)
    bend_m = sqrt(max(_LINK_M**2 - length_m**2 / 4, 0.0))
    elbow: Array = shoulder_m + shoulder_to_wrist / 2 + up_and_back / length_m * bend_m
    return elbow


def _pose_along(start_m: Array, end_m: Array) -> Pose:
    """Return a pose at `start_m` whose z axis points to `end_m`."""
    z = (end_m - start_m) / max(length(end_m - start_m), 1e-9)
    helper = np.array([0.0, 1.0, 0.0]) if abs(z[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = cross(helper, z)
    x /= length(x)
    return Pose(columns(x, cross(z, x), z), start_m)


def _pose_attributes(pose: Pose) -> str:
    """Return a pose as MJCF attributes."""
    axes = (*pose.rotation[:, 0], *pose.rotation[:, 1])
    return f'pos="{_number_text(pose.translation_m)}" xyaxes="{_number_text(axes)}"'


def _number_text(values: Iterable[float]) -> str:
    return " ".join(f"{float(value):.9g}" for value in values)
