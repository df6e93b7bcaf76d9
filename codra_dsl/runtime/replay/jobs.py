"""Jobs and time in a replay: both follow the journal. No perception function is called, and nothing waits."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock, Outcome, Timer, TimerQueue, Work
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.perception import Failure, Function, Interval, Job, Result
from codra_dsl.runtime.replay.looks import Looks, OpenLook, recorded_look
from codra_dsl.runtime.replay.undetermined import NOT_RECORDED
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

JobKey = tuple[str, int]
"""An algorithm, and the number of one of its jobs."""


class DivergedError(Exception):
    """The replay cannot follow the journal any further.

    If the package does not have a variable or skill that the run used, the message names it.
    """


class _ReplayedWork(Work):
    """The time within a replayed job. The job's function is not called; time follows the recorded evidence reports."""

    def __init__(self) -> None:
        super().__init__()
        self.instant_s = 0.0
        self.on_cancel: Callable[[], None] = lambda: None

    def cancel(self) -> None:
        super().cancel()
        self.on_cancel()

    def now_s(self) -> float:
        return self.instant_s

    def sleep(self, duration_s: float) -> None:
        raise AssertionError(f"a replay calls no function that could sleep {duration_s} s")


class ReplayedJobs:
    """The jobs of a journal: their reports about evidence, and their results.

    Each event about a job is added when it is read from the journal, and dropped when it is used.

    Attributes:
        repeat_calls: a function that repeats the calls that a job's function made on the context manager; its
            argument is the number of the job among all jobs.
        looks: after the first difference, assigns the outcomes of recorded jobs to the jobs of the replay.
    """

    def __init__(self, is_equal: Callable[[], bool]) -> None:
        """Begin without jobs; `is_equal` returns whether all events so far are equal to those of the journal."""
        self.repeat_calls: Callable[[int], None] = lambda _: None
        self.looks: Looks | None = None
        self._is_equal = is_equal
        self._work_count = 0
        self._divergence: DivergedError | None = None
        self._reports: dict[JobKey, list[tuple[float, Interval]]] = {}
        self._end_events: dict[JobKey, Event] = {}
        self._start_errors: dict[JobKey, str] = {}
        self._deliveries: dict[JobKey, Callable[[Any], None]] = {}
        self._result_names: dict[str, Sequence[str]] = {}
        self._starting_job: tuple[_ReplayedWork, JobKey | None] = (_ReplayedWork(), None)
        self._last_jobs: dict[str, tuple[_ReplayedWork, Job]] = {}
        self._start_instants_s: dict[JobKey, float] = {}

    def go_on(self, looks: Looks) -> None:
        """From now on, let `looks` end the jobs."""
        self.looks = looks

    def pair_open_jobs(self) -> None:
        """Assign recorded jobs to the open jobs, as soon as the recorded starts are known.

        A job whose start was equal is the recorded job with the same number.
        """
        for (algorithm, index), deliver in self._deliveries.items():
            start_s = self._start_instants_s.get((algorithm, index))
            self._begin_look(algorithm, deliver, start_s, index if start_s is None else None)
        self._deliveries.clear()

    def end_recorded_look(self, key: JobKey, now_s: float) -> None:
        """After the first difference: handle the end of a recorded job."""
        algorithm, index = key
        end_event = self._end_events.pop(key, None)
        self._reports.pop(key, None)
        if self.looks is not None:
            start_s, names = self.looks.recorded_start_s(algorithm, index), self._result_names.get(algorithm, ())
            self.looks.end_recorded(algorithm, recorded_look(index, start_s, end_event, names, now_s))

    def add_event(self, event: Event) -> None:
        """Add an event about a job: its start, a report about its evidence, the error of its start, or its end."""
        key = (event.name, int(event.details["index"]))
        match event.kind, event.what:
            case Kind.INPUT, "evidence":
                start_s, stamp_s = event.details["evidence_s"]
                self._add_report(key, event.details["told_s"], Interval(start_s, stamp_s))
            case Kind.INPUT, "unstarted":
                self._start_errors[key] = event.details["message"]
            case Kind.JOB, "returned" | "failed":
                self._end_events.setdefault(key, event)
            case Kind.JOB, "started" if self.looks is not None:
                self.looks.add_recorded_start(event)
            case _:
                pass

    def _add_report(self, key: JobKey, report_s: float, interval: Interval) -> None:
        """Add a report. It is used when the job has begun, and at the latest before the algorithm's next job begins."""
        algorithm, index = key
        if self.looks is not None:
            if self.looks.open_index(algorithm) == index:
                self.looks.report(algorithm, report_s, interval)
            else:
                self._reports.setdefault(key, []).append((report_s, interval))
            return
        work, job = self._last_jobs.get(algorithm, (None, None))
        if work is not None and job is not None and job.index == index:
            _report(work, job, report_s, interval)
        else:
            self._reports.setdefault(key, []).append((report_s, interval))

    def find(self, algorithm: Algorithm) -> Function:
        """Return a replacement for an algorithm's function, which repeats the recorded reports and calls."""
        self._result_names[algorithm.name] = tuple(algorithm.returns)

        def play(*, job: Job, **_: object) -> Mapping[str, Value]:
            work, _key = self._starting_job
            key = (algorithm.name, job.index)
            self._last_jobs[algorithm.name] = (work, job)
            self._starting_job = (work, key)
            if self.looks is None:
                for report in self._reports.pop(key, ()):
                    _report(work, job, *report)
                self._repeat_calls_of_job()
            return {}

        return play

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None], now_s: float) -> Work:
        """Begin a job; it ends when its recorded end is replayed."""
        work = _ReplayedWork()
        self._work_count += 1
        self._starting_job = (work, None)
        run(work)
        key = self._starting_job[1]
        if self.looks is not None and key is not None:
            self._begin_look(key[0], deliver, now_s, None)
            return work
        if self._divergence is not None:
            raise self._divergence
        if key is None:
            raise DivergedError
        if not self._is_equal():
            self._start_instants_s[key] = now_s
        if key in self._start_errors:
            raise RuntimeError(self._start_errors.pop(key))
        self._deliveries[key] = deliver
        return work

    def _begin_look(
        self, algorithm: str, deliver: Callable[[Any], None], start_s: float | None, index: int | None
    ) -> None:
        """Begin a look: a recorded one with a number, or one that began at an instant."""
        if self.looks is None:
            return
        work, job = self._last_jobs[algorithm]
        if start_s is not None:
            index = self.looks.recorded_index(algorithm, start_s)
        look = OpenLook(
            algorithm=algorithm,
            start_s=-math.inf if start_s is None else start_s,
            index=index,
            report=partial(_report, work, job),
            deliver=deliver,
        )
        work.on_cancel = partial(self.looks.cancel, algorithm)
        for report in () if index is None else self._reports.pop((algorithm, index), ()):
            look.report(*report)
        self.looks.begin(look)

    def _repeat_calls_of_job(self) -> None:
        """Repeat the calls of the present job.

        If these calls diverge, keep the error for `start` to raise, because an error in a job does not reach the caller
        of the job.
        """
        try:
            self.repeat_calls(self._work_count)
        except DivergedError as error:
            self._divergence = error

    def deliver(self, key: JobKey) -> None:
        """End a job with the result that it had in the recorded run."""
        deliver = self._deliveries.pop(key, None)
        if deliver is None:
            raise DivergedError
        deliver(self._outcome(key))

    def _outcome(self, key: JobKey) -> Result | Failure:
        event = self._end_events.pop(key, None)
        if event is None or event.what == "failed":
            # there is no event if the run no longer needed the result
            message = NOT_RECORDED if event is None else str(event.details.get("message", ""))
            return Failure(Reason.FAILED, message)
        values = event.details.get("values", {})
        return Result({name: values.get(name) for name in self._result_names[key[0]]})


def _report(work: _ReplayedWork, job: Job, report_s: float, interval: Interval) -> None:
    """Repeat the report of a job about its evidence."""
    work.instant_s = report_s
    job.evidence(interval.start_s, report_s if interval.stamp_s is None else interval.stamp_s)


class ReplayedClock(Clock):
    """A clock whose time follows a journal. Only the context manager of a replay uses it."""

    def __init__(self, start_s: float, jobs: ReplayedJobs) -> None:
        self._now_s = start_s
        self._jobs = jobs
        self._events = TimerQueue()
        self._event_count = 0
        self.step_count = 0

    def now_s(self) -> float:
        """Return the present instant."""
        return self._now_s

    def advance(self, instant_s: float) -> None:
        """Move to an instant, unless the clock shows a later one."""
        self._now_s = max(self._now_s, instant_s)

    def next_event_s(self) -> float:
        """Return when the next event is due; infinity if there is none."""
        return self._events.next_s()

    def step(self) -> None:
        """Execute the next event."""
        timer = self._events.pop_due(math.inf)
        if timer is None:
            raise DivergedError
        self.advance(timer.instant_s)
        self.step_count += 1
        timer.fire()

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
