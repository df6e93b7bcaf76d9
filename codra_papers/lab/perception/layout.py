"""The laboratory as built: machines, their joints, and the AprilTags on the machines, as a tag survey would list them.

Perception may use this module, because a robot has a map of the tags. Perception never gets the state of the joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from math import cos, hypot, pi, sin
from threading import Lock
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from codra_papers.lab.perception.frame import Intrinsics
from codra_papers.lab.perception.poses import Array, Pose, rotation_about


class Part(StrEnum):
    """The rigid parts of a machine that carry tags."""

    BASE = "base"
    LID = "lid"
    LATCH = "latch"
    ROTOR = "rotor"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tag:
    """One AprilTag of family 36h11 on a part.

    Attributes:
        tag_id: the number of the tag in the family; unique in the laboratory.
        part: the part that carries the tag.
        size_m: the length of a side of the black square.
        part_from_tag: the pose of the tag's frame: origin in the centre, x right, y up, z out of the face to the
            viewer.
    """

    tag_id: int
    part: Part
    size_m: float
    part_from_tag: Pose

    def corners_m(self) -> Array:
        """Return the black square's corners in the part's frame, shape (4, 3).

        Their order is that of OpenCV's detector: top left, top right, bottom right, bottom left.
        """
        return _corners_m(self)


@lru_cache(maxsize=256)
def _corners_m(tag: Tag) -> Array:
    half = tag.size_m / 2
    square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
    corners_m = tag.part_from_tag.apply(square)
    corners_m.setflags(write=False)
    return corners_m


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joint:
    """A hinge between a machine's base and another part; at 0 rad the part's pose is `base_from_part`.

    Attributes:
        part: the part that moves.
        base_from_part: the pose of the part at 0 rad.
        axis: the axis of the hinge, through the part's origin: a unit vector in the part's own frame. Positive angles
            are right-handed turns about the axis.
        range_rad: the angles at the two ends of the joint's motion.
    """

    part: Part
    base_from_part: Pose
    axis: tuple[float, float, float]
    range_rad: tuple[float, float]


class Shape(StrEnum):
    """The kinds of machines. Machines of one shape differ in their places, their names and the ids of their tags."""

    CENTRIFUGE = "centrifuge"
    PCR_CYCLER = "pcr_cycler"
    SHAKER = "shaker"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Machine:
    """A machine on its table.

    Attributes:
        name: the name of the machine, which is unique in its laboratory and is also the name of the machine's use of
            the template in a spec.
        shape: the kind of the machine.
        map_from_base: the pose of the machine's base (not the robot's base) in the laboratory's map: origin on the
            table top under the middle of the housing, x out of the front towards a user, y to the user's right, z up.
        joints: one joint for each moving part. A larger angle opens the lid further; the latch is locked at 0 rad; the
            rotor turns freely.
        tags: the tags on all parts.
    """

    name: str
    shape: Shape
    map_from_base: Pose
    joints: tuple[Joint, ...]
    tags: tuple[Tag, ...]

    def joint(self, part: Part) -> Joint:
        """Return the joint that moves a part."""
        return next(joint for joint in self.joints if joint.part is part)

    def tags_on(self, part: Part) -> tuple[Tag, ...]:
        """Return the tags that a part carries, in ascending order of their ids."""
        return tuple(tag for tag in self.tags if tag.part is part)

    def map_from_part(self, part: Part, angle_rad: float) -> Pose:
        """Return the pose of a part in the map when the part's joint is at an angle.

        The base has no joint, so for the base the angle is ignored.
        """
        if part is Part.BASE:
            return self.map_from_base
        joint = self.joint(part)
        turn = Pose(rotation_about(joint.axis, angle_rad), np.zeros(3))
        return self.map_from_base @ joint.base_from_part @ turn

    def distance_m(self, map_from_robot: Pose) -> float:
        """Return the horizontal distance from the origin of a robot's base to the origin of this machine's base.

        `in_observable_distance` and `in_manipulation_distance` compare this distance with their limits.
        """
        x_m, y_m, _ = map_from_robot.translation_m - self.map_from_base.translation_m
        return hypot(x_m, y_m)

    def parts(self) -> tuple[Part, ...]:
        """Return the machine's parts: the base first, then the moving parts."""
        return (Part.BASE, *(joint.part for joint in self.joints))

    def at_place(self, x_m: float, y_m: float, heading_rad: float) -> Machine:
        """Return the same machine at another place, with the same table height."""
        height_m = float(self.map_from_base.translation_m[2])
        return replace(self, map_from_base=_table_pose(x_m, y_m, heading_rad, height_m))

    def named(self, name: str, first_tag_id: int) -> Machine:
        """Return the same machine with another name, and with ids of tags that begin at `first_tag_id`."""
        ids = {tag.tag_id: first_tag_id + index for index, tag in enumerate(self.tags)}
        return replace(self, name=name, tags=tuple(replace(tag, tag_id=ids[tag.tag_id]) for tag in self.tags))

    def with_tags(self, scale: float) -> Machine:
        """Return the same machine with tags scaled by a factor, in the same places."""
        return replace(self, tags=tuple(replace(tag, size_m=tag.size_m * scale) for tag in self.tags))


