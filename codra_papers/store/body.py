"""What the robot's own code has of its body: readings of sensors and commands. Nothing here knows what is true."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import pi, radians
from typing import Protocol

import numpy as np

from codra_papers.store.geometry import Floats, Point, Pose2D

CAMERA_AT = Pose2D(0.45, 0.0)
CAMERA_VIEW_RAD = radians(87.0)
CAMERA_VIEW_UP_RAD = radians(58.0)
CAMERA_NEAREST_M, CAMERA_FARTHEST_M = 0.3, 6.0
"""The camera in the robot's front, as its maker describes it (Intel D435i, depth)."""

STEADY_BELOW_RAD_S = 0.3
"""While the robot turns faster, the camera's pictures are blurred and show nothing."""


class Side(StrEnum):
    """Where a laser looks."""

    FRONT_LEFT = "front_left"
    FRONT_RIGHT = "front_right"
    BACK = "back"


FRONT = (Side.FRONT_LEFT, Side.FRONT_RIGHT)


class Way(StrEnum):
    """How the robot drives."""

    FORWARD = "forward"
    BACKWARD = "backward"


class Lift(StrEnum):
    """What the fork does."""

    UP = "up"
    DOWN = "down"


class Outcome(StrEnum):
    """What became of a command."""

    DONE = "done"
    STOPPED = "stopped"
    BLOCKED = "blocked"
    BUMPED = "bumped"


class Seen(StrEnum):
    """What the camera can tell apart."""

    PERSON = "person"
    CONTAINER = "container"


LASERS_AT = {
    Side.FRONT_LEFT: Pose2D(0.45, 0.35, radians(70.0)),
    Side.FRONT_RIGHT: Pose2D(0.45, -0.35, radians(-70.0)),
    Side.BACK: Pose2D(-0.75, 0.0, pi),
}
"""The lasers in the robot's frame; those at the corners of the front look to its sides too.

The one at the tip of the fork sees the wheels of containers, not their frames."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """One turn of a laser.

    Attributes:
        mount: where it is in the robot's frame.
        bearings_rad: of its rays, from the mount's heading; shape (rays,).
        ranges_m: how far each goes; `farthest_m` for one that meets nothing; shape (rays,).
    """

    instant_s: float
    mount: Pose2D
    bearings_rad: Floats
    ranges_m: Floats
    farthest_m: float

    def points_m(self) -> Floats:
        """Return what it has met, in the robot's frame, from right to left as it sees it; shape (points, 2)."""
        is_met = self.ranges_m < self.farthest_m
        bearings, ranges = self.bearings_rad[is_met] + self.mount.heading_rad, self.ranges_m[is_met]
        found: Floats = np.stack(
            (self.mount.x_m + ranges * np.cos(bearings), self.mount.y_m + ranges * np.sin(bearings)), axis=1
        )
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """What a detector finds in one picture of the camera.

    Attributes:
        at: in the robot's frame; of a person, who has no front, the heading is 0.
        share: how much of it is in sight, from 0 to 1.
    """

    kind: Seen
    at: Pose2D
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture of the camera, as its detector sees it.

    Attributes:
        is_steady: whether the robot held still enough for it to show anything.
    """

    instant_s: float
    is_steady: bool
    sightings: tuple[Sighting, ...]


Done = Callable[[Outcome], None]
Stop = Callable[[], None]
"""Brakes and drops a command, which ends as stopped; one that has ended, or given way to another, is left alone."""


class Body(Protocol):
    """The robot's hardware with the manufacturer's own layer (P2: MIRA and CogniDrive)."""

    def believed(self) -> Pose2D:
        """Return where its localisation says that it stands: a few centimetres off."""
        ...

    def localisation_spread_m(self) -> float:
        """Return how far off the localisation takes itself to be."""
        ...

    def scan(self, side: Side) -> Scan:
        """Return the latest turn of a laser."""
        ...

    def look(self) -> Picture:
        """Return the latest picture."""
        ...

    def battery_percent(self) -> float:
        """Return the level of the battery."""
        ...

    def is_charging(self) -> bool:
        """Return whether it stands at the dock and charges."""
        ...

    def has_load(self) -> bool:
        """Return whether the fork weighs something."""
        ...

    def is_bumped(self) -> bool:
        """Return whether a bumper was touched within the last two seconds."""
        ...

    def speed_m_s(self) -> float:
        """Return how fast it drives; negative backwards."""
        ...

    def set_max_speed(self, speed_m_s: float) -> None:
        """Drive no faster than this from now on."""
        ...

    def drive(self, points_m: Sequence[Point], way: Way, done: Done) -> Stop:
        """Drive from point to point, in the believed map; backwards without turning on the spot."""
        ...

    def turn(self, angle_rad: float, done: Done) -> Stop:
        """Turn on the spot."""
        ...

    def lift(self, lift: Lift, done: Done) -> Stop:
        """Raise or lower the fork."""
        ...
