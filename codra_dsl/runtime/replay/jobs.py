"""Jobs and time in a replay: both follow the journal. No perception function is called, and nothing waits.

Up to the first difference, a job of the replay is the recorded job with the same number. Afterwards, jobs of the replay
need not begin when the jobs of the run began. A job that begins at the instant of a recorded job has the result of this
job. Any other job is shifted: it waits for the first recorded job of the same algorithm whose evidence begins after the
job has begun, and has its result and its evidence. If no recorded job comes within the period of the observer, or if
the run no longer needed its result, the result is not known.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S, Clock, Outcome, Timer, TimerQueue, Work
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.perception import Failure, Function, Interval, Result
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.replay.undetermined import NOT_RECORDED, Undetermined
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

JobKey = tuple[str, int]
"""An algorithm, and the number of one of its jobs."""


class DivergedError(Exception):
    """The replay cannot follow the journal any further.

    If the package does not have a variable or skill that the run used, the message names it.
    """


class _Look(Work):
    """A replayed job, whose function is not called; its time follows the recorded evidence reports.

    Attributes:
        start_s: when the job began.
        deliver: ends the job with an outcome.
        index: the number of the recorded job whose outcome this job has; None if it is not known which one this is.
        is_assumed: whether the job rests on an assumption: it is shifted, or it has other arguments than in the run.
        is_over: whether the job has ended.
    """

    algorithm: Algorithm
    job: RunningJob | None = None

    def __init__(self, start_s: float, deliver: Callable[[Any], None], on_cancel: Callable[[_Look], None]) -> None:
        super().__init__()
        self.start_s = start_s
        self.deliver = deliver
        self.index: int | None = None
        self.is_assumed = False
        self.is_over = False
        self._on_cancel = on_cancel
        self._reported_s = 0.0

    def report(self, report_s: float, interval: Interval) -> None:
        """Repeat a report about the evidence."""
        assert self.job is not None
        self._reported_s = report_s
        self.job.report(replace(interval, stamp_s=report_s) if interval.stamp_s is None else interval)

    def cancel(self) -> None:
        super().cancel()
        self._on_cancel(self)

    def now_s(self) -> float:
        return self._reported_s

    def sleep(self, duration_s: float) -> None:
        raise AssertionError(f"a replay calls no function that could sleep {duration_s} s")


class ReplayedJobs:
    """The jobs of a journal: their reports about evidence, and their results.

    Each event about a job is added when it is read from the journal, and dropped when it is used.

    Attributes:
        repeat_calls: a function that repeats the calls that a job's function made on the context manager; its
            argument is the number of the job among all jobs.
        undetermined: learns which jobs rest on an assumption, and which results the run does not have.
    """

    def __init__(self, is_equal: Callable[[], bool]) -> None:
        """Begin without jobs; `is_equal` returns whether all events so far are equal to those of the journal."""
        self.repeat_calls: Callable[[int], None] = lambda _: None
        self.undetermined: Undetermined | None = None
        self._is_equal = is_equal
        self._clock: Clock | None = None
        self._work_count = 0
        self._divergence: DivergedError | None = None
        self._starting_look: _Look | None = None
        self._looks: dict[str, _Look] = {}  # the last look of each algorithm; evidence may be used after its end
        self._reports: dict[JobKey, list[tuple[float, Interval]]] = {}
        self._end_events: dict[JobKey, Event] = {}
        self._start_errors: dict[JobKey, str] = {}
        self._recorded_starts_s: dict[str, dict[int, float]] = defaultdict(dict)

    def go_on(self, clock: Clock) -> None:
        """Assign recorded jobs by their starts from now on, after the first difference.

        The starts of the recorded jobs are known as far as the journal was read.
        """
        self._clock = clock
        for look in self._looks.values():
            if look.index is None and not look.is_over:
                self._assign(look, clock)

    def check(self) -> None:
        """Raise the error of the repeated calls of a job, if there is one."""
        error, self._divergence = self._divergence, None
        if error is not None:
            raise error

    def add_event(self, event: Event) -> None:
        """Add an event about a job: its start, a report about its evidence, the error of its start, or its end."""
        key = (event.name, int(event.details["index"]))
        match event.kind, event.what:
            case Kind.INPUT, "evidence":
                start_s, stamp_s = event.details["evidence_s"]
                host_s = tuple(event.details["host_s"]) if "host_s" in event.details else None
                interval = Interval(start_s, stamp_s, event.details.get("earliest_s"), host_s)
                self._add_report(key, event.details["told_s"], interval)
            case Kind.INPUT, "unstarted":
                self._start_errors[key] = event.details["message"]
            case Kind.JOB, "returned" | "failed":
                self._end_events.setdefault(key, event)
            case Kind.JOB, "started":
                self._recorded_starts_s[event.name][key[1]] = event.instant_s
            case _:
                pass

    def _add_report(self, key: JobKey, report_s: float, interval: Interval) -> None:
        """Repeat a report in its job; if the job has not begun, keep the report."""
        look = self._looks.get(key[0])
        if look is not None and look.index == key[1]:
            look.report(report_s, interval)
        else:
            self._reports.setdefault(key, []).append((report_s, interval))

    def find(self, algorithm: Algorithm) -> Function:
        """Return a replacement for an algorithm's function, which repeats the recorded calls."""

        def play(*, job: RunningJob, **_: object) -> Mapping[str, Value]:
            assert self._starting_look is not None
            self._starting_look.algorithm, self._starting_look.job = algorithm, job
            if self._clock is None:
                self._repeat_calls_of_job()
            return {}

        return play

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None], now_s: float) -> Work:
        """Begin a job; it ends when its recorded end is replayed."""
        self._work_count += 1
        look = self._starting_look = _Look(now_s, deliver, self._cancel)
        run(look)
        if look.job is None:
            raise DivergedError
        key = (look.algorithm.name, look.job.index)
        if self._clock is None and key in self._start_errors:
            raise RuntimeError(self._start_errors.pop(key))
        self._looks[look.algorithm.name] = look
        if self._clock is not None:
            self._assign(look, self._clock)
        elif self._is_equal():
            self._repeat(look, look.job.index)
        return look

    def began_before(self, key: JobKey, instant_s: float) -> bool:
        """Return whether the job that repeats a recorded job began before an instant."""
        look = self._looks.get(key[0])
        return look is not None and look.index == key[1] and look.start_s < instant_s

    def deliver(self, key: JobKey, now_s: float) -> None:
        """End a job with the result of a recorded job, which has ended now."""
        name, index = key
        look = self._looks.get(name)
        look = None if look is None or look.is_over else look
        if self._clock is None and (look is None or look.index != index):
            raise DivergedError(f"{name!r} has no job {index} that could end")
        end_event = self._end_events.pop(key, None)
        recorded_start_s = self._recorded_starts_s[name].pop(index, -math.inf)
        self._reports.pop(key, None)
        if look is not None and look.index == index:
            self._end_with(look, end_event)
        elif look is not None and look.index is None and end_event is not None:
            # the evidence of a failed job is not recorded: its entire duration counts
            start_s, stamp_s = map(float, end_event.details.get("evidence_s") or (recorded_start_s, now_s))
            interval = Interval(start_s, stamp_s)
            if interval.start_s >= look.start_s - PUNCTUALITY_TOLERANCE_S:
                look.report(now_s, interval)
                self._end_with(look, end_event)

    def _repeat_calls_of_job(self) -> None:
        """Repeat the calls of the present job.

        If these calls diverge, keep the error for `check` to raise, because an error in a job does not reach the caller
        of the job.
        """
        try:
            self.repeat_calls(self._work_count)
        except DivergedError as error:
            self._divergence = error

    def _repeat(self, look: _Look, index: int) -> None:
        """Let a job repeat a recorded job."""
        look.index = index
        for report in self._reports.pop((look.algorithm.name, index), ()):
            look.report(*report)

    def _assign(self, look: _Look, clock: Clock) -> None:
        """After the first difference: let a job repeat the recorded job that began at the same instant, if any."""
        undetermined, name = self.undetermined, look.algorithm.name
        assert undetermined is not None
        starts_s = self._recorded_starts_s[name]
        indices = (i for i, start_s in starts_s.items() if abs(start_s - look.start_s) <= PUNCTUALITY_TOLERANCE_S)
        index = next(indices, None)
        look.is_assumed = index is None or bool(look.algorithm.given)
        if look.is_assumed:
            undetermined.begin_assumed_look(name)
        if index is None:
            missing_s = clock.now_s() + undetermined.periods_s.get(name, 0.0)
            clock.call_at(missing_s, lambda: None if look.is_over else undetermined.miss_look(name))
        else:
            del starts_s[index]
            self._repeat(look, index)

    def _cancel(self, look: _Look) -> None:
        """After the first difference: end a job that was cancelled, or has timed out."""
        if self._clock is not None:
            failure = Failure(Reason.FAILED, "it ended because it was cancelled")
            self._clock.call_at(self._clock.now_s(), lambda: self._end(look, failure, is_known=look.index is not None))

    def _end_with(self, look: _Look, end_event: Event | None) -> None:
        """End a job as a recorded job ended; None if the run no longer needed the result.

        If the recorded job timed out, its result is not recorded either.
        """
        if end_event is None or end_event.details.get("reason") == Reason.TIMED_OUT:
            self._end(look, Failure(Reason.FAILED, NOT_RECORDED), is_known=look.cancelled)
            return
        details: Mapping[str, Any] = end_event.details
        if end_event.what == "failed":
            outcome: Result | Failure = Failure(Reason(details["reason"]), str(details.get("message", "")))
        else:
            values = details.get("values", {})
            outcome = Result({name: values.get(name) for name in look.algorithm.returns})
        self._end(look, outcome, is_known=True)

    def _end(self, look: _Look, outcome: Result | Failure, *, is_known: bool) -> None:
        if look.is_over:
            return
        look.is_over = True
        if self.undetermined is not None:
            self.undetermined.end_look(look.algorithm.name, is_known=is_known, is_assumed=look.is_assumed)
        look.deliver(outcome)


