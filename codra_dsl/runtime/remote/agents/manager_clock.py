"""The clock of the manager, as another program sees it."""

from __future__ import annotations

from collections.abc import Callable

from codra_dsl.runtime.clock import Clock, Outcome, Timer, WallClock, Work
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.remote.clock_offset import MAX_DRIFT, ClockOffset


class ManagerClock(Clock):
    """The manager's time, at most as late as it really is. Events and callbacks run on a clock of this program.

    Evidence that a program takes now is therefore never in the future of the manager. The clock is behind by the time
    that a message takes, and does not go back.
    """

    def __init__(self, own_clock: Clock | None = None) -> None:
        """Begin without a comparison; `compare` must be called first.

        Args:
            own_clock: the clock of this program, in real time; by default a new one.
        """
        self._own_clock = WallClock() if own_clock is None else own_clock
        self._is_own_clock_new = own_clock is None
        self._offset = ClockOffset()
        self._lock = new_lock()
        self._base = (0.0, 0.0)
        self.last_answer_asked_s = self._own_clock.now_s()

    def compare(self, ask_now_s: Callable[[], float]) -> None:
        """Ask the manager for its time, and set this clock by the answer."""
        asked_s = self._own_clock.now_s()
        manager_s = ask_now_s()
        answered_s = self._own_clock.now_s()
        with self._lock:
            self._offset.add(asked_s, manager_s, answered_s)
            estimate = self._offset.manager_time(answered_s)
            self._base = answered_s, max(self.now_s(), estimate.instant_s - estimate.uncertainty_s)
            self.last_answer_asked_s = asked_s

    def silence_s(self) -> float:
        """Return the time since the program sent the last question to which it has the answer."""
        return self._own_clock.now_s() - self.last_answer_asked_s

    def advance(self, manager_s: float) -> None:
        """Note that the manager's clock has reached an instant."""
        with self._lock:
            if manager_s > self.now_s():
                self._base = self._own_clock.now_s(), manager_s

    def close(self) -> None:
        """Let waiting calls return; a new clock of this program runs no more events."""
        if self._is_own_clock_new and isinstance(self._own_clock, WallClock):
            self._own_clock.close()
        self._own_clock.notify()

    def now_s(self) -> float:
        """Return the present instant of the manager; the lock is not needed."""
        own_s, manager_s = self._base
        return manager_s + (self._own_clock.now_s() - own_s) * (1.0 - MAX_DRIFT)

    def sleep(self, duration_s: float) -> None:
        """Let real time pass."""
        self._own_clock.sleep(duration_s)

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event in the dispatcher thread of this program."""
        own_s, manager_s = self._base
        return self._own_clock.call_at(own_s + (instant_s - manager_s) / (1.0 - MAX_DRIFT), callback)

    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `is_ready()` is true, the timeout is over, or the clock is closed."""
        return self._own_clock.wait_until(is_ready, timeout_s)

    def notify(self) -> None:
        """Wake all waiting threads."""
        self._own_clock.notify()

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Run the work in a daemon thread of this program."""
        return self._own_clock.start(run, deliver)
