"""Nodes with several children.

Each function returns the kind of one node. The nodes follow the documentation of BehaviorTree.CPP version 4: its pages
on sequences, fallbacks, parallel, conditional and switch nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto

from codra_dsl.runtime.behavior_trees.node import Entry, Kind, Node, Setting
from codra_dsl.runtime.behavior_trees.result import Result, TreeError
from codra_dsl.runtime.behavior_trees.scope import equal, number_in


class _EndPolicy(Enum):
    """The behaviour of a sequence or fallback after a child has ended it."""

    RESTART = auto()
    TICK_AGAIN = auto()


class _StepPolicy(Enum):
    """When the next child is ticked after a child that completed within one tick: in the same tick or in the next."""

    SAME_TICK = auto()
    ONE_PER_TICK = auto()


def sequence() -> Kind:
    """Tick children in order while they succeed; continue with the running child; restart after a failure."""
    return _OrderedComposite(Result.SUCCESS, _EndPolicy.RESTART, _StepPolicy.SAME_TICK)


def async_sequence() -> Kind:
    """As `sequence`, but yield after a child that completed in one tick, so a halt is possible between children."""
    return _OrderedComposite(Result.SUCCESS, _EndPolicy.RESTART, _StepPolicy.ONE_PER_TICK)


def sequence_with_memory() -> Kind:
    """As `sequence`, but after a failure or a halt, continue with the child that failed or was halted."""
    return _OrderedComposite(Result.SUCCESS, _EndPolicy.TICK_AGAIN, _StepPolicy.ONE_PER_TICK)


def fallback() -> Kind:
    """Tick children in order while they fail; continue with the running child."""
    return _OrderedComposite(Result.FAILURE, _EndPolicy.RESTART, _StepPolicy.SAME_TICK)


def async_fallback() -> Kind:
    """As `fallback`, but yield after a child that completed in one tick, so a halt is possible between children."""
    return _OrderedComposite(Result.FAILURE, _EndPolicy.RESTART, _StepPolicy.ONE_PER_TICK)


def reactive_sequence() -> Kind:
    """At each tick, tick the children from the first one on; if a child is running, halt all other children."""
    return _ReactiveComposite(Result.SUCCESS)


def reactive_fallback() -> Kind:
    """At each tick, tick the children of a fallback from the first one on, as `reactive_sequence` does."""
    return _ReactiveComposite(Result.FAILURE)


class _OrderedComposite(Kind):
    """A sequence or a fallback that remembers which child is next."""

    def __init__(self, continue_result: Result, end_policy: _EndPolicy, step_policy: _StepPolicy) -> None:
        self._continue_result = continue_result
        self._end_policy = end_policy
        self._step_policy = step_policy
        self._child_index = 0
        self._skipped_count = 0

    def tick(self, node: Node) -> Result:
        """Tick the children, beginning with the remembered one."""
        if not node.is_running:
            self._skipped_count = 0
        child_count = len(node.nodes)
        while self._child_index < child_count:
            child = node.nodes[self._child_index]
            was_idle = child.result is Result.IDLE
            result = child.execute()
            if result is Result.RUNNING:
                return result
            if result.is_completed and result is not self._continue_result:
                return self._end(node, result)
            self._child_index += 1
            self._skipped_count += result is Result.SKIPPED
            must_yield = self._step_policy is _StepPolicy.ONE_PER_TICK and was_idle and result is not Result.SKIPPED
            if must_yield and self._child_index < child_count:
                node.wake()
                return Result.RUNNING
        return self._complete(node)

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Begin with the first child when the node next starts, unless the node has a memory."""
        if self._end_policy is _EndPolicy.RESTART:
            self._child_index = self._skipped_count = 0

    def _end(self, node: Node, result: Result) -> Result:
        first_index = self._child_index if self._end_policy is _EndPolicy.TICK_AGAIN else 0
        for child in node.nodes[first_index:]:
            child.reset()
        self._child_index = first_index
        return result

    def _complete(self, node: Node) -> Result:
        are_all_skipped = self._skipped_count == len(node.nodes)
        node.reset_children()
        self._child_index = self._skipped_count = 0
        return Result.SKIPPED if are_all_skipped else self._continue_result


class _ReactiveComposite(Kind):
    """A sequence or a fallback that ticks all children before the running one at each tick."""

    def __init__(self, continue_result: Result) -> None:
        self._continue_result = continue_result

    def tick(self, node: Node) -> Result:
        """Tick the children, beginning with the first one."""
        are_all_skipped = True
        for child in node.nodes:
            result = child.execute()
            are_all_skipped = are_all_skipped and result is Result.SKIPPED
            if result is Result.RUNNING:
                for other in node.nodes:
                    if other is not child:
                        other.reset()
                return result
            if result.is_completed and result is not self._continue_result:
                node.reset_children()
                return result
        node.reset_children()
        return Result.SKIPPED if are_all_skipped else self._continue_result


