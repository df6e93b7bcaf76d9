"""Agents that record single sensor values: the robot's pose, distances, and whether pictures are sharp."""

from __future__ import annotations

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge
from codra_papers.store.agents.surroundings import containers_m, gap_m, moving_points
from codra_papers.store.agents.working import PeriodicCalls
from codra_papers.store.body import FRONT, Body, Side
from codra_papers.store.knowledge import FARTHEST_M, pose_of

PERIOD_S = 0.2


class Localisation:
    """Records the robot's pose and its uncertainty."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Start to record five times a second."""
        self._handle = knowledge.as_agent("localisation")
        self._body = body
        self._periodic_calls = PeriodicCalls(clock, PERIOD_S, self._record_pose)

    def _record_pose(self) -> None:
        with self._handle.transaction() as change:
            change.place("world", "robot_pose", "robot", pose_of(self._body.believed_pose()))
            change.set("robot", "pose_spread", self._body.localisation_spread_m())


class CameraAgent:
    """Records whether the robot moves slowly enough for sharp pictures."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Start to record five times a second."""
        self._handle = knowledge.as_agent("camera_agent")
        self._body = body
        self._periodic_calls = PeriodicCalls(clock, PERIOD_S, self._record_steadiness)

    def _record_steadiness(self) -> None:
        self._handle.set("camera", "camera_steady", self._body.look().is_steady)


class Lasers:
    """Records the distances of the nearest objects: in front, behind, and, if not on the map, in any direction."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Start to record five times a second."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("lasers")
        self._body = body
        self._periodic_calls = PeriodicCalls(clock, PERIOD_S, self._record_gaps)

    def _record_gaps(self) -> None:
        strange_gap_m = gap_m(moving_points(self._body, containers_m(self._knowledge.snapshot())))
        with self._handle.transaction() as change:
            change.set("robot", "strange_gap", min(strange_gap_m, FARTHEST_M))
            change.set("robot", "front_gap", min(self._gap_m(side) for side in FRONT))
            change.set("robot", "back_gap", self._gap_m(Side.BACK))

    def _gap_m(self, side: Side) -> float:
        return float(self._body.scan(side).ranges_m.min())
