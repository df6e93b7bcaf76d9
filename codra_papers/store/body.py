"""The robot's body as its own code sees it: sensor readings and commands, but nothing of the true state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from math import pi, radians
from typing import Protocol

import numpy as np

from codra_papers.store.geometry import Floats, Point, Pose2D

CAMERA_POSE = Pose2D(0.45, 0.0)
CAMERA_VIEW_RAD = radians(87.0)
CAMERA_VIEW_HEIGHT_RAD = radians(58.0)
CAMERA_NEAREST_M, CAMERA_FARTHEST_M = 0.3, 6.0
"""The camera in the robot's front, as described in its data sheet (Intel D435i, depth)."""

STEADY_BELOW_RAD_S = 0.3
"""While the robot turns faster than this, the camera's pictures are blurred and useless."""


class Side(StrEnum):
    """The lasers, named after the directions in which they look."""

    FRONT_LEFT = "front_left"
    FRONT_RIGHT = "front_right"
    BACK = "back"


FRONT = (Side.FRONT_LEFT, Side.FRONT_RIGHT)


class Way(StrEnum):
    """The direction in which the robot drives."""

    FORWARD = "forward"
    BACKWARD = "backward"


class Lift(StrEnum):
    """The direction in which the fork moves."""

    UP = "up"
    DOWN = "down"


class Outcome(StrEnum):
    """The result of a command."""

    DONE = "done"
    STOPPED = "stopped"
    BLOCKED = "blocked"
    BUMPED = "bumped"


class ObjectKind(StrEnum):
    """The kinds of objects that the camera distinguishes."""

    PERSON = "person"
    CONTAINER = "container"


LASER_POSES = {
    Side.FRONT_LEFT: Pose2D(0.45, 0.35, radians(70.0)),
    Side.FRONT_RIGHT: Pose2D(0.45, -0.35, radians(-70.0)),
    Side.BACK: Pose2D(-0.75, 0.0, pi),
}
"""The poses of the lasers in the robot's frame. The lasers at the front corners also look to the sides.

The laser at the tip of the fork sees the wheels of containers, not their frames."""


@dataclass(frozen=True, kw_only=True)
class Scan:
    """The rays of one laser at one instant.

    Attributes:
        mount: the pose of the laser in the robot's frame.
        bearings_rad: directions of the rays, relative to the mount's heading; shape (rays,).
        ranges_m: lengths of the rays; `farthest_m` for a ray that hits no object; shape (rays,).
    """

    instant_s: float
    mount: Pose2D
    bearings_rad: Floats
    ranges_m: Floats
    farthest_m: float

    def points_m(self) -> Floats:
        """Return the points that the rays hit, in the robot's frame, from right to left; shape (points, 2)."""
        return self._points_m

    @cached_property
    def _points_m(self) -> Floats:
        has_hit = self.ranges_m < self.farthest_m
        bearings, ranges = self.bearings_rad[has_hit] + self.mount.heading_rad, self.ranges_m[has_hit]
        points: Floats = np.stack(
            (self.mount.x_m + ranges * np.cos(bearings), self.mount.y_m + ranges * np.sin(bearings)), axis=1
        )
        return points


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One object that a detector recognises in a picture of the camera.

    Attributes:
        at: the pose of the object in the robot's frame. For a person, who has no front, the heading is 0.
        share: the share of the object that is in sight, from 0 to 1.
    """

    kind: ObjectKind
    at: Pose2D
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """The detections in one picture of the camera.

    Attributes:
        is_steady: whether the robot moved slowly enough for a sharp picture.
    """

    instant_s: float
    is_steady: bool
    sightings: tuple[Sighting, ...]


EndCallback = Callable[[Outcome], None]
StopFunction = Callable[[], None]
"""A function that brakes and ends a command as stopped. If the command has ended or was replaced, it does nothing."""


class Body(Protocol):
    """The robot's hardware with the manufacturer's own layer (P2: MIRA and CogniDrive)."""

    def believed_pose(self) -> Pose2D:
        """Return the pose from the localisation, which is a few centimetres off."""
        ...

    def localisation_spread_m(self) -> float:
        """Return the uncertainty that the localisation reports."""
        ...

    def scan(self, side: Side) -> Scan:
        """Return the latest scan of a laser."""
        ...

    def look(self) -> Picture:
        """Return the latest picture."""
        ...

    def battery_percent(self) -> float:
        """Return the level of the battery."""
        ...

    def is_charging(self) -> bool:
        """Return whether the robot is at the dock and charges."""
        ...

    def has_load(self) -> bool:
        """Return whether the fork carries a load, measured by the weight on the fork."""
        ...

    def is_bumped(self) -> bool:
        """Return whether a bumper was touched within the last two seconds."""
        ...

    def speed_m_s(self) -> float:
        """Return the speed of the robot: negative when it drives backwards."""
        ...

    def set_max_speed(self, speed_m_s: float) -> None:
        """Drive no faster than this from now on."""
        ...

    def drive(self, points_m: Sequence[Point], way: Way, done: EndCallback) -> StopFunction:
        """Drive from point to point by the believed pose. Backwards, the robot drives without turning on the spot."""
        ...

    def turn(self, angle_rad: float, done: EndCallback) -> StopFunction:
        """Turn on the spot."""
        ...

    def lift(self, lift: Lift, done: EndCallback) -> StopFunction:
        """Raise or lower the fork."""
        ...