class Parallel(Kind):
    """Ticks all children that have not completed, until enough of them succeed or fail; then halts the others."""

    def __init__(self, *, success_count: Setting = "-1", failure_count: Setting = "1") -> None:
        """Set how many successes make the node succeed, and how many failures make it fail.

        -1 means all children, -2 means all but one, and so on.
        """
        self._success_count = success_count
        self._failure_count = failure_count
        self._results_by_child: dict[int, Result] = {}

    def tick(self, node: Node) -> Result:
        """Tick the children in order; once the result is certain, the remaining children are not ticked."""
        declared_success_count = node.read_integer(self._success_count)
        success_threshold = _threshold(declared_success_count, node, "succeed")
        failure_threshold = _threshold(node.read_integer(self._failure_count), node, "fail")
        child_count, skipped_count = len(node.nodes), 0
        for index, child in enumerate(node.nodes):
            if index not in self._results_by_child:
                result = child.execute()
                skipped_count += result is Result.SKIPPED
                if result.is_completed:
                    self._results_by_child[index] = result
            results = list(self._results_by_child.values())
            succeeded_count, failed_count = results.count(Result.SUCCESS), results.count(Result.FAILURE)
            if succeeded_count >= success_threshold or (
                declared_success_count < 0 and succeeded_count + skipped_count >= success_threshold
            ):
                return self._end(node, Result.SUCCESS)
            if child_count - failed_count < success_threshold or failed_count >= failure_threshold:
                return self._end(node, Result.FAILURE)
        return Result.SKIPPED if skipped_count == child_count else Result.RUNNING

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Forget which children have completed."""
        self._results_by_child.clear()

    def _end(self, node: Node, result: Result) -> Result:
        self._results_by_child.clear()
        node.reset_children()
        return result


class ParallelAll(Kind):
    """Ticks all children until every child has completed, with any result, and then counts the failures."""

    def __init__(self, *, max_failures: Setting = "1") -> None:
        """Set the number of failures that make the node fail; -1 means all children."""
        self._max_failures = max_failures
        self._results_by_child: dict[int, Result] = {}

    def tick(self, node: Node) -> Result:
        """Tick the children that have not completed."""
        failure_threshold = _threshold(node.read_integer(self._max_failures), node, "fail")
        skipped_count = 0
        for index, child in enumerate(node.nodes):
            if index in self._results_by_child:
                continue
            result = child.execute()
            skipped_count += result is Result.SKIPPED
            if result.is_completed:
                self._results_by_child[index] = result
        if skipped_count == len(node.nodes):
            return Result.SKIPPED
        if skipped_count + len(self._results_by_child) < len(node.nodes):
            return Result.RUNNING
        failed_count = list(self._results_by_child.values()).count(Result.FAILURE)
        self._results_by_child.clear()
        node.reset_children()
        return Result.FAILURE if failed_count >= failure_threshold else Result.SUCCESS

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Forget which children have completed."""
        self._results_by_child.clear()


def _threshold(declared_count: int, node: Node, verb: str) -> int:
    child_count = len(node.nodes)
    if declared_count > child_count:
        raise TreeError(f"{node.name!r} has {child_count} children: {declared_count} of them can never {verb}")
    return max(child_count + declared_count + 1, 0) if declared_count < 0 else declared_count


class IfThenElse(Kind):
    """Ticks its first child as a condition until it completes, and then ticks the second or the third child.

    The condition is not ticked again while the chosen child is running.
    """

    def __init__(self) -> None:
        self._branch_index: int | None = None

    def tick(self, node: Node) -> Result:
        """Tick the condition unless it has already completed; then tick the branch."""
        if self._branch_index is None:
            condition_result = node.nodes[0].execute()
            if condition_result in (Result.RUNNING, Result.SKIPPED):
                return condition_result
            self._branch_index = 1 if condition_result is Result.SUCCESS else 2
        is_missing = self._branch_index == len(node.nodes)
        result = Result.FAILURE if is_missing else node.nodes[self._branch_index].execute()
        if result is not Result.RUNNING:
            self._branch_index = None
            node.reset_children()
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Tick the condition again when the node next starts."""
        self._branch_index = None


class WhileDoElse(Kind):
    """Ticks its first child as a condition at each tick; halts a running branch when the condition's result changes."""

    def tick(self, node: Node) -> Result:
        """Tick the condition, then the branch."""
        condition_result = node.nodes[0].execute()
        if condition_result is Result.RUNNING:
            return condition_result
        result: Result = Result.SKIPPED
        if condition_result is not Result.SKIPPED:
            branch_index, other_index = (1, 2) if condition_result is Result.SUCCESS else (2, 1)
            for child in node.nodes[other_index : other_index + 1]:
                child.reset()
            result = node.nodes[branch_index].execute() if branch_index < len(node.nodes) else Result.FAILURE
        if result is not Result.RUNNING:
            node.reset_children()
        return result


class Switch(Kind):
    """Ticks the child of the first case that equals a variable; if no case equals it, ticks the last child."""

    def __init__(self, variable: Setting, *cases: Setting, enums: Sequence[tuple[str, int]] = ()) -> None:
        """Set the variable and the cases; they are compared as texts, as numbers, or as names of numbers (`enums`)."""
        self._variable = variable
        self._cases = cases
        self._enums = dict(enums)
        self._running_child: Node | None = None

    def tick(self, node: Node) -> Result:
        """Choose a child at each tick; a running child is halted when another one is chosen."""
        child = node.nodes[self._chosen_index(node)]
        if self._running_child is not None and self._running_child is not child:
            self._running_child.reset()
        result = child.execute()
        self._running_child = child if result is Result.RUNNING else None
        if result.is_completed:
            node.reset_children()
        return result

    def halt(self, node: Node) -> None:  # noqa: ARG002
        """Forget the running child."""
        self._running_child = None

    def _chosen_index(self, node: Node) -> int:
        default_index = len(self._cases)
        if isinstance(self._variable, Entry) and not node.scope.has(self._variable.key):
            return default_index
        variable = node.read(self._variable)
        matching_indices = (
            index for index, case in enumerate(self._cases) if self._is_equal(variable, node.read(case))
        )
        return next(matching_indices, default_index)

    def _is_equal(self, variable: object, case: object) -> bool:
        if str(variable) == str(case):
            return True
        left, right = self._as_number(variable), self._as_number(case)
        return left is not None and right is not None and equal(left, right)

    def _as_number(self, value: object) -> int | float | None:
        return self._enums[value] if isinstance(value, str) and value in self._enums else number_in(value)
