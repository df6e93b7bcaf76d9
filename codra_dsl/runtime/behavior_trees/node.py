"""A node of a tree as BehaviorTree.CPP version 4 understands it, in a shape that py_trees can tick and draw.

py_trees' own composites cannot keep that meaning: they know no SKIPPED, their `Sequence` and `Selector` stop what ran
before by another rule, their `Parallel` ticks again what has ended, their decorators tick a child once a tick and no
more, and none has conditions around its tick. So a `Node` is a `Behaviour` for whoever looks at it from outside, and
its `Kind` decides what a tick means.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import Scope, is_true, number_in, plain
from codra_dsl.runtime.clock import Clock

Script = Callable[[Scope], Any]
"""An expression over the entries of a scope."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A port's value that stands on the blackboard: `{key}`."""

    key: str


Setting = str | Entry
"""What a port is given: a text, or an entry."""


@dataclass(frozen=True, slots=True)
class Assignment:
    """One statement of a script.

    Attributes:
        entry: that is written.
        value: what is written.
        creates: whether the entry need not be there (`:=`).
    """

    entry: str
    value: Script
    creates: bool

    def run(self, scope: Scope) -> None:
        """Write the entry."""
        value = plain(self.value(scope))
        (scope.create if self.creates else scope.assign)(self.entry, value)


def create(entry: str, value: Script) -> Assignment:
    """Return `entry := value`."""
    return Assignment(entry, value, creates=True)


