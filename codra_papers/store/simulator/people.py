"""People in the shop: they walk along the corridors, stop before shelves, and step aside only for the robot.

Each person has a separate random source, so one more person does not change the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import pairwise
from math import atan2, cos, hypot, inf, sin
from random import Random

import networkx as nx

from codra_papers.store.geometry import Disc, Point
from codra_papers.store.layout import BACK_Y_M, CORRIDORS_X_M, FRONT_Y_M
from codra_papers.store.routes import clearance_m

PERSON_RADIUS_M = 0.25
KEEP_OFF_M = 0.3
"""Smallest distance of the middle of a walking person's body from the robot."""

KEEP_RIGHT_M = 0.7
"""How far to the right of the middle of a corridor people walk."""

PATIENCE_S = 4.0
"""How long the robot may be in a person's way before the person turns back."""

SIDESTEP_ANGLES_RAD = (-0.5, 0.5, -1.0, 1.0, -1.4, 1.4)
"""Directions of a step aside to get past the robot, relative to the way to the goal. The first direction is to the
right."""

DETOUR_M = 2.5
"""A person who turns back keeps this far from the place where the robot was in the way, if another way exists."""

Plan = Iterator[tuple[Point, float]]
"""Points to walk to, and for each point the time to stay there, in seconds."""


class Person:
    """A walking person.

    Attributes:
        at_m: the middle of the body.
        speed_m_s: the walking speed.
        has_left: whether the person has left the shop, at the end of the plan.
    """

    def __init__(self, name: str, at_m: Point, speed_m_s: float, plan: Callable[[Point, Point | None], Plan]) -> None:
        """Begin to walk.

        Args:
            name: the name of the person.
            at_m: the place of the person.
            speed_m_s: the walking speed of the person.
            plan: returns a plan that begins at a point. When the person turns back, the function is called again with
                the point where the robot is in the way.
        """
        self.name = name
        self.at_m = at_m
        self.speed_m_s = speed_m_s
        self._make_plan = plan
        self._plan = plan(at_m, None)
        self._goal, self._stay_s = next(self._plan)
        self._waited_s = 0.0
        self.has_left = False

    def disc(self) -> Disc:
        """Return the person's space on the floor."""
        return Disc(self.at_m, PERSON_RADIUS_M)

    def step(self, duration_s: float, distance_to_robot_m: Callable[[Point], float]) -> None:
        """Walk on. If the robot is in the way, walk around it if there is room, and otherwise wait."""
        remaining_m = _distance_m(self.at_m, self._goal)
        if remaining_m < 1e-9:
            self._stay(duration_s)
            return
        step_m = min(self.speed_m_s * duration_s, remaining_m)
        next_point = _point_towards(self.at_m, self._goal, step_m)
        if self._can_go(next_point, distance_to_robot_m):
            self.at_m, self._waited_s = next_point, 0.0
            return
        sidestep = self._sidestep(step_m, distance_to_robot_m)
        if sidestep is not None:
            self.at_m = sidestep
        self._wait(duration_s, next_point)

    def _can_go(self, next_point: Point, distance_to_robot_m: Callable[[Point], float]) -> bool:
        gap_m = distance_to_robot_m(next_point)
        return gap_m >= KEEP_OFF_M or gap_m >= distance_to_robot_m(self.at_m)

    def _sidestep(self, step_m: float, distance_to_robot_m: Callable[[Point], float]) -> Point | None:
        """Return a step past the robot that leads nearer to the goal, and not into a shelf; None if no step does."""
        way_rad = atan2(self._goal[1] - self.at_m[1], self._goal[0] - self.at_m[0])
        for turn_rad in SIDESTEP_ANGLES_RAD:
            next_point = (
                self.at_m[0] + cos(way_rad + turn_rad) * step_m,
                self.at_m[1] + sin(way_rad + turn_rad) * step_m,
            )
            if self._can_go(next_point, distance_to_robot_m) and clearance_m(next_point) >= PERSON_RADIUS_M:
                return next_point
        return None

    def _stay(self, duration_s: float) -> None:
        self._stay_s -= duration_s
        if self._stay_s <= 0.0:
            following = next(self._plan, None)
            self.has_left = following is None
            self._goal, self._stay_s = following or (self._goal, inf)

    def _wait(self, duration_s: float, blocked_m: Point) -> None:
        self._waited_s += duration_s
        if self._waited_s >= PATIENCE_S:
            self._waited_s = 0.0
            self._plan = self._make_plan(self.at_m, blocked_m)
            self._goal, self._stay_s = next(self._plan)


