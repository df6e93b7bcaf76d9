"""Laser points that are not on the robot's map, and the people who may be there.

A laser hits only the near side of a person, and beside the fork only a little of this side. The body is behind the
points.
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
"""Farther objects are ignored: they may be gone before the robot arrives."""

OFF_MAP_M = 0.2
"""Points nearer than this to a shelf or a wall belong to it."""

OF_CONTAINER_M = 0.6
"""Points nearer than this to the middle of a container belong to it."""

PERSON_M = 0.25
"""The radius of a person's body."""

CORE_M = 0.2
"""No ray passes nearer than this to the middle of a body, even with the noise of a laser."""

PLACES_M = tuple(place.point_m for area in AREAS.values() for place in area.places)
"""The places for containers."""


def is_strange(points_m: Floats, robot: Pose2D, containers_m: Sequence[Point]) -> npt.NDArray[np.bool_]:
    """Return for each point in the robot's frame whether neither map nor container explains it; shape (points,)."""
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
    """Return for each laser point the middle of a body whose near side is at this point; shape (points, 2)."""
    points = scan.points_m()
    ways = points - (scan.mount.x_m, scan.mount.y_m)
    middles: Floats = points + PERSON_M * ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)
    return middles


def is_seen_through(scan: Scan, bodies: Floats) -> npt.NDArray[np.bool_]:
    """Return for each body whether it is impossible because a ray passes through its core; shape (bodies,)."""
    turns = scan.bearings_rad + scan.mount.heading_rad
    to_body = bodies - (scan.mount.x_m, scan.mount.y_m)
    along_m = np.stack((np.cos(turns), np.sin(turns)), axis=1) @ to_body.T
    depth_m2 = CORE_M**2 - ((to_body**2).sum(axis=1) - along_m**2)
    entry_m = along_m - np.sqrt(np.maximum(depth_m2, 0.0))
    is_passed = (depth_m2 > 0.0) & (along_m > 0.0) & (scan.ranges_m[:, None] > entry_m)
    is_impossible: npt.NDArray[np.bool_] = np.any(is_passed, axis=0)
    return is_impossible


def gaps_m(bodies: Floats, *, is_loaded: bool) -> Floats:
    """Return the distances of bodies from the robot and its load: negative if they overlap; shape (bodies,)."""
    x_m, y_m = bodies[:, 0], np.abs(bodies[:, 1])
    fork_half_m = (BODY_WIDTH_M if is_loaded else FORK_WIDTH_M) / 2
    body = np.hypot(np.maximum(np.maximum(BODY_BACK_M - x_m, x_m - BODY_FRONT_M), 0.0),
                    np.maximum(y_m - BODY_WIDTH_M / 2, 0.0))  # fmt: skip
    fork = np.hypot(np.maximum(np.maximum(FORK_TIP_M - x_m, x_m - BODY_BACK_M), 0.0),
                    np.maximum(y_m - fork_half_m, 0.0))  # fmt: skip
    gaps: Floats = np.minimum(body, fork) - PERSON_M
    return gaps
