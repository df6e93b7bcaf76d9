"""Nodes with one child, and subtrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from codra_dsl.runtime.behavior_trees.node import Entry, Kind, Node, Script, Setting, TickContext
from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import is_true

_S_PER_MS = 0.001
_BOOLEAN_TEXTS = ("false", "true", "0", "1")
UNLIMITED = -1
"""The number of cycles or attempts that means no limit."""


def inverter() -> Kind:
    """Turn success into failure and failure into success."""
    return _ResultMapper({Result.SUCCESS: Result.FAILURE, Result.FAILURE: Result.SUCCESS})


def force_success() -> Kind:
    """Turn every completed result of the child into success."""
    return _ResultMapper({Result.FAILURE: Result.SUCCESS})


def force_failure() -> Kind:
    """Turn every completed result of the child into failure."""
    return _ResultMapper({Result.SUCCESS: Result.FAILURE})


def keep_running_until_failure() -> Kind:
    """Tick a child again in the next tick if it succeeded or was skipped."""
    return _ResultMapper({Result.SUCCESS: Result.RUNNING, Result.SKIPPED: Result.RUNNING})


class _ResultMapper(Kind):
    """Replaces results of the child by other results."""

    def __init__(self, replacements: Mapping[Result, Result]) -> None:
        self._replacements = replacements

    def tick(self, node: Node) -> Result:
        """Tick the child."""
        result = _tick_child(node)
        return self._replacements.get(result, result)


def _tick_child(node: Node) -> Result:
    """Tick the only child; afterwards it is idle, unless it is running."""
    (child,) = node.nodes
    result = child.execute()
    if result is not Result.RUNNING:
        child.reset()
    return result


def repeat(num_cycles: Setting) -> Kind:
    """Tick a child again while it succeeds, for a number of cycles."""
    return _Loop(num_cycles, repeat_result=Result.SUCCESS)


def retry_until_successful(num_attempts: Setting) -> Kind:
    """Tick a child again while it fails, for a number of attempts."""
    return _Loop(num_attempts, repeat_result=Result.FAILURE)


class _Loop(Kind):
    """Executes its child in rounds: again after each success, or again after each failure."""

    def __init__(self, round_limit: Setting, *, repeat_result: Result) -> None:
        self._round_limit = round_limit
        self._repeat_result = repeat_result
        self._finished_round_count = 0

    def tick(self, node: Node) -> Result:
        """Tick the child; yield after a round that took one tick only, otherwise begin the next round in this tick."""
        round_limit = node.read_integer(self._round_limit)
        while self._has_rounds_left(round_limit):
            was_idle = node.nodes[0].result is Result.IDLE
            result = _tick_child(node)
            if result is not self._repeat_result:
                self._finished_round_count = 0 if result.is_completed else self._finished_round_count
                return result
            self._finished_round_count += 1
            # The library reads the port again after a failed attempt, but not after a cycle.
            if self._repeat_result is Result.FAILURE:
                round_limit = node.read_integer(self._round_limit)
            if was_idle and self._has_rounds_left(round_limit):
                node.wake()
                return Result.RUNNING
        self._finished_round_count = 0
        node.reset_children()
        return self._repeat_result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Count the rounds from 0 when the node next starts."""
        self._finished_round_count = 0

    def _has_rounds_left(self, round_limit: int) -> bool:
        return round_limit == UNLIMITED or self._finished_round_count < round_limit


class Delay(Kind):
    """Ticks its child after a delay.

    Like all nodes that wait, this node has no thread: it reads the clock when the tree is ticked. A waiting node calls
    `Pulse.wait_for` with the instant for which it waits.
    """

    def __init__(self, delay_msec: Setting) -> None:
        self._delay_msec = delay_msec
        self._due_s: float | None = None

    def tick(self, node: Node) -> Result:
        """Wait, then tick the child."""
        if self._due_s is None:
            self._due_s = node.now_s + node.read_integer(self._delay_msec) * _S_PER_MS
        if node.now_s < self._due_s:
            node.tick_context.pulse.wait_for(self._due_s)
            return Result.RUNNING
        result = _tick_child(node)
        if result is not Result.RUNNING:
            self._due_s = None
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Begin a new delay when the node next starts."""
        self._due_s = None


class Timeout(Kind):
    """Halts its child and fails when the child runs longer than a limit; 0 means no limit."""

    def __init__(self, msec: Setting) -> None:
        self._msec = msec
        self._due_s: float | None = None

    def tick(self, node: Node) -> Result:
        """Tick the child, unless the time is over."""
        if self._due_s is None:
            limit_ms = node.read_integer(self._msec)
            self._due_s = node.now_s + limit_ms * _S_PER_MS if limit_ms > 0 else float("inf")
        elif node.now_s >= self._due_s:
            self._due_s = None
            node.reset_children()
            return Result.FAILURE
        result = _tick_child(node)
        if result is not Result.RUNNING:
            self._due_s = None
        elif self._due_s < float("inf"):
            node.tick_context.pulse.wait_for(self._due_s)
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Restart the measured time when the node next starts."""
        self._due_s = None


