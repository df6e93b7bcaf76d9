"""The `job` argument of a perception function, and its reports about evidence."""

from __future__ import annotations

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
        """Return the number of the job among those of its algorithm, as in the event log."""
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
        """Sleep; raise `Cancelled` once the job has been cancelled."""
        ...

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken; a condition that fails afterwards does not invalidate the evidence."""
        ...


@dataclass(frozen=True, slots=True)
class Interval:
    """The time in which evidence is taken, from start to stamp; the stamp is None while it is still being taken."""

    start_s: float
    stamp_s: float | None = None


class RunningJob:
    """The `job` of one call, in the thread of the perception function or, for a process, in the thread that serves it.

    Attributes:
        chance: the seed of `random`.
    """

    def __init__(self, work: Work, chance: str, index: int) -> None:
        self.chance = chance
        self.index = index
        self._work = work
        self._reports: list[tuple[float, Interval]] = []
        self._lock = threading.Lock()

    @cached_property
    def random(self) -> random.Random:
        """Return a random generator that depends only on the seed, the algorithm and the number of the job."""
        return random.Random(self.chance)

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been cancelled."""
        return self._work.cancelled

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return self._work.now_s()

    def sleep(self, duration_s: float) -> None:
        """Sleep."""
        self._work.sleep(duration_s)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken."""
        with self._lock:  # `reported_by` returns the same answer for an instant at any later time
            now_s = self.now_s()
            if not start_s <= stamp_s <= now_s:
                raise ValueError(f"evidence has a start, then a stamp, both in the past: not {start_s} to {stamp_s}")
            self._reports.append((now_s, Interval(float(start_s), float(stamp_s))))

    def reported_by(self, now_s: float) -> tuple[float, Interval] | None:
        """Return the last report about the evidence up to an instant, with the instant of the report."""
        with self._lock:
            for report in reversed(self._reports):
                if report[0] <= now_s:
                    return report
        return None
