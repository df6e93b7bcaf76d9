"""The knowledge graph of a manager, for an agent in another program."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.package_files import manifest_of
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AgentHandle, Request, Transaction
from codra_dsl.runtime.knowledge.graph_copy import GraphCopy
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.operations import Operation, Verb
from codra_dsl.runtime.knowledge.plain_graph import PlainGraph
from codra_dsl.runtime.remote.agents.manager_clock import ManagerClock
from codra_dsl.runtime.remote.protocol import MAX_NAME_CHARACTERS, MessageError, PlainData, plain_value

Ask = Callable[..., PlainData]
"""Sends a request with its fields to the manager, and returns the answer, or raises the error of the request."""


class RemoteKnowledge(GraphCopy):
    """A copy of the manager's graph for reading, and handles of agents, which write the graph itself.

    When a call of a handle returns, the copy has the change of this call.
    """

    def __init__(
        self,
        package: ModuleType,
        ask: Ask,
        *,
        lease_s: float,
        end_reason: Callable[[], str],
        own_clock: Clock | None = None,
    ) -> None:
        """Begin without a state; see `GraphCopy`.

        Args:
            package: the generated package of the spec.
            ask: asks the manager.
            lease_s: how long the copy can be read after the last request that the manager has answered.
            end_reason: returns why the connection has ended; empty while it lasts.
            own_clock: the clock of this program, in real time; by default a new one.

        Raises:
            LookupError: if the spec declares no knowledge graph.
        """
        model = getattr(package, "KNOWLEDGE", None)
        if model is None:
            raise LookupError(f"the spec {package.MODEL.name!r} declares no knowledge graph")
        variables = [variable for variable in package.MODEL.variables if variable.pose_condition is None]
        self._ask = ask
        self._lease_s = lease_s
        self._end_reason = end_reason
        self._manager_clock = ManagerClock(own_clock)
        super().__init__(GraphSchema(model, variables), clock=self._manager_clock, check_current=self._check_current)

    def as_agent(self, name: str) -> AgentHandle:
        """Return the handle with which an agent writes. A connection can have one open handle.

        The handle is open until `close`, the end of its `with` statement, or the end of the connection. Then the tasks
        that the agent executes are aborted with the reason `executor_lost`.

        Raises:
            UnknownNameError: if no such agent is declared.
            AgentTakenError: if a handle of the agent, or of another agent of this connection, is open.
            NotPermittedError: if the user of the connection is another agent.
        """
        if name not in self._schema.agents:
            raise unknown_name_error("agent", name, self._schema.agents)
        self._ask("enter", agent=name)
        return self._create_handle(name)

    def receive(self, plain: PlainGraph) -> None:
        """Apply a change of the manager's graph."""
        self._manager_clock.advance(plain["instant_s"])
        super().receive(plain)

    def compare_clocks(self) -> None:
        """Renew the lease, and set the clock of the copy."""
        self._manager_clock.compare(lambda: float(self._ask("keep")["now_s"]))

    def end(self) -> None:
        """Let all waiting calls return, because the connection has ended."""
        self._manager_clock.close()

    def record_rule_state(self, agent: str, name: str, state: str, message: str) -> None:
        """Record the new state of an agent's rule in the manager's journal."""
        del agent  # the session speaks for it
        self._ask("record_rule", rule=name, state=state, message=message[:MAX_NAME_CHARACTERS])

    def _check_current(self) -> None:
        if reason := self._end_reason():
            raise ConnectionError(reason)
        if self._manager_clock.silence_s() > self._lease_s:
            raise ConnectionError(f"the manager has not answered for {self._lease_s:g} s")

    def _apply_verb(self, agent: str, verb: Verb, arguments: tuple[Any, ...]) -> Any:
        del agent  # the session speaks for it
        return self._write(Operation(verb, arguments))

    def _write(self, operation: Operation, **fields: object) -> Request | None:
        ask, create_fields = _REQUESTS[operation.verb]
        answer = self._ask(ask, **create_fields(*operation.arguments), **fields)
        return Request(operation.arguments[0], answer["number"]) if operation.verb is Verb.REQUEST else None

    @contextmanager
    def _transaction(self, name: str, check_open: Callable[[], None], rule: str = "") -> Iterator[Transaction]:
        check_open()
        del name  # the session speaks for it
        number = self._ask("begin_change", **({"rule": rule} if rule else {}))["change"]

        def attempt(operation: Operation) -> Request | None:
            check_open()
            return self._write(operation, change=number)

        transaction = Transaction(attempt, new_lock())
        try:
            yield transaction
            transaction.end()
            transaction.check()
            check_open()
        except BaseException:
            transaction.end()
            with contextlib.suppress(ConnectionError, RuntimeError, MessageError):  # it may be discarded already
                self._ask("end_change", change=number, discard=True)
            raise
        self._ask("end_change", change=number)

    def _check_rule(self, agent: str, rule: str) -> None:
        del agent  # the session speaks for it
        self._ask("check_rule", rule=rule)

    def _release_handle(self, name: str) -> None:
        del name  # the session speaks for it
        with contextlib.suppress(ConnectionError, RuntimeError):  # the end of the session has closed the handle
            self._ask("exit")


