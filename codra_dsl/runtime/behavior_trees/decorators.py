"""Nodes with one child, and subtrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from codra_dsl.runtime.behavior_trees.node import Entry, Kind, Node, Script, Setting, TickContext
from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import is_true

_S_PER_MS = 0.001
_TRUTHS = ("false", "true", "0", "1")
WITHOUT_END = -1
"""As a number of cycles or attempts."""


def inverter() -> Kind:
    """Turn success into failure and failure into success."""
    return _Turned({Result.SUCCESS: Result.FAILURE, Result.FAILURE: Result.SUCCESS})


def force_success() -> Kind:
    """Turn whatever a child completes with into success."""
    return _Turned({Result.FAILURE: Result.SUCCESS})


def force_failure() -> Kind:
    """Turn whatever a child completes with into failure."""
    return _Turned({Result.SUCCESS: Result.FAILURE})


def keep_running_until_failure() -> Kind:
    """Begin again with a child that succeeded or was skipped, in the next tick."""
    return _Turned({Result.SUCCESS: Result.RUNNING, Result.SKIPPED: Result.RUNNING})


class _Turned(Kind):
    """Tells its parent another result than its child's."""

    def __init__(self, results: Mapping[Result, Result]) -> None:
        self._results = results

    def tick(self, node: Node) -> Result:
        """Tick the child."""
        result = _ticked(node)
        return self._results.get(result, result)


def _ticked(node: Node) -> Result:
    """Tick the only child; one that has ended is idle again."""
    (child,) = node.nodes
    result = child.execute()
    if result is not Result.RUNNING:
        child.reset()
    return result


def repeat(num_cycles: Setting) -> Kind:
    """Tick a child again while it succeeds, so many times."""
    return _Loop(num_cycles, again=Result.SUCCESS)


def retry_until_successful(num_attempts: Setting) -> Kind:
    """Tick a child again while it fails, so many times."""
    return _Loop(num_attempts, again=Result.FAILURE)


class _Loop(Kind):
    """Begins again with its child after one of its two results."""

    def __init__(self, rounds: Setting, *, again: Result) -> None:
        self._rounds = rounds
        self._again = again
        self._done = 0

    def tick(self, node: Node) -> Result:
        """Go through rounds until one takes more than this tick; it yields after a round that took one tick only."""
        rounds = node.whole(self._rounds)
        while self._goes_on(rounds):
            was_idle = node.nodes[0].result is Result.IDLE
            result = _ticked(node)
            if result is not self._again:
                self._done = 0 if result.is_completed else self._done
                return result
            self._done += 1
            if self._again is Result.FAILURE:  # the library looks again after a failed attempt, but not after a cycle
                rounds = node.whole(self._rounds)
            if was_idle and self._goes_on(rounds):
                node.wake()
                return Result.RUNNING
        self._done = 0
        node.reset_children()
        return self._again

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Count anew the next time."""
        self._done = 0

    def _goes_on(self, rounds: int) -> bool:
        return rounds == WITHOUT_END or self._done < rounds


class Delay(Kind):
    """Ticks its child once some time has passed."""

    def __init__(self, delay_msec: Setting) -> None:
        self._delay_msec = delay_msec
        self._due_s: float | None = None

    def tick(self, node: Node) -> Result:
        """Wait, then tick the child."""
        if self._due_s is None:
            self._due_s = node.now_s + node.whole(self._delay_msec) * _S_PER_MS
        if node.now_s < self._due_s:
            node.tick_context.pulse.wait_for(self._due_s)
            return Result.RUNNING
        result = _ticked(node)
        if result is not Result.RUNNING:
            self._due_s = None
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Wait anew the next time."""
        self._due_s = None


