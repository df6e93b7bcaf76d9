"""The shop: 20 m by 15 m, shelves with corridors of 2 m between them (P2, section 6), and the named poses.

Five rows of shelves run from 4 m to 13 m north; in front of them is an open zone. A picking area is a recess for roll
containers in a row. The recess is open to the corridor east of the row. From the first observation pose of an area, the
shelf hides the southern end of the recess. From the second pose, this end is in sight (P2, Figure 8).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from types import MappingProxyType

from codra_papers.store.geometry import Box, Pose2D

LENGTH_M, DEPTH_M = 20.0, 15.0
CORRIDOR_M = 2.0
ROWS_WEST_M = (2.0, 5.6, 9.2, 12.8, 16.4)
ROW_WIDTH_M = 1.6
ROW_SOUTH_M, ROW_NORTH_M = 4.0, 13.0
PANEL_M = 0.1
"""Thickness of the panel at the back of a recess."""

CORRIDORS_X_M = (1.0, 4.6, 8.2, 11.8, 15.4, 19.0)
"""The middles of the corridors between the rows."""

FRONT_Y_M, BACK_Y_M = 2.0, 14.0
"""The middles of the ways in front of the rows and behind the rows."""

CONTAINER_M = 0.7
"""The length and width of a roll container."""

WHEEL_OFFSET_M = 0.3
WHEEL_RADIUS_M = 0.05
"""Radius of the wheels. The four wheels are `WHEEL_OFFSET_M` from the container's middle along both of its axes."""

BODY_FRONT_M, BODY_BACK_M, FORK_TIP_M = 0.45, 0.0, -0.75
BODY_WIDTH_M, FORK_WIDTH_M = 0.7, 0.4
REACH_M = 0.83
"""Distance of the robot's farthest corner from its axle. The robot turns about the axle."""

FORK_M = 0.4
"""How far the middle of the fork, and of a container on the fork, is behind the robot's axle."""

DEPTH_OF_PLACE_M = 1.0
"""Depth of a container's middle in a recess."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recess:
    """An opening in a row of shelves.

    Attributes:
        row: the number of the row; the row farthest in the west has the number 0.
    """

    row: int
    south_m: float
    north_m: float

    @property
    def corridor_x_m(self) -> float:
        """Return the middle of the corridor to which the recess opens."""
        return CORRIDORS_X_M[self.row + 1]

    def place(self, y_m: float) -> Pose2D:
        """Return the pose in the recess of a container that faces the corridor."""
        return Pose2D(ROWS_WEST_M[self.row] + ROW_WIDTH_M - DEPTH_OF_PLACE_M, y_m, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Area:
    """An area for containers, with the robot's poses around it (P2, Figure 8).

    Attributes:
        observation_poses: the poses from which the robot looks for a container, in order.
        delivery: the pose of the robot when it sets down a container.
        places: the places for containers; containers are delivered to the first of them.
    """

    name: str
    recess: Recess
    observation_poses: tuple[Pose2D, ...]
    places: tuple[Pose2D, ...]

    @property
    def delivery(self) -> Pose2D:
        """Return the robot's pose when a container on its fork is at the first place."""
        return robot_at(self.places[0])

    @property
    def approach(self) -> Pose2D:
        """Return the pose where the robot begins to back up to the delivery pose."""
        return approach_to(self.places[0])


def robot_at(container: Pose2D) -> Pose2D:
    """Return the robot's pose when its fork is under a container."""
    return container.pose_ahead(FORK_M)


def approach_to(container: Pose2D) -> Pose2D:
    """Return the pose in the corridor from which the robot backs up, fork first, to a container in a recess."""
    return container.pose_ahead(DEPTH_OF_PLACE_M + CORRIDOR_M / 2)


def _picking_area(name: str, row: int) -> Area:
    recess = Recess(row=row, south_m=7.0, north_m=10.2)
    x_m = recess.corridor_x_m
    return Area(
        name=name,
        recess=recess,
        observation_poses=(Pose2D(x_m, recess.south_m - 1.9, 2.1), Pose2D(x_m, recess.north_m + 0.8, pi + 0.9)),
        places=(recess.place(9.4), recess.place(7.6)),
    )


def _single_place_area(name: str, south_m: float) -> Area:
    recess = Recess(row=4, south_m=south_m, north_m=south_m + 1.8)
    middle_m = south_m + 0.9
    return Area(
        name=name,
        recess=recess,
        observation_poses=(Pose2D(recess.corridor_x_m, middle_m, pi),),
        places=(recess.place(middle_m),),
    )


PICKING_AREAS: Mapping[str, Area] = MappingProxyType(
    {name: _picking_area(name, row) for row, name in enumerate(("area_1", "area_2", "area_3", "area_4"))}
)
"""Where pickers work."""

SUPPLY = _single_place_area("supply", 5.0)
"""Where an empty container waits for the robot."""

DELIVERY = _single_place_area("delivery", 9.0)
"""The general delivery pose (P2, section 5.1): staff take away the containers that are set down here."""

AREAS: Mapping[str, Area] = MappingProxyType({**PICKING_AREAS, SUPPLY.name: SUPPLY, DELIVERY.name: DELIVERY})

START = Pose2D(8.2, 2.0, pi / 2)
"""Where the robot waits for orders."""

DOCK = Pose2D(1.0, 1.0, pi)
"""Where the robot charges."""


def _row(row: int) -> list[Box]:
    west_m, east_m = ROWS_WEST_M[row], ROWS_WEST_M[row] + ROW_WIDTH_M
    boxes, built_until_m = [], ROW_SOUTH_M
    for recess in sorted((area.recess for area in AREAS.values() if area.recess.row == row), key=lambda r: r.south_m):
        boxes.append(Box.between(west_m, built_until_m, east_m, recess.south_m))
        boxes.append(Box.between(west_m, recess.south_m, west_m + PANEL_M, recess.north_m))
        built_until_m = recess.north_m
    return [*boxes, Box.between(west_m, built_until_m, east_m, ROW_NORTH_M)]


def _walls() -> tuple[Box, ...]:
    thickness_m = 0.2
    return (
        Box.between(-thickness_m, -thickness_m, LENGTH_M + thickness_m, 0.0),
        Box.between(-thickness_m, DEPTH_M, LENGTH_M + thickness_m, DEPTH_M + thickness_m),
        Box.between(-thickness_m, 0.0, 0.0, DEPTH_M),
        Box.between(LENGTH_M, 0.0, LENGTH_M + thickness_m, DEPTH_M),
    )


SHELVES = tuple(box for row in range(len(ROWS_WEST_M)) for box in _row(row))
WALLS = _walls()
FIXED_BOXES = (*SHELVES, *WALLS)
"""All fixed objects."""
