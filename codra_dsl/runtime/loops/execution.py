"""Execution: the mission's tree, which runs one of its guarded branches (P2, section 5.2 and Figure 7).

A course is chosen by writing the entry that the guards read. Before the entry is written, the tree is halted; this
aborts the tasks that the tree's leaves have handed over. The tree is ticked again when none of these tasks is open, or
when the time for ending them is over.

The tree is not ticked while its old branch ends. So the next branch does not begin before the old branch has ended or
the time for ending it is over. Because the tree is halted completely, it needs no branch for the time in between.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from codra_dsl.isolation.error_text import described
from codra_dsl.runtime.behavior_trees import Result, Tree
from codra_dsl.runtime.behavior_trees.node import Leaves
from codra_dsl.runtime.clock import Clock, is_interrupt
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.loops.declarations import Repeat, TreeModel

FAILED = "failed"
"""The result of a branch whose halting raised an error."""

RecordEvent = Callable[[str, str, dict[str, object]], None]
"""Records an event, given the name of its subject, what happened, and the details."""


@dataclass(slots=True)
class _EndingBranch:
    """A branch that is ending.

    Attributes:
        result: the result of the tree; tasks may still be open.
        is_halting: whether the actions of the branch are still being halted.
        is_reported: whether an event has reported that the branch ended, or that it did not end in time.
    """

    action: str
    branch: str
    since_s: float
    until_s: float
    result: str
    is_halting: bool = True
    is_reported: bool = False


class Execution:
    """Ticks one tree and switches its branches."""

    def __init__(
        self,
        model: TreeModel,
        *,
        leaves: Leaves,
        clock: Clock,
        knowledge: Knowledge | None,
        abort_s: float,
        record_event: RecordEvent,
    ) -> None:
        """Make the tree; nothing is ticked yet.

        Args:
            model: the model of the tree.
            leaves: provides the action of each leaf.
            clock: the clock for the tree and for the time limit of ending branches.
            knowledge: the graph with the tasks; None if there are no tasks.
            abort_s: how long a branch may take to end after the course has left it.
            record_event: called for each event about a branch, and for each failure.

        Raises:
            TreeError: if the robot does not have the action of a leaf.
        """
        self.model = model
        self.tree = Tree(model.build(), leaves=leaves, clock=clock)
        self.action = ""
        self.due_s = -math.inf
        self._knowledge = knowledge
        self._clock = clock
        self._abort_s = abort_s
        self._record_event = record_event
        self._result = Result.IDLE
        self._ending_branch: _EndingBranch | None = None
        self._is_idle_until_switch = False
        self._report_lock = new_lock()

    @property
    def branch(self) -> str:
        """Return the value of the entry that selects the branch; empty before the first course is chosen."""
        scope = self.tree.scope
        return str(scope.get(self.model.entry)) if scope.has(self.model.entry) else ""

    def choose(self, action: str) -> None:
        """Halt the present branch within this call; once this branch has ended, run the branch of `action`."""
        old_action, now_s = self.action, self._clock.now_s()
        self.action = action
        self._is_idle_until_switch = False
        if self._ending_branch is not None or not old_action:
            self.due_s = now_s
            return
        result = "halted" if self._result is Result.RUNNING else str(self._result)
        ending_branch = _EndingBranch(old_action, self.branch, now_s, now_s + self._abort_s, result)
        self._ending_branch = ending_branch
        self._clock.call_at(ending_branch.until_s, lambda: self._record_overdue(ending_branch))
        if not self._run_safely(self.halt):
            ending_branch.result = FAILED
        ending_branch.is_halting = False
        self.due_s = self._clock.now_s()

    def tick(self) -> None:
        """Tick the tree, unless no course is chosen yet or the branch that was left has not ended."""
        try:
            self._advance()
        finally:
            self._schedule()

    def _advance(self) -> None:
        if self._ending_branch is None or self._has_ended(self._ending_branch):
            self._ending_branch = None
            if self.action and self.branch != self.model.branches[self.action]:
                self.tree.scope.create(self.model.entry, self.model.branches[self.action])
            if not self._is_idle_until_switch and (self.action or not self.model.course):
                self._run_safely(self._tick)

    def halt(self) -> None:
        """Halt all running actions."""
        self._result = Result.IDLE
        self.tree.halt()

    def _tick(self) -> None:
        self._result = Result.IDLE
        self._result = self.tree.tick()
        self._is_idle_until_switch = self._result.is_completed and self.model.repeat is Repeat.ON_SWITCH

    def _run_safely(self, run: Callable[[], None]) -> bool:
        """Call a function that runs actions of the robot; return False if it raised an exception."""
        try:
            run()
        except BaseException as error:  # the robot's actions may raise any exception
            if is_interrupt(error):
                raise
            self._record_event(self.model.name, "failed", {"message": described(error)})
            return False
        return True

    def _has_ended(self, ending_branch: _EndingBranch) -> bool:
        now_s, open_tasks = self._clock.now_s(), self._open_tasks()
        if open_tasks and now_s < ending_branch.until_s:
            return False
        self._record_overdue(ending_branch)
        if not open_tasks:
            ending_branch.is_reported = True
            details = {"action": ending_branch.action, "branch": ending_branch.branch, "result": ending_branch.result}
            self._record_event(
                self.model.name, "ended", {**self._course_details(), **details, "took_s": now_s - ending_branch.since_s}
            )
        return True

    def _record_overdue(self, ending_branch: _EndingBranch) -> None:
        """Report once that a branch has not ended in time."""
        now_s, open_tasks = self._clock.now_s(), self._open_tasks()
        with self._report_lock:
            if (
                ending_branch.is_reported
                or now_s < ending_branch.until_s
                or not (open_tasks or ending_branch.is_halting)
            ):
                return
            ending_branch.is_reported = True
        details = {"action": ending_branch.action, "branch": ending_branch.branch, "tasks": open_tasks}
        self._record_event(
            self.model.name, "overdue", {**self._course_details(), **details, "took_s": now_s - ending_branch.since_s}
        )

    def _course_details(self) -> dict[str, object]:
        return {"course": self.model.course}

    def _open_tasks(self) -> list[str]:
        if self._knowledge is None or not self.model.tasks:
            return []
        handovers = map(self._knowledge.snapshot().handover, self.model.tasks)
        return [handover.task for handover in handovers if handover.is_open and handover.requester == self.model.agent]

    def _schedule(self) -> None:
        now_s, tree_due_s = self._clock.now_s(), self.tree.due_s
        if tree_due_s is None or tree_due_s <= now_s:  # the node that waited for this instant has been halted
            tree_due_s = math.inf
        ending_limit_s = math.inf if self._ending_branch is None else self._ending_branch.until_s
        self.due_s = min(now_s + self.model.period_s, tree_due_s, ending_limit_s)
