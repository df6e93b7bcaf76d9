"""The clock of a context manager: its events run one after the other, in steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial
from operator import attrgetter
from typing import Any

from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S, Clock, Outcome, Timer, TimerQueue, Work


class LockedClock(Clock):
    """A clock whose events run while a lock is held; pieces of work run without this lock.

    Every change is made in a step. A step is an event, or the code in a `with clock:` statement, such as a command.
    Within a step the time does not change, so the effect of a step depends only on its instant and on earlier steps.
    Therefore a run in real time can be repeated from its journal as exactly as a run in simulated time.

    Attributes:
        step_count: how many events have happened.
        work_count: how many pieces of work have been started.
        on_late_event: called when an event happens more than `PUNCTUALITY_TOLERANCE_S` after its time.
    """

    def __init__(self, clock: Clock, lock: Any) -> None:
        self.step_count = 0
        self.work_count = 0
        self.on_late_event: Callable[[], None] = _no_op
        self._outer_clock = clock
        self._read_outer_now_s = clock.now_s
        self._lock = lock
        self._is_owned: Callable[[], bool] = lock._is_owned
        self._release: Callable[..., None] = lock.__exit__
        self._is_step = False  # whether the thread that has the lock is in a step
        self._timers = TimerQueue()
        self._event_count = 0
        self._step_instant_s = -math.inf
        self._running_work_number: int | None = None

    def __enter__(self) -> None:
        self._acquire(True)

    __exit__ = property(attrgetter("_release"))
    """The release of the lock itself: at the start of a Python method, a signal handler may raise."""

    def without_step(self) -> WithoutStep:
        """Return a context manager that holds the lock for code that only reads, and therefore is not a step."""
        return WithoutStep(self._acquire, self._release)

    def _acquire(self, is_step: bool) -> None:
        """Take the lock, and begin a step if `is_step` and the thread is not in a step.

        A signal handler may raise after the lock was taken. Then the `with` statement does not begin, and would not
        release the lock.
        """
        was_owned = self._is_owned()
        try:
            self._lock.acquire()
            if not was_owned:
                self._is_step = False
            if is_step and not self._is_step:
                now_s = self._read_outer_now_s()
                if now_s > self._step_instant_s:  # noqa: PLR1730 - every step runs this, and `max` takes longer
                    self._step_instant_s = now_s
                self._is_step = True
        except BaseException:
            if was_owned or self._is_owned():
                self._lock.release()
            raise

    def now_s(self) -> float:
        """Return the present instant; within a step, the instant at which the step began."""
        return self._step_instant_s if self._is_owned() and self._is_step else self._read_outer_now_s()

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""
        self._outer_clock.sleep(duration_s)

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event that runs while the lock is held; the caller must hold the lock."""
        due_s = max(instant_s, self.now_s())
        if instant_s == math.inf:
            return Timer(due_s, callback)
        timer = _LockedTimer(due_s, callback, self)
        self._timers.add(timer, self._event_count)
        self._event_count += 1
        timer.outer_timer = self._outer_clock.call_at(due_s, partial(self._run_next_event, due_s))
        return timer

    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until `is_ready()` is true; `is_ready` must not acquire the lock."""
        return self._outer_clock.wait_until(is_ready, timeout_s)

    def notify(self) -> None:
        """Wake every `wait_until`, because its condition may have changed."""
        self._outer_clock.notify()

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Start a piece of work whose outcome is delivered in a step."""
        self.work_count += 1
        work_number = self.work_count

        def run_as_numbered_work(work: Work) -> Outcome:
            if not self._is_owned():
                return run(work)  # in a separate thread
            outer_work_number, self._running_work_number = self._running_work_number, work_number
            try:
                return run(work)
            finally:
                self._running_work_number = outer_work_number

        def deliver_in_step(outcome: Outcome) -> None:
            with self:
                deliver(outcome)

        return self._outer_clock.start(run_as_numbered_work, deliver_in_step)

    def position(self) -> Mapping[str, int]:
        """Return the position of the present moment in the run. A replay repeats a command at the same position.

        The position consists of the number of events so far and, in simulated time, the number of the piece of work
        whose function runs within the present step.
        """
        return (
            {"step": self.step_count}
            if self._running_work_number is None
            else {"step": self.step_count, "work": self._running_work_number}
        )

    def _run_next_event(self, due_s: float) -> None:
        """Run the first due event, if there is one: the event of this call may have been cancelled meanwhile.

        The event counts as happening at its time, unless this time is over by more than `PUNCTUALITY_TOLERANCE_S`.
        """
        with self._lock:
            now_s = self._outer_clock.now_s()
            timer = self._timers.pop_due(max(now_s, due_s))
            if timer is None:
                return
            instant_s = timer.instant_s
            is_late = now_s > instant_s + PUNCTUALITY_TOLERANCE_S
            self._step_instant_s = max(self._step_instant_s, now_s if is_late else instant_s)
            self._is_step = True
            if is_late:
                self.on_late_event()
            self.step_count += 1
            timer.fire()


class _LockedTimer(Timer):
    """An event of a `LockedClock`. The lock is held while it is cancelled.

    A cancelled event is not a step. If it is due already, it stays a step, without an effect: a replay, which does not
    know when a thread got the lock, makes the same steps.
    """

    __slots__ = ("_clock", "outer_timer")

    def __init__(self, instant_s: float, callback: Callable[[], None], clock: LockedClock) -> None:
        super().__init__(instant_s, callback)
        self._clock = clock
        self.outer_timer: Timer | None = None

    def cancel(self) -> None:
        if self.instant_s <= self._clock.now_s():
            self._callback = _no_op
            return
        super().cancel()
        if self.outer_timer is not None:
            self.outer_timer.cancel()


class WithoutStep:
    """Holds the lock of a `LockedClock` for code that only reads."""

    def __init__(self, acquire: Callable[[bool], None], release: Callable[..., None]) -> None:
        self._acquire = acquire
        self._release = release

    def __enter__(self) -> None:
        self._acquire(False)

    __exit__ = property(attrgetter("_release"))


def _no_op() -> None:
    pass


def _checked_duration(duration_s: float) -> float:
    if not duration_s >= 0:
        raise ValueError(f"a duration is zero or more seconds, not {duration_s!r}")
    return duration_s
