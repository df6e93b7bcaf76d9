"""An observer at run time: its tree, the order of its algorithms, and the effect of a tick on its variables."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import reduce
from operator import and_, or_

from py_trees.behaviour import Behaviour

from codra_dsl.logic import Term, Value, reads_ages
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.observers.branch import Branch
from codra_dsl.runtime.observers.failed_look import FailedLook, decisive_look
from codra_dsl.runtime.observers.services import ObserverServices
from codra_dsl.runtime.observers.ticking import tick
from codra_dsl.runtime.values.cell import Reading, Reason, known_reading
from codra_dsl.runtime.values.conditions_held import ContextNow, ObservabilityMonitor
from codra_dsl.runtime.values.derived import with_inputs
from codra_dsl.runtime.values.model import Algorithm

__all__ = ["Branch", "Observer", "ObserverModel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverModel:
    """An observer O_i: how its tree is built, and the variables that it identifies (P1, Equations 5, 6).

    Attributes:
        period_s: the time from the start of one job of an algorithm to the start of the next. If a job takes longer,
            the next job follows at once.
        priority: when jobs compete for a slot, the job of the observer with the largest priority goes first.
        build: builds the behaviour tree.
    """

    name: str
    identifies: tuple[str, ...]
    build: Callable[[Observer], Behaviour]
    period_s: float = 1.0
    priority: int = 0


class Observer:
    """O_i of P1: one behaviour tree that identifies one or more context-variables."""

    def __init__(
        self, model: ObserverModel, services: ObserverServices, on_tick_request: Callable[[Observer], None]
    ) -> None:
        self.model = model
        self.name = model.name
        self.services = services
        self.is_wanted = False
        self.now_s = services.now_s()
        self._context_now = ContextNow(services.cells, self.now_s)
        self._on_tick_request = on_tick_request
        self._branches: list[Branch] = []
        self._written_readings: list[Reading[Value]] = []
        self._failed_looks: dict[str, list[FailedLook]] = {}
        self._has_job_ended = False
        self._failure: str | None = None
        self.tree: Behaviour = model.build(self)
        self._branches_by_variable: dict[str, list[Branch]] = {name: [] for name in model.identifies}
        for branch in self._branches:
            for name in branch.identifies:
                self._branches_by_variable.setdefault(name, []).append(branch)
        self._hosted_branches = [branch for branch in self._branches if branch.algorithm.host]
        self._set_rivals()
        self.on_event_variables = tuple(
            name for name in model.identifies if services.variables[name].refresh == "on_event"
        )
        for branch in self._branches:
            branch.is_on_event = set(branch.identifies) <= set(self.on_event_variables)
        self.on_event_needs = tuple(name for name in self.needs() if services.variables[name].refresh == "on_event")
        self._age_sensitive_terms = [term for term in self._terms() if reads_ages(term)]
        self._observability_monitors = {
            name: ObservabilityMonitor(term)
            for name in model.identifies
            if (term := self.observability_condition(name)) is not None
        }

    def branch(self, algorithm: Algorithm) -> Branch:
        """Return a new branch for an algorithm; generated code calls this while it builds the tree."""
        branch = Branch(algorithm, self)
        self._branches.append(branch)
        return branch

    @property
    def branches(self) -> tuple[Branch, ...]:
        """Return the branches, by rank."""
        return tuple(self._branches)

    def needs(self) -> tuple[str, ...]:
        """Return C_Oi, the context-variables that the observer reads (P1, Equation 7), sorted.

        The inputs of derived variables are included.
        """
        return tuple(sorted(with_inputs(self._names_in(self._terms()), self.services.cells)))

    def watched_variables(self) -> tuple[str, ...]:
        """Return the variables whose changes cause a tick.

        These are the variables that the observer needs, and its own variables with `refresh: on_event`.
        """
        return tuple(sorted({*self.needs(), *self.on_event_variables}))

    def age_sensitive_needs(self) -> tuple[str, ...]:
        """Return the context-variables whose age the observer reads, sorted.

        Newer evidence for them may matter even if the value stays the same.
        """
        return tuple(sorted(self._names_in(self._age_sensitive_terms)))

    def observability_condition(self, variable: str) -> Term | None:
        """Return the condition under which a variable can be observed: all preconditions of one of its algorithms hold.

        Return None if the variable can always be observed.
        """
        conditions = [[term for _, term in branch.conditions] for branch in self._branches_by_variable[variable]]
        return reduce(or_, (reduce(and_, terms) for terms in conditions)) if conditions and all(conditions) else None

    def context_now(self) -> ContextNow:
        """Return the context as it is at this tick."""
        return self._context_now

    def branches_asking_for(self, variable: str) -> list[Branch]:
        """Return the branches that need a variable to look now. They look only if their own variables are asked for."""
        if not self.is_wanted:
            return []
        return [branch for branch in self._branches if variable in branch.read_variables and branch.would_look]

    def obstacle(self, variable: str) -> str:
        """Return why no algorithm of a variable can look now: a condition for each of them; empty if one can look."""
        if self._failure is not None:
            return f"{self.name} failed and is stopped: withdraw {variable} and declare it again"
        context_now = ContextNow(self.services.cells, self.services.now_s())
        conditions = [branch.blocking_condition(context_now) for branch in self._branches_by_variable[variable]]
        return "; ".join(name for name in conditions if name is not None) if all(conditions) else ""

    @property
    def hosts(self) -> frozenset[str]:
        """Return the hosts of the algorithms."""
        return frozenset(branch.algorithm.host for branch in self._hosted_branches)

    def request_tick(self) -> None:
        """Request a tick, because the tick may have an effect."""
        self._on_tick_request(self)

    # Called by the branches of the observer

    def note_job_end(self) -> None:
        """Note that a job ended in this tick; the next tick, at the same instant, decides on its effect."""
        self._has_job_ended = True

    def add_failed_look(self, variable: str, failed_look: FailedLook) -> None:
        """Keep a failed look until it is clear that no alternative delivers a value."""
        self._failed_looks.setdefault(variable, []).append(failed_look)

    def write(  # noqa: PLR0917 - every look calls this, and keyword arguments take longer
        self, variable: str, content: Value, algorithm: str, start_s: float, stamp_s: float, latest_stamp_s: float
    ) -> bool:
        """Keep an identified value until the end of the round; return whether the evidence of the value counts.

        Args:
            variable: the variable.
            content: its value.
            algorithm: the algorithm that delivered the value.
            start_s: when the taking of the evidence began.
            stamp_s: the instant from which the age of the evidence counts.
            latest_stamp_s: the latest instant at which the evidence can have been complete.
        """
        if not self.services.cells[variable].admits(start_s, latest_stamp_s):
            self.services.event_writer.write(
                Kind.VARIABLE, variable, "too_old", value=content, evidence_s=stamp_s, source=algorithm
            )
            return False
        expires_s = stamp_s + self.services.variables[variable].valid_for_s
        self._failed_looks.pop(variable, None)
        self._written_readings.append(
            known_reading(variable, content, stamp_s, start_s, self.now_s, expires_s, algorithm)
        )
        return True

    def next_branch_in_turn(self, branch: Branch) -> Branch | None:
        """Return the branch, among a branch and its rivals, that may start a job now; None if there is none.

        An algorithm is needed if at least one of its variables is not served by any algorithm of better rank. Among the
        needed algorithms, the one that has not run for the longest time goes first, so that no algorithm starves
        another one. Among algorithms with equal times, the one with the best rank goes first.
        """
        if branch.is_rival_busy:
            return None
        ready_branches = [
            rival
            for rival in branch.rivals
            if rival.earliest_start_s() <= self.now_s and rival.is_asked_for() and self._may_run(rival)
        ]
        return min(ready_branches, key=lambda rival: rival.last_start_s, default=None)

    # Life cycle

    def start(self) -> None:
        """Start the observer; it looks as soon as it can."""
        self.is_wanted, self._failure = True, None
        for branch in self._branches:
            branch.refresh()

    def stop(self) -> None:
        """Clear the control flag; the next tick cancels the jobs of the observer."""
        self.is_wanted = False

    def tick(self, now_s: float) -> list[Reading[Value]]:
        """Tick the tree once; return the readings of the variables that the tick has identified or made unknown."""
        self.now_s, self._written_readings, self._has_job_ended = now_s, [], False
        self._context_now = ContextNow(self.services.cells, now_s)
        if self._failure is not None:
            return []
        for branch in self._branches:
            branch.note_stuck()
        for branch in self._hosted_branches:
            branch.note_host()
        tick(self.tree)
        if not self.is_wanted:
            self._failed_looks.clear()
            return []
        for variable in self.model.identifies:
            self._decide_loss(variable)
        if self._has_job_ended and self._needs_another_tick():
            self.request_tick()
        return self._written_readings

    def fail(self, message: str) -> list[Reading[Value]]:
        """Stop the observer until it is started again, because its tree failed; values that it wrote become unknown."""
        self._written_readings, self._failure = [], message
        for branch in self._branches:
            branch.cancel()
        self._failed_looks.clear()
        for variable in self.model.identifies:
            reading = self._reading(variable)
            if not reading.known or self._is_own(reading):
                self._make_unknown(variable, FailedLook(Reason.FAILED, message, self.now_s, self.name))
        return self._written_readings

    def next_tick_s(self) -> float | None:
        """Return when a tick will next have an effect if nothing changes before; None if there is no such instant."""
        if not self.is_wanted or self._failure is not None:
            return None
        instants = []
        for term in self._age_sensitive_terms:
            wait_s = term.flips_s(self._context_now)
            if wait_s:
                instants.append(self.now_s + wait_s)
        for branch in self._branches:
            start_s = branch.earliest_start_s()
            if start_s <= self.now_s or branch.is_rival_busy:
                continue
            if branch.is_asked_for() and (self.on_event_needs or self._may_run(branch)):
                instants.append(start_s)
        return min(instants, default=None)

    # Internal

    @staticmethod
    def _names_in(terms: Iterable[Term]) -> set[str]:
        return {name for term in terms for name in term.variables()}

    def _terms(self) -> list[Term]:
        return [term for branch in self._branches for _, term in branch.conditions]

    def _set_rivals(self) -> None:
        """Set the rivals of each branch: the branches that share variables with it, directly or indirectly, by rank.

        The branch itself is one of them. Only one of these branches runs at a time.
        """
        rank = {branch: number for number, branch in enumerate(self._branches)}
        grouped_branches = set[Branch]()
        for branch in self._branches:
            if branch in grouped_branches:
                continue
            group, pending_branches = {branch}, [branch]
            while pending_branches:
                for name in pending_branches.pop().identifies:
                    new_branches = [other for other in self._branches_by_variable[name] if other not in group]
                    group.update(new_branches)
                    pending_branches.extend(new_branches)
            rivals = tuple(sorted(group, key=rank.__getitem__))
            for rival in rivals:
                rival.rivals = rivals
            grouped_branches |= group

    def _may_run(self, branch: Branch) -> bool:
        if branch.is_occupied or branch.blocking_condition(self.context_now()) is not None:
            return False
        better_branches = self._branches[: self._branches.index(branch)]
        return any(not any(other.serves(variable) for other in better_branches) for variable in branch.identifies)

    def _reading(self, variable: str) -> Reading[Value]:
        """Return the present reading of a variable, which can be one that was written in this tick.

        An observer continues during an override of its variable, so it reads the readings that the override hides.
        """
        newest_reading = self.services.cells[variable].observed.at(self.now_s)
        for reading in self._written_readings:
            if reading.name == variable and reading.evidence_s >= newest_reading.evidence_s:
                newest_reading = reading
        return newest_reading

    def _is_own(self, reading: Reading[Value]) -> bool:
        return any(branch.algorithm.name == reading.source for branch in self._branches)

    def _decide_loss(self, variable: str) -> None:
        """Decide whether a tick makes a variable unknown, or gives an unknown variable a new reason."""
        does_forget = self._forgets(variable)
        if variable in self._failed_looks and not self._has_job_ended and not self._alternative_is_busy(variable):
            failed_look = decisive_look(
                self._reading(variable), self._failed_looks.pop(variable, ()), does_forget=does_forget
            )
            if failed_look is not None:
                self._make_unknown(variable, failed_look)
        if does_forget and variable in self._observability_monitors:
            self._forget_unseen(variable)

    def _forgets(self, variable: str) -> bool:
        """Return whether the value of a variable is lost when the variable cannot be observed.

        While an action changes the variable, this is always the case.
        """
        model = self.services.variables[variable]
        return model.when_unobservable == "forget" or self.services.event_triggers.may_be_changing(variable)

    def _needs_another_tick(self) -> bool:
        """Return whether, after a job, another tick at this instant may have an effect."""
        if self._failed_looks or len(self._branches) > 1:
            return True
        (branch,) = self._branches
        return branch.earliest_start_s() <= self.now_s and branch.is_asked_for()

    def _alternative_is_busy(self, variable: str) -> bool:
        """Return whether a busy algorithm without a failed look may still deliver a value."""
        tried_algorithms = {failed_look.algorithm for failed_look in self._failed_looks.get(variable, ())}
        return any(
            branch.is_busy and branch.algorithm.name not in tried_algorithms
            for branch in self._branches_by_variable[variable]
        )

    def _forget_unseen(self, variable: str) -> None:
        reading = self._reading(variable)
        if not reading.known:
            return
        monitor, cells = self._observability_monitors[variable], self.services.cells
        loss_s = monitor.loss_s(cells, reading, is_own=self._is_own(reading), now_s=self.now_s)
        if loss_s is not None:
            since_s = max(loss_s, reading.evidence_s)
            self._make_unknown(
                variable, FailedLook(Reason.FORGOTTEN, self._blocking_conditions_text(variable), since_s, self.name)
            )

    def _blocking_conditions_text(self, variable: str) -> str:
        conditions = (branch.blocking_condition(self.context_now()) for branch in self._branches_by_variable[variable])
        return "; ".join(name or "a condition that did not hold for a moment" for name in conditions)

    def _make_unknown(self, variable: str, failed_look: FailedLook) -> None:
        reading: Reading[Value] = Reading(
            name=variable,
            reason=failed_look.reason,
            detail=failed_look.detail,
            evidence_s=failed_look.since_s,
            identified_s=self.now_s,
            source=failed_look.algorithm,
        )
        self._written_readings.append(reading)
