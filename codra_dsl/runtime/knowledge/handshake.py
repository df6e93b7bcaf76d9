"""The handshake by which agents hand over tasks on edges of the graph (P2, section 3.2 and Figure 2).

    no request ─request─> wants ─acknowledge─> is ─finish─> finished
                            └──────abort────────┴──deadline──> aborted

The requester inserts the edge `wants` (P2's `starts`) and may abort the task. The executor acknowledges the request
(P2's ACK) by turning this edge into `is`, and finishes the task with a result. Each step names its request, so that no
agent answers another request by mistake.

A deadline ends a stage even if the agents no longer exist. The time until the deadline runs from the step that began
the stage. At the instant of the deadline the stage has ended, regardless of the order in which the events of this
instant are executed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.declarations import TaskModel, by
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema, Stage
from codra_dsl.runtime.knowledge.permissions import GRAPH_WRITER, Permissions
from codra_dsl.runtime.knowledge.state import Handover, Request

REQUESTER = "requester"
UNACKNOWLEDGED = "unacknowledged"
OVERDUE = "overdue"
EXECUTOR_LOST = "executor_lost"


class ConflictError(RuntimeError):
    """A step of a handshake that is not possible at the present stage of the task."""


def request(change_set: ChangeSet, task: str, values: Mapping[str, object]) -> Request:
    """Request a task, with values of attributes that requesters write; the executor must acknowledge the request."""
    model = _task_model(change_set.schema, task)
    Permissions(by(*model.requesters)).check(change_set.agent, f"a request of {task}")
    before = _present_handover(change_set, model)
    if before.is_open:
        raise ConflictError(
            f"{task!r} was already requested by {before.requester!r} (request {before.number}, {before.stage}): "
            "request it again when it has ended"
        )
    after = Handover(
        task, Stage.WANTS, before.number + 1, change_set.agent, change_set.now_s, change_set.now_s + model.acknowledge_s
    )
    _write(change_set, model, before, after)
    for attribute, value in values.items():
        change_set.set(task, attribute, value, None)
    return after.request


def acknowledge(change_set: ChangeSet, request: Request) -> None:
    """Acknowledge a task as its executor: the task has begun."""
    model = _model_of_request(change_set.schema, request)
    Permissions(by(model.by)).check(change_set.agent, f"the acknowledgement of {request.task}")
    before = _require_handover(change_set, request, Stage.WANTS)
    after = before._replace(stage=Stage.IS, since_s=change_set.now_s, deadline_s=change_set.now_s + model.finish_s)
    _write(change_set, model, before, after)


def finish(change_set: ChangeSet, request: Request, result: str) -> None:
    """End a task as its executor, with one of the declared results."""
    model = _model_of_request(change_set.schema, request)
    Permissions(by(model.by)).check(change_set.agent, f"the result of {request.task}")
    if result not in model.results:
        raise unknown_name_error(f"result of {request.task!r}", result, model.results)
    before = _require_handover(change_set, request, Stage.IS)
    after = before._replace(stage=Stage.FINISHED, since_s=change_set.now_s, deadline_s=math.inf, result=str(result))
    _write(change_set, model, before, after)


def abort(change_set: ChangeSet, request: Request) -> None:
    """Abort a task as its requester, before it has finished."""
    model = _model_of_request(change_set.schema, request)
    Permissions(by(*model.requesters)).check(change_set.agent, f"the abortion of {request.task}")
    before = _require_handover(change_set, request, Stage.WANTS, Stage.IS)
    Permissions(by(before.requester)).check(
        change_set.agent, f"the abortion of request {request.number} of {request.task}"
    )
    _write(change_set, model, before, _aborted_copy(before, change_set.now_s, REQUESTER))


def abandon(change_set: ChangeSet, task: str) -> None:
    """Abort a task that has begun, because the program of its executor is lost; otherwise do nothing."""
    model = _task_model(change_set.schema, task)
    Permissions(by(model.by)).check(change_set.agent, f"the end of {task}")
    handover = _present_handover(change_set, model)
    if handover.stage is Stage.IS:
        _write(change_set, model, handover, _aborted_copy(handover, change_set.now_s, EXECUTOR_LOST))


def expire(change_set: ChangeSet, task: str) -> None:
    """Abort a task if its deadline has passed; otherwise do nothing."""
    _present_handover(change_set, _task_model(change_set.schema, task))


def _task_model(schema: GraphSchema, task: str) -> TaskModel:
    if task not in schema.tasks:
        raise unknown_name_error("task", task, schema.tasks)
    return schema.tasks[task]


def _model_of_request(schema: GraphSchema, request: Request) -> TaskModel:
    if not isinstance(request, Request):
        raise TypeError(f"expected the return value of request(), or the request of a handover, not {request!r}")
    return _task_model(schema, request.task)


def _present_handover(change_set: ChangeSet, model: TaskModel) -> Handover:
    """Return the handover of a task.

    If the task's deadline has passed, abort the task first, even if the event of the deadline was not executed yet.
    """
    handover = change_set.handover(model.name)
    if not handover.is_open or change_set.now_s < handover.deadline_s:
        return handover
    reason = UNACKNOWLEDGED if handover.stage is Stage.WANTS else OVERDUE
    aborted_handover = _aborted_copy(handover, handover.deadline_s, reason)
    previous_agent, change_set.agent = change_set.agent, GRAPH_WRITER
    try:
        _write(change_set, model, handover, aborted_handover)
    finally:
        change_set.agent = previous_agent
    return aborted_handover


def _require_handover(change_set: ChangeSet, request: Request, *stages: Stage) -> Handover:
    """Return the handover of the latest request; raise an error for an older request or another stage."""
    handover = _present_handover(change_set, _task_model(change_set.schema, request.task))
    if handover.request == request and handover.stage in stages:
        return handover
    if handover.request != request:
        raise ConflictError(
            f"request {request.number} of {request.task!r} is not the latest request: that is request {handover.number}"
        )
    reason_text = f" ({handover.reason})" if handover.reason else ""
    raise ConflictError(f"request {request.number} of {request.task!r} is at the stage {handover.stage}{reason_text}")


def _aborted_copy(handover: Handover, instant_s: float, reason: str) -> Handover:
    return handover._replace(stage=Stage.ABORTED, since_s=instant_s, deadline_s=math.inf, reason=reason)


def _write(change_set: ChangeSet, model: TaskModel, before: Handover, after: Handover) -> None:
    """Write the handover of a task: its edge, and the attributes of its node."""
    change_set.set_handover(after)
    if before.stage is not None:
        change_set.discard_edge((model.origin, before.stage, model.name))
    # When the task ends, the node that does the task may have been deleted.
    if after.stage is not None and (after.is_open or change_set.has_node(model.origin)):
        change_set.upsert_edge(change_set.schema.edge_type(after.stage), model.origin, model.name)
    attribute_changes = (
        ("request", before.number, after.number),
        ("requester", before.requester, after.requester),
        ("result", before.result, after.result),
        ("reason", before.reason or None, after.reason or None),
    )
    for attribute, value_before, value_after in attribute_changes:
        if value_before != value_after:
            change_set.write(model.name, attribute, value_after)
