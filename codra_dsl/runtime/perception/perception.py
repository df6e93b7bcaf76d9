"""Perception outside the tick: jobs that run perception functions, with slots, timeouts and cancellation.

Whatever a perception function does (raise, hang, return nonsense), it ends as a `Failure` of its job; nothing of it
reaches the forest or the main execution (P1, section 3.2: observers never interfere).
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from codra_dsl.isolation.messages import described
from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reason
from codra_dsl.runtime.clock import Cancelled, Clock
from codra_dsl.runtime.journal import Kind, Scribe
from codra_dsl.runtime.model import Algorithm
from codra_dsl.runtime.perception.attempt import Attempt, State
from codra_dsl.runtime.perception.calls import CallError, Function, ToldError
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.outcome import Failure, Result, checked
from codra_dsl.runtime.perception.performers import Performers
from codra_dsl.runtime.perception.spending import Account, Spent
from codra_dsl.runtime.slots import Precedence, Slots

GRACE_S = 0.2
"""How long a job may still take to end by itself once it has timed out; then its process is ended, if it has one."""


class Perception:
    """Runs the jobs of all algorithms of one forest. Whoever calls it holds the context manager's lock."""

    def __init__(
        self,
        *,
        clock: Clock,
        slots: Slots,
        handles: Mapping[str, object],
        seed: int,
        scribe: Scribe,
        find: Callable[[Algorithm], Function],
    ) -> None:
        """Run nothing yet.

        Args:
            clock: in which jobs take their time.
            slots: of shared resources.
            handles: the handle of each resource without slots, by name.
            seed: of the chance that jobs see.
            scribe: is told what jobs do.
            find: returns the function of an algorithm, or raises `CallError`.
        """
        self._clock = clock
        self._performers = Performers(find, clock.start)
        self._slots = slots
        self._handles = handles
        self._seed = seed
        self._scribe = scribe
        self._accounts: dict[str, Account] = {}
        self._requested: Counter[str] = Counter()
        self._at_work: dict[str, Attempt] = {}

    def prepare(self, algorithms: Iterable[Algorithm]) -> None:
        """Find the functions of all algorithms, with their handles and slots; start processes for those that want one.

        Raises:
            CallError: if something is missing.
        """
        wanted = {algorithm.name: algorithm for algorithm in algorithms}
        for algorithm in wanted.values():
            self._check(algorithm)
            self._slots.expect(algorithm.slots, algorithm.timeout_s)
            self._accounts[algorithm.name] = Account()
        self._performers.prepare(list(wanted.values()), self._handles)

    def close(self) -> None:
        """Close what was set up and end all processes; it waits a moment, so its caller must not hold the lock."""
        self._performers.close()

    def account(self, algorithm: Algorithm) -> Account:
        """Return where it is counted what an algorithm spends and brings."""
        return self._accounts[algorithm.name]

    def spent(self, algorithms: Iterable[Algorithm]) -> Spent:
        """Return what some algorithms have spent and brought so far."""
        return sum((self._accounts[algorithm.name].spent() for algorithm in algorithms), Spent())

    def at_work(self, algorithm: Algorithm) -> Attempt | None:
        """Return the attempt whose function has not come to its end yet, even if nobody waits for it any more.

        An algorithm is not run twice at a time.
        """
        return self._at_work.get(algorithm.name)

    def request(
        self,
        algorithm: Algorithm,
        precedence: Precedence,
        arguments: Callable[[], Mapping[str, Value | None] | None],
        changed: Callable[[], None],
    ) -> Attempt:
        """Ask for a job; it starts, in an event of its own, as soon as it has its slots.

        Args:
            algorithm: whose job it is; none of its jobs may be at work.
            precedence: says, whenever it is asked, how it stands to others that wait for the same slots.
            arguments: asked when the job is about to begin: the values of the context-variables that it is given, or
                None when it must not begin.
            changed: called when the attempt has ended, when its function has, and when that takes too long.
        """
        attempt = Attempt(algorithm, self._requested[algorithm.name], arguments, changed)
        self._requested[algorithm.name] += 1
        attempt.requested_s = self._clock.now_s()
        attempt.ticket = self._slots.request(
            algorithm.slots, precedence, lambda: self._begin(attempt), algorithm.timeout_s
        )
        return attempt

    def cancel(self, attempt: Attempt) -> None:
        """Wait for an attempt no longer."""
        if attempt.start_s is not None and not isinstance(attempt.outcome, Failure):
            self._accounts[attempt.algorithm.name].cancelled += 1
        if attempt.state is not State.ENDED:
            self._tell(attempt, "cancelled")
            self._abandon(attempt)

    def void(self, attempt: Attempt, condition: str) -> None:
        """Drop what an attempt brought, or would bring: a condition did not hold while its evidence was taken."""
        if not isinstance(attempt.outcome, Failure):
            self._accounts[attempt.algorithm.name].voided += 1
        self._tell(attempt, "voided", condition=condition)
        self._abandon(attempt)

    def _check(self, algorithm: Algorithm) -> None:
        missing = [name for name in algorithm.handles if name not in self._handles]
        if missing:
            raise CallError(f"perception {algorithm.name!r} reads {missing[0]!r}: give start() its handle")
        unknown = [name for name in algorithm.slots if name not in self._slots.resources]
        if unknown:
            raise CallError(f"perception {algorithm.name!r} needs a slot of {unknown[0]!r}, which is no resource")

    def _begin(self, attempt: Attempt) -> None:
        arguments = attempt.arguments()
        if arguments is None:
            self._end(attempt)
            attempt.changed()
            return
        algorithm = attempt.algorithm
        attempt.state, attempt.start_s = State.RUNNING, self._clock.now_s()
        self._accounts[algorithm.name].begin(attempt.start_s - attempt.requested_s)
        chance = f"{self._seed}/{algorithm.name}/{attempt.index}"
        attempt.noted = self._note
        self._at_work[algorithm.name] = attempt
        self._tell(attempt, "started")
        try:
            attempt.work = self._clock.start(
                lambda work: self._run(attempt, RunningJob(work, chance, attempt.index), arguments),
                lambda outcome: self._deliver(attempt, outcome),
            )
        except RuntimeError as error:  # no thread could be started
            self._scribe.tell_input(algorithm.name, "unstarted", index=attempt.index, message=str(error))
            self._conclude_delivered(attempt, Failure(Reason.FAILED, described(error)))
            return
        timeout_s = attempt.start_s + algorithm.timeout_s
        attempt.timeout = self._clock.call_at(timeout_s, lambda: self._time_out(attempt))

    def _run(self, attempt: Attempt, job: RunningJob, arguments: Mapping[str, Value | None]) -> Result | Failure:
        attempt.job = job
        algorithm = attempt.algorithm
        handles = {name: self._handles[name] for name in algorithm.handles}
        try:
            performer = self._performers.of(algorithm)
            return checked(algorithm, performer.perform(job, {**algorithm.parameters, **arguments}, handles))
        except Cancelled:
            return Failure(Reason.FAILED, "it ended because it was cancelled")
        except ToldError as error:
            return Failure(Reason.FAILED, str(error))
        except BaseException as error:  # whatever a user's function raises stays here
            if isinstance(error, KeyboardInterrupt) and threading.current_thread() is threading.main_thread():
                raise  # in simulated time it is the user who wants an end
            return Failure(Reason.FAILED, described(error))

    def _note(self, attempt: Attempt, told_s: float, interval: Interval) -> None:
        """Tell what a job said of its evidence, when that first matters."""
        evidence_s = [interval.start_s, interval.stamp_s]
        self._scribe.tell_input(
            attempt.algorithm.name, "evidence", index=attempt.index, told_s=told_s, evidence_s=evidence_s
        )

    def _deliver(self, attempt: Attempt, outcome: Result | Failure) -> None:
        self._scribe.tell_input(attempt.algorithm.name, "delivered", index=attempt.index)
        self._conclude_delivered(attempt, outcome)

    def _conclude_delivered(self, attempt: Attempt, outcome: Result | Failure) -> None:
        del self._at_work[attempt.algorithm.name]
        if attempt.timeout is not None:
            attempt.timeout.cancel()
        if attempt.state is not State.ENDED:
            self._end(attempt)
            self._conclude(attempt, outcome)
        attempt.changed()

    def _time_out(self, attempt: Attempt) -> None:
        """End a job that takes too long; one that was cancelled before and does not end is stuck."""
        if attempt.state is State.ENDED:
            self._tell(attempt, "stuck")
        else:
            self._abandon(attempt)
            self._conclude(attempt, Failure(Reason.TIMED_OUT, f"no result within {attempt.algorithm.timeout_s:g} s"))
        if self.at_work(attempt.algorithm) is attempt:
            attempt.timeout = self._clock.call_at(self._clock.now_s() + GRACE_S, lambda: self._give_up(attempt))
        attempt.changed()

    def _give_up(self, attempt: Attempt) -> None:
        """End the process of a job that does not end by itself."""
        if self.at_work(attempt.algorithm) is attempt:
            self._performers.of(attempt.algorithm).give_up()

    def _conclude(self, attempt: Attempt, outcome: Result | Failure) -> None:
        attempt.outcome = outcome
        if isinstance(outcome, Failure):
            self._accounts[attempt.algorithm.name].failed += 1
            self._tell(attempt, "failed", reason=outcome.reason, message=outcome.message)
        else:
            evidence = attempt.evidence(self._clock.now_s())
            taken = [] if evidence is None else [evidence.start_s, evidence.stamp_s]
            self._tell(attempt, "returned", values=outcome.values, evidence_s=taken)

    def _abandon(self, attempt: Attempt) -> None:
        if attempt.state is not State.ENDED:
            self._end(attempt)
            if attempt.work is not None:
                attempt.work.cancel()

    def _end(self, attempt: Attempt) -> None:
        attempt.state, attempt.end_s = State.ENDED, self._clock.now_s()
        if attempt.start_s is not None:
            self._accounts[attempt.algorithm.name].end(attempt.end_s - attempt.start_s, len(attempt.algorithm.slots))
        if attempt.ticket is not None:
            self._slots.release(attempt.ticket)
            attempt.ticket = None  # it knows the attempt: without that both go at once, and no collector is needed

    def _tell(self, attempt: Attempt, what: str, **details: object) -> None:
        self._scribe.tell(Kind.JOB, attempt.algorithm.name, what, index=attempt.index, **details)


def _nothing(*_: object) -> None:
    pass
