"""A clock that ends a main execution at a given instant, even in the middle of a sleep or wait."""

from __future__ import annotations

import math
from collections.abc import Callable

from codra_dsl.runtime.clock import Clock, Outcome, Timer, Work


class TimeIsUp(Exception):  # noqa: N818 - it is the planned end of a run
    """The planned duration of the run is over."""


class LimitedClock(Clock):
    """A clock that ends every sleep and wait at a given instant; events and work continue as on the original clock.

    Attributes:
        end_s: the instant from which every sleep or wait raises `TimeIsUp`; infinity for never.
    """

    def __init__(
        self,
        clock: Clock,
        end_s: float,
        report_instant: Callable[[float], None],
        between_events: Callable[[], None] = lambda: None,
    ) -> None:
        """Limit a clock.

        Args:
            clock: the original clock.
            end_s: the instant from which every sleep or wait raises `TimeIsUp`; infinity for never.
            report_instant: a function that is called with the present instant after each sleep.
            between_events: in simulated time, a function that is called before the first event of each sleep or wait
                and after each event. An exception that it raises ends the sleep or wait.
        """
        self._clock = clock
        self.end_s = end_s
        self._report_instant = report_instant
        self._between_events = between_events

    def now_s(self) -> float:
        """Return the present instant."""
        return self._clock.now_s()

    def sleep(self, duration_s: float) -> None:
        """Let this duration pass, or the time that is left if it is shorter.

        Raises:
            TimeIsUp: if the end was reached.
        """
        left_s = self._left_s()
        self._clock.wait_until(self._checked(lambda: False), min(duration_s, left_s))
        self._report_instant(self.now_s())
        if duration_s >= left_s:
            raise TimeIsUp

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event."""
        return self._clock.call_at(instant_s, callback)

    def wait_until(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until `ready()` is true, and return True. Return False if `timeout_s` passes first.

        Raises:
            TimeIsUp: if the end was reached first.
        """
        left_s = self._left_s()
        if self._clock.wait_until(self._checked(ready), min(timeout_s, left_s)):
            return True
        if left_s <= timeout_s and left_s < math.inf:
            raise TimeIsUp
        return False

    def notify(self) -> None:
        """Wake all `wait_until` calls, so that they check their conditions again."""
        self._clock.notify()

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Start a piece of work."""
        return self._clock.start(run, deliver)

    def _checked(self, ready: Callable[[], bool]) -> Callable[[], bool]:
        def check_and_ask() -> bool:
            self._between_events()
            return ready()

        return check_and_ask

    def _left_s(self) -> float:
        return max(self.end_s - self.now_s(), 0.0)
