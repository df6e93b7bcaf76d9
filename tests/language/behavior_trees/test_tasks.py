"""Leaves that hand tasks over by the handshake of the knowledge graph (P2, section 3.2)."""

from __future__ import annotations

import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.behavior_trees import Result, Robot, Task, Tree
from codra_dsl.runtime.knowledge import Knowledge, Request, Stage
from codra_dsl.runtime.knowledge.declarations import (
    AttributeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    TaskModel,
    by,
)
from codra_dsl.runtime.values.model import text
from tests.language.behavior_trees.stories import document, main_tree

MODELS = """<Action ID="Detect"><input_port name="goal" default="any"/><output_port name="result" default="{result}"/>
  <output_port name="reason" default="{reason}"/></Action>"""
DETECTING = TaskModel(
    name="detecting",
    origin="robot",
    by="detector",
    requesters=("executor", "other"),
    results=("found", "lost"),
    acknowledge_s=1.0,
    finish_s=10.0,
    attributes=(AttributeModel(name="goal", type=text(), sources=by("executor", "other")),),
)
SHOP = KnowledgeModel(
    name="shop",
    node_types=(NodeTypeModel(name="robot"),),
    nodes=(NodeModel(name="robot", type="robot"),),
    tasks=(DETECTING,),
)


class Store:
    """A graph, the agent that detects, and a tree that requests detections."""

    def __init__(self, body: str = "<Detect/>") -> None:
        self.clock = SimClock()
        self.knowledge = Knowledge(SHOP, clock=self.clock)
        self.detector = self.knowledge.as_agent("detector")
        self.executor = self.knowledge.as_agent("executor")
        robot = Robot()
        robot.can(
            "Detect",
            lambda: Task("detecting", self.executor, self.knowledge, succeeds_with=("found",), values=("goal",)),
        )
        self.tree: Tree = main_tree(document(body, MODELS), robot, clock=self.clock)

    @property
    def stage(self) -> Stage | None:
        return self.knowledge.snapshot().handover("detecting").stage

    @property
    def request(self) -> Request:
        return self.knowledge.snapshot().handover("detecting").request


@pytest.mark.parametrize(("result", "expected"), [("found", Result.SUCCESS), ("lost", Result.FAILURE)])
def test_a_task_is_requested_acknowledged_and_finished(result: str, expected: Result) -> None:
    store = Store('<Detect goal="box"/>')

    assert (store.tree.tick(), store.stage) == (Result.RUNNING, Stage.WANTS)
    assert store.knowledge.get("detecting", "goal").value == "box"
    assert (store.tree.tick(), store.stage) == (Result.RUNNING, Stage.WANTS)
    store.detector.acknowledge(store.request)
    assert (store.tree.tick(), store.stage) == (Result.RUNNING, Stage.IS)
    store.detector.finish(store.request, result)
    assert store.tree.tick() is expected
    assert store.tree.scope.get("result") == result


@pytest.mark.parametrize("acknowledged", [False, True])
def test_halting_aborts_the_task(acknowledged: bool) -> None:
    store = Store()
    store.tree.tick()
    if acknowledged:
        store.detector.acknowledge(store.request)

    store.tree.halt()

    handover = store.knowledge.snapshot().handover("detecting")
    assert (handover.stage, handover.reason) == (Stage.ABORTED, "requester")


def test_an_unacknowledged_task_fails_at_its_deadline() -> None:
    store = Store()

    assert store.tree.run(period_s=0.1) is Result.FAILURE
    assert store.tree.scope.get("reason") == "unacknowledged"
    assert store.clock.now_s() == pytest.approx(1.0, abs=0.11)


def test_a_task_whose_executor_died_fails_by_its_deadline() -> None:
    store = Store()
    store.tree.tick()
    store.detector.acknowledge(store.request)
    store.detector.close()

    assert store.tree.run(period_s=0.5) is Result.FAILURE
    assert store.tree.scope.get("reason") == "overdue"


def test_a_task_that_ended_by_itself_is_not_aborted() -> None:
    store = Store()
    store.tree.tick()
    store.detector.acknowledge(store.request)
    store.detector.finish(store.request, "found")

    store.tree.halt()

    assert store.stage is Stage.FINISHED
    assert store.knowledge.refusals() == ()


def test_a_task_of_another_requester_is_waited_for_and_never_aborted() -> None:
    store = Store()
    other = store.knowledge.as_agent("other")
    theirs = other.request("detecting")

    assert store.tree.tick() is Result.RUNNING
    store.tree.halt()
    assert store.request == theirs
    assert store.stage is Stage.WANTS

    store.tree.tick()
    store.detector.acknowledge(theirs)
    store.detector.finish(theirs, "lost")
    assert (store.tree.tick(), store.stage) == (Result.RUNNING, Stage.WANTS)
    assert store.request.number == theirs.number + 1


def test_a_result_that_was_overwritten_between_two_ticks_is_not_a_success() -> None:
    store = Store()
    store.tree.tick()
    ours = store.request
    store.detector.acknowledge(ours)
    store.detector.finish(ours, "found")
    other = store.knowledge.as_agent("other")
    other.request("detecting")

    assert store.tree.tick() is Result.FAILURE
    assert store.tree.scope.get("reason") == "unseen"


def test_retrying_requests_again() -> None:
    store = Store('<RetryUntilSuccessful num_attempts="2"><Detect/></RetryUntilSuccessful>')
    store.tree.tick()
    first = store.request
    store.detector.acknowledge(first)
    store.detector.finish(first, "lost")
    assert (store.tree.tick(), store.stage) == (Result.RUNNING, Stage.WANTS)

    store.detector.acknowledge(store.request)
    store.detector.finish(store.request, "found")
    assert store.tree.tick() is Result.SUCCESS
    assert store.request.number == first.number + 1
