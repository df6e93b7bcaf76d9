"""Finds routes through the shop by networkx's A* on a grid over the map; the robot is treated as round."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from math import ceil, hypot

import networkx as nx
import numpy as np

from codra_papers.store.geometry import Disc, Floats, Point, Pose2D
from codra_papers.store.layout import DEPTH_M, FIXED_BOXES, LENGTH_M

GRID_M = 0.2
TURNING_ROOM_M = 0.9
"""At places where the robot turns, its axle is at least this far from shelves and walls.

The farthest corner of the robot is 0.83 m from the axle."""

LANE_M = 0.38
"""Half the width that the robot needs to drive straight on."""

_ROUNDING_M = 1e-6
_PLACE_TOLERANCE_M = 0.01
"""A place has room to turn even if its clearance is this much less: the robot may be a little off the grid's points."""

_REACH_M = 0.3
"""Largest distance from the grid at which a route may begin and end."""


class NoRouteError(LookupError):
    """No wide enough route leads from the start to the goal."""


_MIDDLES_M = np.array([box.centre.point_m for box in FIXED_BOXES])
_HALVES_M = np.array([(box.length_m / 2, box.width_m / 2) for box in FIXED_BOXES])
"""Half lengths and widths of shelves and walls, which are parallel to the axes of the map."""


def clearance_m(point_m: Point) -> float:
    """Return the distance of a point from the nearest shelf or wall: 0 inside a shelf or a wall."""
    return float(clearances_m(np.array([point_m]))[0])


def clearances_m(points_m: Floats) -> Floats:
    """Return `clearance_m` for many points of shape (points, 2). The result has the shape (points,)."""
    outside_m = np.maximum(np.abs(points_m[:, None, :] - _MIDDLES_M) - _HALVES_M, 0.0)
    distances_m: Floats = np.hypot(outside_m[..., 0], outside_m[..., 1]).min(axis=1)
    return distances_m


def has_room(start_m: Point, end_m: Point, room_m: float) -> bool:
    """Return whether a straight way keeps the distance `room_m` from shelves and walls, checked every 5 cm."""
    steps = max(1, ceil(hypot(end_m[0] - start_m[0], end_m[1] - start_m[1]) / 0.05))
    shares = np.arange(steps + 1)[:, None] / steps
    points = np.array(start_m) + (np.array(end_m) - np.array(start_m)) * shares
    return bool((clearances_m(points) >= room_m - _ROUNDING_M).all())


def route(start: Pose2D, goal: Pose2D, avoid: Sequence[Disc] = ()) -> tuple[Point, ...]:
    """Return the points to drive through after the start, up to and including the goal.

    If the robot has no room to turn, as in a recess, it first drives straight on, or straight back.

    Args:
        start: the pose of the robot.
        goal: the goal of the robot.
        avoid: further places; the axle keeps `TURNING_ROOM_M` away from them.

    Raises:
        NoRouteError: no route leads to the goal.
    """
    grid = _grid() if not avoid else _grid_without(avoid)
    turning_place_m, first = _turning_place(start, grid, avoid)
    last = _nearest(grid, goal.point_m)
    if last is None:
        raise NoRouteError(f"the robot has no room to turn at ({goal.x_m:.2f}, {goal.y_m:.2f})")
    try:
        points_m: list[Point] = nx.astar_path(grid, first, last, heuristic=_distance_m, weight="length_m")
    except nx.NetworkXNoPath:
        raise NoRouteError(f"no route leads from {start.point_m} to {goal.point_m}") from None
    corners = _straightened(turning_place_m, points_m, avoid)
    first_points = () if turning_place_m == start.point_m else (turning_place_m,)
    return (*first_points, *corners[:-1], goal.point_m)


def _turning_place(start: Pose2D, grid: nx.Graph[Point], avoid: Sequence[Disc]) -> tuple[Point, Point]:
    """Return the first place with room to turn, and the nearest point of the grid.

    The place is the start itself, or lies straight ahead of the start, or straight behind it, in this order.

    Raises:
        NoRouteError: no such place is near.
    """
    # a robot that is already nearer to a shelf or wall than `LANE_M` must not get even nearer
    room_m = min(LANE_M, clearance_m(start.point_m))
    for sign in (1.0, -1.0):
        for step in range(31):
            end_m = start.point_at(sign * step * 0.1)
            if not has_room(start.point_m, end_m, room_m) or _approaches(start.point_m, end_m, avoid):
                break
            node = _nearest(grid, end_m)
            if node is not None and clearance_m(end_m) >= TURNING_ROOM_M - _PLACE_TOLERANCE_M:
                return end_m, node
    raise NoRouteError(f"the robot has no room to turn near {start.point_m}")


