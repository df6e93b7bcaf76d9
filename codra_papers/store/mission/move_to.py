"""The leaf `MoveTo`: one or more goals of the task `navigating`, one after the other."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Task
from codra_dsl.runtime.geometry import FrameError
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge
from codra_papers.store.body import Way
from codra_papers.store.geometry import Pose2D, wrapped
from codra_papers.store.knowledge import pose_of, stand_of

THERE_M = 0.3
THERE_RAD = 0.2
"""Who stands so near to a named pose is there: the robot's own idea of where it stands is some centimetres off."""

_DELIVERY = "_delivery"
_APPROACH = "_approach"


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """Where to drive, and how."""

    stand: Pose2D
    way: Way = Way.FORWARD


class MoveTo(Action):
    """Drives to what the port `pose` says: a `Goal`, or the name of a pose in the graph.

    A delivery pose lies in a recess, its container behind the robot: so it is backed up to from its approach.
    A named pose at which the robot stands is reached without driving.
    """

    def __init__(self, agent: AgentHandle, knowledge: Knowledge) -> None:
        """Drive for an agent, which must be a requester of `navigating`."""
        self._agent = agent
        self._knowledge = knowledge
        self._task = Task("navigating", agent, knowledge, succeeds_with=("arrived",))
        self._ahead: list[Goal] = []
        self._is_asked = False

    def start(self, ports: Ports) -> Result:
        """Drive to the first goal, as soon as nobody else drives."""
        self._ahead, self._is_asked = list(self._goals(ports.value("pose"))), False
        return self.go_on(ports)

    def go_on(self, ports: Ports) -> Result:
        """Go on to the next goal when one is reached."""
        if self._is_asked:
            result = self._task.go_on(ports)
            if result is not Result.SUCCESS:
                return result
            self._is_asked = False
        if not self._ahead:
            return Result.SUCCESS
        if not self._knowledge.snapshot().handover("navigating").is_open:
            self._ask(self._ahead.pop(0), ports)
        return Result.RUNNING

    def halt(self, ports: Ports) -> None:
        """Stop driving."""
        if self._is_asked:
            self._task.halt(ports)
        self._ahead, self._is_asked = [], False

    def _ask(self, goal: Goal, ports: Ports) -> None:
        with self._agent.transaction() as change:
            change.place("world", "goal_pose", "goal", pose_of(goal.stand))
            change.set("goal", "goal_way", goal.way)
        self._is_asked = True
        self._task.start(ports)

    def _goals(self, pose: object) -> tuple[Goal, ...]:
        if isinstance(pose, Goal):
            return (pose,)
        name = str(pose)
        last = Goal(stand=self._named(name))
        if name.endswith(_DELIVERY):
            approach = self._named(name.removesuffix(_DELIVERY) + _APPROACH)
            return Goal(stand=approach), Goal(stand=last.stand, way=Way.BACKWARD)
        return () if self._is_at(last.stand) else (last,)

    def _named(self, name: str) -> Pose2D:
        return stand_of(self._knowledge.transform("world", name).pose)

    def _is_at(self, stand: Pose2D) -> bool:
        try:
            robot = stand_of(self._knowledge.transform("world", "robot").pose)
        except FrameError:  # nobody has said yet where it is
            return False
        return robot.distance_m(stand) < THERE_M and abs(wrapped(robot.heading_rad - stand.heading_rad)) < THERE_RAD
