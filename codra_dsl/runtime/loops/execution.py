"""Execution: the mission's tree, of whose guarded branches one runs (P2, section 5.2 and Figure 7).

A course is chosen by writing the entry that the guards read. Before that the tree is halted, which aborts the tasks
that its leaves have handed over; it is ticked again when none of these is open any more, or when the time for that is
over.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass

from codra_dsl.runtime.behavior_trees import Result, Tree
from codra_dsl.runtime.behavior_trees.node import Leaves
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.loops.declarations import Repeat, TreeModel

FAILED = "failed"
"""How a branch ended whose halting raised an error."""

Tell = Callable[[str, str, dict[str, object]], None]
"""Tells an event: of what, what, and its details."""


@dataclass(slots=True)
class _Leaving:
    """A branch that is to end.

    Attributes:
        result: how it ended, as far as the tree goes.
        is_halting: while its actions are being halted.
        is_told: whether it has been told that it ended, or that it did not in its time.
    """

    action: str
    branch: str
    since_s: float
    until_s: float
    result: str
    is_halting: bool = True
    is_told: bool = False


class Execution:
    """Ticks one tree and lets it change its branch."""

    def __init__(
        self, model: TreeModel, *, leaves: Leaves, clock: Clock, knowledge: Knowledge | None, abort_s: float, tell: Tell
    ) -> None:
        """Make the tree; nothing is ticked yet.

        Args:
            model: of the tree.
            leaves: gives each leaf its action.
            clock: for the tree, and for the time that a branch has to end.
            knowledge: holds the tasks; None if there are none.
            abort_s: how long a branch that is left may take to end.
            tell: is told what becomes of branches, and what fails.

        Raises:
            TreeError: if the robot lacks an action.
        """
        self.model = model
        self.tree = Tree(model.build(), leaves=leaves, clock=clock)
        self.action = ""
        self.due_s = -math.inf
        self._knowledge = knowledge
        self._clock = clock
        self._abort_s = abort_s
        self._tell = tell
        self._result = Result.IDLE
        self._leaving: _Leaving | None = None
        self._is_resting = False
        self._telling = threading.Lock()

    @property
    def branch(self) -> str:
        """Return what the entry says; empty before the first course is chosen."""
        scope = self.tree.scope
        return str(scope.get(self.model.entry)) if scope.has(self.model.entry) else ""

    def choose(self, action: str) -> None:
        """Let the branch of another action run, once the present one has ended; it is halted within this call."""
        left, now_s = self.action, self._clock.now_s()
        self.action = action
        self._is_resting = False
        if self._leaving is not None or not left:
            self.due_s = now_s
            return
        result = "halted" if self._result is Result.RUNNING else str(self._result)
        leaving = _Leaving(left, self.branch, now_s, now_s + self._abort_s, result)
        self._leaving = leaving
        self._clock.call_at(leaving.until_s, lambda: self._tell_overdue(leaving))
        if not self._attempt(self.halt):
            leaving.result = FAILED
        leaving.is_halting = False
        self.due_s = self._clock.now_s()

    def tick(self) -> None:
        """Tick the tree, unless no course is chosen yet or the branch that was left has not ended."""
        try:
            self._go_on()
        finally:
            self._schedule()

    def _go_on(self) -> None:
        if self._leaving is None or self._has_ended(self._leaving):
            self._leaving = None
            if self.action and self.branch != self.model.branches[self.action]:
                self.tree.scope.create(self.model.entry, self.model.branches[self.action])
            if not self._is_resting and (self.action or not self.model.course):
                self._attempt(self._tick)

    def halt(self) -> None:
        """Halt whatever runs."""
        self._result = Result.IDLE
        self.tree.halt()

    def _tick(self) -> None:
        self._result = Result.IDLE
        self._result = self.tree.tick()
        self._is_resting = self._result.is_completed and self.model.repeat is Repeat.ON_SWITCH

    def _attempt(self, part: Callable[[], None]) -> bool:
        """Do what calls actions of the robot; return whether none of them raised."""
        try:
            part()
        except Exception as error:  # noqa: BLE001 - an action of the robot's, and all that it calls
            self._tell(self.model.name, "failed", {"message": f"{type(error).__name__}: {error}"})
            return False
        return True

    def _has_ended(self, leaving: _Leaving) -> bool:
        now_s, is_open = self._clock.now_s(), self._open_tasks()
        if is_open and now_s < leaving.until_s:
            return False
        self._tell_overdue(leaving)
        if not is_open:
            leaving.is_told = True
            details = {"action": leaving.action, "branch": leaving.branch, "result": leaving.result}
            self._tell(self.model.name, "ended", {**self._whose(), **details, "took_s": now_s - leaving.since_s})
        return True

    def _tell_overdue(self, leaving: _Leaving) -> None:
        """Tell that a branch has not ended in its time, once."""
        now_s, tasks = self._clock.now_s(), self._open_tasks()
        with self._telling:
            if leaving.is_told or now_s < leaving.until_s or not (tasks or leaving.is_halting):
                return
            leaving.is_told = True
        details = {"action": leaving.action, "branch": leaving.branch, "tasks": tasks}
        self._tell(self.model.name, "overdue", {**self._whose(), **details, "took_s": now_s - leaving.since_s})

    def _whose(self) -> dict[str, object]:
        return {"course": self.model.course}

    def _open_tasks(self) -> list[str]:
        if self._knowledge is None or not self.model.tasks:
            return []
        handovers = map(self._knowledge.snapshot().handover, self.model.tasks)
        return [each.task for each in handovers if each.is_open and each.requester == self.model.agent]

    def _schedule(self) -> None:
        now_s, wanted_s = self._clock.now_s(), self.tree.due_s
        if wanted_s is None or wanted_s <= now_s:  # what waits for an instant before now has been halted since
            wanted_s = math.inf
        over_s = math.inf if self._leaving is None else self._leaving.until_s
        self.due_s = min(now_s + self.model.period_s, wanted_s, over_s)
