"""Perception outside the tick: jobs that run perception functions, with slots, timeouts and cancellation.

Whatever a perception function does (raise, hang, return nonsense), it ends as a `Failure` of its job; nothing of it
reaches the forest or the main execution (P1, section 3.2: observers never interfere).
"""

from __future__ import annotations

import importlib
import random
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any, Protocol

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reason
from codra_dsl.runtime.clock import Cancelled, Clock, Timer, Work
from codra_dsl.runtime.journal import Kind, Scribe
from codra_dsl.runtime.model import Algorithm, NotOfTypeError
from codra_dsl.runtime.slots import Slots, Ticket

MAX_MESSAGE = 200
"""Characters of a foreign text that a reason shows."""


Function = Callable[..., object]
"""A perception function: called with keyword arguments, it returns a mapping as the spec's `returns` says."""


class CallError(LookupError):
    """A spec's `call` names no function, or a resource has no handle: a mistake in how the robot is put together."""


class Job(Protocol):
    """What a perception function gets as `job`."""

    @property
    def index(self) -> int:
        """Return the number of the job among those of its algorithm, as the record tells it."""
        ...

    @property
    def random(self) -> random.Random:
        """Return chance that depends on the seed, the algorithm and the number of its job only."""
        ...

    @property
    def cancelled(self) -> bool:
        """Return whether nobody waits for the result any more."""
        ...

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Spend time; raises `Cancelled` when nobody waits for the result any more."""
        ...

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Say when the evidence was taken: what fails afterwards takes nothing away from it."""
        ...


@dataclass(frozen=True, slots=True)
class Interval:
    """When evidence is taken: from its start to its stamp, which is None while it is still being taken."""

    start_s: float
    stamp_s: float | None = None


