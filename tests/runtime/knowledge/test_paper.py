"""P2's own examples: Figure 1 as its prose tells it, and the steps t to t+7 of section 3.2."""

from __future__ import annotations

import numpy as np

from codra_dsl.logic import value
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.geometry import Outcome, Pose
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge, Request, Snapshot, Stage
from codra_dsl.runtime.knowledge.declarations import absent, distance, path, some
from tests.runtime.knowledge.store import store

ROBOT = Pose.about((0.0, 0.0, 1.0), 0.5, (2.0, 1.0, 0.0))
CONTAINER = Pose.about((0.0, 0.0, 1.0), -0.25, (3.0, 1.5, 0.0))


def test_figure_1_holds_symbols_and_geometry_in_one_structure() -> None:
    knowledge = store()
    navigation, detection = knowledge.as_agent("navigation"), knowledge.as_agent("container_detection")
    people = knowledge.as_agent("person_detection")
    navigation.place("world", "robot_pose", "robot", ROBOT)
    detection.insert_node("roll_container", "roll_container")
    detection.place("world", "container_pose", "roll_container", CONTAINER)
    detection.insert_edge("roll_container", "close_to", "robot")
    people.insert_edge("people", "is_not", "robot")
    seen = knowledge.snapshot()

    by_hand = np.linalg.inv(np.array(ROBOT.matrix())) @ np.array(CONTAINER.matrix())
    found = seen.transform("robot", "roll_container")
    np.testing.assert_allclose(np.array(found.pose.matrix()), by_hand, atol=1e-12)
    assert found.outcome is Outcome.EXACT
    (close,) = seen.match(path(some("roll_container", called="container"), "close_to", "robot"))
    assert close.node("container") == "roll_container"
    assert seen.holds(path("people", "is_not", "robot"), distance("robot", "roll_container") < 1.2)
    assert seen.get("battery", "level").value == 80.0
    assert seen.holds(path("robot", "has", some("battery", called="battery")), value("battery.level") > 50.0)


class Trial:
    """The agents of section 3.2, each with the handle of its own name."""

    def __init__(self) -> None:
        self.clock = SimClock()
        self.knowledge: Knowledge = store(self.clock)
        self.decider = self.knowledge.as_agent("decision_maker")
        self.navigation = self.knowledge.as_agent("navigation")
        self.detection = self.knowledge.as_agent("container_detection")
        self.picking = self.knowledge.as_agent("picking")
        self.fork = self.knowledge.as_agent("fork")

    def tasks(self) -> dict[str, str]:
        """Return how far each task is that was asked for, by the edges of the graph."""
        seen = self.knowledge.snapshot()
        return {edge.target: edge.label for edge in seen.edges(origin="robot") if edge.type in set(Stage)}

    def do(self, requester: AgentHandle, executor: AgentHandle, task: str, **goal: float) -> Request:
        """Hand a task over: it is asked for, and acknowledged a moment later."""
        request = requester.request(task, **goal)
        assert self.tasks()[task] == "wants"
        self.clock.sleep(0.2)
        executor.acknowledge(request)
        assert self.tasks()[task] == "is"
        return request

    def pass_time(self) -> Snapshot:
        """Let the task go on for a while; return the graph at the end of the step."""
        self.clock.sleep(5.0)
        return self.knowledge.snapshot()


def test_section_3_2_is_replayed_step_by_step() -> None:
    trial = Trial()
    navigating = trial.do(trial.decider, trial.navigation, "navigating", goal_x=2.0, goal_y=1.0)
    trial.navigation.place("world", "robot_pose", "robot", ROBOT)
    trial.navigation.insert_edge("robot", "in", "area_1")
    trial.navigation.finish(navigating, "ok")

    # t: the robot is in the picking area, and the executor's ACK turns `wants` into `is`
    detecting = trial.do(trial.decider, trial.detection, "detecting")
    seen = trial.pass_time()
    assert trial.tasks() == {"navigating": "finished", "detecting": "is"}
    assert seen.holds(path("robot", "in", "area_1"), absent("world", "container_pose", some("roll_container")))

    # t+1: result, node and pose become visible together; then the robot approaches
    with trial.detection.transaction() as found:
        found.insert_node("container_1", "roll_container")
        found.place("world", "container_pose", "container_1", CONTAINER)
        found.finish(detecting, "ok")
    navigating = trial.do(trial.decider, trial.navigation, "navigating", goal_x=2.6, goal_y=1.2)
    seen = trial.pass_time()
    assert trial.tasks() == {"detecting": "finished", "navigating": "is"}
    assert seen.holds(value("detecting.result") == "ok", path("world", "container_pose", some("roll_container")))
    assert (seen.get("navigating", "goal_x").value, seen.get("navigating", "goal_x").source) == (2.6, "decision_maker")

    # t+2: one last check that the container has not been moved
    trial.navigation.finish(navigating, "ok")
    detecting = trial.do(trial.decider, trial.detection, "detecting")
    assert not trial.pass_time().get("detecting", "result").known
    assert trial.tasks() == {"navigating": "finished", "detecting": "is"}
    trial.detection.finish(detecting, "ok")
    pick_up(trial)


def pick_up(trial: Trial) -> None:
    """Go on with t+3 to t+7, in which the picking agent hands over tasks of its own."""
    # t+3: the picking up task begins; its agent rotates the robot
    picking_up = trial.do(trial.decider, trial.picking, "picking_up")
    rotating = trial.do(trial.picking, trial.navigation, "rotating")
    trial.pass_time()
    assert trial.tasks() == {"navigating": "finished", "detecting": "finished", "picking_up": "is", "rotating": "is"}

    # t+4: turned by 180 degrees it checks the wheels of the container
    turned = Pose.about((0.0, 0.0, 1.0), 0.5 + np.pi, ROBOT.translation_m)
    trial.navigation.place("world", "robot_pose", "robot", turned)
    trial.navigation.finish(rotating, "ok")
    detecting = trial.do(trial.picking, trial.detection, "detecting")
    trial.pass_time()
    assert trial.tasks()["rotating"] == "finished"
    assert trial.knowledge.snapshot().handover("detecting").requester == "picking"
    trial.detection.finish(detecting, "ok")

    # t+5: it approaches the container, for which the robot starts navigating, backwards
    approaching = trial.do(trial.picking, trial.navigation, "approaching")
    navigating = trial.decider.request("navigating", goal_x=2.9, goal_y=1.4)
    assert trial.tasks() | {"detecting": "finished"} == {
        "rotating": "finished",
        "detecting": "finished",
        "picking_up": "is",
        "approaching": "is",
        "navigating": "wants",
    }
    trial.navigation.acknowledge(navigating)
    trial.pass_time()
    trial.navigation.finish(navigating, "ok")
    trial.navigation.finish(approaching, "ok")

    # t+6 and t+7: the fork lifts the container, which stands on the robot from then on
    lifting = trial.do(trial.picking, trial.fork, "lifting")
    trial.pass_time()
    assert trial.tasks()["lifting"] == "is"
    with trial.fork.transaction() as lifted:
        lifted.place("robot", "carried", "container_1", Pose.of((-0.6, 0.0, 0.1)))
        lifted.finish(lifting, "ok")
    trial.picking.finish(picking_up, "ok")
    seen = trial.pass_time()
    assert set(trial.tasks().values()) == {"finished"}
    assert seen.holds(
        path("robot", "carried", some("roll_container")), absent("world", "container_pose", "container_1")
    )
    assert seen.transform("robot", "container_1").pose.translation_m == (-0.6, 0.0, 0.1)
