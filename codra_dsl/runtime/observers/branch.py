"""One algorithm within an observer's tree: its preconditions, its job, and the result."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Protocol

from codra_dsl.logic import Term, Value, known
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.observers.failed_look import FailedLook
from codra_dsl.runtime.observers.services import ObserverServices
from codra_dsl.runtime.perception import CostMeter, Failure, Interval, JobRun, Result, State
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Cell, Reason
from codra_dsl.runtime.values.conditions_held import ContextNow, complete_from_s, first_loss_s, has_held
from codra_dsl.runtime.values.derived import with_inputs
from codra_dsl.runtime.values.hysteresis import DebouncedCondition, Hysteresis, Vote, Votes
from codra_dsl.runtime.values.model import Algorithm, NotOfTypeError

SHORTEST_PERIOD_S = 0.01
"""The shortest period, so that time passes even if an algorithm takes no time and may look again at once."""

INVALIDATION_DELAY_S = 1e-6
"""The delay from the start of acting to a look for the changed variables, so that the evidence of the look counts."""


class ObserverSchedule(Protocol):
    """The period and the priority of an observer, from its declaration."""

    @property
    def period_s(self) -> float:
        """Return the time from the start of one job of an algorithm to the start of the next."""
        ...

    @property
    def priority(self) -> int:
        """Return the priority: when jobs compete for a slot, the job with the largest priority goes first."""
        ...


class BranchObserver(Protocol):
    """The parts of an observer that its branches use.

    Attributes:
        name: the name of the observer.
        services: the part of the context manager that the observer uses.
        now_s: the instant of the present tick.
    """

    name: str
    services: ObserverServices
    now_s: float

    @property
    def model(self) -> ObserverSchedule:
        """Return the declaration of the observer."""
        ...

    def observability_condition(self, variable: str) -> Term | None:
        """Return the condition under which a variable can be observed; None if it can always be observed."""
        ...

    def context_now(self) -> ContextNow:
        """Return the context as it is at this tick."""
        ...

    def next_branch_in_turn(self, branch: Branch) -> Branch | None:
        """Return the branch, among a branch and its rivals, that may start a job now; None if there is none."""
        ...

    def request_tick(self) -> None:
        """Request a tick of the observer, because the tick may have an effect."""
        ...

    def note_job_end(self) -> None:
        """Note that a job ended in this tick."""
        ...

    def add_failed_look(self, variable: str, failed_look: FailedLook) -> None:
        """Keep a failed look until it is clear that no alternative delivers a value."""
        ...

    def write(  # noqa: PLR0917 - the arguments of Observer.write
        self, variable: str, content: Value, algorithm: str, start_s: float, stamp_s: float, latest_stamp_s: float
    ) -> bool:
        """Keep an identified value until the end of the round; return whether the evidence of the value counts."""
        ...


class Branch:
    """One algorithm within an observer: its preconditions, its job, and the result.

    The nodes of the observer's tree use the branch. A branch makes no decision about variables.
    """

    def __init__(self, algorithm: Algorithm, observer: BranchObserver) -> None:
        self.algorithm = algorithm
        self.observer = observer
        self.identifies: list[str] = []
        self.value_terms: dict[str, Term] = {}
        self._votes: dict[str, Votes] = {}
        self.acceptance_conditions: list[tuple[str, Term]] = []
        self.conditions: list[tuple[str, Term]] = []
        self._judged_context: ContextNow | None = None
        self._blocking_condition: str | None = None
        self.rivals: tuple[Branch, ...] = (self,)
        self.result: Result | None = None
        self._job_run: JobRun | None = None
        self._pin_instant_s: float | None = None
        self._interval = Interval(0.0, 0.0)
        self._job_index = 0
        self.last_start_s = BEFORE_ALL_S
        self._is_fresh = True
        self._period_s = max(observer.model.period_s, SHORTEST_PERIOD_S, algorithm.min_interval_s)
        self.is_on_event = False
        self._is_accepted = False
        self._variables_without_value: set[str] = set()
        self._reported_stuck_run: JobRun | None = None
        self._reported_host_obstacle = ""
        for name in algorithm.given:
            self.require(f"known({name})", known(name))

    # When the branch may look

    def require(self, name: str, term: Term) -> None:
        """Add a precondition, unless the branch already has it."""
        if (name, repr(term)) not in ((other, repr(condition)) for other, condition in self.conditions):
            self.conditions.append((name, term))

    def blocking_condition(self, context: ContextNow) -> str | None:
        """Return the first precondition that does not hold; None if all hold. A host must be connected.

        During a tick the context does not change, so the conditions are judged once for each context.
        """
        if context is not self._judged_context:
            self._judged_context = context
            blocking_conditions = (name for name, term in self.conditions if not term.holds(context))
            self._blocking_condition = self._host_obstacle() or next(blocking_conditions, None)
        return self._blocking_condition

    def _host_obstacle(self) -> str:
        """Return why the host of the algorithm cannot look; empty if it can, or if the algorithm has no host."""
        host = self.algorithm.host
        return self.observer.services.perception.hosts.obstacle(host) if host else ""

    def add_variable(self, variable: str, term: Term) -> None:
        """Add a variable, with the term that computes its value from a result."""
        self.identifies.append(variable)
        self.value_terms[variable] = term
        if isinstance(term, DebouncedCondition):
            self._votes[variable] = Votes(term.needed, term.among)

    def refresh(self) -> None:
        """Let the branch look as soon as possible after the start of its observer; earlier results confirm no value."""
        self._is_fresh = True
        for votes in self._votes.values():
            votes.clear()

    def earliest_start_s(self) -> float:
        """Return when the next job may start, if the variables of the branch are asked for."""
        start_s = self._next_in_period_s()
        if self.is_on_event:
            # evidence from the very instant of an invalidation does not count
            for cell in self._own_cells:
                start_s = max(start_s, cell.invalidated_s + INVALIDATION_DELAY_S)
        return start_s

    def is_asked_for(self) -> bool:
        """Return whether the branch is to look as soon as it may.

        This is false if all its variables have `refresh: on_event`, and none is both due and asked for.
        """
        return not self.is_on_event or any(map(self.observer.services.is_asked_for, self.due_variables()))

    def _next_in_period_s(self) -> float:
        """Return the end of the pause between two jobs.

        With `refresh: on_event`, the end of acting also ends the pause.
        """
        has_new_cause = self.is_on_event and self.last_start_s < self.observer.services.event_triggers.last_acting_end_s
        is_at_once = self._is_fresh or has_new_cause
        return self.last_start_s + (self.algorithm.min_interval_s if is_at_once else self._period_s)

    @property
    def would_look(self) -> bool:
        """Return whether the branch needs its preconditions now: it looks, or its pause is over and no rival looks."""
        if self.is_busy:
            return True
        if self.is_rival_busy:
            return False
        return self._next_in_period_s() <= self.observer.services.now_s()

    @cached_property
    def read_variables(self) -> frozenset[str]:
        """The variables that preconditions read; it is needed only after all preconditions were added."""
        names = {name for _, term in self.conditions for name in term.variables()}
        return with_inputs(names, self.observer.services.cells)

    @property
    def is_occupied(self) -> bool:
        """Return whether the algorithm's function still runs, even if its job was cancelled.

        While it runs, no other job of the algorithm starts: a function that hangs costs one thread, not one per period.
        """
        return self.observer.services.perception.working_job(self.algorithm) is not None

    def serves(self, variable: str) -> bool:
        """Return whether the algorithm can run, identifies a variable, and did not fail to do so in its last job."""
        can_run = not self.is_occupied and self.blocking_condition(self.observer.context_now()) is None
        return can_run and variable in self.identifies and variable not in self._variables_without_value

    # The job of the branch

    @property
    def is_busy(self) -> bool:
        """Return whether a job was requested and its outcome was not processed yet."""
        return self._job_run is not None

    @property
    def is_rival_busy(self) -> bool:
        """Return whether the branch or one of its rivals is busy."""
        for rival in self.rivals:  # noqa: SIM110 - every tick asks this, and `any` takes longer
            if rival._job_run is not None:
                return True
        return False

    @property
    def is_finished(self) -> bool:
        """Return whether the job has ended."""
        return self._job_run is not None and self._job_run.state is State.ENDED

    @property
    def is_evidence_taken(self) -> bool:
        """Return whether the evidence is complete, but the job was not processed yet.

        From then on, preconditions are judged only for the interval of the evidence.
        """
        interval = self._job_run.evidence(self.observer.now_s) if self._job_run is not None else None
        return interval is not None and interval.stamp_s is not None

    def start(self) -> None:
        """Request a job."""
        self._job_run = self.observer.services.perception.request(
            self.algorithm, self._precedence, self._begin, self.observer.request_tick
        )

    def violated_condition(self) -> str | None:
        """Return a precondition that did not hold at some moment while the evidence was taken; None if all held."""
        interval = self._job_run.evidence(self.observer.now_s) if self._job_run is not None else None
        if interval is None:
            return None
        end_s = self.observer.now_s if interval.stamp_s is None else interval.stamp_s
        cells = self.observer.services.cells
        violated_conditions = (
            name for name, term in self.conditions if not has_held(term, cells, interval.start_s, end_s)
        )
        return next(violated_conditions, None)

    def cancel(self) -> None:
        """Cancel the job."""
        job_run = self._drop_job()
        if job_run is not None:
            self.observer.services.perception.cancel(job_run)

    def void(self, condition: str) -> None:
        """Drop the job because a precondition did not hold while its evidence was taken."""
        job_run = self._drop_job()
        if job_run is not None:
            self.observer.services.perception.void(job_run, condition)
            self._variables_without_value = set(self.identifies)

    def take_outcome(self) -> bool:
        """Process the outcome of the finished job; return whether the outcome is a result."""
        job_run = self._drop_job()
        if job_run is None or job_run.start_s is None:
            return False
        self._interval = job_run.evidence(self.observer.now_s) or Interval(job_run.start_s)
        self._job_index = job_run.index
        if isinstance(job_run.outcome, Result):
            self.result, self._variables_without_value = job_run.outcome, set()
            self._is_accepted = False
            self._cost_meter.evaluated_count += 1
            return True
        if isinstance(job_run.outcome, Failure):
            self._add_failed_looks(self.identifies, job_run.outcome.reason, job_run.outcome.message, job_run.start_s)
        return False

    def note_host(self) -> None:
        """Report once that the host is lost: a failed look, after which alternatives need no pause.

        When the host is connected again, the branch looks at once.
        """
        obstacle = self._host_obstacle()
        if obstacle == self._reported_host_obstacle:
            return
        self._reported_host_obstacle = obstacle
        if not obstacle:
            self.refresh()
            return
        self.observer.note_job_end()  # so an alternative can begin before the variables become unknown
        for rival in self.rivals:
            rival._is_fresh = True
        self._add_failed_looks(self.identifies, Reason.UNREACHABLE, obstacle, self.observer.now_s)

    def note_stuck(self) -> None:
        """Report once that a cancelled job has not ended in time."""
        job_run = self.observer.services.perception.working_job(self.algorithm)
        if (
            job_run is None
            or job_run is self._reported_stuck_run
            or job_run.start_s is None
            or job_run.outcome is not None
        ):
            return
        if job_run.state is State.ENDED and self.observer.now_s >= job_run.start_s + self.algorithm.timeout_s:
            self._reported_stuck_run = job_run
            detail = f"a job that was cancelled does not end within {self.algorithm.timeout_s:g} s"
            self._add_failed_looks(self.identifies, Reason.TIMED_OUT, detail, job_run.start_s)

    # The result of the job

    def reject(self, condition: str) -> None:
        """Reject the result because a refinement does not hold for it (P1, Figure 4: refine the result)."""
        self._refuse(self.identifies, Reason.REJECTED, f"not {condition}")

    def identify(self, variable: str, term: Term) -> bool:
        """Give a variable its value from the result (P1, Equation 6); return whether the variable received one.

        A result between `enter` and `leave` confirms the value that the variable had when the evidence was taken. If
        the variable was unknown at this instant, the result is rejected.
        """
        raw_value = term.evaluate(self.result) if self.result is not None else None
        if raw_value is None and self._keeps_value(term):
            cell = self.observer.services.cells[variable]
            raw_value = cell.observed_at(self._stamp_s()).content
            if raw_value is None or cell.observed_at(self._latest_stamp_s()).content != raw_value:
                self._refuse((variable,), Reason.REJECTED, "between enter and leave, and it was unknown before")
                return False
        try:
            content = None if raw_value is None else self.observer.services.variables[variable].type.convert(raw_value)
        except NotOfTypeError as error:
            self._refuse((variable,), Reason.FAILED, str(error))
            return False
        if content is None:
            self._refuse((variable,), Reason.REJECTED, "the result has no value for it")
            return False
        start_s = self._interval.start_s
        if variable in self._votes:
            confirmed_start_s = self._confirmed_start_s(variable, content, self._votes[variable])
            if confirmed_start_s is None:
                return False
            start_s = min(start_s, confirmed_start_s)
        is_counted = self.observer.write(
            variable, content, self.algorithm.name, start_s, self._stamp_s(), self._latest_stamp_s()
        )
        if is_counted and not self._is_accepted:
            self._is_accepted = True
            self._cost_meter.accepted_count += 1
        return is_counted

    # Internal

    @property
    def _cost_meter(self) -> CostMeter:
        return self.observer.services.perception.cost_meter(self.algorithm)

    def _precedence(self) -> tuple[float, int]:
        """Return the priority and the urgency of the branch's requests for slots."""
        is_contested = bool(self.algorithm.slots)
        urgency = self.observer.services.urgency(self.observer.name) if is_contested else 0
        return self.observer.model.priority, urgency

    def _begin(self) -> dict[str, Value | None] | None:
        """Return the context values for the job, whose evidence starts now; None if the job must not begin."""
        now_s = self.observer.services.now_s()
        context = ContextNow(self.observer.services.cells, now_s)
        if self.blocking_condition(context) is not None:
            return None
        self._pin_instant_s = now_s
        for cell in self._condition_cells:
            cell.pin(now_s)
        return {name: context.value(name) for name in self.algorithm.given}

    def due_variables(self) -> list[str]:
        """Return the variables of the branch that are due because of events, whether or not they are needed."""
        services = self.observer.services
        now_s, is_due = services.now_s(), services.event_triggers.is_due
        readings = [cell.observed.at(now_s) for cell in self._own_cells]
        return [reading.name for reading in readings if is_due(reading)]

    def _drop_job(self) -> JobRun | None:
        job_run, self._job_run = self._job_run, None
        if self._pin_instant_s is not None:
            for cell in self._condition_cells:
                cell.unpin(self._pin_instant_s)
            self._pin_instant_s = None
        if job_run is not None:
            self.observer.note_job_end()
            if job_run.start_s is not None:  # when a job has started, its branch is no longer due
                self.last_start_s, self._is_fresh = job_run.start_s, False
        return job_run

    @cached_property
    def _own_cells(self) -> list[Cell]:
        """The cells of the variables that the branch identifies; it is needed only after all were added."""
        return [self.observer.services.cells[name] for name in self.identifies]

    @cached_property
    def _condition_cells(self) -> list[Cell]:
        return [self.observer.services.cells[name] for name in sorted(self.read_variables)]

    def _latest_stamp_s(self) -> float:
        """Return the latest instant at which the evidence can have been complete."""
        return self.observer.now_s if self._interval.stamp_s is None else self._interval.stamp_s

    def _stamp_s(self) -> float:
        """Return the instant from which the age of the evidence counts."""
        evidence_s = self._interval.evidence_s
        return self.observer.now_s if evidence_s is None else evidence_s

    def _keeps_value(self, term: Term) -> bool:
        """Return whether the result lies between enter and leave."""
        inner_term = term.term if isinstance(term, DebouncedCondition) else term
        return self.result is not None and isinstance(inner_term, Hysteresis) and inner_term.keeps_value(self.result)

    def _confirmed_start_s(self, variable: str, content: Value, votes: Votes) -> float | None:
        """Count a result. Return the start of the evidence for its value; None if too few results agree.

        An unconfirmed result is a failed look, like a rejected result. So `keep` and `forget` decide about the last
        value, and the algorithm does not give way to an alternative. An outlier has no effect while the last results
        still confirm the present value of the variable.
        """
        vote = Vote(content, self._interval.start_s, self._stamp_s())
        if not self.observer.services.cells[variable].admits(vote.start_s, self._latest_stamp_s()):
            return vote.start_s  # evidence from before an action is not counted as a vote; `write` reports it
        votes.add(vote, lambda earlier_vote: self._still_counts(variable, earlier_vote))
        start_s = votes.start_s(content)
        if start_s is None:
            count_text = f"{votes.count(content)} of the last {votes.among} results, {votes.needed} are needed"
            detail = f"{_value_text(content)} in {count_text}"
            self._record_refusal((variable,), Reason.UNCONFIRMED, detail)
            reading = self.observer.services.cells[variable].observed.at(self.observer.now_s)
            if not reading.known or votes.count(reading.content) < votes.needed:
                failed_look = FailedLook(Reason.UNCONFIRMED, detail, vote.stamp_s, self.algorithm.name)
                self.observer.add_failed_look(variable, failed_look)
        return start_s

    def _still_counts(self, variable: str, earlier_vote: Vote) -> bool:
        """Return whether an earlier result still counts for a variable beside the present result.

        It does not count if it is from before the last action that changed the variable, if it is no longer valid, or
        if the variable is declared with `forget` and could not be observed at some moment since the result.
        """
        services = self.observer.services
        model, cells, latest_stamp_s = services.variables[variable], services.cells, self._latest_stamp_s()
        if (
            earlier_vote.start_s <= cells[variable].invalidated_s
            or earlier_vote.stamp_s + model.valid_for_s <= latest_stamp_s
        ):
            return False
        term = self.observer.observability_condition(variable) if model.when_unobservable == "forget" else None
        if term is None:
            return True
        since_s = max(earlier_vote.stamp_s, complete_from_s(term, cells))
        return first_loss_s(term, cells, since_s, latest_stamp_s) is None

    def _refuse(self, variables: Iterable[str], reason: Reason, detail: str) -> None:
        """Record that a result has no value for some variables, and add a failed look for each."""
        self._record_refusal(variables, reason, detail)
        self._add_failed_looks(variables, reason, detail, self._stamp_s())

    def _record_refusal(self, variables: Iterable[str], reason: Reason, detail: str) -> None:
        refusal_details = {"index": self._job_index, "variables": list(variables), "reason": reason, "message": detail}
        self.observer.services.event_writer.write(Kind.JOB, self.algorithm.name, "rejected", **refusal_details)

    def _add_failed_looks(self, variables: Iterable[str], reason: Reason, detail: str, since_s: float) -> None:
        for variable in variables:
            self._variables_without_value.add(variable)
            self.observer.add_failed_look(variable, FailedLook(reason, detail, since_s, self.algorithm.name))


def _value_text(content: Value) -> str:
    return str(content).lower() if isinstance(content, bool) else str(content)
