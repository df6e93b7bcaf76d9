"""A simulated clock that is wrong: it differs from another one by an offset, and drifts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from codra_dsl.runtime.clock import Clock, Outcome, SimClock, Timer, Work


class _SkewedWork(Work):
    def __init__(self, work: Work, clock: SkewedClock) -> None:
        super().__init__()
        self._work = work
        self._clock = clock

    @property
    def cancelled(self) -> bool:
        return self._work.cancelled

    def now_s(self) -> float:
        return self._clock.shown_s(self._work.now_s())

    def sleep(self, duration_s: float) -> None:
        self._work.sleep(duration_s / (1.0 + self._clock.drift))


@dataclass
class SkewedClock(Clock):
    """Shows `offset_s` more than the true clock, and `drift` seconds more for each second."""

    true_clock: SimClock
    offset_s: float
    drift: float

    def shown_s(self, true_s: float) -> float:
        return self.offset_s + true_s * (1.0 + self.drift)

    def now_s(self) -> float:
        return self.shown_s(self.true_clock.now_s())

    def sleep(self, duration_s: float) -> None:
        self.true_clock.sleep(duration_s / (1.0 + self.drift))

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        return self.true_clock.call_at((instant_s - self.offset_s) / (1.0 + self.drift), callback)

    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        return self.true_clock.wait_until(is_ready, timeout_s / (1.0 + self.drift))

    def notify(self) -> None:
        self.true_clock.notify()

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        return self.true_clock.start(lambda work: run(_SkewedWork(work, self)), deliver)