def _approaches(start_m: Point, end_m: Point, avoid: Sequence[Disc]) -> bool:
    """Return whether a step leads near to a place to avoid, and nearer to this place than the step's start."""
    return any(
        _distance_m(end_m, disc.centre_m) < min(_distance_m(start_m, disc.centre_m), disc.radius_m + LANE_M)
        for disc in avoid
    )


@cache
def _grid() -> nx.Graph[Point]:
    """Return the free points of the grid, each joined to its neighbours."""
    graph: nx.Graph[Point] = nx.Graph()
    columns, rows = round(LENGTH_M / GRID_M), round(DEPTH_M / GRID_M)
    places = [(column, row) for column in range(columns + 1) for row in range(rows + 1)]
    clearances_of_places_m = clearances_m(np.array(places) * GRID_M)
    for (column, row), room_m in zip(places, clearances_of_places_m.tolist(), strict=True):
        if room_m < TURNING_ROOM_M - _ROUNDING_M:
            continue
        point = _grid_point(column, row)
        graph.add_node(point)
        for across, along in ((-1, 0), (0, -1), (-1, -1), (-1, 1)):
            other = _grid_point(column + across, row + along)
            if other in graph:
                graph.add_edge(point, other, length_m=_distance_m(point, other))
    return graph


def _grid_point(column: int, row: int) -> Point:
    return (round(column * GRID_M, 3), round(row * GRID_M, 3))


def _grid_without(avoid: Sequence[Disc]) -> nx.Graph[Point]:
    grid = _grid()
    return grid.subgraph([point for point in grid if not _is_near_disc(point, avoid)])


def _is_near_disc(point: Point, avoid: Sequence[Disc]) -> bool:
    return any(_distance_m(point, disc.centre_m) < disc.radius_m + TURNING_ROOM_M for disc in avoid)


def _nearest(grid: nx.Graph[Point], point_m: Point) -> Point | None:
    """Return the nearest point of the grid within reach, or None."""
    steps = range(-2, 3)
    column, row = round(point_m[0] / GRID_M), round(point_m[1] / GRID_M)
    nearby_points = [_grid_point(column + a, row + b) for a in steps for b in steps]
    near = [node for node in nearby_points if node in grid and _distance_m(node, point_m) <= _REACH_M]
    return min(near, key=lambda node: (_distance_m(node, point_m), node), default=None)


def _straightened(start_m: Point, points_m: Sequence[Point], avoid: Sequence[Disc]) -> list[Point]:
    """Return the corners of a route. Each next corner is the farthest point to which the robot can drive straight."""
    corners, corner, index = list[Point](), start_m, 0
    while index < len(points_m):
        farthest = index
        for candidate in range(len(points_m) - 1, index, -1):
            if has_room(corner, points_m[candidate], TURNING_ROOM_M) and not _passes(
                corner, points_m[candidate], avoid
            ):
                farthest = candidate
                break
        corner, index = points_m[farthest], farthest + 1
        corners.append(corner)
    return corners


def _passes(start_m: Point, end_m: Point, avoid: Sequence[Disc]) -> bool:
    """Return whether a straight way passes a place to avoid with less room than turning requires."""
    length_m = _distance_m(start_m, end_m) or 1.0
    direction = ((end_m[0] - start_m[0]) / length_m, (end_m[1] - start_m[1]) / length_m)
    for disc in avoid:
        dx, dy = disc.centre_m[0] - start_m[0], disc.centre_m[1] - start_m[1]
        nearest_m = min(max(dx * direction[0] + dy * direction[1], 0.0), length_m)
        if hypot(dx - direction[0] * nearest_m, dy - direction[1] * nearest_m) < disc.radius_m + TURNING_ROOM_M:
            return True
    return False


def _distance_m(a: Point, b: Point) -> float:
    return hypot(b[0] - a[0], b[1] - a[1])
