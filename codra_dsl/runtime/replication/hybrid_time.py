"""Hybrid logical clocks: instants of real time that also respect which write was known when another was made."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

MAX_DRIFT_S = 10.0
"""A replica accepts a commit only if the commit's time is at most this far ahead of the replica's own clock."""


class HybridTime(NamedTuple):
    """An instant of a hybrid logical clock. Each write has a later instant than all writes that its writer knew.

    Attributes:
        physical_s: the latest physical time that the writer had read or received.
        counter: orders the instants with the same physical time.
    """

    physical_s: float
    counter: int


BEFORE_ALL = HybridTime(-math.inf, 0)
"""An instant before all writes."""


class Stamp(NamedTuple):
    """The identity of one write, and its place in the order of all writes.

    Attributes:
        physical_s: as in `HybridTime`.
        counter: as in `HybridTime`.
        author: the agent that made the write; among equal instants, the order of authors decides.
        replica: the replica on which the agent made the write.
        position: the position of the write in its commit.
    """

    physical_s: float
    counter: int
    author: str
    replica: str
    position: int

    @property
    def time(self) -> HybridTime:
        """Return the instant of the write."""
        return HybridTime(self.physical_s, self.counter)


class HybridClock:
    """The hybrid logical clock of one replica.

    Attributes:
        latest: the latest instant that the clock has shown or received.
    """

    def __init__(self, now_s: Callable[[], float], latest: HybridTime) -> None:
        """Create a clock that shows only instants after `latest`; `now_s` reads the physical clock of the machine."""
        self._now_s = now_s
        self.latest = latest

    def tick(self) -> HybridTime:
        """Return an instant after all instants that the clock has shown or received."""
        physical_s = self._now_s()
        if physical_s > self.latest.physical_s:
            self.latest = HybridTime(physical_s, 0)
        else:
            self.latest = HybridTime(self.latest.physical_s, self.latest.counter + 1)
        return self.latest

    def admits(self, time: HybridTime) -> bool:
        """Return whether an instant of another replica is at most `MAX_DRIFT_S` ahead of the physical clock."""
        return time.physical_s <= self._now_s() + MAX_DRIFT_S

    def receive(self, time: HybridTime) -> None:
        """Show only later instants than an instant of another replica from now on."""
        self.latest = max(self.latest, time)