def assign(entry: str, value: Script) -> Assignment:
    """Return `entry = value`."""
    return Assignment(entry, value, creates=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What is asked before a node's tick and done after it.

    Attributes:
        failure_if: and the two that follow, in this order: asked of an idle node, decide in place of its tick.
        while_true: asked before each tick; where it does not hold, a running node is halted, and it is skipped.
        on_success: and the two that follow: done when the node completes, `post` after the others.
        on_halted: done when the node was halted while it ran.
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
    """What gives each leaf of a robot its action."""

    def of(self, name: str) -> Any:
        """Return what makes the action of a name."""
        ...


@dataclass(slots=True)
class Pulse:
    """What the nodes of a tree tell about one tick.

    Attributes:
        visited: the nodes that were ticked, in the order in which they ended.
        awake: whether a node wants the tree ticked again at once.
        due_s: the earliest instant for which a node waits.
    """

    visited: list[Node] = field(default_factory=list)
    awake: bool = False
    due_s: float | None = None

    def wait_for(self, instant_s: float) -> None:
        """Say that a node waits for an instant."""
        self.due_s = instant_s if self.due_s is None else min(self.due_s, instant_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class TickContext:
    """What the nodes of a tree share."""

    scope: Scope
    clock: Clock
    leaves: Leaves
    pulse: Pulse


class Kind(ABC):
    """What a tick of a node means."""

    @abstractmethod
    def tick(self, node: Node) -> Result:
        """Tick children as it sees fit and return what the node comes to: anything but IDLE."""

    def halt(self, node: Node) -> None:  # noqa: B027 - most kinds have nothing to forget
        """Forget what a running node remembers; its children are halted after that."""

    def bind(self, node: Node, tick_context: TickContext) -> TickContext:  # noqa: ARG002
        """Take what it needs from the surroundings, and return those of its children."""
        return tick_context

    def entries(self) -> Iterable[Entry]:
        """Return the entries that its ports name."""
        return (setting for setting in vars(self).values() if isinstance(setting, Entry))


class Node(Behaviour):
    """One node, with its children."""

    def __init__(self, name: str, kind: Kind, *children: Node, conditions: Conditions = UNCONDITIONAL) -> None:
        """Make a node that is not bound yet.

        Args:
            name: as trees are drawn with it.
            kind: what its tick means; one of its own, which no other node has.
            children: in order.
            conditions: around its tick.
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
        """Give the node and all below it what they need to be ticked."""
        self._tick_context = tick_context
        for entry in self._kind.entries():
            tick_context.scope.declare(entry.key)
        inner = self._kind.bind(self, tick_context)
        for child in self.nodes:
            child.bind(inner)

    # For kinds

    @property
    def tick_context(self) -> TickContext:
        """Return what it is bound to."""
        if self._tick_context is None:
            raise TreeError(f"the node {self.name!r} is not bound: it is ticked as part of a Tree")
        return self._tick_context

    @property
    def scope(self) -> Scope:
        """Return the entries that it sees."""
        return self.tick_context.scope

    @property
    def now_s(self) -> float:
        """Return the present instant."""
        return self.tick_context.clock.now_s()

    @property
    def is_running(self) -> bool:
        """Return whether its last tick left it running."""
        return self.result is Result.RUNNING

    def read(self, setting: Setting) -> Any:
        """Return what a port is given: its text, or the value of its entry."""
        return self.scope.get(setting.key) if isinstance(setting, Entry) else setting

    def whole(self, setting: Setting) -> int:
        """Return what a port is given as a whole number."""
        value = number_in(self.read(setting))
        if value is None or value != int(value):
            raise TreeError(f"{self.name!r} needs a whole number, not {self.read(setting)!r}")
        return int(value)

    def wake(self) -> None:
        """Ask for another tick at once: the node has yielded between two of its steps."""
        self.tick_context.pulse.awake = True

    def reset_children(self) -> None:
        """Make all children idle; those that run are halted, the first one first."""
        errors: list[Exception] = []
        for child in self.nodes:
            try:
                child.reset()
            except Exception as error:  # noqa: BLE001 - the others are halted whatever an action raises
                errors.append(error)
        if errors:
            raise errors[0]

    # Ticking

    def execute(self) -> Result:
        """Tick it, with its conditions, and return what it comes to."""
        result = self._decided() or self._kind.tick(self)
        if result.is_completed:
            self._run(self._conditions.on_success if result is Result.SUCCESS else self._conditions.on_failure)
            self._run(self._conditions.post)
        self._become(Result.IDLE if result is Result.SKIPPED else result)
        self.tick_context.pulse.visited.append(self)
        return result

    def reset(self) -> None:
        """Make it idle: halted if it runs, and without a result otherwise."""
        if self.is_running:
            self.halt()
        self._become(Result.IDLE)

    def halt(self) -> None:
        """Stop it while it runs: what it remembers, then its children, then what is to be done when it was halted."""
        try:
            self._kind.halt(self)
        finally:
            try:
                self.reset_children()
            finally:
                self._become(Result.IDLE)
        self._run(self._conditions.on_halted)

    def _decided(self) -> Result | None:
        """Return what the conditions before the tick decide, or None."""
        asked, scope = self._conditions, self.scope
        if self.is_running:
            if asked.while_true is None or is_true(asked.while_true(scope)):
                return None
            self.halt()
            return Result.SKIPPED
        if self.result is not Result.IDLE:
            return None
        for condition, result in (
            (asked.failure_if, Result.FAILURE),
            (asked.success_if, Result.SUCCESS),
            (asked.skip_if, Result.SKIPPED),
        ):
            if condition is not None and is_true(condition(scope)):
                return result
        holds = asked.while_true is None or is_true(asked.while_true(scope))
        return None if holds else Result.SKIPPED

    def _run(self, script: tuple[Assignment, ...]) -> None:
        for statement in script:
            statement.run(self.scope)

    def _become(self, result: Result) -> None:
        self.result = result
        self.status = result.status

    # As py_trees knows it

    def tick(self) -> Iterator[Behaviour]:
        """Tick it once and yield all nodes that were ticked, children first."""
        visited = self.tick_context.pulse.visited
        visited.clear()
        if self.result.is_completed:
            self.reset()
        self.execute()
        yield from tuple(visited)

    def update(self) -> Status:
        """Tick it once, for who asks a single behaviour."""
        return self.execute().status

    def stop(self, new_status: Status) -> None:
        """Halt it: py_trees calls this when a tree is interrupted."""
        self.reset()
        self.status = new_status
        self.iterator = self.tick()
