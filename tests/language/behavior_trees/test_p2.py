"""P2's two trees: global management and pick-up management (P2, sections 3.2 and 5.2, Figures 2, 3 and 7)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from codra_dsl.generation.emit.behaviour_trees import tree_module
from codra_dsl.language.behavior_trees import check, read, write
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Action, Ports, Result, Robot, Scope, Task, Tree
from codra_dsl.runtime.knowledge import Knowledge, Request, Stage
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel, NodeModel, NodeTypeModel, TaskModel
from tests.language.behavior_trees.stories import functions

ROOT = Path(__file__).parents[3]
SHOP = KnowledgeModel(
    name="shop",
    node_types=(NodeTypeModel(name="robot"),),
    nodes=(NodeModel(name="robot", type="robot"),),
    tasks=(
        TaskModel(
            name="fetching",
            origin="robot",
            by="picking",
            requesters=("mission",),
            results=("fetched", "not_found", "failed"),
            acknowledge_s=2.0,
            finish_s=600.0,
        ),
    ),
)


def tree(name: str, robot: Robot, scope: Scope, clock: SimClock) -> Tree:
    """Return the main tree of a file of the repository."""
    forest, problems = read(ROOT / "specs" / "trees" / f"{name}.xml", ROOT)
    assert forest is not None
    checked, check_problems = check(forest)
    assert (problems, check_problems) == ((), ())
    assert checked is not None
    assert forest.main is not None
    return Tree(functions(tree_module(checked))[forest.main](), leaves=robot, clock=clock, scope=scope)


class Drive(Action):
    """An action that drives somewhere in two ticks."""

    def __init__(self, log: list[str]) -> None:
        self._log = log

    def start(self, ports: Ports) -> Result:
        self._log.append(f"drive to {ports.text('pose')}")
        return Result.RUNNING

    def go_on(self, ports: Ports) -> Result:
        self._log.append(f"reached {ports.text('pose')}")
        return Result.SUCCESS

    def halt(self, ports: Ports) -> None:
        self._log.append(f"stopped on the way to {ports.text('pose')}")


def cary(log: list[str], seen: list[bool]) -> Robot:
    """Return the robot's simple actions; `seen` has the results of detections. The last result repeats."""

    def logging_action(format_entry: Callable[[Ports], str]) -> Callable[[Ports], bool]:
        def action(ports: Ports) -> bool:
            log.append(format_entry(ports))
            return True

        return action

    def detect(ports: Ports) -> bool:
        ports.set("container_pose", "container")
        ports.set("fork_towards", "before it")
        log.append("look")
        return seen.pop(0) if len(seen) > 1 else seen[0]

    def check_wheels(ports: Ports) -> bool:
        ports.set("fork_pose", "wheels")
        return True

    robot = Robot()
    robot.can("MoveTo", lambda: Drive(log))
    robot.does("DetectContainer", detect)
    robot.does("CheckWheels", check_wheels)
    robot.does("Rotate", logging_action(lambda ports: f"rotate {ports.number('angle_deg'):g}"))
    robot.does("RaiseFork", logging_action(lambda _: "raise the fork"))
    robot.does("LowerFork", logging_action(lambda _: "lower the fork"))
    robot.does("Inform", logging_action(lambda ports: ports.text("message")))
    robot.does("IsLoaded", lambda _: log.count("raise the fork") > log.count("lower the fork"))
    return robot


class Cary:
    """Both loops on one graph: the mission hands over the pick-up, and the other executor ticks its tree."""

    def __init__(self, *seen: bool) -> None:
        self.log: list[str] = []
        clock = SimClock()
        self.clock = clock
        self.knowledge = Knowledge(SHOP, clock=clock)
        self.mission_agent = self.knowledge.as_agent("mission")
        self.picking_agent = self.knowledge.as_agent("picking")
        robot = cary(self.log, list(seen))
        robot.can("PickUp", lambda: Task("fetching", self.mission_agent, self.knowledge, succeeds_with=("fetched",)))
        robot.does("TakeOrder", self._take)
        robot.does("CompleteOrder", self._complete)
        robot.does("SetOrderAside", lambda _: self._close("order set aside"))
        robot.does("ResumeOrders", lambda _: True)
        robot.does("RedirectOrder", lambda _: self._close("order redirected"))
        robot.does("GiveOrderUp", lambda _: False)
        robot.does("CloseOrder", lambda ports: self._close(f"order {ports.text('outcome')}"))
        robot.does("IsRequested", self._is_requested)
        robot.does("Report", self._report)
        self.mission_scope = Scope()
        self.mission = tree("mission", robot, self.mission_scope, clock)
        self.picking = tree("pick_up", robot, Scope(), clock)
        self._request: Request | None = None
        self._has_order = False

    def _complete(self, _: Ports) -> bool:
        self._has_order = False
        return True

    def _close(self, event: str) -> bool:
        had_order, self._has_order = self._has_order, False
        if had_order:
            self.log.append(event)
        return had_order

    def _take(self, ports: Ports) -> bool:
        self._has_order = True
        for name in ("observation_pose", "delivery_pose"):
            ports.set(name, name)
        return True

    def _is_requested(self, ports: Ports) -> bool:
        handover = self.knowledge.snapshot().handover("fetching")
        if handover.stage is Stage.WANTS:
            self.picking_agent.acknowledge(handover.request)
            self._request = handover.request
        ports.set("second_observation_pose", "second pose")
        return handover.is_open

    def _report(self, ports: Ports) -> bool:
        request, self._request = self._request, None
        if request is not None:
            self.picking_agent.finish(request, ports.text("result"))
        return True

    def step(self) -> Result:
        """Run one period of both executors."""
        self.clock.sleep(0.5)
        result = self.mission.tick()
        self.picking.tick()
        return result

    def run(self, until: Callable[[], bool] = lambda: False) -> Result:
        """Step until the mission ends or `until` is true."""
        for _ in range(50):
            result = self.step()
            if result is not Result.RUNNING or until():
                return result
        raise AssertionError(self.log)


