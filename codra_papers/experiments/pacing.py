"""The pace of simulated time: as fast as possible, or as fast as real time."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

from codra_dsl.runtime.clock import Clock

BEAT_PERIOD_S = 0.1
"""The interval at which simulated time is compared with real time."""

MAX_DELAY_S = 1.0
"""A simulation that is further behind real time than this does not catch up; it continues from the present instant."""


class Pace(StrEnum):
    """The pace of simulated time."""

    FAST = "fast"
    REAL = "real"


class Beat:
    """A repeated event that lets simulated time wait for real time."""

    def __init__(self, clock: Clock, real_clock: Clock | None, act: Callable[[], None]) -> None:
        """Schedule the first event.

        Args:
            clock: the clock of simulated time.
            real_clock: the clock of real time to wait for; None to run as fast as possible.
            act: a function that is called in each event.
        """
        self._clock = clock
        self._real_clock = real_clock
        self._act = act
        self._clock_difference_s = 0.0 if real_clock is None else clock.now_s() - real_clock.now_s()
        clock.call_at(clock.now_s() + BEAT_PERIOD_S, self._beat)

    def _beat(self) -> None:
        if self._real_clock is not None:
            lead_s = self._clock.now_s() - self._real_clock.now_s() - self._clock_difference_s
            if lead_s > 0:
                self._real_clock.sleep(lead_s)
            elif lead_s < -MAX_DELAY_S:
                self._clock_difference_s += lead_s
        self._act()
        self._clock.call_at(self._clock.now_s() + BEAT_PERIOD_S, self._beat)
