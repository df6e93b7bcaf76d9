"""Handles with which agents write the graph, by single operations or in transactions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn, Self, SupportsIndex

from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.handshake import ConflictError
from codra_dsl.runtime.knowledge.operations import INSERT_EDGE, INSERT_NODE, SET, Operation, Verb
from codra_dsl.runtime.knowledge.rule_execution import RuleExecution
from codra_dsl.runtime.knowledge.state import Request
from codra_dsl.runtime.knowledge.watches import Change

Apply = Callable[[Verb, tuple[Any, ...]], Any]
"""Applies the operation of a verb with its arguments, and returns the result of the operation."""


class Writer:
    """The operations by which an agent writes the graph.

    A write without permission is refused: the error names the permitted agents, and the audit records the refusal.

    Every operation raises:
        NotASourceError: if only other agents may write the element (a node, an edge, an attribute or a task).
        OutrankedError: if an agent of higher priority wrote the element, and what this agent wrote is still valid.
        UnknownNameError: if a type, an attribute or a task is not declared.
        AbsentError: if a node or an edge does not exist.
        NotOfTypeError: if a value does not have the declared type.
    """

    __slots__ = ("_apply",)

    def __init__(self, apply: Apply) -> None:
        self._apply = apply

    def __reduce_ex__(self, _protocol: SupportsIndex) -> NoReturn:
        """Refuse to be copied or pickled, because closing this object would not close the copy.

        Raises:
            TypeError: always.
        """
        raise TypeError(f"a {type(self).__name__} cannot be copied: pass this object itself, or open another one")

    def insert_node(self, name: str, type: str, /, **values: object) -> None:
        """Insert a node, with values of some of its attributes.

        Raises:
            PresentError: if a node of this name exists.
        """
        self._apply(INSERT_NODE, (name, type, values))

    def delete_node(self, name: str) -> None:
        """Delete a node and all edges to and from it, including the edges of other agents."""
        self._apply(Verb.DELETE_NODE, (name,))

    def set(self, name: str, attribute: str, value: object, *, evidence_s: float | None = None) -> None:
        """Write an attribute of a node.

        Args:
            name: the name of the node.
            attribute: the name of the attribute.
            value: the value; None makes the attribute unknown.
            evidence_s: when the evidence was taken; None means now. If the present value of the attribute has newer
                evidence, the present value is kept.

        Raises:
            ValueError: if the evidence lies in the future.
        """
        self._apply(SET, (name, attribute, value, evidence_s))

    def insert_edge(self, origin: str, type: str, target: str, /, **values: object) -> None:
        """Insert an edge, or write attributes of an existing one.

        Raises:
            ValueError: if edges of this type have a pose; use `place` for them.
        """
        self._apply(INSERT_EDGE, (origin, type, target, values))

    def delete_edge(self, origin: str, type: str, target: str) -> None:
        """Delete an edge. If the edge held the pose of its target, the target has no pose from now on."""
        self._apply(Verb.DELETE_EDGE, (origin, type, target))

    def set_of_edge(
        self, origin: str, type: str, target: str, attribute: str, value: object, *, evidence_s: float | None = None
    ) -> None:
        """Write an attribute of an edge, as `set` does for a node."""
        self._apply(Verb.SET_OF_EDGE, (origin, type, target, attribute, value, evidence_s))

    def place(self, origin: str, type: str, target: str, pose: Pose, *, stamp_s: float | None = None) -> None:
        """Set the pose of a node relative to another node. The pose holds from the instant `stamp_s`.

        This inserts the edge between the two nodes, and removes the edge that held the earlier pose of the target
        relative to another node.

        Args:
            origin: the parent node.
            type: the type of the edge; it must declare a motion.
            target: the child node.
            pose: the pose of the target relative to the origin.
            stamp_s: when the pose was measured; None means now. Poses may be set in any order of their stamps.

        Raises:
            FrameError: if the target is an ancestor of the origin at the instant `stamp_s`.
            ValueError: if the stamp lies in the future, the pose is not a rigid motion, or edges of this type have no
                pose.
        """
        self._apply(Verb.PLACE, (origin, type, target, pose, stamp_s))

    # Tasks (P2, section 3.2)

    def request(self, task: str, /, **values: object) -> Request:
        """Request a task, with values of the task's attributes, such as the goal.

        The executor then acknowledges the request.

        Raises:
            ConflictError: if the task was requested before and has not ended.
        """
        request: Request = self._apply(Verb.REQUEST, (task, values))
        return request

    def acknowledge(self, request: Request) -> None:
        """Acknowledge a task as its executor: the task has begun.

        Raises:
            ConflictError: if the request is not the latest one, or does not wait for an acknowledgement.
        """
        self._apply(Verb.ACKNOWLEDGE, (request,))

    def finish(self, request: Request, result: str) -> None:
        """End a task as its executor, with one of the declared results.

        Raises:
            ConflictError: if the request is not the latest one, or the task has not begun or has ended.
        """
        self._apply(Verb.FINISH, (request, result))

    def abort(self, request: Request) -> None:
        """Abort a task as its requester.

        Raises:
            ConflictError: if the request is not the latest one, or the task has ended.
        """
        self._apply(Verb.ABORT, (request,))


class Transaction(Writer):
    """Changes that become visible together, or not at all.

    Each write is checked immediately, against the graph at the beginning of the transaction plus the transaction's
    earlier writes. If the graph has changed by the end of the transaction, all operations are applied again to the
    changed graph.
    """

    __slots__ = ("_attempt", "_error", "_is_over", "_operations_and_results", "_write_lock")

    def __init__(self, attempt: Callable[[Operation], Any], write_lock: AbstractContextManager[object]) -> None:
        """Begin without changes.

        Args:
            attempt: applies an operation to a private change set. The transaction holds `write_lock` when it calls this
                function.
            write_lock: the graph's lock for writes. Each operation of the transaction and its end hold this lock, so
                none of them happens in the middle of another write.
        """
        super().__init__(self._execute)
        self._attempt = attempt
        self._write_lock = write_lock
        self._is_over = False
        self._operations_and_results: list[tuple[Operation, Any]] = []
        self._error: BaseException | None = None

    @property
    def operations(self) -> tuple[Operation, ...]:
        """Return the operations applied so far."""
        return tuple(operation for operation, _ in self._operations_and_results)

    def _execute(self, verb: Verb, arguments: tuple[Any, ...]) -> Any:
        operation = Operation(verb, arguments)
        with self._write_lock:
            if self._is_over:
                raise PermissionError("this transaction is over: begin another")
            try:
                result = self._attempt(operation)
            except BaseException as error:
                self._error = error
                raise
            self._operations_and_results.append((operation, result))
        return result

    def end(self) -> None:
        """Accept no more changes."""
        with self._write_lock:
            self._is_over = True

    def check(self) -> None:
        """Raise the error of a failed operation, even if the program has caught it; no change becomes visible then."""
        if self._error is not None:
            raise self._error

    def reapply(self, change_set: ChangeSet) -> None:
        """Apply all operations to another change set.

        Raises:
            ConflictError: if an operation now has another result than the one that the program received before.
        """
        for operation, result in self._operations_and_results:
            if operation.apply(change_set) != result:
                raise ConflictError(
                    "the task was requested again while this transaction was open: begin another transaction"
                )


def raise_closed_error(name: str) -> NoReturn:
    """Raise the error for a closed handle.

    Raises:
        PermissionError: always.
    """
    raise PermissionError(f"this handle of the agent {name!r} is closed")


def _refuse_operation(name: str, _verb: Verb, _arguments: tuple[Any, ...]) -> NoReturn:
    raise_closed_error(name)


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentPort:
    """The functions of the graph that one agent's handle calls.

    Attributes:
        apply: applies an operation as this agent. A closed handle no longer calls this function.
        begin_transaction: begins a transaction of this agent.
        subscribe_to_wakes: subscribes a callback, which is called when a pattern in the agent's `wakes` begins to hold.
            The subscription keeps the handle alive.
        prepare_rule: returns an execution of the rule with a given name.
        close: closes the handle.
        check_open: raises `PermissionError` after `close`.
    """

    apply: Apply
    begin_transaction: Callable[[], AbstractContextManager[Transaction]]
    subscribe_to_wakes: Callable[[AgentHandle, Callable[[Change], object]], Subscription]
    prepare_rule: Callable[[str], RuleExecution[Transaction]]
    close: Callable[[], None]
    check_open: Callable[[], None]


class AgentHandle(Writer):
    """The handle with which one agent writes; an agent has at most one open handle. Writes carry the agent's name."""

    __slots__ = ("__weakref__", "_name", "_port")

    def __init__(self, name: str, port: AgentPort) -> None:
        """Open the handle.

        Args:
            name: the name of the agent.
            port: the functions of the graph for this agent.
        """
        super().__init__(port.apply)
        self._name = name
        self._port = port

    @property
    def name(self) -> str:
        """Return the name of the agent."""
        return self._name

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the handle: it can no longer write, and the subscriptions of `on_wake` end.

        `as_agent` can then return a new handle.
        """
        self._port.close()
        self._apply = partial(_refuse_operation, self._name)

    def check_open(self) -> None:
        """Check that the handle is open.

        Raises:
            PermissionError: if it is closed.
        """
        self._port.check_open()

    def transaction(self) -> AbstractContextManager[Transaction]:
        """Begin changes that become visible together at the end of the `with` statement.

        If one change fails, no change becomes visible.
        """
        return self._port.begin_transaction()

    def on_wake(self, callback: Callable[[Change], object]) -> Subscription:
        """Call back whenever a pattern in the agent's `wakes` begins to hold, and at once if patterns hold already.

        If the agent has no `wakes`, the callback is called once, immediately.

        The callback runs without any lock, one call at a time. In real time it runs in a thread of its own. In
        simulated time it runs as an event at the instant of the change and must not wait. Its exceptions are logged.
        If the graph changes while the callback runs, the patterns are evaluated once more afterwards. The callback is
        then called again only if a pattern has begun to hold.

        The subscription keeps the handle alive until it is unsubscribed or the handle is closed. No other handle of
        the agent can be opened meanwhile.
        """
        return self._port.subscribe_to_wakes(self, callback)

    def acting(self, rule: str) -> RuleExecution[Transaction]:
        """Return the execution of one of this agent's rules, to be used in a `with` statement around the action.

        Raises:
            UnknownNameError: if the agent has no such rule.
            RuleError: at the beginning of the `with` statement, if a `before` pattern does not hold.
        """
        return self._port.prepare_rule(rule)
