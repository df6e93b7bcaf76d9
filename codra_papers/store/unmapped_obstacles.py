"""What the lasers meet that is not on the robot's map, and who may stand there.

Lasers meet the near side of somebody only, and beside the fork little of that: the body is behind what they meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

import numpy as np
import numpy.typing as npt

from codra_papers.store.body import Scan
from codra_papers.store.geometry import Floats, Point, Pose2D
from codra_papers.store.layout import AREAS, BODY_BACK_M, BODY_FRONT_M, BODY_WIDTH_M, FORK_TIP_M, FORK_WIDTH_M
from codra_papers.store.routes import clearances_m

WITHIN_M = 3.0
"""What is farther away may be gone before the robot is there."""

OFF_MAP_M = 0.2
"""What lasers see nearer than this to a shelf or a wall is taken for it."""

OF_CONTAINER_M = 0.6
"""What they see nearer than this to the middle of a container is taken for it."""

PERSON_M = 0.25
"""The radius of somebody's body."""

CORE_M = 0.2
"""Through what is nearer than this to the middle of a body no ray goes, with the noise of a laser."""

PLACES_M = tuple(place.point_m for area in AREAS.values() for place in area.places)
"""Where containers are kept."""


def is_strange(points_m: Floats, robot: Pose2D, containers_m: Sequence[Point]) -> npt.NDArray[np.bool_]:
    """Return which of some points, in the robot's frame, neither the map nor a container explains; shape (points,)."""
    if not len(points_m):
        return np.zeros(0, dtype=bool)
    east, north = cos(robot.heading_rad), sin(robot.heading_rad)
    on_map = points_m @ np.array([[east, north], [-north, east]]) + robot.point_m
    strange: npt.NDArray[np.bool_] = clearances_m(on_map) > OFF_MAP_M
    if containers_m:
        apart_m = np.linalg.norm(on_map[:, None] - np.array(containers_m), axis=2)
        strange &= (apart_m >= OF_CONTAINER_M).all(axis=1)
    return strange


def bodies_m(scan: Scan) -> Floats:
    """Return for each point that a laser meets the middle of a body whose near side it would be; shape (points, 2)."""
    points = scan.points_m()
    ways = points - (scan.mount.x_m, scan.mount.y_m)
    found: Floats = points + PERSON_M * ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)
    return found


def is_seen_through(scan: Scan, bodies: Floats) -> npt.NDArray[np.bool_]:
    """Return where no body can be, for a ray of a laser goes in where its core would be; shape (bodies,)."""
    turns = scan.bearings_rad + scan.mount.heading_rad
    to_body = bodies - (scan.mount.x_m, scan.mount.y_m)
    along_m = np.stack((np.cos(turns), np.sin(turns)), axis=1) @ to_body.T
    depth_m2 = CORE_M**2 - ((to_body**2).sum(axis=1) - along_m**2)
    entry_m = along_m - np.sqrt(np.maximum(depth_m2, 0.0))
    is_passed = (depth_m2 > 0.0) & (along_m > 0.0) & (scan.ranges_m[:, None] > entry_m)
    found: npt.NDArray[np.bool_] = np.any(is_passed, axis=0)
    return found


def gaps_m(bodies: Floats, *, is_loaded: bool) -> Floats:
    """Return how far bodies are from the robot and what it carries: negative inside; shape (bodies,)."""
    x_m, y_m = bodies[:, 0], np.abs(bodies[:, 1])
    fork_half_m = (BODY_WIDTH_M if is_loaded else FORK_WIDTH_M) / 2
    body = np.hypot(np.maximum(np.maximum(BODY_BACK_M - x_m, x_m - BODY_FRONT_M), 0.0),
                    np.maximum(y_m - BODY_WIDTH_M / 2, 0.0))  # fmt: skip
    fork = np.hypot(np.maximum(np.maximum(FORK_TIP_M - x_m, x_m - BODY_BACK_M), 0.0),
                    np.maximum(y_m - fork_half_m, 0.0))  # fmt: skip
    gaps: Floats = np.minimum(body, fork) - PERSON_M
    return gaps