class RunOnce(Kind):
    """Ticks its child until it has completed once in the life of the tree."""

    def __init__(self, *, then_skip: Setting = "true") -> None:
        """Set whether later ticks are skipped or return the first result."""
        self._then_skip = then_skip
        self._first_result: Result | None = None

    def tick(self, node: Node) -> Result:
        """Tick the child, or return its first result."""
        if self._first_result is not None:
            return Result.SKIPPED if is_true(node.read(self._then_skip)) else self._first_result
        result = _tick_child(node)
        self._first_result = result if result.is_completed else None
        return result


class Precondition(Kind):
    """Starts its child only if a condition holds; the condition is not evaluated while the child is running."""

    def __init__(self, condition: Script, *, otherwise: Setting = "FAILURE") -> None:
        """Set the condition, and the result if it does not hold (the port `else`)."""
        self._condition = condition
        self._otherwise = otherwise

    def tick(self, node: Node) -> Result:
        """Evaluate the condition and tick the child."""
        if node.nodes[0].is_running or is_true(self._condition(node.scope)):
            return _tick_child(node)
        return _parse_result(node, self._otherwise)


def skip_unless_updated(entry: str) -> Kind:
    """Skip the child unless an entry was written since the last check."""
    return _EntryUpdateDecorator(entry, Result.SKIPPED)


def wait_value_update(entry: str) -> Kind:
    """Return RUNNING until an entry was written since the last check."""
    return _EntryUpdateDecorator(entry, Result.RUNNING)


class _EntryUpdateDecorator(Kind):
    """Starts its child if an entry was written since the last check; there is no check while the child is running."""

    def __init__(self, entry: str, unchanged_result: Result) -> None:
        self._entry = entry
        self._unchanged_result = unchanged_result
        self._seen_write_count = 0

    def tick(self, node: Node) -> Result:
        """Continue with a running child, or check the entry."""
        if not node.nodes[0].is_running:
            previous_write_count, self._seen_write_count = self._seen_write_count, node.scope.write_count(self._entry)
            if self._seen_write_count == previous_write_count:
                return self._unchanged_result
        return _tick_child(node)


class QueueLoop(Kind):
    """Takes items from a queue, one for every round of its child, until the queue is empty or a round fails."""

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
            queue: a text of items separated by semicolons, or an entry that holds a list or such a text. Items are
                removed from the list; the text of an entry is read once in the life of the tree, as in the library.
            read: parses the text of an item.
            value: the entry to which each item is written for the child.
            if_empty: the result when no item is left.
        """
        self._queue = queue
        self._read = read
        self._value = value
        self._if_empty = if_empty
        self._remaining_items: list[object] = []
        self._was_text_read = False

    def tick(self, node: Node) -> Result:
        """Continue with a running child, or take the next item."""
        if node.result is Result.IDLE and isinstance(self._queue, str):
            self._remaining_items = self._parse_items(node, self._queue)
        if not node.nodes[0].is_running:
            items = self._items(node)
            if not items:
                return _parse_result(node, self._if_empty)
            item = items.pop(0)
            if self._value is not None:
                node.scope.create(self._value.key, item)
        return Result.FAILURE if _tick_child(node) is Result.FAILURE else Result.RUNNING

    def _items(self, node: Node) -> list[object]:
        if isinstance(self._queue, Entry):
            queue = node.read(self._queue)
            if isinstance(queue, list):
                return queue
            if not isinstance(queue, str):
                raise TreeError(f"the entry {self._queue.key!r} does not hold a list: {node.name!r} needs a list")
            if not self._was_text_read:
                self._was_text_read, self._remaining_items = True, self._parse_items(node, queue)
        return self._remaining_items

    def _parse_items(self, node: Node, text: str) -> list[object]:
        return [self._parse_item(node, item) for item in text.split(";")] if text else []

    def _parse_item(self, node: Node, text: str) -> object:
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
    """Loop over booleans."""
    return QueueLoop(queue, lambda item: bool(_BOOLEAN_TEXTS.index(item) % 2), value=value, if_empty=if_empty)


def _parse_result(node: Node, setting: Setting) -> Result:
    """Return the result that the value of a port names."""
    result_name = str(node.read(setting)).strip().lower()
    named_results = [result for result in Result if result is not Result.IDLE and result.value == result_name]
    if not named_results:
        raise TreeError(f"{node.name!r} needs SUCCESS, FAILURE, SKIPPED or RUNNING, not {node.read(setting)!r}")
    return named_results[0]


class Subtree(Kind):
    """Ticks the root of another tree, which has its own entries and entries that are remapped to the outer tree."""

    def __init__(
        self,
        *,
        remapped: Mapping[str, str] | None = None,
        constants: Mapping[str, str] | None = None,
        remaps_all: bool = False,
    ) -> None:
        """Remap entries.

        Args:
            remapped: the names of entries in the outer tree. The keys are the names of these entries in the subtree.
            constants: entries of the subtree with an initial value.
            remaps_all: whether every other entry, unless private, is the entry of the same name in the outer tree
                (`_autoremap`).
        """
        self._remapped = remapped or {}
        self._constants = constants or {}
        self._remaps_all = remaps_all

    def tick(self, node: Node) -> Result:
        """Tick the root of the other tree."""
        return _tick_child(node)

    def bind(self, node: Node, tick_context: TickContext) -> TickContext:  # noqa: ARG002
        """Return a tick context with the scope of the subtree."""
        inner_scope = tick_context.scope.within(self._remapped, self._constants, remaps_all=self._remaps_all)
        return replace(tick_context, scope=inner_scope)
