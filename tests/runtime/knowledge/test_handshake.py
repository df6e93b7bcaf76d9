"""The handshake, against a model that knows only the rules: over random orders of events, and without an executor."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as some
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from codra_dsl.runtime import NotASourceError, SimClock, UnknownNameError
from codra_dsl.runtime.knowledge import AgentHandle, ConflictError, Knowledge, Request, Stage
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel, NodeModel, NodeTypeModel, TaskModel, path
from tests.runtime.knowledge.store import store

ACKNOWLEDGE_S, FINISH_S = 1.0, 4.0
AGENTS = ("ann", "bob", "worker", "stranger")

MODEL = KnowledgeModel(
    name="one_task",
    node_types=(NodeTypeModel(name="robot"),),
    nodes=(NodeModel(name="robot", type="robot"),),
    tasks=(
        TaskModel(
            name="detecting",
            origin="robot",
            by="worker",
            requesters=("ann", "bob"),
            results=("found", "lost"),
            acknowledge_s=ACKNOWLEDGE_S,
            finish_s=FINISH_S,
        ),
        TaskModel(name="idling", origin="robot", by="stranger", requesters=("stranger",), results=("ok",)),
    ),
)


class Handshake(RuleBasedStateMachine):
    """A model of the rules of the handshake, compared with the graph."""

    @initialize()
    def begin(self) -> None:
        self.clock = SimClock()
        self.knowledge = Knowledge(MODEL, clock=self.clock)
        self.handles = {name: self.knowledge.as_agent(name) for name in AGENTS}
        self.stage, self.number, self.requester = "", 0, ""
        self.deadline_s, self.result, self.reason = float("inf"), None, ""

    def step(self, agent: str, is_allowed: bool, is_possible: bool, take: object) -> bool:
        """Take a step, which must be refused, must conflict, or must succeed; return whether it did."""
        assert callable(take)
        if not is_allowed:
            with pytest.raises(NotASourceError):
                take(self.handles[agent])
        elif not is_possible:
            with pytest.raises(ConflictError):
                take(self.handles[agent])
        else:
            take(self.handles[agent])
        return is_allowed and is_possible

    @rule(agent=some.sampled_from(AGENTS))
    def request(self, agent: str) -> None:
        is_possible = self.stage not in ("wants", "is")
        if self.step(agent, agent in ("ann", "bob"), is_possible, lambda handle: handle.request("detecting")):
            self.stage, self.number, self.requester = "wants", self.number + 1, agent
            self.deadline_s, self.result, self.reason = self.clock.now_s() + ACKNOWLEDGE_S, None, ""

    @rule(agent=some.sampled_from(AGENTS), back=some.integers(0, 2))
    def acknowledge(self, agent: str, back: int) -> None:
        request = Request("detecting", self.number - back)
        is_possible = back == 0 and self.stage == "wants"
        if self.step(agent, agent == "worker", is_possible, lambda handle: handle.acknowledge(request)):
            self.stage, self.deadline_s = "is", self.clock.now_s() + FINISH_S

    @rule(agent=some.sampled_from(AGENTS), back=some.integers(0, 2), result=some.sampled_from(["found", "lost"]))
    def finish(self, agent: str, back: int, result: str) -> None:
        request = Request("detecting", self.number - back)
        is_possible = back == 0 and self.stage == "is"
        if self.step(agent, agent == "worker", is_possible, lambda handle: handle.finish(request, result)):
            self.stage, self.deadline_s, self.result = "finished", float("inf"), result

    @rule(agent=some.sampled_from(AGENTS), back=some.integers(0, 2))
    def abort(self, agent: str, back: int) -> None:
        request = Request("detecting", self.number - back)
        is_possible = back == 0 and self.stage in ("wants", "is")
        is_allowed = agent == self.requester if is_possible else agent in ("ann", "bob")
        if self.step(agent, is_allowed, is_possible, lambda handle: handle.abort(request)):
            self.stage, self.deadline_s, self.reason = "aborted", float("inf"), "requester"

    @rule(duration_s=some.sampled_from([0.25, 0.5, 1.0, 2.0, 4.0]))
    def pass_time(self, duration_s: float) -> None:
        self.clock.sleep(duration_s)
        if self.clock.now_s() >= self.deadline_s:
            self.reason = "unacknowledged" if self.stage == "wants" else "overdue"
            self.stage, self.deadline_s = "aborted", float("inf")

    @invariant()
    def the_graph_agrees_with_the_rules(self) -> None:
        seen = self.knowledge.snapshot()
        assert [edge.label for edge in seen.edges(target="detecting")] == ([self.stage] if self.stage else [])
        handover = seen.handover("detecting")
        assert (handover.stage or "", handover.number, handover.requester) == (self.stage, self.number, self.requester)
        attribute_values = [
            seen.get("detecting", name).content for name in ("request", "requester", "result", "reason")
        ]
        assert attribute_values == [self.number or None, self.requester or None, self.result, self.reason or None]
        assert handover.deadline_s == self.deadline_s


TestHandshake = Handshake.TestCase
TestHandshake.settings = settings(max_examples=50, stateful_step_count=40)


@pytest.fixture
def clock() -> SimClock:
    return SimClock()


@pytest.fixture
def knowledge(clock: SimClock) -> Knowledge:
    return Knowledge(MODEL, clock=clock)


def stage(knowledge: Knowledge) -> tuple[str | None, str]:
    handover = knowledge.snapshot().handover("detecting")
    return handover.stage, handover.reason


def work(worker: AgentHandle, request: Request, steps: int) -> None:
    """Take some steps as the executor; then it dies, with its handle."""
    for step in (lambda: worker.acknowledge(request), lambda: worker.finish(request, "found"))[:steps]:
        step()
    worker.close()


@pytest.mark.parametrize(
    ("steps", "ends_s", "as_what"),
    [
        (0, ACKNOWLEDGE_S, (Stage.ABORTED, "unacknowledged")),
        (1, FINISH_S, (Stage.ABORTED, "overdue")),
        (2, 0.0, (Stage.FINISHED, "")),
    ],
)
def test_a_task_whose_executor_dies_ends_as_aborted_by_its_deadline(
    knowledge: Knowledge, clock: SimClock, steps: int, ends_s: float, as_what: tuple[Stage, str]
) -> None:
    request = knowledge.as_agent("ann").request("detecting")
    work(knowledge.as_agent("worker"), request, steps)
    if ends_s:
        clock.sleep(ends_s - 0.001)
        assert stage(knowledge)[0] in {Stage.WANTS, Stage.IS}
        clock.sleep(0.001)
    assert stage(knowledge) == as_what
    clock.sleep(100.0)
    assert stage(knowledge) == as_what


def test_a_new_executor_answers_the_next_request_and_not_the_previous_one(
    knowledge: Knowledge, clock: SimClock
) -> None:
    ann = knowledge.as_agent("ann")
    first = ann.request("detecting")
    clock.sleep(ACKNOWLEDGE_S)
    second = ann.request("detecting")
    worker = knowledge.as_agent("worker")
    with pytest.raises(ConflictError, match="request 1 of 'detecting' is not the latest request: that is request 2"):
        worker.acknowledge(first)
    worker.acknowledge(second)
    assert stage(knowledge) == (Stage.IS, "")


def test_a_late_step_raises_an_error_with_the_stage_of_the_task(knowledge: Knowledge, clock: SimClock) -> None:
    ann, worker = knowledge.as_agent("ann"), knowledge.as_agent("worker")
    request = ann.request("detecting")
    with pytest.raises(ConflictError, match=r"'detecting' was already requested by 'ann' \(request 1, wants\)"):
        knowledge.as_agent("bob").request("detecting")
    clock.sleep(ACKNOWLEDGE_S)
    with pytest.raises(ConflictError, match=r"request 1 of 'detecting' is at the stage aborted \(unacknowledged\)"):
        worker.acknowledge(request)


def test_a_step_at_the_deadline_is_too_late_in_either_order_of_events(knowledge: Knowledge, clock: SimClock) -> None:
    ann, worker = knowledge.as_agent("ann"), knowledge.as_agent("worker")
    messages: list[str] = []

    def acknowledge() -> None:
        with pytest.raises(ConflictError) as conflict:
            worker.acknowledge(Request("detecting", 1))
        messages.append(str(conflict.value))

    clock.call_at(ACKNOWLEDGE_S, acknowledge)
    ann.request("detecting")
    clock.sleep(ACKNOWLEDGE_S)
    assert messages == ["request 1 of 'detecting' is at the stage aborted (unacknowledged)"]
    assert stage(knowledge) == (Stage.ABORTED, "unacknowledged")


def test_a_result_that_is_not_declared_is_refused(knowledge: Knowledge) -> None:
    request = knowledge.as_agent("ann").request("detecting")
    worker = knowledge.as_agent("worker")
    worker.acknowledge(request)
    with pytest.raises(UnknownNameError, match="no result of 'detecting' 'fond': did you mean 'found'"):
        worker.finish(request, "fond")
    with pytest.raises(UnknownNameError, match="no task 'detectin': did you mean 'detecting'"):
        knowledge.as_agent("bob").request("detectin")


def test_only_the_requester_may_abort(knowledge: Knowledge) -> None:
    request = knowledge.as_agent("ann").request("detecting")
    with pytest.raises(NotASourceError, match="'the abortion of request 1 of detecting' may be written by ann"):
        knowledge.as_agent("bob").abort(request)
    assert stage(knowledge) == (Stage.WANTS, "")


def test_an_executor_that_is_woken_by_the_graph_takes_the_task_over() -> None:
    clock = SimClock()
    knowledge = store(clock)
    detection, decider = knowledge.as_agent("container_detection"), knowledge.as_agent("decision_maker")

    def wake(_: object) -> None:
        handover = knowledge.snapshot().handover("detecting")
        if handover.stage is Stage.WANTS:
            detection.acknowledge(handover.request)

    knowledge.subscribe(wake, path("robot", "wants", "detecting"))
    for _ in range(3):
        decider.abort(decider.request("detecting"))
        decider.request("detecting")
        clock.sleep(0.1)
        handover = knowledge.snapshot().handover("detecting")
        assert handover.stage is Stage.IS
        detection.finish(handover.request, "lost")


def test_steps_of_a_handshake_are_part_of_a_transaction(knowledge: Knowledge) -> None:
    ann, worker = knowledge.as_agent("ann"), knowledge.as_agent("worker")
    with ann.transaction() as both:
        request = both.request("detecting")
        assert stage(knowledge) == (None, "")
    assert stage(knowledge) == (Stage.WANTS, "")

    def run_transaction() -> None:
        with worker.transaction() as write:
            write.acknowledge(request)
            ann.abort(request)

    with pytest.raises(ConflictError, match=r"request 1 of 'detecting' is at the stage aborted \(requester\)"):
        run_transaction()


def test_a_request_number_is_not_given_to_two_requesters(knowledge: Knowledge) -> None:
    ann, bob = knowledge.as_agent("ann"), knowledge.as_agent("bob")

    def run_transaction() -> None:
        with ann.transaction() as write:
            write.request("detecting")
            bob.abort(bob.request("detecting"))

    with pytest.raises(ConflictError, match="was requested again while this transaction was open"):
        run_transaction()
    assert knowledge.snapshot().handover("detecting").number == 1
