"""The `job` argument of a perception function, and its reports about evidence."""

from __future__ import annotations

import math
import random
import threading
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from codra_dsl.runtime.clock import Work


class Job(Protocol):
    """The `job` argument of a perception function."""

    @property
    def index(self) -> int:
        """Return the number of the job among the jobs of its algorithm, as in the event log."""
        ...

    @property
    def random(self) -> random.Random:
        """Return a random generator that depends only on the seed, the algorithm and the number of the job."""
        ...

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been cancelled."""
        ...

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Let time pass; raise `Cancelled` once the job's result is no longer needed."""
        ...

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken. A condition that fails after that time does not void the evidence."""
        ...


@dataclass(frozen=True, slots=True)
class Interval:
    """The time in which evidence is taken.

    The clock of a host is known only up to an uncertainty, so the interval of its evidence is widened on both sides.

    Attributes:
        start_s: the earliest instant at which the taking can have begun.
        stamp_s: the latest instant at which it can have ended; None while the evidence is being taken.
        earliest_stamp_s: the earliest instant at which it can have ended, if this is another instant.
        host_s: the start and the stamp on the clock of the host, if a host took the evidence.
    """

    start_s: float
    stamp_s: float | None = None
    earliest_stamp_s: float | None = None
    host_s: tuple[float, float] | None = None

    @property
    def evidence_s(self) -> float | None:
        """Return the instant from which the age of the evidence counts; None while the evidence is being taken."""
        return self.stamp_s if self.earliest_stamp_s is None else self.earliest_stamp_s


class RunningJob:
    """The `job` argument of one call.

    It is used in the thread of the perception function or, if a process runs the function, in the thread that serves
    this process.

    Attributes:
        random_seed: the seed of `random`.
    """

    def __init__(self, work: Work, random_seed: str, index: int, lock: threading.RLock) -> None:
        """Create the argument of one call; jobs may share the lock, which is held only for an instant."""
        self.random_seed = random_seed
        self.index = index
        self._work = work
        self._reports: list[tuple[float, Interval]] = []
        self._lock = lock

    @cached_property
    def random(self) -> random.Random:
        """Return a random generator that depends only on the seed, the algorithm and the number of the job."""
        return random.Random(self.random_seed)

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been cancelled."""
        return self._work.cancelled

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return self._work.now_s()

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""
        self._work.sleep(duration_s)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken."""
        self.report(Interval(float(start_s), float(stamp_s)))

    def report(self, interval: Interval) -> None:
        """Report when the evidence was taken, perhaps by a clock with an uncertainty."""
        start_s, stamp_s = interval.start_s, interval.stamp_s
        with self._lock:  # so `last_report_until` always returns the same report for an instant
            now_s = self.now_s()
            if stamp_s is None or not -math.inf < start_s <= stamp_s <= now_s:
                raise ValueError(f"evidence has a start, then a stamp, both in the past: not {start_s} to {stamp_s}")
            self._reports.append((now_s, interval))

    def last_report_until(self, now_s: float) -> tuple[float, Interval] | None:
        """Return the instant and the interval of the last report about the evidence up to `now_s`; None if none."""
        with self._lock:
            for report in reversed(self._reports):
                if report[0] <= now_s:
                    return report
        return None
