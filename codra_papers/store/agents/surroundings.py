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
from codra_papers.store.unmapped_obstacles import PERSON_M, PLACES_M, WITHIN_M, is_strange

OBSTACLE_M = 0.3
"""The radius of an obstacle around a laser point."""

RIM = 12
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


def strange_points(body: Body, sides: Sequence[Side], known_m: Sequence[Point]) -> Floats:
    """Return the points near the robot, in its frame, that neither the map nor the graph explains: people, mostly.

    Args:
        body: the body with the lasers.
        sides: the lasers to use.
        known_m: the places of the known containers.

    Returns:
        The points, the nearest first; shape (points, 2).
    """
    points = np.concatenate([body.scan(side).points_m() for side in sides])
    ranges_m = np.hypot(points[:, 0], points[:, 1])
    order = np.argsort(ranges_m, kind="stable")
    near: Floats = points[order[ranges_m[order] < WITHIN_M]]
    strange: Floats = near[is_strange(near, body.believed(), known_m)]
    return strange


def moving_points(body: Body, known_m: Sequence[Point]) -> Floats:
    """Return these points for all lasers, without those at places for containers: an unknown container may be there."""
    return strange_points(body, tuple(Side), (*known_m, *PLACES_M))


def gap_m(points: Floats) -> float:
    """Return the distance of the nearest point from the robot and its load; infinite without points."""
    ahead_m = np.maximum(np.maximum(points[:, 0] - BODY_FRONT_M, FORK_TIP_M - points[:, 0]), 0.0)
    aside_m = np.maximum(np.abs(points[:, 1]) - BODY_WIDTH_M / 2, 0.0)
    return float(np.hypot(ahead_m, aside_m).min(initial=inf))


def obstacles(body: Body, known_m: Sequence[Point]) -> tuple[Disc, ...]:
    """Return the obstacles in front of the robot that neither the map nor the graph contains.

    Args:
        body: the body with the lasers; only the front ones are used.
        known_m: the places of the known containers.
    """
    robot = body.believed()
    centres_m: list[Point] = []
    for point in strange_points(body, FRONT, known_m).tolist():
        x_m, y_m = robot.out(*point)
        if all(hypot(x_m - x, y_m - y) > OBSTACLE_M for x, y in centres_m):
            centres_m.append((x_m, y_m))
    return tuple(Disc(point, OBSTACLE_M) for point in centres_m)


def people_m(snapshot: Snapshot) -> list[Point]:
    """Return the places of the known people."""
    nodes = (node.name for node in snapshot.nodes("person") if snapshot.parent(node.name) == "world")
    return [floor_pose_of(snapshot.transform("world", name).pose).point_m for name in nodes]


def away(body: Body, known_m: Sequence[Point], longest_m: float) -> tuple[Way, float]:
    """Return the direction, straight on or straight back, that leads farther from near obstacles, and its free length.

    Args:
        body: the body with the lasers.
        known_m: the places of the known people; they are needed because no laser sees people beside the fork.
        longest_m: the largest length to return.
    """
    points = np.concatenate([*(body.scan(side).points_m() for side in Side), _rims(body, known_m)])
    steps: dict[Way, tuple[float, float]] = {}
    for way in (Way.BACKWARD, Way.FORWARD):
        length_m = min(room_m(body, known_m, way), longest_m)
        there_m = length_m if way is Way.FORWARD else -length_m
        nearest_m = float(np.hypot(points[:, 0] - there_m, points[:, 1]).min(initial=inf))
        steps[way] = (nearest_m if length_m > 0.0 else 0.0, length_m)
    way = max(steps, key=lambda candidate: steps[candidate])
    return way, steps[way][1]


def room_m(body: Body, known_m: Sequence[Point], way: Way) -> float:
    """Return how far the robot may go straight on, or straight back, so that a gap stays free; at least 0.

    A person beside the fork is in the way of the body when the robot goes back.

    Args:
        body: the body with the lasers.
        known_m: the places of the known people.
        way: the direction.
    """
    sides = FRONT if way is Way.FORWARD else tuple(Side)
    points = np.concatenate([*(body.scan(side).points_m() for side in sides), _rims(body, known_m)])
    if way is Way.FORWARD:
        gaps = points[:, 0] - BODY_FRONT_M
    else:
        gaps = np.where(points[:, 0] < FORK_TIP_M, FORK_TIP_M, BODY_BACK_M) - points[:, 0]
    ahead = gaps[(np.abs(points[:, 1]) <= LANE_M) & (gaps >= 0.0)]
    return max(float(ahead.min(initial=inf)) - KEEP_FREE_M, 0.0)


def _rims(body: Body, known_m: Sequence[Point]) -> Floats:
    """Return points around the bodies of people, in the robot's frame; shape (points, 2)."""
    robot = body.believed()
    points: Floats = np.array([
        (x_m + PERSON_M * cos(turn), y_m + PERSON_M * sin(turn))
        for x_m, y_m in (robot.seen_from_here(point) for point in known_m)
        for turn in np.linspace(0.0, 2 * pi, RIM, endpoint=False)
    ]).reshape(-1, 2)  # fmt: skip
    return points
