"""The leaf `MoveTo`: one or more goals for the task `navigating`, in sequence."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Task
from codra_dsl.runtime.geometry import FrameError
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge
from codra_papers.store.body import Way
from codra_papers.store.geometry import Pose2D, wrapped
from codra_papers.store.knowledge import floor_pose_of, pose_of

THERE_M = 0.3
THERE_RAD = 0.2
"""Within these limits the robot counts as at a named pose, because its localisation is some centimetres off."""

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
    the approach pose that belongs to it. If the robot is already at another named pose, it does not drive.
    """

    def __init__(self, agent: AgentHandle, knowledge: Knowledge) -> None:
        """Create the leaf for an agent, which must be a requester of `navigating`."""
        self._agent = agent
        self._knowledge = knowledge
        self._task = Task("navigating", agent, knowledge, succeeds_with=("arrived",))
        self._next_goals: list[Goal] = []
        self._is_asked = False

    def start(self, ports: Ports) -> Result:
        """Drive to the first goal, as soon as no other request for `navigating` is open."""
        self._next_goals, self._is_asked = list(self._goals(ports.value("pose"))), False
        return self.go_on(ports)

    def go_on(self, ports: Ports) -> Result:
        """Drive to the next goal when one is reached."""
        if self._is_asked:
            result = self._task.go_on(ports)
            if result is not Result.SUCCESS:
                return result
            self._is_asked = False
        if not self._next_goals:
            return Result.SUCCESS
        if not self._knowledge.snapshot().handover("navigating").is_open:
            self._ask(self._next_goals.pop(0), ports)
        return Result.RUNNING

    def halt(self, ports: Ports) -> None:
        """Stop driving."""
        if self._is_asked:
            self._task.halt(ports)
        self._next_goals, self._is_asked = [], False

    def _ask(self, goal: Goal, ports: Ports) -> None:
        with self._agent.transaction() as change:
            change.place("world", "goal_pose", "goal", pose_of(goal.pose))
            change.set("goal", "goal_way", goal.way)
        self._is_asked = True
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
            robot = floor_pose_of(self._knowledge.transform("world", "robot").pose)
        except FrameError:  # the robot has no pose yet
            return False
        return robot.distance_m(pose) < THERE_M and abs(wrapped(robot.heading_rad - pose.heading_rad)) < THERE_RAD
