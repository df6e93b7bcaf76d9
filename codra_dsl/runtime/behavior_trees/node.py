"""A node with the semantics of BehaviorTree.CPP version 4; py_trees can tick and draw a tree of such nodes.

The composites of py_trees cannot implement these semantics: they have no SKIPPED, their `Sequence` and `Selector` stop
running children by other rules, their `Parallel` ticks completed children again, their decorators tick a child only
once per tick, and none of them has conditions around its tick.

So there is only one class of nodes, `Node`, which is a `Behaviour` of py_trees. The `Kind` of a node is a value that
implements the node's tick. In this way, conditions around a tick, SKIPPED and halting are implemented once, and
generated code reads like the XML.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import Scope, is_true, number_in, plain_value
from codra_dsl.runtime.clock import Clock

Script = Callable[[Scope], Any]
"""An expression over the entries of a scope."""


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of the blackboard as the value of a port: `{key}`."""

    key: str


Setting = str | Entry
"""The value of a port in a tree: a text, or an entry."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """One statement of a script.

    Attributes:
        entry: the entry that is written.
        value: the expression whose value is written.
        creates: whether the statement creates a missing entry (`:=`).
    """

    entry: str
    value: Script
    creates: bool

    def run(self, scope: Scope) -> None:
        """Write the entry."""
        value = plain_value(self.value(scope))
        (scope.create if self.creates else scope.assign)(self.entry, value)


def create(entry: str, value: Script) -> Assignment:
    """Return `entry := value`."""
    return Assignment(entry, value, creates=True)


def assign(entry: str, value: Script) -> Assignment:
    """Return `entry = value`."""
    return Assignment(entry, value, creates=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """The conditions before a node's tick and the scripts after it.

    Attributes:
        failure_if: evaluated when the node is idle, before `success_if` and `skip_if`. The first of these three
            conditions that holds decides the result, and the node is not ticked.
        success_if: see `failure_if`.
        skip_if: see `failure_if`.
        while_true: evaluated before each tick. If it does not hold, the node is skipped, and halted if it is running.
        on_success: a script that runs after a success.
        on_failure: a script that runs after a failure.
        post: a script that runs after a success or a failure, following `on_success` or `on_failure`.
        on_halted: a script that runs after the running node was halted.
    """

    failure_if: Script | None = None
    success_if: Script | None = None
    skip_if: Script | None = None
    while_true: Script | None = None
    on_success: tuple[Assignment, ...] = ()
    on_failure: tuple[Assignment, ...] = ()
    post: tuple[Assignment, ...] = ()
    on_halted: tuple[Assignment, ...] = ()


UNCONDITIONAL = Conditions()


class Leaves(Protocol):
    """Provides the actions of a robot's leaves, and the kinds of its own control nodes and decorators."""

    def of(self, name: str) -> Any:
        """Return a new action by its name."""
        ...

    def control(self, name: str, ports: Any) -> Kind:
        """Return a new kind for a control node or a decorator of the robot, by its name."""
        ...


