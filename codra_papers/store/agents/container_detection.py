"""P2's ContainerDetectionAgent: on request (`robot -wants-> detecting`), it detects roll containers and their poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, cos, hypot, sin

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot, Transaction
from codra_papers.store.agents.working import Executor, PeriodicCalls, last_number
from codra_papers.store.body import Body, ObjectKind
from codra_papers.store.geometry import Pose2D
from codra_papers.store.knowledge import floor_pose_of, pose_of

PERIOD_S = 0.2
PICTURE_COUNT = 12
"""Number of sharp pictures in one detection."""

MIN_SIGHTINGS = 4
"""Smallest number of these pictures in which a container must be seen."""

SAME_CONTAINER_M = 0.5
"""Two sightings nearer to each other than this belong to one container."""

SURE_WITHIN_M = 4.0
"""A known container is gone if it is nearer to the robot than this and in view, but was not seen."""


@dataclass(slots=True)
class _Candidate:
    poses: list[Pose2D] = field(default_factory=list)

    def mean(self) -> Pose2D:
        count = len(self.poses)
        heading_rad = atan2(
            sum(sin(pose.heading_rad) for pose in self.poses), sum(cos(pose.heading_rad) for pose in self.poses)
        )
        return Pose2D(
            sum(pose.x_m for pose in self.poses) / count, sum(pose.y_m for pose in self.poses) / count, heading_rad
        )


class ContainerDetection:
    """Detects roll containers."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Wait for requests."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("container_detection")
        self._body = body
        self._clock = clock
        self._container_count = last_number(knowledge.snapshot(), "roll_container")
        self._candidates: list[_Candidate] = []
        self._picture_count = 0
        self._periodic_calls: PeriodicCalls | None = None
        self._task = Executor(knowledge, self._handle, "detecting", self._begin, self._end)

    def _begin(self, _: Snapshot) -> None:
        self._candidates, self._picture_count = [], 0
        self._periodic_calls = PeriodicCalls(self._clock, PERIOD_S, self._look)

    def _end(self) -> None:
        if self._periodic_calls is not None:
            self._periodic_calls.stop()

    def _look(self) -> None:
        picture = self._body.look()
        if not picture.is_steady:
            return
        self._picture_count += 1
        robot = self._body.believed_pose()
        for sighting in picture.sightings:
            if sighting.kind is ObjectKind.CONTAINER:
                x_m, y_m = robot.point_at(sighting.at.x_m, sighting.at.y_m)
                self._add_sighting(Pose2D(x_m, y_m, robot.heading_rad + sighting.at.heading_rad))
        if self._picture_count == PICTURE_COUNT:
            self._end()
            poses = [candidate.mean() for candidate in self._candidates if len(candidate.poses) >= MIN_SIGHTINGS]
            self._write_containers(poses)
            self._task.finish("found" if poses else "lost")

    def _add_sighting(self, pose: Pose2D) -> None:
        for candidate in self._candidates:
            if candidate.mean().distance_m(pose) < SAME_CONTAINER_M:
                candidate.poses.append(pose)
                return
        self._candidates.append(_Candidate([pose]))

    def _write_containers(self, poses: Sequence[Pose2D]) -> None:
        snapshot = self._knowledge.snapshot()
        known_poses = {
            node.name: floor_pose_of(snapshot.transform("world", node.name).pose)
            for node in snapshot.nodes("roll_container")
            if snapshot.parent(node.name) == "world"
        }
        with self._handle.transaction() as change:
            for pose in poses:
                name = min(
                    known_poses,
                    key=lambda known_name: (known_poses[known_name].distance_m(pose), known_name),
                    default=None,
                )
                if name is None or known_poses[name].distance_m(pose) > SAME_CONTAINER_M:
                    self._container_count += 1
                    name = f"roll_container_{self._container_count}"
                    change.insert_node(name, "roll_container")
                known_poses.pop(name, None)
                change.place("world", "container_pose", name, pose_of(pose))
            self._delete_unseen(change, snapshot, known_poses)

    def _delete_unseen(self, change: Transaction, snapshot: Snapshot, unseen_poses: dict[str, Pose2D]) -> None:
        robot = self._body.believed_pose()
        for name, pose in unseen_poses.items():
            is_close = hypot(pose.x_m - robot.x_m, pose.y_m - robot.y_m) < SURE_WITHIN_M
            if is_close and snapshot.in_view(name, "camera"):
                change.delete_node(name)
