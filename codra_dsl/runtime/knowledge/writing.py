"""Writing the graph: through a handle that carries one agent's name, one step at a time or several as one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Self, TypeVar

from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import handshake
from codra_dsl.runtime.knowledge.draft import Draft
from codra_dsl.runtime.knowledge.state import Request
from codra_dsl.runtime.knowledge.words import Words

ResultT = TypeVar("ResultT")
Apply = Callable[[Callable[[Draft], Any]], Any]
"""Applies a change to the graph and returns what the change returns."""


class Writer(ABC):
    """What an agent can write. Whatever it may not write is refused, with who may, and found in the audit.

    All of these raise `NotASourceError` for what is for others to write, `OutrankedError` for what an agent that goes
    before this one has written, `UnknownNameError` for types, attributes and tasks that are not declared, `AbsentError`
    for nodes and edges that are not there, and `NotOfTypeError` for values that are not what is declared.
    """

    __slots__ = ("_words",)

    def __init__(self, words: Words) -> None:
        self._words = words

    @abstractmethod
    def _apply(self, change: Callable[[Draft], ResultT]) -> ResultT:
        """Apply a change and return what it returns."""

    def insert_node(self, name: str, type: str, /, **values: object) -> None:
        """Insert a node, with values of some of its attributes.

        Raises:
            PresentError: if there is a node of this name.
        """
        self._apply(lambda draft: draft.insert_node(name, type, values))

    def delete_node(self, name: str) -> None:
        """Delete a node, and all edges to and from it, whoever wrote them."""
        self._apply(lambda draft: draft.delete_node(name))

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
        self._apply(lambda draft: draft.set(name, attribute, value, evidence_s))

    def insert_edge(self, origin: str, type: str, target: str, /, **values: object) -> None:
        """Insert an edge, or write attributes of the one that is there.

        Raises:
            ValueError: if edges of this type have a pose: these are placed.
        """
        self._apply(lambda draft: draft.insert_edge(origin, type, target, values))

    def delete_edge(self, origin: str, type: str, target: str) -> None:
        """Delete an edge. A node that stood in another by it stands nowhere from now on."""
        self._apply(lambda draft: draft.delete_edge(origin, type, target))

    def set_of_edge(
        self, origin: str, type: str, target: str, attribute: str, value: object, *, evidence_s: float | None = None
    ) -> None:
        """Write an attribute of an edge, as `set` does of a node."""
        self._apply(lambda draft: draft.set_of_edge(origin, type, target, attribute, value, evidence_s))

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
        self._apply(lambda draft: draft.place(origin, type, target, pose, stamp_s))

    # Tasks (P2, section 3.2)

    def request(self, task: str, /, **values: object) -> Request:
        """Ask for a task, with values of attributes such as its goal; its executor is to acknowledge.

        Raises:
            ConflictError: if it was asked for and has not ended.
        """
        return self._apply(lambda draft: handshake.request(self._words, draft, task, values))

    def acknowledge(self, request: Request) -> None:
        """Say, as its executor, that a task has begun.

        Raises:
            ConflictError: if the request is not the present one, or not one that waits.
        """
        self._apply(lambda draft: handshake.acknowledge(self._words, draft, request))

    def finish(self, request: Request, result: str) -> None:
        """End a task, as its executor, with one of its results.

        Raises:
            ConflictError: if the request is not the present one, or the task has not begun or has ended.
        """
        self._apply(lambda draft: handshake.finish(self._words, draft, request, result))

    def abort(self, request: Request) -> None:
        """End a task, as who asked for it.

        Raises:
            ConflictError: if the request is not the present one, or the task has ended.
        """
        self._apply(lambda draft: handshake.abort(self._words, draft, request))


class Transaction(Writer):
    """Changes that become visible together, or not at all.

    What is written is checked at once, on the graph as it was when the transaction began and what was written in it so
    far. If the graph has changed by the end, it is all done again on what is there then.
    """

    __slots__ = ("_attempt", "_changes", "_error", "_is_over")

    def __init__(self, words: Words, attempt: Apply) -> None:
        """Begin with no change.

        Args:
            words: what is declared.
            attempt: makes a change in a draft that nobody else sees.
        """
        super().__init__(words)
        self._attempt = attempt
        self._changes: list[tuple[Callable[[Draft], Any], Any]] = []
        self._error: BaseException | None = None
        self._is_over = False

    def _apply(self, change: Callable[[Draft], ResultT]) -> ResultT:
        if self._is_over:
            raise PermissionError("this transaction is over: begin another")
        try:
            result: ResultT = self._attempt(change)
        except BaseException as error:
            self._error = error
            raise
        self._changes.append((change, result))
        return result

    def end(self) -> None:
        """Take no more changes."""
        self._is_over = True

    def check(self) -> None:
        """Raise what a change raised, though the program may have caught it: then nothing becomes visible."""
        if self._error is not None:
            raise self._error

    def again(self, draft: Draft) -> None:
        """Make all changes in another draft.

        Raises:
            ConflictError: if that gives another result than the program was told.
        """
        for change, result in self._changes:
            if change(draft) != result:
                raise handshake.ConflictError("the task was handed over otherwise while the transaction was made")


class AgentHandle(Writer):
    """The handle of one agent: what it writes carries its name, and no other handle of this name is open."""

    __slots__ = ("__weakref__", "_close", "_commit", "_name", "_transact")

    def __init__(
        self,
        name: str,
        words: Words,
        commit: Apply,
        transact: Callable[[], AbstractContextManager[Transaction]],
        close: Callable[[], None],
    ) -> None:
        """Write for an agent.

        Args:
            name: of the agent.
            words: what is declared.
            commit: applies a change as this agent.
            transact: begins a transaction of this agent.
            close: called when the handle is not used any more.
        """
        super().__init__(words)
        self._name = name
        self._commit = commit
        self._transact = transact
        self._close = close

    @property
    def name(self) -> str:
        """Return the name of the agent."""
        return self._name

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Write no more with this handle; the agent can be taken again."""
        self._close()

    def transaction(self) -> AbstractContextManager[Transaction]:
        """Begin changes that become visible together at the end of the `with` statement; none does if one fails."""
        return self._transact()

    def _apply(self, change: Callable[[Draft], ResultT]) -> ResultT:
        result: ResultT = self._commit(change)
        return result