def test_the_nominal_branch_picks_up_delivers_and_returns() -> None:
    robot = Cary(True)

    assert robot.run() is Result.SUCCESS
    assert robot.log == [
        *("drive to observation_pose", "reached observation_pose"),
        *("look", "drive to container", "reached container", "look", "rotate 180"),
        *("drive to wheels", "reached wheels", "raise the fork"),
        *("drive to delivery_pose", "reached delivery_pose", "lower the fork", "mission completed"),
        *("drive to start", "reached start"),
    ]


def test_a_container_that_is_not_visible_from_the_first_pose_is_detected_from_the_second() -> None:
    robot = Cary(False, True)

    assert robot.run() is Result.SUCCESS
    assert robot.log[2:6] == ["look", "drive to second pose", "reached second pose", "look"]
    assert robot.log[-4:] == ["lower the fork", "mission completed", "drive to start", "reached start"]


def test_a_missing_container_is_reported_and_the_robot_returns() -> None:
    robot = Cary(False)

    assert robot.run() is Result.SUCCESS
    assert robot.log[2:] == [
        *("look", "drive to second pose", "reached second pose", "look", "no roll container found"),
        *("order failed", "mission aborted", "drive to start", "reached start"),
    ]


def test_a_full_container_goes_to_the_general_delivery_pose_instead() -> None:
    """Situation (a): the delivery to the second picking area is aborted."""
    robot = Cary(True)
    robot.run(until=lambda: robot.log[-1] == "drive to delivery_pose")

    robot.mission_scope.create("course", "deliver")

    assert robot.run() is Result.SUCCESS
    after = robot.log.index("drive to delivery_pose") + 1
    assert robot.log[after:] == [
        *("stopped on the way to delivery_pose", "drive to delivery_delivery", "reached delivery_delivery"),
        *("lower the fork", "roll container delivered", "drive to start", "reached start"),
    ]


@pytest.mark.parametrize(("course", "pose"), [("start", "start"), ("dock", "dock")])
def test_another_course_aborts_the_pick_up_through_the_graph(course: str, pose: str) -> None:
    """Situation (b), as in Figure 3: the executor of the pick-up sees that its task is aborted, and stops its tree."""
    robot = Cary(True)
    robot.run(until=lambda: robot.log[-1] == "drive to container")

    robot.mission_scope.create("course", course)

    assert robot.run() is Result.SUCCESS
    handover = robot.knowledge.snapshot().handover("fetching")
    assert (handover.stage, handover.reason) == (Stage.ABORTED, "requester")
    after = robot.log.index("drive to container") + 1
    assert robot.log[after : after + 5] == [
        *("order set aside", "mission aborted"),
        *(f"drive to {pose}", "stopped on the way to container", f"reached {pose}"),
    ]
    assert not robot.picking.root.is_running


def test_an_unknown_course_runs_the_nominal_branch() -> None:
    robot = Cary(True)
    robot.mission_scope.create("course", "pick")

    assert robot.step() is Result.RUNNING
    assert robot.log == ["drive to observation_pose"]


@pytest.mark.parametrize("name", ["mission", "pick_up"])
def test_the_files_are_in_the_form_that_codra_writes(name: str) -> None:
    path = ROOT / "specs" / "trees" / f"{name}.xml"
    forest, _ = read(path, ROOT)
    assert forest is not None

    assert write(forest.files[0]) == path.read_text("utf-8")
