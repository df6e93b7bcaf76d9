"""P2's examples: Figure 1 as described in the text, and the steps t to t+7 of section 3.2."""

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
    transform = seen.transform("robot", "roll_container")
    np.testing.assert_allclose(np.array(transform.pose.matrix()), by_hand, atol=1e-12)
    assert transform.outcome is Outcome.EXACT
    (close,) = seen.match(path(some("roll_container", called="container"), "close_to", "robot"))
    assert close.node("container") == "roll_container"
    assert seen.holds(path("people", "is_not", "robot"), distance("robot", "roll_container") < 1.2)
    assert seen.get("battery", "level").value == 80.0
    assert seen.holds(path("robot", "has", some("battery", called="battery")), value("battery.level") > 50.0)


TURNED = Pose.about((0.0, 0.0, 1.0), 0.5 + np.pi, ROBOT.translation_m)
WHEELS = Pose.about((0.0, 0.0, 1.0), -0.2, (3.05, 1.48, 0.0))
"""The pose of the container according to its wheels, after the robot has turned round."""

LIFTED = Pose.of((-0.6, 0.0, 0.1))

STEPS: dict[str, dict[str, str]] = {
    "t": {"navigating": "finished", "detecting": "is"},
    "t+1": {"navigating": "is", "detecting": "finished"},
    "t+2": {"navigating": "finished", "detecting": "is"},
    "t+3": {"navigating": "finished", "detecting": "finished", "picking_up": "is", "rotating": "is"},
    "t+4": {"navigating": "finished", "detecting": "is", "picking_up": "is", "rotating": "finished"},
    "t+5": {
        "navigating": "is",
        "detecting": "finished",
        "picking_up": "is",
        "rotating": "finished",
        "approaching": "is",
    },
    "t+6": {
        "navigating": "finished",
        "detecting": "finished",
        "picking_up": "is",
        "rotating": "finished",
        "approaching": "finished",
        "lifting": "is",
    },
    "t+7": dict.fromkeys(("navigating", "detecting", "picking_up", "rotating", "approaching", "lifting"), "finished"),
}
"""The tasks with edges from the robot at every step, according to section 3.2 and Figure 2."""


def tasks(seen: Snapshot) -> dict[str, str]:
    """Return the stages of the requested tasks, by the edges of a graph."""
    return {edge.target: edge.label for edge in seen.edges(origin="robot") if edge.type in set(Stage)}


class Trial:
    """The agents of section 3.2 with their handles, and the graph of every step."""

    def __init__(self) -> None:
        self.clock = SimClock()
        self.knowledge: Knowledge = store(self.clock)
        self.decider = self.knowledge.as_agent("decision_maker")
        self.navigation = self.knowledge.as_agent("navigation")
        self.detection = self.knowledge.as_agent("container_detection")
        self.people = self.knowledge.as_agent("person_detection")
        self.picking = self.knowledge.as_agent("picking")
        self.fork = self.knowledge.as_agent("fork")
        self.graphs: dict[str, Snapshot] = {}

    def do(self, requester: AgentHandle, executor: AgentHandle, task: str, **goal: float) -> Request:
        """Hand a task over: request it, and acknowledge it a moment later. It has no result until it ends."""
        request = requester.request(task, **goal)
        assert tasks(self.knowledge.snapshot())[task] == "wants"
        self.clock.sleep(0.2)
        executor.acknowledge(request)
        seen = self.knowledge.snapshot()
        assert tasks(seen)[task] == "is"
        assert (seen.get(task, "requester").value, seen.get(task, "result").known) == (requester.name, False)
        return request

    def end(self, executor: AgentHandle, request: Request) -> None:
        """End a task with the result OK."""
        executor.finish(request, "ok")
        seen = self.knowledge.snapshot()
        assert (tasks(seen)[request.task], seen.get(request.task, "result").value) == ("finished", "ok")

    def step(self, name: str) -> Snapshot:
        """Let time pass, while reactive agents write as well; return the graph of the step."""
        self.clock.sleep(5.0)
        self.navigation.set("battery", "level", 79.0 - len(self.graphs))
        self.people.insert_edge("people", "is_not", "robot")
        self.graphs[name] = seen = self.knowledge.snapshot()
        assert tasks(seen) == STEPS[name]
        return seen


def is_near(pose: Pose, expected: Pose) -> bool:
    """Return whether two poses are equal except for rounding."""
    return pose.distance_m(expected) < 1e-9 and pose.angle_rad(expected) < 1e-6


