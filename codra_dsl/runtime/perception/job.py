"""What a perception function gets as `job`, and what it tells about its evidence."""

from __future__ import annotations

import random
import threading
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from codra_dsl.runtime.clock import Work


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


class RunningJob:
    """The `job` of one call, in the thread of its perception function, or of the process that does it.

    Attributes:
        chance: the seed of `random`.
    """

    def __init__(self, work: Work, chance: str, index: int) -> None:
        self.chance = chance
        self.index = index
        self._work = work
        self._told: list[tuple[float, Interval]] = []
        self._telling = threading.Lock()

    @cached_property
    def random(self) -> random.Random:
        """Return chance that depends on the seed, the algorithm and the number of its job only."""
        return random.Random(self.chance)

    @property
    def cancelled(self) -> bool:
        """Return whether nobody waits for the result any more."""
        return self._work.cancelled

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return self._work.now_s()

    def sleep(self, duration_s: float) -> None:
        """Spend time."""
        self._work.sleep(duration_s)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Say when the evidence was taken."""
        with self._telling:  # who asks `told_by` at an instant gets the same answer later
            now_s = self.now_s()
            if not start_s <= stamp_s <= now_s:
                raise ValueError(f"evidence is taken from a start to a stamp, both past: not {start_s} to {stamp_s}")
            self._told.append((now_s, Interval(float(start_s), float(stamp_s))))

    def told_by(self, now_s: float) -> tuple[float, Interval] | None:
        """Return the last that was told about the evidence up to an instant, and when."""
        with self._telling:
            for told in reversed(self._told):
                if told[0] <= now_s:
                    return told
        return None
