"""The leaf `MoveTo`: one or more goals for the task `navigating`, in sequence."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Task
from codra_dsl.runtime.geometry import FrameError
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge
from codra_papers.store.body import Way
from codra_papers.store.geometry import Pose2D, wrapped
from codra_papers.store.knowledge import floor_pose_of, pose_of

ARRIVAL_TOLERANCE_M = 0.3
ARRIVAL_TOLERANCE_RAD = 0.2
"""Within these limits the robot is treated as being at a named pose: its localisation is some centimetres off."""

_DELIVERY = "_delivery"
_APPROACH = "_approach"


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A goal, and the direction of driving."""

    pose: Pose2D
    way: Way = Way.FORWARD


class MoveTo(Action):
    """Drives to the value of the port `pose`: a `Goal`, or the name of a pose in the graph.

    A delivery pose lies in a recess, with the container behind the robot. So the robot backs up to a delivery pose from
    the approach pose of the same area. If the port names another pose, and the robot is already there, the robot does
    not drive.
    """

    def __init__(self, agent: AgentHandle, knowledge: Knowledge) -> None:
        """Create the leaf for an agent, which must be a requester of `navigating`."""
        self._agent = agent
        self._knowledge = knowledge
        self._task = Task("navigating", agent, knowledge, succeeds_with=("arrived",))
        self._next_goals: list[Goal] = []
        self._is_requested = False

    def start(self, ports: Ports) -> Result:
        """Drive to the first goal, as soon as no other request for `navigating` is open."""
        self._next_goals, self._is_requested = list(self._goals(ports.value("pose"))), False
        return self.go_on(ports)

    def go_on(self, ports: Ports) -> Result:
        """Drive to the next goal when a goal is reached."""
        if self._is_requested:
            result = self._task.go_on(ports)
            if result is not Result.SUCCESS:
                return result
            self._is_requested = False
        if not self._next_goals:
            return Result.SUCCESS
        if not self._knowledge.snapshot().handover("navigating").is_open:
            self._request_drive(self._next_goals.pop(0), ports)
        return Result.RUNNING

    def halt(self, ports: Ports) -> None:
        """Stop driving."""
        if self._is_requested:
            self._task.halt(ports)
        self._next_goals, self._is_requested = [], False

    def _request_drive(self, goal: Goal, ports: Ports) -> None:
        with self._agent.transaction() as change:
            change.place("world", "goal_pose", "goal", pose_of(goal.pose))
            change.set("goal", "goal_way", goal.way)
        self._is_requested = True
        self._task.start(ports)

    def _goals(self, pose: object) -> tuple[Goal, ...]:
        if isinstance(pose, Goal):
            return (pose,)
        name = str(pose)
        last = Goal(pose=self._named_pose(name))
        if name.endswith(_DELIVERY):
            approach = self._named_pose(name.removesuffix(_DELIVERY) + _APPROACH)
            return Goal(pose=approach), Goal(pose=last.pose, way=Way.BACKWARD)
        return () if self._is_at(last.pose) else (last,)

    def _named_pose(self, name: str) -> Pose2D:
        return floor_pose_of(self._knowledge.transform("world", name).pose)

    def _is_at(self, pose: Pose2D) -> bool:
        try:
            robot_pose = floor_pose_of(self._knowledge.transform("world", "robot").pose)
        except FrameError:  # the robot has no pose yet
            return False
        return (
            robot_pose.distance_m(pose) < ARRIVAL_TOLERANCE_M
            and abs(wrapped(robot_pose.heading_rad - pose.heading_rad)) < ARRIVAL_TOLERANCE_RAD
        )