INTRINSICS = Intrinsics(width=640, height=480, focal_px=554.256)
"""The intrinsics of the arm camera, whose view is 60 degrees wide and 46.8 degrees high."""

TILE_PER_TAG = 10 / 8
"""The side of a tag's white tile, divided by that of its black square: 10 cells by 8 cells."""

_CENTRIFUGE_PANEL_RAD = 0.52
_PCR_CYCLER_PANEL_RAD = 0.60
_SHAKER_PANEL_RAD = 0.50
"""For each shape, the elevation of the front panel's normal."""


def _facing_pose(elevation_rad: float, centre_m: tuple[float, float, float]) -> Pose:
    """Return the pose of a tag that faces out of the machine's front, raised by an elevation (pi / 2: straight up)."""
    normal = (cos(elevation_rad), 0.0, sin(elevation_rad))
    up = (-sin(elevation_rad), 0.0, cos(elevation_rad))
    return Pose(np.column_stack(((0.0, 1.0, 0.0), up, normal)), np.array(centre_m))


def _panel_pose(panel: Pose, right_m: float, up_m: float, out_m: float) -> Pose:
    return panel @ Pose(np.eye(3), np.array([right_m, up_m, out_m]))


def _tag(tag_id: int, part: Part, size_m: float, part_from_tag: Pose) -> Tag:
    return Tag(tag_id=tag_id, part=part, size_m=size_m, part_from_tag=part_from_tag)


def _hinge(x_m: float, z_m: float, opens_to_rad: float) -> Joint:
    """Return a lid's hinge along the rear edge. The lid extends in +x of its own frame, so it opens about -y."""
    return Joint(
        part=Part.LID,
        base_from_part=Pose(np.eye(3), np.array([x_m, 0.0, z_m])),
        axis=(0.0, -1.0, 0.0),
        range_rad=(0.0, opens_to_rad),
    )


def _lever(pivot: Pose) -> Joint:
    """Return the joint of a latch lever in the plane of the front panel.

    The lever is upright at 0 rad (locked), and turned to its left at 1 rad (unlocked).
    """
    return Joint(part=Part.LATCH, base_from_part=pivot, axis=(0.0, 0.0, 1.0), range_rad=(0.0, 1.0))


def _centrifuge() -> Machine:
    """Return a floor centrifuge, 0.76 m wide, with six tags far apart, and two more on the rotor under the lid.

    The lid's tags face out of its front edge and a little down, so that they are seen from above when the lid is
    closed, and from the front when the lid is open.
    """
    panel = _facing_pose(_CENTRIFUGE_PANEL_RAD, (0.36, 0.0, 0.22))
    rotor = Joint(
        part=Part.ROTOR,
        base_from_part=Pose(np.eye(3), np.array([0.0, 0.0, 0.28])),
        axis=(0.0, 0.0, 1.0),
        range_rad=(0.0, 2 * pi),
    )
    tags = (
        _tag(10, Part.BASE, 0.100, _panel_pose(panel, -0.29, 0.045, 0.0)),
        _tag(11, Part.BASE, 0.100, _panel_pose(panel, 0.29, 0.045, 0.0)),
        _tag(12, Part.BASE, 0.100, _facing_pose(0.5, (-0.25, -0.315, 0.54))),
        _tag(13, Part.LID, 0.100, _facing_pose(-0.31, (0.485, -0.150, 0.065))),
        _tag(14, Part.LID, 0.100, _facing_pose(-0.31, (0.485, 0.150, 0.065))),
        _tag(15, Part.LATCH, 0.064, _lever_tag_pose(0.08)),
        _tag(16, Part.ROTOR, 0.080, _facing_pose(pi / 2, (0.085, 0.0, 0.0))),
        _tag(17, Part.ROTOR, 0.080, _facing_pose(pi / 2, (-0.085, 0.0, 0.0))),
    )
    return Machine(
        name=Shape.CENTRIFUGE.value,
        shape=Shape.CENTRIFUGE,
        map_from_base=_table_pose(2.2, 5.2, -pi / 2, 0.50),
        joints=(_hinge(-0.22, 0.33, 1.35), _lever(_panel_pose(panel, 0.0, -0.06, 0.02)), rotor),
        tags=tags,
    )


