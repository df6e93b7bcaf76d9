"""Writing the graph: through a handle that carries one agent's name, one step at a time or several as one."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn, Self

from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.handshake import ConflictError
from codra_dsl.runtime.knowledge.operations import INSERT_EDGE, INSERT_NODE, SET, Operation, Verb
from codra_dsl.runtime.knowledge.rule_execution import RuleExecution
from codra_dsl.runtime.knowledge.state import Request
from codra_dsl.runtime.knowledge.watches import Change

Apply = Callable[[Verb, tuple[Any, ...]], Any]
"""Does what a verb says with what is given, and returns what the agent is told."""


class Writer:
    """What an agent can write. Whatever it may not write is refused, with who may, and found in the audit.

    All of these raise `NotASourceError` for what is for others to write, `OutrankedError` for what an agent that goes
    before this one has written, `UnknownNameError` for types, attributes and tasks that are not declared, `AbsentError`
    for nodes and edges that are not there, and `NotOfTypeError` for values that are not what is declared.
    """

    __slots__ = ("_apply",)

    def __init__(self, apply: Apply) -> None:
        self._apply = apply

    def insert_node(self, name: str, type: str, /, **values: object) -> None:
        """Insert a node, with values of some of its attributes.

        Raises:
            PresentError: if there is a node of this name.
        """
        self._apply(INSERT_NODE, (name, type, values))

    def delete_node(self, name: str) -> None:
        """Delete a node, and all edges to and from it, whoever wrote them."""
        self._apply(Verb.DELETE_NODE, (name,))

    def set(self, name: str, attribute: str, value: object, *, evidence_s: float | None = None) -> None:
        """Write an attribute of a node.

        Args:
            name: of the node.
            attribute: its name.
            value: what the agent knows of it; None makes it unknown.
            evidence_s: when the evidence was taken; now, if None. A value with newer evidence stays.

        Raises:
            ValueError: if the evidence lies in the future.
        """
        self._apply(SET, (name, attribute, value, evidence_s))

    def insert_edge(self, origin: str, type: str, target: str, /, **values: object) -> None:
        """Insert an edge, or write attributes of the one that is there.

        Raises:
            ValueError: if edges of this type have a pose: these are placed.
        """
        self._apply(INSERT_EDGE, (origin, type, target, values))

    def delete_edge(self, origin: str, type: str, target: str) -> None:
        """Delete an edge. A node that stood in another by it stands nowhere from now on."""
        self._apply(Verb.DELETE_EDGE, (origin, type, target))

    def set_of_edge(
        self, origin: str, type: str, target: str, attribute: str, value: object, *, evidence_s: float | None = None
    ) -> None:
        """Write an attribute of an edge, as `set` does of a node."""
        self._apply(Verb.SET_OF_EDGE, (origin, type, target, attribute, value, evidence_s))

    def place(self, origin: str, type: str, target: str, pose: Pose, *, stamp_s: float | None = None) -> None:
        """Say where a node stands in another, from an instant on.

        The edge between the two is there from then on, and the one by which the node stood in something else is not.

        Args:
            origin: the node in which the other stands.
            type: of the edge, which has a motion.
            target: the node that stands there.
            pose: of the target in the origin.
            stamp_s: when that was so; now, if None. Instants may come in any order.

        Raises:
            FrameError: if the origin stands in the target at that time.
            ValueError: if the stamp lies in the future, the pose is no rigid motion, or the type of edges has none.
        """
        self._apply(Verb.PLACE, (origin, type, target, pose, stamp_s))

    # Tasks (P2, section 3.2)

    def request(self, task: str, /, **values: object) -> Request:
        """Ask for a task, with values of attributes such as its goal; its executor is to acknowledge.

        Raises:
            ConflictError: if it was asked for and has not ended.
        """
        request: Request = self._apply(Verb.REQUEST, (task, values))
        return request

    def acknowledge(self, request: Request) -> None:
        """Say, as its executor, that a task has begun.

        Raises:
            ConflictError: if the request is not the present one, or not one that waits.
        """
        self._apply(Verb.ACKNOWLEDGE, (request,))

    def finish(self, request: Request, result: str) -> None:
        """End a task, as its executor, with one of its results.

        Raises:
            ConflictError: if the request is not the present one, or the task has not begun or has ended.
        """
        self._apply(Verb.FINISH, (request, result))

    def abort(self, request: Request) -> None:
        """End a task, as who asked for it.

        Raises:
            ConflictError: if the request is not the present one, or the task has ended.
        """
        self._apply(Verb.ABORT, (request,))


class Transaction(Writer):
    """Changes that become visible together, or not at all.

    What is written is checked at once, on the graph as it was when the transaction began and what was written in it so
    far. If the graph has changed by the end, it is all done again on what is there then.
    """

    __slots__ = ("_attempt", "_done", "_error", "_is_over", "_turn")

    def __init__(self, attempt: Callable[[Operation], Any], turn: AbstractContextManager[object]) -> None:
        """Begin with no change.

        Args:
            attempt: applies an operation to a draft that nobody else sees; who calls it has the turn.
            turn: of the graph. The transaction ends in it as well, so nothing is written while it becomes visible.
        """
        super().__init__(self._do)
        self._attempt = attempt
        self._turn = turn
        self._is_over = False
        self._done: list[tuple[Operation, Any]] = []
        self._error: BaseException | None = None

    @property
    def operations(self) -> tuple[Operation, ...]:
        """Return what has been done in it so far."""
        return tuple(operation for operation, _ in self._done)

    def _do(self, verb: Verb, given: tuple[Any, ...]) -> Any:
        operation = Operation(verb, given)
        with self._turn:
            if self._is_over:
                raise PermissionError("this transaction is over: begin another")
            try:
                result = self._attempt(operation)
            except BaseException as error:
                self._error = error
                raise
            self._done.append((operation, result))
        return result

    def end(self) -> None:
        """Take no more changes."""
        with self._turn:
            self._is_over = True

    def check(self) -> None:
        """Raise what a change raised, though the program may have caught it: then nothing becomes visible."""
        if self._error is not None:
            raise self._error

    def again(self, change_set: ChangeSet) -> None:
        """Make all changes in another draft.

        Raises:
            ConflictError: if that gives another result than the program was told.
        """
        for operation, result in self._done:
            if operation.apply(change_set) != result:
                raise ConflictError("the task was handed over otherwise while the transaction was made")


def closed(name: str) -> NoReturn:
    """Tell that a handle is closed.

    Raises:
        PermissionError: always.
    """
    raise PermissionError(f"this handle of the agent {name!r} is closed")


def _closed(name: str, _verb: Verb, _given: tuple[Any, ...]) -> NoReturn:
    closed(name)


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentPort:
    """By what the handle of an agent does its work.

    Attributes:
        commit: does something as this agent, which a handle that is closed asks no more.
        transact: begins a transaction of this agent.
        wake: calls back when the agent is to wake, and keeps the handle until that ends.
        act: returns the action of a rule, by its name.
        close: is called when the handle is not used any more.
        check_open: raises `PermissionError` from then on.
    """

    commit: Apply
    transact: Callable[[], AbstractContextManager[Transaction]]
    wake: Callable[[AgentHandle, Callable[[Change], object]], Subscription]
    act: Callable[[str], RuleExecution[Transaction]]
    close: Callable[[], None]
    check_open: Callable[[], None]


class AgentHandle(Writer):
    """The handle of one agent: what it writes carries its name, and no other handle of this name is open."""

    __slots__ = ("__weakref__", "_name", "_port")

    def __init__(self, name: str, port: AgentPort) -> None:
        """Write for an agent.

        Args:
            name: of the agent.
            port: by which it does so.
        """
        super().__init__(port.commit)
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
        """Write no more with this handle, and be woken no more; the agent can be taken again."""
        self._port.close()
        self._apply = partial(_closed, self._name)

    def check_open(self) -> None:
        """Do nothing while the handle is open.

        Raises:
            PermissionError: once it is closed.
        """
        self._port.check_open()

    def transaction(self) -> AbstractContextManager[Transaction]:
        """Begin changes that become visible together at the end of the `with` statement; none does if one fails."""
        return self._port.transact()

    def on_wake(self, callback: Callable[[Change], object]) -> Subscription:
        """Call back when what wakes this agent comes to hold, and first if it holds now; else once, at once.

        The callback runs without any lock, one call at a time: in real time in a thread of its own, in simulated time
        as an event at the instant of the change, which must not wait. What it raises is logged. While it runs the graph
        may change; it is then called once more, with how things are.

        Until it is unsubscribed, or the handle closed, the handle is held: nobody else gets the agent meanwhile.
        """
        return self._port.wake(self, callback)

    def acting(self, rule: str) -> RuleExecution[Transaction]:
        """Begin, by a `with` statement, an action of which a rule of this agent tells.

        Raises:
            UnknownNameError: if the agent has no such rule.
            RuleError: at the beginning of the statement, if what must hold before does not.
        """
        return self._port.act(rule)