def new_shopper(seed: int, number: int) -> Person:
    """Return a person who walks from shelf to shelf without end."""
    random = Random(f"{seed} person {number}")
    x_m, y_m = random.choice(CORRIDORS_X_M), random.uniform(4.5, 12.5)
    return Person(f"person {number}", (x_m + KEEP_RIGHT_M, y_m), random.uniform(0.6, 1.3), _Shopping(random))


def new_visitor(
    at_m: Point, ends_m: Sequence[Point], times: int, leave_to_m: Point, *, other_exit_m: Point | None = None
) -> Person:
    """Return a person who walks to a place, crosses it several times, and goes away.

    If the robot is in the way, the person turns back, and makes one crossing less.

    Args:
        at_m: the place of the person.
        ends_m: the ends of each crossing.
        times: the number of crossings.
        leave_to_m: the last place.
        other_exit_m: a second exit. The person leaves the shop by the exit to which the robot is not in the way. None
            for a person who stays at `leave_to_m`.
    """
    remaining_ends = iter([ends_m[index % len(ends_m)] for index in range(times)])

    exits_m = [exit_m for exit_m in (leave_to_m, other_exit_m) if exit_m is not None]

    def plan(from_m: Point, blocked_m: Point | None) -> Plan:
        for end in remaining_ends:
            yield end, 1.0
        exit_m = min(exits_m, key=lambda exit_m: _is_beyond(from_m, blocked_m, exit_m))
        yield exit_m, inf if other_exit_m is None else 0.0

    return Person("visitor", at_m, 1.0, plan)


class _Shopping:
    """The plans of one shopper, from one random source."""

    def __init__(self, random: Random) -> None:
        self._random = random

    def __call__(self, at_m: Point, blocked_m: Point | None) -> Plan:
        graph = _corridor_graph() if blocked_m is None else _graph_without(blocked_m)
        node = min(graph, key=lambda point: (_is_beyond(at_m, blocked_m, point), _distance_m(point, at_m), point))
        yield _right_of(at_m, node, node), 0.0  # beside the node, so that the person walks straight on
        while True:
            goal = (self._random.choice(CORRIDORS_X_M), self._random.choice((6.5, 8.5, 10.5)))
            way: list[Point] = nx.shortest_path(_corridor_graph(), node, goal, weight="length_m")
            for before, after in pairwise(way):
                yield _right_of(before, after, before), 0.0
                yield _right_of(before, after, after), 0.0
            node = goal
            if len(way) > 1:
                yield _right_of(way[-2], goal, goal), self._random.uniform(3.0, 25.0)
            else:
                yield (goal[0] + KEEP_RIGHT_M, goal[1]), self._random.uniform(3.0, 25.0)


def _graph_without(blocked_m: Point) -> nx.Graph[Point]:
    graph = _corridor_graph()
    return graph.subgraph([node for node in graph if _distance_m(node, blocked_m) > DETOUR_M])


def _is_beyond(at_m: Point, blocked_m: Point | None, node: Point) -> bool:
    """Return whether the way to a node leads past the blocked point, instead of back."""
    if blocked_m is None:
        return False
    blocked_offset = (blocked_m[0] - at_m[0], blocked_m[1] - at_m[1])
    return blocked_offset[0] * (node[0] - at_m[0]) + blocked_offset[1] * (node[1] - at_m[1]) > 0.0


@cache
def _corridor_graph() -> nx.Graph[Point]:
    """Return the graph of the corridors. Its nodes are crossings and other points in the middle of the corridors."""
    graph: nx.Graph[Point] = nx.Graph()
    for x_m in CORRIDORS_X_M:
        nx.add_path(graph, [(x_m, y_m) for y_m in (FRONT_Y_M, 6.5, 8.5, 10.5, BACK_Y_M)])
    for y_m in (FRONT_Y_M, BACK_Y_M):
        nx.add_path(graph, [(x_m, y_m) for x_m in CORRIDORS_X_M])
    for one, other in graph.edges:
        graph.edges[one, other]["length_m"] = _distance_m(one, other)
    return graph


def _right_of(start: Point, end: Point, point: Point) -> Point:
    """Return the point at which a person walks, to the right of a point in the middle of a corridor."""
    way_rad = atan2(end[1] - start[1], end[0] - start[0])
    return (point[0] + sin(way_rad) * KEEP_RIGHT_M, point[1] - cos(way_rad) * KEEP_RIGHT_M)


def _point_towards(start: Point, end: Point, length_m: float) -> Point:
    share = length_m / _distance_m(start, end)
    return (start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)


def _distance_m(a: Point, b: Point) -> float:
    return hypot(b[0] - a[0], b[1] - a[1])