def _pcr_cycler() -> Machine:
    """Return a bench-top PCR-cycler, 0.34 m wide, with eight tags close together. Every view of it shows most tags.

    The PCR-cycler is in the middle of the room, so views of it have the centrifuge in the background.
    """
    panel = _facing_pose(_PCR_CYCLER_PANEL_RAD, (0.21, 0.0, 0.11))
    tags = (
        _tag(20, Part.BASE, 0.064, _panel_pose(panel, -0.125, 0.042, 0.0)),
        _tag(21, Part.BASE, 0.064, _panel_pose(panel, 0.125, 0.042, 0.0)),
        _tag(22, Part.BASE, 0.064, _panel_pose(panel, -0.125, -0.042, 0.0)),
        _tag(23, Part.BASE, 0.064, _panel_pose(panel, 0.125, -0.042, 0.0)),
        _tag(24, Part.LID, 0.064, _facing_pose(-0.42, (0.345, -0.095, 0.05))),
        _tag(25, Part.LID, 0.064, _facing_pose(-0.42, (0.345, 0.0, 0.05))),
        _tag(26, Part.LID, 0.064, _facing_pose(-0.42, (0.345, 0.095, 0.05))),
        _tag(27, Part.LATCH, 0.048, _lever_tag_pose(0.05)),
    )
    return Machine(
        name=Shape.PCR_CYCLER.value,
        shape=Shape.PCR_CYCLER,
        map_from_base=_table_pose(3.4, 3.0, -pi / 2, 0.72),
        joints=(_hinge(-0.16, 0.21, 1.15), _lever(_panel_pose(panel, 0.0, -0.045, 0.015))),
        tags=tags,
    )


def shaker(x_m: float, y_m: float, heading_rad: float) -> Machine:
    """Return a bench-top shaker, 0.48 m wide, with three tags on its front, two on its lid and one on its lever.

    The default laboratory does not contain a shaker.

    Args:
        x_m: the x coordinate of the shaker in the map.
        y_m: the y coordinate of the shaker in the map.
        heading_rad: the direction of the shaker's front.
    """
    panel = _facing_pose(_SHAKER_PANEL_RAD, (0.27, 0.0, 0.16))
    tags = (
        _tag(30, Part.BASE, 0.080, _panel_pose(panel, -0.18, 0.045, 0.0)),
        _tag(31, Part.BASE, 0.080, _panel_pose(panel, 0.18, 0.045, 0.0)),
        _tag(32, Part.BASE, 0.080, _panel_pose(panel, -0.18, -0.055, 0.0)),
        _tag(33, Part.LID, 0.080, _facing_pose(-0.36, (0.405, -0.115, 0.055))),
        _tag(34, Part.LID, 0.080, _facing_pose(-0.36, (0.405, 0.115, 0.055))),
        _tag(35, Part.LATCH, 0.056, _lever_tag_pose(0.06)),
    )
    return Machine(
        name=Shape.SHAKER.value,
        shape=Shape.SHAKER,
        map_from_base=_table_pose(x_m, y_m, heading_rad, 0.64),
        joints=(_hinge(-0.19, 0.26, 1.25), _lever(_panel_pose(panel, 0.0, -0.05, 0.018))),
        tags=tags,
    )


def _lever_tag_pose(length_m: float) -> Pose:
    return Pose(np.eye(3), np.array([0.0, length_m, 0.0]))


def _table_pose(x_m: float, y_m: float, heading_rad: float, height_m: float) -> Pose:
    floor_pose = Pose.planar(x_m, y_m, heading_rad)
    return Pose(floor_pose.rotation, np.array([x_m, y_m, height_m]))


MACHINES: Mapping[str, Machine] = MappingProxyType(
    {machine.name: machine for machine in (_centrifuge(), _pcr_cycler())}
)
"""The machines of the laboratory that the protocol describes, by name."""


class _Survey:
    """The tag survey of the laboratory in which this process's robot works."""

    machines: ClassVar[Mapping[str, Machine]] = MACHINES
    lock: ClassVar[Lock] = Lock()


@contextmanager
def surveyed(machines: Iterable[Machine]) -> Iterator[None]:
    """Let perception in this process use these machines until the `with` statement ends.

    Perception functions get the name of a machine and frames, but no laboratory. They know a machine only from the tag
    survey of the laboratory in which the robot works. A process has one survey, because it has one robot.

    Raises:
        RuntimeError: the robot of this process already works in a laboratory.
    """
    if not _Survey.lock.acquire(blocking=False):
        raise RuntimeError("this process's robot already works in a laboratory; run another one in another process")
    before = _Survey.machines
    try:
        _Survey.machines = MappingProxyType({machine.name: machine for machine in machines})
        yield
    finally:
        _Survey.machines = before
        _Survey.lock.release()


def known_tag_ids() -> tuple[int, ...]:
    """Return the ids of all tags that the survey lists, in ascending order."""
    return tuple(sorted(tag.tag_id for machine in _Survey.machines.values() for tag in machine.tags))


def machine_named(name: str) -> Machine:
    """Return a machine of the survey.

    Raises:
        ValueError: the survey has no machine of that name.
    """
    if name not in _Survey.machines:
        known = ", ".join(_Survey.machines)
        raise ValueError(f"there is no machine '{name}' in the laboratory; its machines are {known}")
    return _Survey.machines[name]