@dataclass(slots=True)
class Pulse:
    """The reports of a tree's nodes about one tick.

    Attributes:
        visited_nodes: the ticked nodes, in the order in which their ticks ended.
        needs_tick: whether a node needs another tick of the tree at once.
        due_s: the earliest instant for which a node waits.
    """

    visited_nodes: list[Node] = field(default_factory=list)
    needs_tick: bool = False
    due_s: float | None = None

    def wait_for(self, instant_s: float) -> None:
        """Report that a node waits for an instant."""
        self.due_s = instant_s if self.due_s is None else min(self.due_s, instant_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class TickContext:
    """The services that the nodes of a tree share during ticks."""

    scope: Scope
    clock: Clock
    leaves: Leaves
    pulse: Pulse


class Kind(ABC):
    """The behaviour of a node during a tick."""

    @abstractmethod
    def tick(self, node: Node) -> Result:
        """Tick children as needed and return the result of the node, which is never IDLE."""

    def halt(self, node: Node) -> None:  # noqa: B027 - most kinds have no state
        """Clear the state of a running node; the node's children are halted afterwards."""

    def bind(self, node: Node, tick_context: TickContext) -> TickContext:  # noqa: ARG002
        """Bind the kind to a tick context, and return the tick context for the children."""
        return tick_context

    def entries(self) -> Iterable[Entry]:
        """Return the entries of the node's ports."""
        return (setting for setting in vars(self).values() if isinstance(setting, Entry))


class Node(Behaviour):
    """One node, with its children."""

    def __init__(self, name: str, kind: Kind, *children: Node, conditions: Conditions = UNCONDITIONAL) -> None:
        """Create a node that is not bound yet.

        Args:
            name: the name in drawings of the tree.
            kind: the behaviour. A kind has state, so every node needs a kind of its own. For the same reason, generated
                functions build a new tree at every call, and two uses of a subtree share no node.
            children: the children, in order.
            conditions: the conditions before the node's tick, and the scripts after it.
        """
        super().__init__(name)
        self.children = list(children)
        for child in children:
            child.parent = self
        self.nodes: Sequence[Node] = children
        self.result = Result.IDLE
        self._kind = kind
        self._conditions = conditions
        self._tick_context: TickContext | None = None

    def bind(self, tick_context: TickContext) -> None:
        """Bind the node and all its descendants to a tick context."""
        self._tick_context = tick_context
        for entry in self._kind.entries():
            tick_context.scope.declare(entry.key)
        inner_context = self._kind.bind(self, tick_context)
        for child in self.nodes:
            child.bind(inner_context)

    # For kinds

    @property
    def tick_context(self) -> TickContext:
        """Return the tick context of the bound node."""
        if self._tick_context is None:
            raise TreeError(f"the node {self.name!r} is not bound: tick it as part of a Tree")
        return self._tick_context

    @property
    def scope(self) -> Scope:
        """Return the scope with the node's entries."""
        return self.tick_context.scope

    @property
    def now_s(self) -> float:
        """Return the present instant."""
        return self.tick_context.clock.now_s()

    @property
    def is_running(self) -> bool:
        """Return whether the last tick of the node returned RUNNING and the node was not halted since."""
        return self.result is Result.RUNNING

    def read(self, setting: Setting) -> Any:
        """Return the value of a port: the text of the port, or the value of the port's entry."""
        return self.scope.get(setting.key) if isinstance(setting, Entry) else setting

    def read_integer(self, setting: Setting) -> int:
        """Return the value of a port as an integer."""
        value = number_in(self.read(setting))
        if value is None or value != int(value):
            raise TreeError(f"{self.name!r} needs a whole number, not {self.read(setting)!r}")
        return int(value)

    def wake(self) -> None:
        """Request another tick at once, because the node has yielded between two of its steps."""
        self.tick_context.pulse.needs_tick = True

    def reset_children(self) -> None:
        """Make all children idle; running children are halted in order."""
        errors: list[Exception] = []
        for child in self.nodes:
            try:
                child.reset()
            except Exception as error:  # noqa: BLE001 - the other children are halted in any case
                errors.append(error)
        if errors:
            raise errors[0]

    # Ticking

    def execute(self) -> Result:
        """Tick the node, with its conditions, and return its result."""
        result = self._result_of_conditions() or self._kind.tick(self)
        if result.is_completed:
            self._run(self._conditions.on_success if result is Result.SUCCESS else self._conditions.on_failure)
            self._run(self._conditions.post)
        self._set_result(Result.IDLE if result is Result.SKIPPED else result)
        self.tick_context.pulse.visited_nodes.append(self)
        return result

    def reset(self) -> None:
        """Make the node idle; halt it if it is running."""
        if self.is_running:
            self.halt()
        self._set_result(Result.IDLE)

    def halt(self) -> None:
        """Halt the running node: clear its state, halt its children, then run `on_halted`."""
        try:
            self._kind.halt(self)
        finally:
            try:
                self.reset_children()
            finally:
                self._set_result(Result.IDLE)
        self._run(self._conditions.on_halted)

    def _result_of_conditions(self) -> Result | None:
        """Return the result that the conditions before the tick decide; None if the node must be ticked."""
        conditions, scope = self._conditions, self.scope
        if self.is_running:
            if conditions.while_true is None or is_true(conditions.while_true(scope)):
                return None
            self.halt()
            return Result.SKIPPED
        if self.result is not Result.IDLE:
            return None
        for condition, result in (
            (conditions.failure_if, Result.FAILURE),
            (conditions.success_if, Result.SUCCESS),
            (conditions.skip_if, Result.SKIPPED),
        ):
            if condition is not None and is_true(condition(scope)):
                return result
        is_allowed = conditions.while_true is None or is_true(conditions.while_true(scope))
        return None if is_allowed else Result.SKIPPED

    def _run(self, script: tuple[Assignment, ...]) -> None:
        for statement in script:
            statement.run(self.scope)

    def _set_result(self, result: Result) -> None:
        self.result = result
        self.status = result.status

    # The interface of py_trees

    def tick(self) -> Iterator[Behaviour]:
        """Tick the node once and yield all ticked nodes, children first."""
        visited_nodes = self.tick_context.pulse.visited_nodes
        visited_nodes.clear()
        if self.result.is_completed:
            self.reset()
        self.execute()
        yield from tuple(visited_nodes)

    def update(self) -> Status:
        """Tick the node once and return its status in py_trees."""
        return self.execute().status

    def stop(self, new_status: Status) -> None:
        """Halt the node; py_trees calls this when a tree is interrupted."""
        self.reset()
        self.status = new_status
        self.iterator = self.tick()
