"""The nodes of an observer's tree, in the order of P1's Figure 4.

A tree is a `Sequence(memory=False)`: control flag, preconditions, due or running, perception, refinements, identify.
Nodes have no state of their own: each uses the branch of its algorithm.
"""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from codra_dsl.logic import Term
from codra_dsl.runtime.observers.observer import Branch, Observer
from codra_dsl.runtime.observers.ticking import FAILURE, INVALID, RUNNING, SUCCESS, leaf_stop, leaf_tick


class ControlFlag(Behaviour):
    """The first node at each tick: checks whether the context manager wants the observer to run (P1, section 3.3)."""

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, observer: Observer) -> None:
        super().__init__("control flag")
        self._observer = observer

    def update(self) -> Status:
        """Fail when the observer is to stop; the tree then cancels the running nodes that follow this node."""
        return SUCCESS if self._observer.is_wanted else FAILURE


class Precondition(Behaviour):
    """An observability precondition over the context (P1, Algorithm 2, line 20).

    Complete evidence is judged by the interval in which it was taken: a precondition that fails after this interval
    neither stops the job nor voids its evidence.
    """

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, name: str, term: Term, *branches: Branch) -> None:
        super().__init__(name)
        self._term = term
        self._branches = branches
        for branch in branches:
            branch.require(name, term)

    def update(self) -> Status:
        """Succeed while the condition holds, or while the evidence is complete but the job has no result yet."""
        truth = self._term.evaluate(self._branches[0].observer.context_now())
        if truth is True:
            self.feedback_message = ""
            return SUCCESS
        self.feedback_message = "unknown" if truth is None else "does not hold"
        return SUCCESS if any(branch.is_evidence_taken for branch in self._branches) else FAILURE


class DueOrRunning(Behaviour):
    """Checks whether it is time to look again, so that perception does not repeat at each tick.

    While the node waits, its status is RUNNING; it is FAILURE only if an alternative looks instead. So a `Selector`
    switches to another branch because of the situation, not because of the period.
    """

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, branch: Branch) -> None:
        super().__init__("due or running")
        self._branch = branch

    def update(self) -> Status:
        """Succeed if the branch is due or busy; otherwise wait, or give way to an alternative by FAILURE."""
        if self._branch.is_busy:
            return SUCCESS
        next_branch = self._branch.observer.next_branch_in_turn(self._branch)
        if next_branch is self._branch:
            return SUCCESS
        is_idle = next_branch is None and not self._branch.is_rival_busy
        return RUNNING if is_idle else FAILURE


class Perceive(Behaviour):
    """The perception algorithm as an asynchronous action: running until its job is done (P1, section 3.3)."""

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, branch: Branch) -> None:
        super().__init__(branch.algorithm.name)
        self._branch = branch

    def update(self) -> Status:
        """Start a job, wait for it, and use its result if its evidence counts."""
        branch = self._branch
        if not branch.is_busy:
            branch.start()
            return RUNNING
        violated_condition = branch.violated_condition()
        if violated_condition is not None:
            branch.void(violated_condition)
            return FAILURE
        if not branch.is_finished:
            return RUNNING
        return SUCCESS if branch.take_outcome() else FAILURE

    def terminate(self, new_status: Status) -> None:
        """Cancel the job if the tree stops this node: the observer stops, or the evidence can no longer count."""
        if new_status is INVALID:
            self._branch.cancel()


class Accept(Behaviour):
    """A refinement of the result, e.g. a minimum number of markers (P1, Figure 4C)."""

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, name: str, term: Term, branch: Branch) -> None:
        super().__init__(name)
        self._term = term
        self._branch = branch
        branch.acceptance_conditions.append((name, term))

    def update(self) -> Status:
        """Fail unless the condition is known to hold for the result."""
        if self._branch.result is not None and self._term.holds(self._branch.result):
            return SUCCESS
        self._branch.reject(self.name)
        return FAILURE


class Identify(Behaviour):
    """Gives one context-variable its value from the result (P1, Equation 6)."""

    tick, stop = leaf_tick, leaf_stop

    def __init__(self, variable: str, term: Term, branch: Branch) -> None:
        super().__init__(f"identify {variable}")
        self._variable = variable
        self._term = term
        self._branch = branch
        branch.add_variable(variable, term)

    def update(self) -> Status:
        """Succeed in any case: if the result has no value for the variable, only this variable receives no value."""
        is_identified = self._branch.identify(self._variable, self._term)
        self.feedback_message = "" if is_identified else "the result does not count or has no value"
        return SUCCESS
