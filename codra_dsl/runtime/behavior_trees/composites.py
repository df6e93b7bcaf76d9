"""Nodes with several children.

Each function returns the kind of one node. The documentation of BehaviorTree.CPP version 4 is the norm: its pages on
sequences, fallbacks, parallel, conditional and switch nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto

from codra_dsl.runtime.behavior_trees.node import Entry, Kind, Node, Setting
from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import equal, number_in


class _After(Enum):
    """What a sequence or fallback does when a child ends it."""

    RESTART = auto()
    TICK_AGAIN = auto()


class _Steps(Enum):
    """Whether it goes on to the next child in the same tick when a child completed in one."""

    SAME_TICK = auto()
    ONE_A_TICK = auto()


def sequence() -> Kind:
    """Tick children in order as long as they succeed; go on with the running one; restart after a failure."""
    return _InOrder(Result.SUCCESS, _After.RESTART, _Steps.SAME_TICK)


def async_sequence() -> Kind:
    """As `sequence`, but can be halted between any two children: it yields when a child completed in one tick."""
    return _InOrder(Result.SUCCESS, _After.RESTART, _Steps.ONE_A_TICK)


def sequence_with_memory() -> Kind:
    """As `sequence`, but a child that failed is ticked again, not those before it; halting changes nothing of that."""
    return _InOrder(Result.SUCCESS, _After.TICK_AGAIN, _Steps.ONE_A_TICK)


def fallback() -> Kind:
    """Tick children in order as long as they fail; go on with the running one."""
    return _InOrder(Result.FAILURE, _After.RESTART, _Steps.SAME_TICK)


def async_fallback() -> Kind:
    """As `fallback`, but can be halted between any two children."""
    return _InOrder(Result.FAILURE, _After.RESTART, _Steps.ONE_A_TICK)


def reactive_sequence() -> Kind:
    """Tick all children from the first at each tick; whatever ran beside the running one is halted."""
    return _Reactive(Result.SUCCESS)


def reactive_fallback() -> Kind:
    """As `reactive_sequence`, for a fallback."""
    return _Reactive(Result.FAILURE)


class _InOrder(Kind):
    """A sequence or a fallback that remembers which child is its turn."""

    def __init__(self, goes_on: Result, after: _After, steps: _Steps) -> None:
        self._goes_on = goes_on
        self._after = after
        self._steps = steps
        self._turn = 0
        self._skipped = 0

    def tick(self, node: Node) -> Result:
        """Tick from the child whose turn it is."""
        if not node.is_running:
            self._skipped = 0
        count = len(node.nodes)
        while self._turn < count:
            child = node.nodes[self._turn]
            was_idle = child.result is Result.IDLE
            result = child.execute()
            if result is Result.RUNNING:
                return result
            if result.is_completed and result is not self._goes_on:
                return self._ended(node, result)
            self._turn += 1
            self._skipped += result is Result.SKIPPED
            one_a_tick = self._steps is _Steps.ONE_A_TICK and was_idle and result is not Result.SKIPPED
            if one_a_tick and self._turn < count:
                node.wake()
                return Result.RUNNING
        return self._finished(node)

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Begin anew the next time, unless it has a memory."""
        if self._after is _After.RESTART:
            self._turn = self._skipped = 0

    def _ended(self, node: Node, result: Result) -> Result:
        first = self._turn if self._after is _After.TICK_AGAIN else 0
        for child in node.nodes[first:]:
            child.reset()
        self._turn = first
        return result

    def _finished(self, node: Node) -> Result:
        all_skipped = self._skipped == len(node.nodes)
        node.reset_children()
        self._turn = self._skipped = 0
        return Result.SKIPPED if all_skipped else self._goes_on


class _Reactive(Kind):
    """A sequence or a fallback that asks all children before the running one at each tick."""

    def __init__(self, goes_on: Result) -> None:
        self._goes_on = goes_on

    def tick(self, node: Node) -> Result:
        """Tick from the first child."""
        all_skipped = True
        for child in node.nodes:
            result = child.execute()
            all_skipped = all_skipped and result is Result.SKIPPED
            if result is Result.RUNNING:
                for other in node.nodes:
                    if other is not child:
                        other.reset()
                return result
            if result.is_completed and result is not self._goes_on:
                node.reset_children()
                return result
        node.reset_children()
        return Result.SKIPPED if all_skipped else self._goes_on


