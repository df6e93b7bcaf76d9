"""Laser points that are not on the robot's map, and the people who may be there.

A laser hits only the side of a person that faces the laser, and beside the fork only a small part of this side. The
person's body is behind the points that the laser hits.
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

FARTHEST_OBSTACLE_M = 3.0
"""Objects farther away than this are ignored, because they may be gone before the robot arrives."""

OFF_MAP_M = 0.2
"""Points nearer than this to a shelf or a wall belong to the shelf or the wall."""

CONTAINER_RADIUS_M = 0.6
"""Points nearer than this to the middle of a container belong to the container."""

PERSON_M = 0.25
"""The radius of a person's body."""

CORE_M = 0.2
"""No ray passes nearer than this to the middle of a body, even with the noise of a laser."""

CONTAINER_PLACES_M = tuple(place.point_m for area in AREAS.values() for place in area.places)
"""The places for containers."""


def is_strange(points_m: Floats, robot: Pose2D, containers_m: Sequence[Point]) -> npt.NDArray[np.bool_]:
    """Return, for each point in the robot's frame, whether neither map nor container explains it; shape (points,)."""
    if not len(points_m):
        return np.zeros(0, dtype=bool)
    east, north = cos(robot.heading_rad), sin(robot.heading_rad)
    map_points_m = points_m @ np.array([[east, north], [-north, east]]) + robot.point_m
    unexplained: npt.NDArray[np.bool_] = clearances_m(map_points_m) > OFF_MAP_M
    if containers_m:
        distances_m = np.linalg.norm(map_points_m[:, None] - np.array(containers_m), axis=2)
        unexplained &= (distances_m >= CONTAINER_RADIUS_M).all(axis=1)
    return unexplained


def bodies_m(scan: Scan) -> Floats:
    """Return, for each laser point, the middle of a body that the ray would hit at this point; shape (points, 2)."""
    points = scan.points_m()
    directions = points - (scan.mount.x_m, scan.mount.y_m)
    middles: Floats = points + PERSON_M * directions / np.maximum(
        np.linalg.norm(directions, axis=1, keepdims=True), 1e-9
    )
    return middles


def is_seen_through(scan: Scan, bodies: Floats) -> npt.NDArray[np.bool_]:
    """Return, for each body, whether the body is impossible because a ray passes through its core; shape (bodies,)."""
    angles_rad = scan.bearings_rad + scan.mount.heading_rad
    to_body = bodies - (scan.mount.x_m, scan.mount.y_m)
    along_m = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=1) @ to_body.T
    depth_m2 = CORE_M**2 - ((to_body**2).sum(axis=1) - along_m**2)
    entry_m = along_m - np.sqrt(np.maximum(depth_m2, 0.0))
    is_passed = (depth_m2 > 0.0) & (along_m > 0.0) & (scan.ranges_m[:, None] > entry_m)
    is_impossible: npt.NDArray[np.bool_] = np.any(is_passed, axis=0)
    return is_impossible


def gaps_m(bodies: Floats, *, is_loaded: bool) -> Floats:
    """Return the distances of bodies from the robot and its load: negative if they overlap; shape (bodies,)."""
    x_m, y_m = bodies[:, 0], np.abs(bodies[:, 1])
    fork_half_m = (BODY_WIDTH_M if is_loaded else FORK_WIDTH_M) / 2
    body_gaps_m = np.hypot(np.maximum(np.maximum(BODY_BACK_M - x_m, x_m - BODY_FRONT_M), 0.0),
                    np.maximum(y_m - BODY_WIDTH_M / 2, 0.0))  # fmt: skip
    fork_gaps_m = np.hypot(np.maximum(np.maximum(FORK_TIP_M - x_m, x_m - BODY_BACK_M), 0.0),
                    np.maximum(y_m - fork_half_m, 0.0))  # fmt: skip
    gaps: Floats = np.minimum(body_gaps_m, fork_gaps_m) - PERSON_M
    return gaps