def digest_of(package: ModuleType) -> str:
    """Return the digest of the spec of a generated package."""
    file = getattr(package, "__file__", None)
    return str(manifest_of(None if file is None else Path(file).parent).get("model", ""))


def _insertion(name: str, type_name: str, values: Mapping[str, object]) -> PlainData:
    return {"name": name, "type": type_name, "values": _plain_values(values)}


def _edge(origin: str, type_name: str, target: str) -> PlainData:
    return {"origin": origin, "type": type_name, "target": target}


def _reading(attribute: str, value: object, evidence_s: float | None) -> PlainData:
    content = plain_value(value)
    optional_fields = {"value": content, "evidence_s": evidence_s}
    return {"attribute": attribute, **{key: field for key, field in optional_fields.items() if field is not None}}


def _placement(origin: str, type_name: str, target: str, pose: Pose, stamp_s: float | None) -> PlainData:
    if not isinstance(pose, Pose):
        raise ValueError(f"{target!r} needs a Pose, not a {type(pose).__name__}")
    numbers = [float(number) for number in (*pose.translation_m, *pose.rotation)]
    return {**_edge(origin, type_name, target), "pose": numbers, **({} if stamp_s is None else {"stamp_s": stamp_s})}


def _request(request: Request) -> PlainData:
    if not isinstance(request, Request):
        raise TypeError(f"expected the return value of request(), or the request of a handover, not {request!r}")
    return {"task": request.task, "number": request.number}


def _plain_values(values: Mapping[str, object]) -> list[PlainData]:
    contents = {name: plain_value(value) for name, value in values.items()}
    return [
        {"name": name} if content is None else {"name": name, "value": content} for name, content in contents.items()
    ]


_REQUESTS: Mapping[Verb, tuple[str, Callable[..., PlainData]]] = {
    Verb.INSERT_NODE: ("insert_node", _insertion),
    Verb.DELETE_NODE: ("delete_node", lambda name: {"name": name}),
    Verb.SET: ("set_attribute", lambda name, *written: {"name": name, **_reading(*written)}),
    Verb.INSERT_EDGE: (
        "insert_edge",
        lambda *edge_and_values: {**_edge(*edge_and_values[:3]), "values": _plain_values(edge_and_values[3])},
    ),
    Verb.DELETE_EDGE: ("delete_edge", _edge),
    Verb.SET_OF_EDGE: ("set_edge_attribute", lambda *fields: {**_edge(*fields[:3]), **_reading(*fields[3:])}),
    Verb.PLACE: ("place", _placement),
    Verb.REQUEST: ("request_task", lambda task, values: {"task": task, "values": _plain_values(values)}),
    Verb.ACKNOWLEDGE: ("acknowledge_task", _request),
    Verb.FINISH: ("finish_task", lambda request, result: {**_request(request), "result": result}),
    Verb.ABORT: ("abort_task", _request),
}
"""For each operation of an agent, the request, and the function that makes its fields from the arguments."""
