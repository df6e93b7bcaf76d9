"""What the lasers show around the robot that is not on its map, and how much room they leave it."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf

import numpy as np

from codra_dsl.worlds.store.body import FRONT, Body, Side, Way
from codra_dsl.worlds.store.geometry import Disc, Point
from codra_dsl.worlds.store.layout import BODY_FRONT_M, FORK_TIP_M
from codra_dsl.worlds.store.routes import clearances_m

OBSTACLE_M = 0.3
"""The radius of what the lasers see in the way."""

WITHIN_M = 3.0
"""What is farther away may be gone before the robot is there."""

OFF_MAP_M = 0.2
"""What lasers see nearer than this to a shelf or a wall is taken for it."""

OF_CONTAINER_M = 0.6
"""What they see nearer than this to the middle of a known container is taken for it."""

LANE_M = 0.42
KEEP_FREE_M = 0.4


def obstacles(body: Body, containers_m: Sequence[Point]) -> tuple[Disc, ...]:
    """Return what stands in the shop that neither the map nor the graph knows: people, mostly.

    Args:
        body: whose lasers are asked, those in front.
        containers_m: where containers are known to stand.
    """
    robot = body.believed()
    near = [point for side in FRONT for point in body.scan(side).points_m().tolist() if hypot(*point) < WITHIN_M]
    seen = [robot.out(*point) for point in sorted(near, key=lambda point: hypot(*point))]
    if not seen:
        return ()
    off_map = [point for point, gap_m in zip(seen, clearances_m(np.array(seen)), strict=True) if gap_m > OFF_MAP_M]
    found: list[Point] = []
    for x_m, y_m in off_map:
        is_container = any(hypot(x_m - x, y_m - y) < OF_CONTAINER_M for x, y in containers_m)
        if not is_container and all(hypot(x_m - x, y_m - y) > OBSTACLE_M for x, y in found):
            found.append((x_m, y_m))
    return tuple(Disc(point, OBSTACLE_M) for point in found)


def away(body: Body, longest_m: float) -> tuple[Way, float]:
    """Return the way, straight on or straight back, that leads farther from what is near, and how far it is free."""
    points = np.concatenate([body.scan(side).points_m() for side in Side])
    found: dict[Way, tuple[float, float]] = {}
    for way in (Way.BACKWARD, Way.FORWARD):
        length_m = min(room_m(body, way), longest_m)
        there_m = length_m if way is Way.FORWARD else -length_m
        nearest_m = float(np.hypot(points[:, 0] - there_m, points[:, 1]).min(initial=inf))
        found[way] = (nearest_m if length_m > 0.0 else 0.0, length_m)
    way = max(found, key=lambda each: found[each])
    return way, found[way][1]


def room_m(body: Body, way: Way) -> float:
    """Return how far the robot may go straight on, or straight back, so that something is left free; 0 at least."""
    if way is Way.FORWARD:
        points = np.concatenate([body.scan(side).points_m() for side in FRONT])
        gaps = points[:, 0] - BODY_FRONT_M
    else:
        points = body.scan(Side.BACK).points_m()
        gaps = FORK_TIP_M - points[:, 0]
    ahead = gaps[(np.abs(points[:, 1]) <= LANE_M) & (gaps >= 0.0)]
    return max(float(ahead.min(initial=inf)) - KEEP_FREE_M, 0.0)
