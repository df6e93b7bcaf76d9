"""P2's PersonDetectionAgent: it records the people in the camera's view, their places, and the nodes near them.

The lasers follow people whom the camera has seen when these people are beside or behind the robot, and while the robot
turns. Lasers can show that an object is not on the map, but not that the object is a person.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, hypot, sin
from statistics import fmean

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import Knowledge, Transaction
from codra_papers.store.agents.surroundings import containers_m, moving_points
from codra_papers.store.agents.working import PeriodicCalls, last_number
from codra_papers.store.body import (
    CAMERA_FARTHEST_M,
    CAMERA_POSE,
    CAMERA_VIEW_RAD,
    Body,
    ObjectKind,
    Sighting,
)
from codra_papers.store.geometry import Point, Pose2D
from codra_papers.store.knowledge import FARTHEST_M, floor_pose_of

PERIOD_S = 0.4
NEAR_M = 1.5
"""A person is near an object if the distance between their middles is smaller than this."""

SAME_PERSON_M = 1.0
"""Largest distance that a person walks between two pictures."""

BREADTH_M = 0.3
"""Laser points nearer than this to a point of a person belong to the same person."""

LASERS_FARTHEST_M = 2.5
"""The lasers look at each place that is nearer to the robot than this."""

FORGET_S = 1.5
"""If the camera or a laser looks at a person's last place, but has not seen the person for this long, the person is
gone."""

EDGE_MARGIN_M = 0.6
"""A person last seen nearer than this to the edge of the camera's view may have left the view."""

REMEMBER_S = 5.0
"""If a person's last place is outside the views of the camera and the lasers, the person is gone after this time."""


class PersonDetection:
    """Keeps a node for each person in view."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Start to look periodically, also for the people whom an earlier program of this agent has seen last."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("person_detection")
        self._body = body
        self._clock = clock
        snapshot, now_s = knowledge.snapshot(), clock.now_s()
        self._person_count = last_number(snapshot, "person")
        self._last_sightings: dict[str, tuple[Point, float]] = {
            node.name: (floor_pose_of(snapshot.transform("world", node.name).pose).point_m, now_s)
            for node in snapshot.nodes("person")
        }
        self._periodic_calls = PeriodicCalls(clock, PERIOD_S, self._look)

    def _look(self) -> None:
        picture = self._body.look()
        if not (picture.is_steady or self._last_sightings):
            return  # the picture is blurred, and no person is followed
        people = [sighting for sighting in picture.sightings if sighting.kind is ObjectKind.PERSON]
        with self._handle.transaction() as change:
            self._follow(change, people)
            self._follow_by_lasers(change)
            self._delete_gone_people(change)
            self._update_near_edges(change)
            robot = self._body.believed_pose()
            gaps_m = [_distance_m(place_m, robot.point_m) for place_m, _ in self._last_sightings.values()]
            if picture.is_steady or gaps_m:
                change.set("robot", "person_distance", min([*gaps_m, FARTHEST_M]))

    def _follow(self, change: Transaction, people: Iterable[Sighting]) -> None:
        robot = self._body.believed_pose()
        unmatched_people = dict(self._last_sightings)
        for sighting in people:
            place_m = robot.point_at(sighting.at.x_m, sighting.at.y_m)
            name = min(
                unmatched_people,
                key=lambda known: (_distance_m(unmatched_people[known][0], place_m), known),
                default=None,
            )
            if name is None or _distance_m(unmatched_people[name][0], place_m) > SAME_PERSON_M:
                self._person_count += 1
                name = f"person_{self._person_count}"
                change.insert_node(name, "person")
            unmatched_people.pop(name, None)
            self._place(change, name, place_m)

    def _follow_by_lasers(self, change: Transaction) -> None:
        """Move people whom the camera does not see now to the laser points that are nearest to their last places."""
        now_s, robot = self._clock.now_s(), self._body.believed_pose()
        lost_names = [name for name, (_, seen_s) in self._last_sightings.items() if seen_s < now_s]
        if not lost_names:
            return
        unmapped_points = moving_points(self._body, containers_m(self._knowledge.snapshot())).tolist()
        points = [robot.point_at(*point) for point in unmapped_points]
        for name in lost_names:
            last_m = self._last_sightings[name][0]
            nearest = min(points, key=lambda point: _distance_m(point, last_m), default=None)
            if nearest is not None and _distance_m(nearest, last_m) < SAME_PERSON_M:
                own_points = [point for point in points if _distance_m(point, nearest) < BREADTH_M]
                self._place(change, name, (fmean(x for x, _ in own_points), fmean(y for _, y in own_points)))

    def _place(self, change: Transaction, name: str, place_m: Point) -> None:
        self._last_sightings[name] = (place_m, self._clock.now_s())
        change.place("world", "person_pose", name, Pose.of((*place_m, 0.0)))

    def _delete_gone_people(self, change: Transaction) -> None:
        now_s, robot = self._clock.now_s(), self._body.believed_pose()
        for name, (place_m, seen_s) in list(self._last_sightings.items()):
            if now_s - seen_s >= (FORGET_S if _is_observable(robot, place_m) else REMEMBER_S):
                del self._last_sightings[name]
                change.delete_node(name)

    def _update_near_edges(self, change: Transaction) -> None:
        snapshot, robot = self._knowledge.snapshot(), self._body.believed_pose()
        others = {"robot": robot.point_m}
        for node in snapshot.nodes("roll_container"):
            if snapshot.parent(node.name) is not None:
                x_m, y_m, _ = snapshot.transform("world", node.name).pose.translation_m
                others[node.name] = (x_m, y_m)
        for name, (place_m, _) in self._last_sightings.items():
            for other, other_place_m in others.items():
                is_near = _distance_m(place_m, other_place_m) < NEAR_M
                was_near = snapshot.has_edge(name, "near", other) if name in snapshot else False
                if is_near and not was_near:
                    change.insert_edge(name, "near", other)
                elif was_near and not is_near:
                    change.delete_edge(name, "near", other)


def _is_observable(robot: Pose2D, place_m: Point) -> bool:
    """Return whether a laser or the camera would see a person at a place, even if the person has moved a little."""
    if _distance_m(robot.point_m, place_m) < LASERS_FARTHEST_M:
        return True
    ahead_m, left_m = Pose2D(*robot.point_at(CAMERA_POSE.x_m, CAMERA_POSE.y_m), robot.heading_rad).relative_point(
        place_m
    )
    range_m, inside_rad = hypot(ahead_m, left_m), CAMERA_VIEW_RAD / 2 - abs(atan2(left_m, ahead_m))
    return range_m <= CAMERA_FARTHEST_M and inside_rad > 0.0 and range_m * sin(inside_rad) > EDGE_MARGIN_M


def _distance_m(a: Point, b: Point) -> float:
    return hypot(b[0] - a[0], b[1] - a[1])