class Timeout(Kind):
    """Halts its child, and fails, when it runs longer than some time; 0 is no limit."""

    def __init__(self, msec: Setting) -> None:
        self._msec = msec
        self._due_s: float | None = None

    def tick(self, node: Node) -> Result:
        """Tick the child while there is time."""
        if self._due_s is None:
            limit_ms = node.whole(self._msec)
            self._due_s = node.now_s + limit_ms * _S_PER_MS if limit_ms > 0 else float("inf")
        elif node.now_s >= self._due_s:
            self._due_s = None
            node.reset_children()
            return Result.FAILURE
        result = _ticked(node)
        if result is not Result.RUNNING:
            self._due_s = None
        elif self._due_s < float("inf"):
            node.tick_context.pulse.wait_for(self._due_s)
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Measure anew the next time."""
        self._due_s = None


class RunOnce(Kind):
    """Ticks its child until it has completed once in the life of the tree."""

    def __init__(self, *, then_skip: Setting = "true") -> None:
        """Be skipped after that, or return the same again for ever."""
        self._then_skip = then_skip
        self._came_to: Result | None = None

    def tick(self, node: Node) -> Result:
        """Tick the child, or tell what it came to."""
        if self._came_to is not None:
            return Result.SKIPPED if is_true(node.read(self._then_skip)) else self._came_to
        result = _ticked(node)
        self._came_to = result if result.is_completed else None
        return result


class Precondition(Kind):
    """Begins with its child only where a condition holds; a child that runs is not asked about."""

    def __init__(self, condition: Script, *, otherwise: Setting = "FAILURE") -> None:
        """Come to another result where the condition does not hold (the port `else`)."""
        self._condition = condition
        self._otherwise = otherwise

    def tick(self, node: Node) -> Result:
        """Ask, and tick the child."""
        if node.nodes[0].is_running or is_true(self._condition(node.scope)):
            return _ticked(node)
        return _result(node, self._otherwise)


def skip_unless_updated(entry: str) -> Kind:
    """Be skipped unless an entry was written since the last time."""
    return _Updated(entry, Result.SKIPPED)


def wait_value_update(entry: str) -> Kind:
    """Run until an entry was written since the last time."""
    return _Updated(entry, Result.RUNNING)


class _Updated(Kind):
    """Begins with its child when an entry was written since it was last asked about."""

    def __init__(self, entry: str, otherwise: Result) -> None:
        self._entry = entry
        self._otherwise = otherwise
        self._seen = 0

    def tick(self, node: Node) -> Result:
        """Go on with a running child, else look at the entry."""
        if not node.nodes[0].is_running:
            seen, self._seen = self._seen, node.scope.writes(self._entry)
            if self._seen == seen:
                return self._otherwise
        return _ticked(node)


class QueueLoop(Kind):
    """Takes items off a queue, one for each round of its child, until the queue is empty or a round fails."""

    def __init__(
        self,
        queue: Setting,
        read: Callable[[str], object],
        *,
        value: Entry | None = None,
        if_empty: Setting = "SUCCESS",
    ) -> None:
        """Loop over a queue.

        Args:
            queue: items in a text, between semicolons, or an entry that holds a list, from which items are taken.
            read: turns the text of an item into it.
            value: the entry in which the child finds the item.
            if_empty: the result when there is no item.
        """
        self._queue = queue
        self._read = read
        self._value = value
        self._if_empty = if_empty
        self._left: list[object] = []

    def tick(self, node: Node) -> Result:
        """Go on with a running child, else take the next item."""
        if node.result is Result.IDLE and isinstance(self._queue, str):
            self._left = [self._item(node, item) for item in self._queue.split(";")] if self._queue else []
        if not node.nodes[0].is_running:
            items = self._items(node)
            if not items:
                return _result(node, self._if_empty)
            item = items.pop(0)
            if self._value is not None:
                node.scope.create(self._value.key, item)
        return Result.FAILURE if _ticked(node) is Result.FAILURE else Result.RUNNING

    def _items(self, node: Node) -> list[object]:
        if isinstance(self._queue, Entry):
            held = node.read(self._queue)
            if not isinstance(held, list):
                raise TreeError(f"the entry {self._queue.key!r} holds no list: {node.name!r} takes items off one")
            return held
        return self._left

    def _item(self, node: Node, text: str) -> object:
        try:
            return self._read(text)
        except ValueError:
            raise TreeError(f"{node.name!r} cannot read the item {text!r}") from None


def loop_int(queue: Setting, *, value: Entry | None = None, if_empty: Setting = "SUCCESS") -> Kind:
    """Loop over whole numbers."""
    return QueueLoop(queue, int, value=value, if_empty=if_empty)


def loop_double(queue: Setting, *, value: Entry | None = None, if_empty: Setting = "SUCCESS") -> Kind:
    """Loop over numbers."""
    return QueueLoop(queue, float, value=value, if_empty=if_empty)


def loop_string(queue: Setting, *, value: Entry | None = None, if_empty: Setting = "SUCCESS") -> Kind:
    """Loop over texts."""
    return QueueLoop(queue, str, value=value, if_empty=if_empty)


def loop_bool(queue: Setting, *, value: Entry | None = None, if_empty: Setting = "SUCCESS") -> Kind:
    """Loop over truths."""
    return QueueLoop(queue, lambda item: bool(_TRUTHS.index(item) % 2), value=value, if_empty=if_empty)


def _result(node: Node, setting: Setting) -> Result:
    """Return the result that a port names."""
    named = str(node.read(setting)).strip().lower()
    results = [result for result in Result if result is not Result.IDLE and result.value == named]
    if not results:
        raise TreeError(f"{node.name!r} needs SUCCESS, FAILURE, SKIPPED or RUNNING, not {node.read(setting)!r}")
    return results[0]


class Subtree(Kind):
    """The root of another tree below this one, with entries of its own and those that are remapped."""

    def __init__(
        self,
        *,
        remapped: Mapping[str, str] | None = None,
        constants: Mapping[str, str] | None = None,
        remaps_all: bool = False,
    ) -> None:
        """Remap entries.

        Args:
            remapped: names of entries within, and what they are called here.
            constants: entries within that have a value from the start.
            remaps_all: whether all others are the same here, unless they are private (`_autoremap`).
        """
        self._remapped = remapped or {}
        self._constants = constants or {}
        self._remaps_all = remaps_all

    def tick(self, node: Node) -> Result:
        """Tick the root of the other tree."""
        return _ticked(node)

    def bind(self, node: Node, tick_context: TickContext) -> TickContext:  # noqa: ARG002
        """Return surroundings with a scope of its own."""
        inner = tick_context.scope.within(self._remapped, self._constants, remaps_all=self._remaps_all)
        return replace(tick_context, scope=inner)
