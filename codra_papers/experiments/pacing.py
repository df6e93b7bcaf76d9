"""The pace of simulated time: as fast as possible, or as fast as real time."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

from codra_dsl.runtime.clock import Clock

BEAT_S = 0.1
"""The interval at which simulated time is compared with real time."""

LATE_S = 1.0
"""A simulation that is later than this does not catch up; it continues from the present instant."""


class Pace(StrEnum):
    """The pace of simulated time."""

    FAST = "fast"
    REAL = "real"


class Beat:
    """A repeated event that lets simulated time wait for real time."""

    def __init__(self, clock: Clock, real: Clock | None, act: Callable[[], None]) -> None:
        """Schedule the first event.

        Args:
            clock: the clock of simulated time.
            real: the clock of real time to wait for; None to run as fast as possible.
            act: called in each event.
        """
        self._clock = clock
        self._real = real
        self._act = act
        self._ahead_s = 0.0 if real is None else clock.now_s() - real.now_s()
        clock.call_at(clock.now_s() + BEAT_S, self._beat)

    def _beat(self) -> None:
        if self._real is not None:
            early_s = self._clock.now_s() - self._real.now_s() - self._ahead_s
            if early_s > 0:
                self._real.sleep(early_s)
            elif early_s < -LATE_S:
                self._ahead_s += early_s
        self._act()
        self._clock.call_at(self._clock.now_s() + BEAT_S, self._beat)