@dataclass(frozen=True, slots=True)
class Result:
    """What a perception function returned, checked; None stands for what it did not measure."""

    values: Mapping[str, Value | None]

    def value(self, name: str) -> Value | None:
        """Return a returned value, or None."""
        return self.values.get(name)

    def age_s(self, name: str) -> float | None:  # noqa: ARG002 - it is the same for all
        """Return None: a returned value has no age."""
        return None


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a job brought no result."""

    reason: Reason
    message: str


class State(Enum):
    """How far an attempt is."""

    WAITING = "waiting"
    RUNNING = "running"
    ENDED = "ended"


class _Job:
    """The `job` of one call; it lives in the thread of its perception function."""

    def __init__(self, work: Work, seed: str, index: int) -> None:
        self.index = index
        self._seed = seed
        self._work = work
        self._told: list[tuple[float, Interval]] = []
        self._telling = threading.Lock()

    @cached_property
    def random(self) -> random.Random:
        return random.Random(self._seed)

    @property
    def cancelled(self) -> bool:
        return self._work.cancelled

    def now_s(self) -> float:
        return self._work.now_s()

    def sleep(self, duration_s: float) -> None:
        self._work.sleep(duration_s)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        with self._telling:  # who asks `told_by` at an instant gets the same answer later
            now_s = self.now_s()
            if not start_s <= stamp_s <= now_s:
                raise ValueError(f"evidence is taken from a start to a stamp, both past: not {start_s} to {stamp_s}")
            self._told.append((now_s, Interval(float(start_s), float(stamp_s))))

    def told_by(self, now_s: float) -> tuple[float, Interval] | None:
        """Return the last that was told about the evidence up to an instant, and when."""
        with self._telling:
            return next((told for told in reversed(self._told) if told[0] <= now_s), None)


class Attempt:
    """One job of one algorithm, from the request to its end.

    Attributes:
        state: how far it is.
        start_s: when the job began; None before.
        outcome: what it brought; None until it has ended, and for ever when it was cancelled or could not begin.
    """

    def __init__(
        self,
        algorithm: Algorithm,
        index: int,
        arguments: Callable[[], Mapping[str, Value | None] | None],
        changed: Callable[[], None],
    ) -> None:
        self.algorithm = algorithm
        self.index = index
        self.arguments = arguments
        self.changed = changed
        self.state = State.WAITING
        self.start_s: float | None = None
        self.end_s: float | None = None
        self.outcome: Result | Failure | None = None
        self.ticket: Ticket | None = None
        self.timeout: Timer | None = None
        self.work: Work | None = None
        self.job: _Job | None = None
        self.heard: tuple[float, Interval] | None = None
        self.noted: Callable[[float, Interval], None] = _nothing

    def evidence(self, now_s: float) -> Interval | None:
        """Return when its evidence is taken, as far as the job has told until now; None before it runs.

        The evidence of a job that tells nothing about it is taken during the whole job.
        """
        if self.start_s is None:
            return None
        told = self.job.told_by(now_s) if self.job is not None else None
        if told is None:
            return Interval(self.start_s, self.end_s)
        if told is not self.heard:
            self.heard = told
            self.noted(*told)
        return told[1]


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
        self._find = find
        self._slots = slots
        self._handles = handles
        self._seed = seed
        self._scribe = scribe
        self._functions: dict[str, Function] = {}
        self._requested: Counter[str] = Counter()
        self._at_work: dict[str, Attempt] = {}

    def prepare(self, algorithm: Algorithm) -> None:
        """Import an algorithm's function and look for its handles and slots.

        Raises:
            CallError: if something is missing.
        """
        missing = [name for name in algorithm.handles if name not in self._handles]
        if missing:
            raise CallError(f"perception {algorithm.name!r} reads {missing[0]!r}: give start() its handle")
        unknown = [name for name in algorithm.slots if name not in self._slots.resources]
        if unknown:
            raise CallError(f"perception {algorithm.name!r} needs a slot of {unknown[0]!r}, which is no resource")
        self._functions[algorithm.name] = self._find(algorithm)

    def at_work(self, algorithm: Algorithm) -> Attempt | None:
        """Return the attempt whose function has not come to its end yet, even if nobody waits for it any more.

        An algorithm is not run twice at a time.
        """
        return self._at_work.get(algorithm.name)

    def request(
        self,
        algorithm: Algorithm,
        priority: float,
        arguments: Callable[[], Mapping[str, Value | None] | None],
        changed: Callable[[], None],
    ) -> Attempt:
        """Ask for a job; it starts, in an event of its own, as soon as it has its slots.

        Args:
            algorithm: whose job it is; none of its jobs may be at work.
            priority: the larger goes first.
            arguments: asked when the job is about to begin: the values of the context-variables that it is given, or
                None when it must not begin.
            changed: called when the attempt has ended, when its function has, and when that takes too long.
        """
        attempt = Attempt(algorithm, self._requested[algorithm.name], arguments, changed)
        self._requested[algorithm.name] += 1
        attempt.ticket = self._slots.request(algorithm.slots, priority, lambda: self._begin(attempt))
        return attempt

    def cancel(self, attempt: Attempt) -> None:
        """Wait for an attempt no longer."""
        if attempt.state is not State.ENDED:
            self._tell(attempt, "cancelled")
            self._abandon(attempt)

    def void(self, attempt: Attempt, condition: str) -> None:
        """Drop what an attempt brought, or would bring: a condition did not hold while its evidence was taken."""
        self._tell(attempt, "voided", condition=condition)
        self._abandon(attempt)

    def _begin(self, attempt: Attempt) -> None:
        arguments = attempt.arguments()
        if arguments is None:
            self._end(attempt)
            attempt.changed()
            return
        algorithm = attempt.algorithm
        attempt.state, attempt.start_s = State.RUNNING, self._clock.now_s()
        seed = f"{self._seed}/{algorithm.name}/{attempt.index}"
        attempt.noted = lambda told_s, interval: self._note(attempt, told_s, interval)
        self._at_work[algorithm.name] = attempt
        self._tell(attempt, "started")
        try:
            attempt.work = self._clock.start(
                lambda work: self._run(attempt, _Job(work, seed, attempt.index), arguments),
                lambda outcome: self._deliver(attempt, outcome),
            )
        except RuntimeError as error:  # no thread could be started
            self._scribe.tell_input(algorithm.name, "unstarted", index=attempt.index, message=str(error))
            self._conclude_delivered(attempt, Failure(Reason.FAILED, described(error)))
            return
        timeout_s = attempt.start_s + algorithm.timeout_s
        attempt.timeout = self._clock.call_at(timeout_s, lambda: self._time_out(attempt))

    def _run(self, attempt: Attempt, job: _Job, arguments: Mapping[str, Value | None]) -> Result | Failure:
        attempt.job = job
        algorithm = attempt.algorithm
        handles = {name: self._handles[name] for name in algorithm.handles}
        try:
            returned = self._functions[algorithm.name](**algorithm.parameters, **handles, **arguments, job=job)
            return checked(algorithm, returned)
        except Cancelled:
            return Failure(Reason.FAILED, "it ended because it was cancelled")
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
        attempt.changed()

    def _conclude(self, attempt: Attempt, outcome: Result | Failure) -> None:
        attempt.outcome = outcome
        if isinstance(outcome, Failure):
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
        if attempt.ticket is not None:
            self._slots.release(attempt.ticket)

    def _tell(self, attempt: Attempt, what: str, **details: object) -> None:
        self._scribe.tell(Kind.JOB, attempt.algorithm.name, what, index=attempt.index, **details)


def imported(algorithm: Algorithm) -> Function:
    """Return the function that an algorithm's `call` names.

    Raises:
        CallError: if there is none.
    """
    module, _, path = algorithm.call.partition(":")
    try:
        found: Any = importlib.import_module(module)
        for name in path.split("."):
            found = getattr(found, name)
    except Exception as error:
        raise CallError(f"perception {algorithm.name!r} calls {algorithm.call!r}: {described(error)}") from error
    if not callable(found):
        raise CallError(f"perception {algorithm.name!r} calls {algorithm.call!r}, which is no function")
    function: Function = found
    return function


def described(error: BaseException) -> str:
    """Return an error as a short text that can be written down, whatever the error is."""
    try:
        message = str(error)
    except Exception:  # noqa: BLE001 - even that may fail
        message = "its message cannot be shown"
    shown = message if len(message) <= MAX_MESSAGE else f"{message[:MAX_MESSAGE]}..."
    return f"{type(error).__name__}: {shown}".encode(errors="replace").decode()


def checked(algorithm: Algorithm, returned: object) -> Result | Failure:
    """Return what a perception function returned, if it is what the spec's `returns` says."""
    if not isinstance(returned, Mapping):
        return Failure(Reason.FAILED, f"returned a {type(returned).__name__}, not a mapping")
    surplus = next((name for name in returned if name not in algorithm.returns), None)
    if surplus is not None:
        shown = repr(surplus[:MAX_MESSAGE]) if isinstance(surplus, str) else f"a {type(surplus).__name__}"
        return Failure(Reason.FAILED, f"returned {shown}, which `returns` does not name")
    values: dict[str, Value | None] = {}
    for name, expected in algorithm.returns.items():
        given = returned.get(name)
        if given is None and not expected.optional:
            return Failure(Reason.FAILED, f"returned no {name!r}")
        try:
            values[name] = None if given is None else expected.convert(given)
        except NotOfTypeError as error:
            return Failure(Reason.FAILED, f"returned {name!r}: {error}")
    return Result(values)


def _nothing(*_: object) -> None:
    pass