class ReplayedClock(Clock):
    """A clock whose time follows a journal. Only the context manager of a replay uses it."""

    def __init__(self, start_s: float, jobs: ReplayedJobs) -> None:
        self._now_s = start_s
        self._jobs = jobs
        self._events = TimerQueue()
        self._event_count = 0
        self._event_count_before_now = 0
        self.step_count = 0

    def now_s(self) -> float:
        """Return the present instant."""
        return self._now_s

    def advance(self, instant_s: float) -> None:
        """Move to an instant, unless the clock shows a later one."""
        if instant_s > self._now_s:
            self._now_s, self._event_count_before_now = instant_s, self._event_count

    def next_event_s(self) -> float:
        """Return when the next event is due; infinity if there is none."""
        return self._events.next_s()

    def is_next_event_before(self, instant_s: float) -> bool:
        """Return whether the next event is due up to an instant, and was scheduled before this instant."""
        is_now = instant_s <= self._now_s
        return self._events.is_next_before(instant_s, self._event_count_before_now if is_now else self._event_count)

    def step(self) -> None:
        """Execute the next event."""
        timer = self._events.pop_due(math.inf)
        if timer is None:
            raise DivergedError
        self.advance(timer.instant_s)
        self.step_count += 1
        timer.fire()
        self._jobs.check()

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event."""
        timer = Timer(instant_s, callback)
        self._events.add(timer, self._event_count)
        self._event_count += 1
        return timer

    def notify(self) -> None:
        """Do nothing, since a replay has no waiting threads."""

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Begin a job; it ends when its recorded end is replayed."""
        return self._jobs.start(run, deliver, self._now_s)

    def sleep(self, duration_s: float) -> None:
        """Fail: a replay never sleeps."""
        raise AssertionError(f"a replay cannot sleep {duration_s} s")

    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        """Fail: a replay never waits."""
        raise AssertionError(f"a replay cannot wait {timeout_s} s for {is_ready}")
