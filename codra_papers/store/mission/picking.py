"""The agent `picking`: it fetches a container when the mission requests one (P2, sections 3.2 and 5.2).

The agent communicates with the mission only by the task `fetching`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from math import pi

from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Robot, Task
from codra_dsl.runtime.knowledge import ConflictError, Knowledge, Request, Stage
from codra_papers.store.body import Way
from codra_papers.store.geometry import Pose2D
from codra_papers.store.knowledge import floor_pose_of
from codra_papers.store.layout import AREAS, approach_to, robot_at
from codra_papers.store.mission.move_to import Goal, MoveTo

_NOTICES = {"no roll container found": "container_not_found", "pose not determined": "container_not_placed"}


class Picking:
    """Executes requests for containers."""

    def __init__(self, knowledge: Knowledge) -> None:
        """Open the handle of the agent `picking`; no request is accepted yet."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("picking")
        self._request: Request | None = None
        self._area = ""
        self._handle.set("robot", "picking_up", False)

    def leaves(self) -> Robot:
        """Return the functions of the leaves of `trees/pick_up.xml`."""
        robot = Robot()
        knowledge, handle = self._knowledge, self._handle
        robot.does("IsRequested", self._is_requested)
        robot.does("Report", self._report)
        robot.does("Inform", self._inform)
        robot.can("MoveTo", lambda: MoveTo(handle, knowledge))
        robot.can(
            "DetectContainer", lambda: _TaskWithCallback(self._task("detecting", "found"), self._set_approach_goals)
        )
        robot.can("CheckWheels", lambda: _TaskWithCallback(self._task("checking", "found"), self._set_fork_goal))
        robot.can("Rotate", lambda: self._task("rotating", "turned"))
        robot.can("RaiseFork", lambda: self._task("lifting", "lifted"))
        return robot

    def _task(self, name: str, success: str) -> Task:
        return Task(name, self._handle, self._knowledge, succeeds_with=(success,))

    def _is_requested(self, ports: Ports) -> bool:
        """Accept a new request, if there is any, and return whether a request is active."""
        handover = self._knowledge.snapshot().handover("fetching")
        if handover.stage is Stage.WANTS:
            self._accept(handover.request)
        is_mine = self._request is not None and self._request == handover.request and handover.is_open
        if not is_mine and self._request is not None:
            self._end()
        if is_mine:
            ports.set("second_observation_pose", self._second_pose_name())
        return is_mine

    def _accept(self, request: Request) -> None:
        try:
            self._handle.acknowledge(request)
        except ConflictError:  # the request was taken back at the same instant
            return
        self._request = request
        self._area = self._nearest_area()
        self._handle.set("robot", "picking_up", True)

    def _report(self, ports: Ports) -> bool:
        """Finish the request with the result that the port `result` gives, unless the request has already ended."""
        request = self._request
        if request is not None:
            with suppress(ConflictError):  # the request has already ended
                self._handle.finish(request, ports.text("result"))
            self._end()
        return True

    def _end(self) -> None:
        self._request = None
        self._handle.set("robot", "picking_up", False)

    def _inform(self, ports: Ports) -> bool:
        notice = _NOTICES.get(ports.text("message"))
        if notice is not None:
            self._handle.set("base", "base_notice", notice)
        return True

    def _set_approach_goals(self, ports: Ports) -> None:
        approach = approach_to(self._container_pose())
        ports.set("container_pose", Goal(pose=approach.turned(pi)))
        ports.set("fork_towards", Goal(pose=approach))

    def _set_fork_goal(self, ports: Ports) -> None:
        ports.set("fork_pose", Goal(pose=robot_at(self._container_pose()), way=Way.BACKWARD))

    def _second_pose_name(self) -> str:
        """Return the name of the last observation pose. Areas without hidden places have only one pose."""
        return f"{self._area}_pose_{len(AREAS[self._area].observation_poses)}"

    def _nearest_area(self) -> str:
        """Return the area whose first observation pose is nearest to the robot."""
        robot = floor_pose_of(self._knowledge.transform("world", "robot").pose)
        return min(AREAS, key=lambda name: (robot.distance_m(AREAS[name].observation_poses[0]), name))

    def _container_pose(self) -> Pose2D:
        """Return the pose of the known container that is nearest to the delivery pose of the area."""
        snapshot = self._knowledge.snapshot()
        delivery = AREAS[self._area].delivery
        poses = [
            floor_pose_of(snapshot.transform("world", node.name).pose)
            for node in snapshot.nodes("roll_container")
            if snapshot.parent(node.name) == "world"
        ]
        return min(poses, key=lambda pose: (pose.distance_m(delivery), pose.x_m, pose.y_m))


class _TaskWithCallback(Action):
    """A task, and a function that is called if the task succeeds."""

    def __init__(self, task: Task, on_success: Callable[[Ports], None]) -> None:
        self._task = task
        self._on_success = on_success

    def start(self, ports: Ports) -> Result:
        return self._call_on_success(self._task.start(ports), ports)

    def go_on(self, ports: Ports) -> Result:
        return self._call_on_success(self._task.go_on(ports), ports)

    def halt(self, ports: Ports) -> None:
        self._task.halt(ports)

    def _call_on_success(self, result: Result, ports: Ports) -> Result:
        if result is Result.SUCCESS:
            self._on_success(ports)
        return result
