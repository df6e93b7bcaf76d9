"""The complete true state of the shop at one instant, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from codra_papers.store.geometry import Box, Disc, Point, Pose2D, Scene
from codra_papers.store.layout import (
    BODY_BACK_M,
    BODY_FRONT_M,
    BODY_WIDTH_M,
    CONTAINER_M,
    FIXED_BOXES,
    FORK_TIP_M,
    FORK_WIDTH_M,
    REACH_M,
    WHEEL_OFFSET_M,
    WHEEL_RADIUS_M,
)


class Load(StrEnum):
    """The load of a container."""

    EMPTY = "empty"
    LOADING = "loading"
    FULL = "full"


class Whereabouts(StrEnum):
    """Where a container is."""

    FLOOR = "floor"
    FORK = "fork"
    BACK_ROOM = "back room"


@dataclass(frozen=True, slots=True, kw_only=True)
class Container:
    """A roll container.

    Attributes:
        at: the pose in the map, even while the container is on the fork; in the back room the pose has no meaning.
    """

    name: str
    at: Pose2D
    load: Load = Load.EMPTY
    where: Whereabouts = Whereabouts.FLOOR

    def box(self) -> Box:
        """Return the space of the container on the floor."""
        return Box(self.at, CONTAINER_M, CONTAINER_M)

    def wheels(self) -> tuple[Disc, ...]:
        """Return the wheels of the container, its only parts near the floor."""
        offsets = [(a * WHEEL_OFFSET_M, b * WHEEL_OFFSET_M) for a in (1, -1) for b in (1, -1)]
        return tuple(Disc(self.at.point_at(*offset), WHEEL_RADIUS_M) for offset in offsets)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotState:
    """The robot's body.

    Attributes:
        at: the pose of the robot's axle.
        turn_rate_rad_s: the turn rate, positive counter-clockwise.
        is_fork_up: whether the fork is raised.
        bumped_s: when a bumper was last touched.
    """

    at: Pose2D
    speed_m_s: float = 0.0
    turn_rate_rad_s: float = 0.0
    is_fork_up: bool = False
    battery_percent: float = 100.0
    is_charging: bool = False
    bumped_s: float = -1e9

    def body(self) -> Box:
        """Return the space of the body, in front of the fork."""
        return _part_box(self.at, BODY_BACK_M, BODY_FRONT_M, BODY_WIDTH_M)

    def fork(self) -> Box:
        """Return the space of the fork."""
        return _part_box(self.at, FORK_TIP_M, BODY_BACK_M, FORK_WIDTH_M)

    def surface_speed_m_s(self) -> float:
        """Return an upper bound for the speed of the robot's points: its speed plus its turn rate times its reach."""
        return abs(self.speed_m_s) + abs(self.turn_rate_rad_s) * REACH_M


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreState:
    """The state of the shop at one instant.

    Attributes:
        step: the number of the step; all steps have the same length.
        people_m: the names and places of the people.
    """

    step: int
    instant_s: float
    robot: RobotState
    containers: tuple[Container, ...]
    people_m: tuple[tuple[str, Point], ...]

    def carried_container(self) -> Container | None:
        """Return the container on the fork; None if the fork is empty."""
        return next((container for container in self.containers if container.where is Whereabouts.FORK), None)

    def containers_on_floor(self) -> tuple[Container, ...]:
        """Return the containers on the floor of the shop."""
        return tuple(container for container in self.containers if container.where is Whereabouts.FLOOR)

    def footprint(self) -> tuple[Box, ...]:
        """Return the space of the robot and its load."""
        return footprint(self.robot, self.carried_container())


def footprint(robot: RobotState, carried_container: Container | None) -> tuple[Box, ...]:
    """Return the space of a robot and its load."""
    robot_boxes = (robot.body(), robot.fork())
    return robot_boxes if carried_container is None else (*robot_boxes, carried_container.box())


SHELL = Scene(FIXED_BOXES)
"""All fixed objects, for rays."""


def _part_box(at: Pose2D, back_m: float, front_m: float, width_m: float) -> Box:
    return Box(at.pose_ahead((back_m + front_m) / 2), front_m - back_m, width_m)