def test_section_3_2_is_replayed_step_by_step() -> None:
    trial = Trial()
    # before: the picker's request is a goal of the navigation agent, which drives to observation pose 1
    navigating = trial.do(trial.decider, trial.navigation, "navigating", goal_x=2.0, goal_y=1.0)
    trial.navigation.place("world", "robot_pose", "robot", ROBOT)
    trial.navigation.insert_edge("robot", "in", "area_1")
    trial.end(trial.navigation, navigating)

    # t: in picking area 1 the decision maker wakes the detection, whose ACK turns the edge into `is`
    detecting = trial.do(trial.decider, trial.detection, "detecting")
    seen = trial.step("t")
    assert seen.holds(path("robot", "in", "area_1"), absent("world", "container_pose", some("roll_container")))
    assert not seen.nodes("roll_container")

    # t+1: result, node and position are written; the robot approaches the estimated pose, a new goal of navigating
    with trial.detection.transaction() as transaction:
        transaction.finish(detecting, "ok")
        transaction.insert_node("container_1", "roll_container")
        transaction.place("world", "container_pose", "container_1", CONTAINER)
    navigating = trial.do(trial.decider, trial.navigation, "navigating", goal_x=2.6, goal_y=1.2)
    seen = trial.step("t+1")
    assert seen.holds(value("detecting.result") == "ok", path("world", "container_pose", "container_1"))
    assert is_near(seen.transform("world", "container_1").pose, CONTAINER)
    assert (seen.get("navigating", "goal_x").value, seen.get("navigating", "goal_x").source) == (2.6, "decision_maker")

    # t+2: the detection checks once more that the container has not been moved
    trial.end(trial.navigation, navigating)
    detecting = trial.do(trial.decider, trial.detection, "detecting")
    seen = trial.step("t+2")
    assert (seen.handover("detecting").number, seen.get("detecting", "result").known) == (2, False)
    trial.end(trial.detection, detecting)
    pick_up(trial)
    # the graph of every step is unchanged at the end
    assert {name: tasks(graph) for name, graph in trial.graphs.items()} == STEPS
    assert [graph.get("battery", "level").value for graph in trial.graphs.values()] == [79.0 - at for at in range(8)]
    assert all(graph.holds(path("people", "is_not", "robot")) for graph in trial.graphs.values())


def pick_up(trial: Trial) -> None:
    """Continue with t+3 to t+7, in which the picking agent hands over tasks of its own."""
    # t+3: the robot starts to pick up, for which its agent rotates it
    picking_up = trial.do(trial.decider, trial.picking, "picking_up")
    rotating = trial.do(trial.picking, trial.navigation, "rotating")
    trial.step("t+3")

    # t+4: turned by 180 degrees, it checks the wheels, which show the pose of the container again
    trial.navigation.place("world", "robot_pose", "robot", TURNED)
    trial.end(trial.navigation, rotating)
    detecting = trial.do(trial.picking, trial.detection, "detecting")
    seen = trial.step("t+4")
    assert seen.handover("detecting").requester == "picking"
    assert is_near(seen.transform("world", "robot").pose, TURNED)
    trial.detection.place("world", "container_pose", "container_1", WHEELS)
    trial.end(trial.detection, detecting)

    # t+5: it must approach; a new pose is navigation's goal, and the decision maker starts navigating, backwards
    approaching = trial.do(trial.picking, trial.navigation, "approaching")
    goal = trial.knowledge.transform("world", "container_1").pose.translation_m
    navigating = trial.do(trial.decider, trial.navigation, "navigating", goal_x=goal[0], goal_y=goal[1])
    seen = trial.step("t+5")
    assert is_near(seen.transform("world", "container_1").pose, WHEELS)
    assert [seen.get("navigating", name).value for name in ("goal_x", "goal_y")] == list(WHEELS.translation_m[:2])
    assert seen.handover("navigating").requester == "decision_maker"
    assert seen.transform("robot", "container_1").pose.translation_m[0] < 0.0  # it lies behind the robot, as the fork
    trial.end(trial.navigation, navigating)
    trial.end(trial.navigation, approaching)

    # t+6: the robot lifts the container with its fork
    lifting = trial.do(trial.picking, trial.fork, "lifting")
    seen = trial.step("t+6")
    assert seen.parent("container_1") == "world"

    # t+7: the container is on the robot, which is ready to deliver it
    with trial.fork.transaction() as lifted:
        lifted.place("robot", "carried", "container_1", LIFTED)
        lifted.finish(lifting, "ok")
    trial.end(trial.picking, picking_up)
    seen = trial.step("t+7")
    assert seen.holds(path("robot", "carried", "container_1"), absent("world", "container_pose", "container_1"))
    assert is_near(seen.transform("robot", "container_1").pose, LIFTED)
    by_hand = np.array(TURNED.matrix()) @ np.array(LIFTED.matrix())
    np.testing.assert_allclose(np.array(seen.transform("world", "container_1").pose.matrix()), by_hand, atol=1e-12)
