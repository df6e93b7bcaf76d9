"""The handshake by which agents hand over tasks on edges of the graph (P2, section 3.2 and Figure 2).

    nobody asked ─request─> wants ─acknowledge─> is ─finish─> finished
                              └──────abort────────┴──deadline──> aborted

The requester draws `wants` (P2's `starts`) and may abort; the executor acknowledges, P2's ACK, by turning it into `is`,
and finishes with a result. Each step names the request that it is about, so that nobody answers another's. A deadline
is the end of a stage by the clock, whether or not anybody is still there to keep it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from codra_dsl.runtime.errors import unknown
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.declarations import TaskModel, by
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema, Stage
from codra_dsl.runtime.knowledge.permissions import START, Permissions
from codra_dsl.runtime.knowledge.state import Handover, Request

REQUESTER = "requester"
UNACKNOWLEDGED = "unacknowledged"
OVERDUE = "overdue"


class ConflictError(RuntimeError):
    """A step of a handshake that cannot be taken from where the task stands."""


def request(change_set: ChangeSet, task: str, values: Mapping[str, object]) -> Request:
    """Ask for a task, with values of what its requesters write: it waits for its executor to acknowledge."""
    model = _model(change_set.schema, task)
    Permissions(by(*model.requesters)).check(change_set.agent, f"a request of {task}")
    before = _now(change_set, model)
    if before.is_open:
        raise ConflictError(
            f"{task!r} was asked for by {before.requester!r} already (request {before.number}, {before.stage}): "
            "it can be asked for again when it has ended"
        )
    after = Handover(
        task, Stage.WANTS, before.number + 1, change_set.agent, change_set.now_s, change_set.now_s + model.acknowledge_s
    )
    _write(change_set, model, before, after)
    for attribute, value in values.items():
        change_set.set(task, attribute, value, None)
    return after.request


def acknowledge(change_set: ChangeSet, asked: Request) -> None:
    """Say, as the executor, that the task has begun."""
    model = _model_of(change_set.schema, asked)
    Permissions(by(model.by)).check(change_set.agent, f"the acknowledgement of {asked.task}")
    before = _at(change_set, asked, Stage.WANTS)
    after = before._replace(stage=Stage.IS, since_s=change_set.now_s, deadline_s=change_set.now_s + model.finish_s)
    _write(change_set, model, before, after)


def finish(change_set: ChangeSet, asked: Request, result: str) -> None:
    """End the task, as the executor, with one of its results."""
    model = _model_of(change_set.schema, asked)
    Permissions(by(model.by)).check(change_set.agent, f"the result of {asked.task}")
    if result not in model.results:
        raise unknown(f"result of {asked.task!r}", result, model.results)
    before = _at(change_set, asked, Stage.IS)
    after = before._replace(stage=Stage.FINISHED, since_s=change_set.now_s, deadline_s=math.inf, result=str(result))
    _write(change_set, model, before, after)


def abort(change_set: ChangeSet, asked: Request) -> None:
    """End the task, as who asked for it, before it has finished."""
    model = _model_of(change_set.schema, asked)
    Permissions(by(*model.requesters)).check(change_set.agent, f"the abortion of {asked.task}")
    before = _at(change_set, asked, Stage.WANTS, Stage.IS)
    Permissions(by(before.requester)).check(change_set.agent, f"the abortion of request {asked.number} of {asked.task}")
    _write(change_set, model, before, _aborted(before, change_set.now_s, REQUESTER))


def expire(change_set: ChangeSet, task: str) -> None:
    """End a task whose deadline has passed; harmless for any other."""
    _now(change_set, _model(change_set.schema, task))


def _model(schema: GraphSchema, task: str) -> TaskModel:
    if task not in schema.tasks:
        raise unknown("task", task, schema.tasks)
    return schema.tasks[task]


def _model_of(schema: GraphSchema, asked: Request) -> TaskModel:
    if not isinstance(asked, Request):
        raise TypeError(f"what names a request is what request() returned, or the request of a handover, not {asked!r}")
    return _model(schema, asked.task)


def _now(change_set: ChangeSet, model: TaskModel) -> Handover:
    """Return how far a task is: one whose deadline has passed has ended, though the clock has not said so yet."""
    handover = change_set.handover(model.name)
    if not handover.is_open or change_set.now_s < handover.deadline_s:
        return handover
    reason = UNACKNOWLEDGED if handover.stage is Stage.WANTS else OVERDUE
    ended = _aborted(handover, handover.deadline_s, reason)
    agent, change_set.agent = change_set.agent, START
    try:
        _write(change_set, model, handover, ended)
    finally:
        change_set.agent = agent
    return ended


def _at(change_set: ChangeSet, asked: Request, *stages: Stage) -> Handover:
    """Return how far the task of a request is, if that is one of some stages."""
    handover = _now(change_set, _model(change_set.schema, asked.task))
    if handover.request == asked and handover.stage in stages:
        return handover
    if handover.request != asked:
        raise ConflictError(
            f"request {asked.number} of {asked.task!r} is not the present one: that is {handover.number}"
        )
    because = f" ({handover.reason})" if handover.reason else ""
    raise ConflictError(f"request {asked.number} of {asked.task!r} is {handover.stage} by now{because}")


def _aborted(handover: Handover, instant_s: float, reason: str) -> Handover:
    return handover._replace(stage=Stage.ABORTED, since_s=instant_s, deadline_s=math.inf, reason=reason)


def _write(change_set: ChangeSet, model: TaskModel, before: Handover, after: Handover) -> None:
    """Write how far a task is: its edge, and the attributes of its node."""
    change_set.hand_over(after)
    if before.stage is not None:
        change_set.remove((model.origin, before.stage, model.name))
    if after.stage is not None and (
        after.is_open or change_set.has_node(model.origin)
    ):  # it may be gone when a task ends
        change_set.draw(change_set.schema.edge_type(after.stage), model.origin, model.name)
    told = (
        ("request", before.number, after.number),
        ("requester", before.requester, after.requester),
        ("result", before.result, after.result),
        ("reason", before.reason or None, after.reason or None),
    )
    for attribute, was, now in told:
        if was != now:
            change_set.write(model.name, attribute, now)
