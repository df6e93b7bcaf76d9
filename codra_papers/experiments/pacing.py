"""How simulated time passes beside real time."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

from codra_dsl.runtime.clock import Clock

BEAT_S = 0.1
"""So often simulated time is held against real time."""

LATE_S = 1.0
"""A simulation that is later than this does not catch up: it goes on from where it is."""


class Pace(StrEnum):
    """How time passes."""

    FAST = "fast"
    REAL = "real"


class Beat:
    """An event again and again, with which simulated time waits for real time."""

    def __init__(self, clock: Clock, real: Clock | None, act: Callable[[], None]) -> None:
        """Begin with an event soon.

        Args:
            clock: of simulated time.
            real: what it waits for; None if it waits for nothing.
            act: done in each event.
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
