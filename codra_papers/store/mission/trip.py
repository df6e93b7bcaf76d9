"""A nominal trip: P2's pick-up and delivery, step by step, as one blocking program (P2, section 3.2 and Figure 2).

A trip has only this course. To take another course, abort the trip. All requests of a trip go through the graph.
"""

from __future__ import annotations

from math import pi

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Request, Snapshot, Stage
from codra_papers.store.body import Way
from codra_papers.store.geometry import Pose2D
from codra_papers.store.knowledge import floor_pose_of, pose_of
from codra_papers.store.layout import AREAS, approach_to, robot_at

LONGEST_S = 600.0
"""Longest wait for a task. Tasks end earlier than this, because their deadlines are shorter."""


class TripError(RuntimeError):
    """A step of a trip had an unexpected result."""


class AbortedError(RuntimeError):
    """A trip was aborted, by `Trip.abort` or by a deadline."""


class Trip:
    """Drives, looks, fetches and delivers as the agent `picking`."""

    def __init__(self, knowledge: Knowledge, clock: Clock) -> None:
        """Open the handle of the agent `picking`. The trip begins with the first call of a method."""
        self._knowledge = knowledge
        self._clock = clock
        self._handle = knowledge.as_agent("picking")
        self._request: Request | None = None
        self._is_aborted = False

    def close(self) -> None:
        """Close the handle of the agent."""
        self._handle.close()

    def abort(self) -> None:
        """Abort the current task, and with it the trip. This may be called in events."""
        self._is_aborted = True
        request = self._request
        if request is not None and self._knowledge.snapshot().handover(request.task).is_open:
            self._handle.abort(request)

    def pick_up(self, area: str) -> bool:
        """Fetch a container from an area, and return whether a container was found.

        If no observation pose shows a container, the base gets a notice (P2, section 6).

        Raises:
            TripError: a step fails.
            AbortedError: the trip is aborted.
        """
        if not self._find_container(area):
            self._handle.set("base", "base_notice", "container_not_found")
            return False
        approach = approach_to(self._container_pose(area))
        self.go(approach.turned(pi))
        self._require_result("detecting", "found")
        self._require_result("rotating", "turned")
        self._require_result("checking", "found")
        self.go(robot_at(self._container_pose(area)), Way.BACKWARD)
        self._require_result("lifting", "lifted")
        return True

    def deliver(self, area: str) -> None:
        """Set down the container at an area.

        Raises:
            TripError: a step fails.
            AbortedError: the trip is aborted.
        """
        self.go(self._named_pose(f"{area}_approach"))
        self.go(self._named_pose(f"{area}_delivery"), Way.BACKWARD)
        self._require_result("lowering", "lowered")

    def go_to(self, name: str) -> None:
        """Drive to a named pose."""
        self.go(self._named_pose(name))

    def go(self, goal: Pose2D, way: Way = Way.FORWARD) -> None:
        """Drive to a pose.

        Raises:
            TripError: the robot does not arrive.
            AbortedError: the trip is aborted.
        """
        with self._handle.transaction() as change:
            change.place("world", "goal_pose", "goal", pose_of(goal))
            change.set("goal", "goal_way", way)
        self._require_result("navigating", "arrived")

    def _find_container(self, area: str) -> bool:
        for number in range(1, len(AREAS[area].observation_poses) + 1):
            self.go(self._named_pose(f"{area}_pose_{number}"))
            if self._run_task("detecting") == "found":
                return True
        return False

    def _require_result(self, task: str, expected_result: str) -> None:
        result = self._run_task(task)
        if result != expected_result:
            raise TripError(f"the result of {task} is {result!r} instead of {expected_result!r}")

    def _run_task(self, task: str) -> str:
        if self._is_aborted:
            raise AbortedError(f"the trip was aborted before {task}")
        self._request = self._handle.request(task)
        self._clock.wait_until(lambda: not self._knowledge.snapshot().handover(task).is_open, LONGEST_S)
        handover = self._knowledge.snapshot().handover(task)
        self._request = None
        if handover.stage is not Stage.FINISHED or handover.result is None:
            raise AbortedError(f"{task} was aborted: {handover.reason}")
        return handover.result

    def _named_pose(self, name: str) -> Pose2D:
        return floor_pose_of(self._knowledge.transform("world", name).pose)

    def _container_pose(self, area: str) -> Pose2D:
        """Return the pose of the known container that is nearest to an area."""
        snapshot: Snapshot = self._knowledge.snapshot()
        delivery = self._named_pose(f"{area}_delivery")
        poses = [
            floor_pose_of(snapshot.transform("world", node.name).pose)
            for node in snapshot.nodes("roll_container")
            if snapshot.parent(node.name) == "world"
        ]
        if not poses:
            raise TripError(f"no container is known near {area}")
        return min(poses, key=lambda pose: (pose.distance_m(delivery), pose.x_m, pose.y_m))