class Parallel(Kind):
    """Ticks all children that have not completed, until enough of them succeeded or failed; then halts the others."""

    def __init__(self, *, success_count: Setting = "-1", failure_count: Setting = "1") -> None:
        """Complete after some successes or failures; -1 is as many as there are children, -2 one less, and so on."""
        self._success_count = success_count
        self._failure_count = failure_count
        self._completed: dict[int, Result] = {}

    def tick(self, node: Node) -> Result:
        """Tick children in order; what is decided on the way is decided for the rest."""
        given = node.whole(self._success_count)
        needed = _threshold(given, node, "succeed")
        allowed = _threshold(node.whole(self._failure_count), node, "fail")
        count, skipped = len(node.nodes), 0
        for index, child in enumerate(node.nodes):
            if index not in self._completed:
                result = child.execute()
                skipped += result is Result.SKIPPED
                if result.is_completed:
                    self._completed[index] = result
            ended = list(self._completed.values())
            succeeded, failed = ended.count(Result.SUCCESS), ended.count(Result.FAILURE)
            if succeeded >= needed or (given < 0 and succeeded + skipped >= needed):
                return self._end(node, Result.SUCCESS)
            if count - failed < needed or failed >= allowed:
                return self._end(node, Result.FAILURE)
        return Result.SKIPPED if skipped == count else Result.RUNNING

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Forget which children have completed."""
        self._completed.clear()

    def _end(self, node: Node, result: Result) -> Result:
        self._completed.clear()
        node.reset_children()
        return result


class ParallelAll(Kind):
    """Ticks all children until each has completed, whatever they come to, then counts the failures."""

    def __init__(self, *, max_failures: Setting = "1") -> None:
        """Fail with so many failures; -1 is as many as there are children."""
        self._max_failures = max_failures
        self._completed: dict[int, Result] = {}

    def tick(self, node: Node) -> Result:
        """Tick those that have not completed."""
        allowed = _threshold(node.whole(self._max_failures), node, "fail")
        skipped = 0
        for index, child in enumerate(node.nodes):
            if index in self._completed:
                continue
            result = child.execute()
            skipped += result is Result.SKIPPED
            if result.is_completed:
                self._completed[index] = result
        if skipped == len(node.nodes):
            return Result.SKIPPED
        if skipped + len(self._completed) < len(node.nodes):
            return Result.RUNNING
        failed = list(self._completed.values()).count(Result.FAILURE)
        self._completed.clear()
        node.reset_children()
        return Result.FAILURE if failed >= allowed else Result.SUCCESS

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Forget which children have completed."""
        self._completed.clear()


def _threshold(given: int, node: Node, verb: str) -> int:
    count = len(node.nodes)
    if given > count:
        raise TreeError(f"{node.name!r} has {count} children: {given} of them can never {verb}")
    return max(count + given + 1, 0) if given < 0 else given


class IfThenElse(Kind):
    """Asks its first child once, then ticks the second or the third until it completes."""

    def __init__(self) -> None:
        self._branch: int | None = None

    def tick(self, node: Node) -> Result:
        """Ask the condition, unless it was answered, and tick the branch."""
        if self._branch is None:
            asked = node.nodes[0].execute()
            if asked in (Result.RUNNING, Result.SKIPPED):
                return asked
            self._branch = 1 if asked is Result.SUCCESS else 2
        missing = self._branch == len(node.nodes)
        result = Result.FAILURE if missing else node.nodes[self._branch].execute()
        if result is not Result.RUNNING:
            self._branch = None
            node.reset_children()
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Ask again the next time."""
        self._branch = None


class WhileDoElse(Kind):
    """Asks its first child at each tick; a branch that runs is halted when the answer changes."""

    def tick(self, node: Node) -> Result:
        """Ask the condition and tick the branch."""
        asked = node.nodes[0].execute()
        if asked is Result.RUNNING:
            return asked
        result: Result = Result.SKIPPED
        if asked is not Result.SKIPPED:
            branch, other = (1, 2) if asked is Result.SUCCESS else (2, 1)
            for child in node.nodes[other : other + 1]:
                child.reset()
            result = node.nodes[branch].execute() if branch < len(node.nodes) else Result.FAILURE
        if result is not Result.RUNNING:
            node.reset_children()
        return result


class Switch(Kind):
    """Ticks the child of the first case that equals a variable, and the last child if none does."""

    def __init__(self, variable: Setting, *cases: Setting, enums: Sequence[tuple[str, int]] = ()) -> None:
        """Compare a variable with cases, as texts, as numbers, or as names of numbers."""
        self._variable = variable
        self._cases = cases
        self._enums = dict(enums)
        self._running: Node | None = None

    def tick(self, node: Node) -> Result:
        """Choose at each tick; a child that runs is halted when another is chosen."""
        child = node.nodes[self._chosen(node)]
        if self._running is not None and self._running is not child:
            self._running.reset()
        result = child.execute()
        self._running = child if result is Result.RUNNING else None
        if result.is_completed:
            node.reset_children()
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Choose anew the next time."""
        self._running = None

    def _chosen(self, node: Node) -> int:
        default = len(self._cases)
        if isinstance(self._variable, Entry) and not node.scope.has(self._variable.key):
            return default
        variable = node.read(self._variable)
        matching = (index for index, case in enumerate(self._cases) if self._equal(variable, node.read(case)))
        return next(matching, default)

    def _equal(self, variable: object, case: object) -> bool:
        if str(variable) == str(case):
            return True
        left, right = self._number(variable), self._number(case)
        return left is not None and right is not None and equal(left, right)

    def _number(self, value: object) -> int | float | None:
        return self._enums[value] if isinstance(value, str) and value in self._enums else number_in(value)
