"""The obstacles that the lasers see and the map does not have, and the room that they leave around the robot."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, pi, sin

import numpy as np

from codra_dsl.runtime.knowledge import Snapshot
from codra_papers.store.body import FRONT, Body, Side, Way
from codra_papers.store.geometry import Disc, Floats, Point
from codra_papers.store.knowledge import floor_pose_of
from codra_papers.store.layout import BODY_BACK_M, BODY_FRONT_M, BODY_WIDTH_M, FORK_TIP_M
from codra_papers.store.unmapped_obstacles import CONTAINER_PLACES_M, FARTHEST_OBSTACLE_M, PERSON_M, is_strange

OBSTACLE_M = 0.3
"""The radius of an obstacle around a laser point."""

RIM_POINT_COUNT = 12
"""Number of points that represent a person's body."""

LANE_M = 0.42
KEEP_FREE_M = 0.4


def containers_m(snapshot: Snapshot) -> list[Point]:
    """Return the places of the known containers."""
    return [
        floor_pose_of(snapshot.transform("world", node.name).pose).point_m
        for node in snapshot.nodes("roll_container")
        if snapshot.parent(node.name) == "world"
    ]


def strange_points(body: Body, sides: Sequence[Side], known_places_m: Sequence[Point]) -> Floats:
    """Return the points near the robot, in its frame, that neither the map nor the graph explains: mostly people.

    Args:
        body: the body with the lasers.
        sides: the lasers to use.
        known_places_m: the places of the known containers.

    Returns:
        The points, the nearest first; shape (points, 2).
    """
    points = np.concatenate([body.scan(side).points_m() for side in sides])
    ranges_m = np.hypot(points[:, 0], points[:, 1])
    order = np.argsort(ranges_m, kind="stable")
    near: Floats = points[order[ranges_m[order] < FARTHEST_OBSTACLE_M]]
    unexplained: Floats = near[is_strange(near, body.believed_pose(), known_places_m)]
    return unexplained


def moving_points(body: Body, known_places_m: Sequence[Point]) -> Floats:
    """Return the `strange_points` of all lasers, except at places for containers, where an unknown container may be."""
    return strange_points(body, tuple(Side), (*known_places_m, *CONTAINER_PLACES_M))


def gap_m(points: Floats) -> float:
    """Return the distance of the nearest point from the robot and its load; infinite if there are no points."""
    ahead_m = np.maximum(np.maximum(points[:, 0] - BODY_FRONT_M, FORK_TIP_M - points[:, 0]), 0.0)
    aside_m = np.maximum(np.abs(points[:, 1]) - BODY_WIDTH_M / 2, 0.0)
    return float(np.hypot(ahead_m, aside_m).min(initial=inf))


def obstacles(body: Body, known_places_m: Sequence[Point]) -> tuple[Disc, ...]:
    """Return the obstacles in front of the robot that neither the map nor the graph contains.

    Args:
        body: the body with the lasers; only the front lasers are used.
        known_places_m: the places of the known containers.
    """
    robot = body.believed_pose()
    centres_m: list[Point] = []
    for point in strange_points(body, FRONT, known_places_m).tolist():
        x_m, y_m = robot.point_at(*point)
        if all(hypot(x_m - x, y_m - y) > OBSTACLE_M for x, y in centres_m):
            centres_m.append((x_m, y_m))
    return tuple(Disc(point, OBSTACLE_M) for point in centres_m)


def people_m(snapshot: Snapshot) -> list[Point]:
    """Return the places of the known people."""
    nodes = (node.name for node in snapshot.nodes("person") if snapshot.parent(node.name) == "world")
    return [floor_pose_of(snapshot.transform("world", name).pose).point_m for name in nodes]


def step_away(body: Body, known_places_m: Sequence[Point], longest_m: float) -> tuple[Way, float]:
    """Return which way, straight on or straight back, leads farther away from near obstacles, and the free length.

    Args:
        body: the body with the lasers.
        known_places_m: the places of the known people; they are needed because no laser sees people beside the fork.
        longest_m: the largest length to return.
    """
    points = np.concatenate([*(body.scan(side).points_m() for side in Side), _rim_points(body, known_places_m)])
    steps_by_way: dict[Way, tuple[float, float]] = {}
    for way in (Way.BACKWARD, Way.FORWARD):
        length_m = min(room_m(body, known_places_m, way), longest_m)
        end_m = length_m if way is Way.FORWARD else -length_m
        nearest_m = float(np.hypot(points[:, 0] - end_m, points[:, 1]).min(initial=inf))
        steps_by_way[way] = (nearest_m if length_m > 0.0 else 0.0, length_m)
    way = max(steps_by_way, key=lambda candidate: steps_by_way[candidate])
    return way, steps_by_way[way][1]


def room_m(body: Body, known_places_m: Sequence[Point], way: Way) -> float:
    """Return how far the robot may go straight on, or straight back, so that `KEEP_FREE_M` remain free; at least 0.

    A person beside the fork is in the way of the body when the robot goes back.

    Args:
        body: the body with the lasers.
        known_places_m: the places of the known people.
        way: the direction.
    """
    sides = FRONT if way is Way.FORWARD else tuple(Side)
    points = np.concatenate([*(body.scan(side).points_m() for side in sides), _rim_points(body, known_places_m)])
    if way is Way.FORWARD:
        lane_gaps_m = points[:, 0] - BODY_FRONT_M
    else:
        lane_gaps_m = np.where(points[:, 0] < FORK_TIP_M, FORK_TIP_M, BODY_BACK_M) - points[:, 0]
    gaps_in_lane_m = lane_gaps_m[(np.abs(points[:, 1]) <= LANE_M) & (lane_gaps_m >= 0.0)]
    return max(float(gaps_in_lane_m.min(initial=inf)) - KEEP_FREE_M, 0.0)


def _rim_points(body: Body, known_places_m: Sequence[Point]) -> Floats:
    """Return points around the bodies of people, in the robot's frame; shape (points, 2)."""
    robot = body.believed_pose()
    points: Floats = np.array([
        (x_m + PERSON_M * cos(angle_rad), y_m + PERSON_M * sin(angle_rad))
        for x_m, y_m in (robot.relative_point(point) for point in known_places_m)
        for angle_rad in np.linspace(0.0, 2 * pi, RIM_POINT_COUNT, endpoint=False)
    ]).reshape(-1, 2)  # fmt: skip
    return points
