"""The part of a session that belongs to an agent in another program: its copy of the graph, and its writes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.context.agents import Agent
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.errors import AgentTakenError, UnknownNameError
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge, RuleState, Transaction
from codra_dsl.runtime.knowledge import Request as TaskRequest
from codra_dsl.runtime.knowledge.agent_handle import Writer
from codra_dsl.runtime.knowledge.graph_schema import agents_of
from codra_dsl.runtime.knowledge.plain_graph import plain_change, plain_state
from codra_dsl.runtime.remote.protocol import (
    OPERATIONS,
    MessageError,
    NotPermittedError,
    PlainData,
    Request,
    notice,
)
from codra_dsl.runtime.values.declarations import MAIN

MAX_CHANGES = 100
"""The maximum number of transactions of a session that are open at the same time."""

MAX_OPERATIONS = 10_000
"""The maximum number of operations of one transaction."""


@dataclass(slots=True, kw_only=True)
class _Change:
    """An open transaction."""

    context: AbstractContextManager[Transaction]
    transaction: Transaction
    operation_count: int = 0

    def writer(self) -> Transaction:
        """Return the transaction for one more operation."""
        if self.operation_count >= MAX_OPERATIONS:
            raise ValueError(f"a change may have at most {MAX_OPERATIONS} operations")
        self.operation_count += 1
        return self.transaction

    def discard(self) -> None:
        error = _DiscardedError()
        with contextlib.suppress(_DiscardedError):
            self.context.__exit__(_DiscardedError, error, None)


class _DiscardedError(Exception):
    """Raised inside a transaction to end it without changes."""


class AgentSession:
    """What one session does with the knowledge graph. A session speaks for at most one agent at a time.

    Writes go through the handle of the agent, which a program in the manager's process would use as well. So the same
    permissions and rules apply, and refusals are audited.
    """

    def __init__(
        self,
        codra: ContextManager[Any, Any],
        send: Callable[[PlainData], None],
        agents: dict[str, Agent[Any, Any]],
        open_agent: Callable[[str], Agent[Any, Any]],
        check_digest: Callable[[str, str], None],
    ) -> None:
        """Begin without an agent.

        Args:
            codra: the context manager.
            send: sends a notice; it must neither wait nor raise an exception.
            agents: the handles of the session, which it closes at its end.
            open_agent: returns the session's handle of an agent, which may be a new one.
            check_digest: raises ValueError if a program has another version of the spec.
        """
        self._codra = codra
        self._send = send
        self._agents = agents
        self._open_agent = open_agent
        self._check_digest = check_digest
        self._agent: Agent[Any, AgentHandle] | None = None
        self._changes: dict[int, _Change] = {}
        self._change_count = 0
        self._graph_subscription: Subscription | None = None

    def handle(self, request: Request) -> PlainData:
        """Carry out one of the `AGENT_REQUESTS`, and return the answer."""
        if request.ask in OPERATIONS:
            return self._operate(request.ask, **request.fields)
        handler: Callable[..., PlainData] = getattr(self, f"_{request.ask}")
        return handler(**request.fields)

    def close(self) -> None:
        """End the session of the agent, whose program has left or is lost: the tasks that it executes fail."""
        if self._graph_subscription is not None:
            self._graph_subscription.unsubscribe()
        if self._agent is not None:
            self._leave_agent(self._agent)

    def _graph(self, digest: str = "") -> PlainData:
        self._check_digest("this program", digest)
        if self._graph_subscription is not None:
            raise ValueError("this session has a copy of the graph already")
        state, self._graph_subscription = self._knowledge().follow_changes(
            lambda change: self._send(notice("change", **plain_change(change)))
        )
        return {"graph": plain_state(state)}

    def _enter(self, agent: str) -> PlainData:
        self._knowledge()
        if self._agent is not None:
            raise AgentTakenError(
                f"this session already speaks for the agent {self._agent.name!r}: close its handle, or connect again"
            )
        self._agent = self._open_agent(agent)
        return {}

    def _exit(self) -> PlainData:
        agent = self._entered()
        self._leave_agent(agent)
        self._agents.pop(agent.name).close()
        return {}

    # Writing

    def _operate(self, ask: str, change: int | None = None, **fields: Any) -> PlainData:
        writer: Writer = self._entered().graph if change is None else self._change(change).writer()
        result = _OPERATIONS[ask](writer, fields)
        return {"number": result.number} if isinstance(result, TaskRequest) else {}

    def _begin_change(self, rule: str | None = None) -> PlainData:
        if len(self._changes) >= MAX_CHANGES:
            raise ValueError(f"a session may have at most {MAX_CHANGES} open changes")
        handle = self._entered().graph
        context = handle.transaction() if rule is None else handle.acting(rule).transaction()
        self._change_count += 1
        self._changes[self._change_count] = _Change(context=context, transaction=context.__enter__())
        return {"change": self._change_count}

    def _end_change(self, change: int, *, discard: bool = False) -> PlainData:
        open_change = self._change(change)
        del self._changes[change]
        if discard:
            open_change.discard()
        else:
            open_change.context.__exit__(None, None, None)
        return {}

    def _check_rule(self, rule: str) -> PlainData:
        self._entered().graph.acting(rule).check_before()
        return {}

    def _record_rule(self, rule: str, state: str, message: str = "") -> PlainData:
        agent = self._entered()
        agent.graph.acting(rule)  # the agent must have this rule
        if state not in tuple(RuleState):
            raise MessageError(f"`state` of `record_rule` must be one of {', '.join(RuleState)}")
        self._knowledge().record_rule_state(agent.name, rule, state, message)
        return {}

    def _knowledge(self) -> Knowledge:
        try:
            return self._codra.knowledge
        except LookupError as error:
            raise UnknownNameError(str(error)) from None

    def _entered(self) -> Agent[Any, AgentHandle]:
        if self._agent is None:
            raise NotPermittedError("this session speaks for no agent: send `enter` first")
        return self._agent

    def _change(self, number: int) -> _Change:
        if number not in self._changes:
            raise MessageError(f"no open change has number {number}")
        return self._changes[number]

    def _leave_agent(self, agent: Agent[Any, AgentHandle]) -> None:
        """Discard the open transactions, and abort the tasks that the agent executes: nobody can finish them."""
        for change in self._changes.values():
            change.discard()
        self._changes.clear()
        self._agent = None
        self._knowledge().abandon_tasks(agent.name)


def agents_of_manager(codra: ContextManager[Any, Any]) -> frozenset[str]:
    """Return the agents that may write variables or the knowledge graph; on a network, each of them is a user."""
    try:
        return codra.model.agents | (agents_of(codra.knowledge.model) - {MAIN})
    except LookupError:
        return codra.model.agents


def _values(fields: PlainData) -> dict[str, object]:
    return {entry["name"]: entry.get("value") for entry in fields.get("values", ())}


def _edge(fields: PlainData) -> tuple[str, str, str]:
    return fields["origin"], fields["type"], fields["target"]


def _request(fields: PlainData) -> TaskRequest:
    return TaskRequest(fields["task"], fields["number"])


def _written(fields: PlainData) -> tuple[str, object]:
    return fields["attribute"], fields.get("value")


_OPERATIONS: Mapping[str, Callable[[Writer, PlainData], object]] = {
    "insert_node": lambda writer, fields: writer.insert_node(fields["name"], fields["type"], **_values(fields)),
    "delete_node": lambda writer, fields: writer.delete_node(fields["name"]),
    "set_attribute": lambda writer, fields: writer.set(
        fields["name"], *_written(fields), evidence_s=fields.get("evidence_s")
    ),
    "insert_edge": lambda writer, fields: writer.insert_edge(*_edge(fields), **_values(fields)),
    "delete_edge": lambda writer, fields: writer.delete_edge(*_edge(fields)),
    "set_edge_attribute": lambda writer, fields: writer.set_of_edge(
        *_edge(fields), *_written(fields), evidence_s=fields.get("evidence_s")
    ),
    "place": lambda writer, fields: writer.place(
        *_edge(fields), Pose(tuple(fields["pose"][:3]), tuple(fields["pose"][3:])), stamp_s=fields.get("stamp_s")
    ),
    "request_task": lambda writer, fields: writer.request(fields["task"], **_values(fields)),
    "acknowledge_task": lambda writer, fields: writer.acknowledge(_request(fields)),
    "finish_task": lambda writer, fields: writer.finish(_request(fields), fields["result"]),
    "abort_task": lambda writer, fields: writer.abort(_request(fields)),
}
"""For each request that writes the graph, the call of the handle or the transaction."""
