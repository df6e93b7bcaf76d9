"""Clocks of real and simulated time. Other modules neither read the time nor wait by themselves: they use a `Clock`.

In simulated time, all events are in one heap, and they run while a program sleeps. When the main execution calls
`sleep` or `wait_until`, this call runs every event up to the end of the sleep or wait, in the order of their instants
and, at the same instant, in the order in which they were scheduled. Everything happens in one thread.

In simulated time, a piece of work (a perception function) runs at once, with the present values of its handles. The
sleeps of the work add to its duration. The outcome is delivered at the end of this duration or, if the work is
cancelled, at the time of the cancellation, as in real time. So blocking code is written once and runs in both kinds of
time, and the same program gives the same events.

In real time a dispatcher thread runs the events. While a piece of work runs, it has a daemon thread to itself, so that
work that hangs delays neither the dispatcher, nor other work, nor the end of the process.
"""

from __future__ import annotations

import heapq
import logging
import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from time import monotonic
from typing import TypeVar

from codra_dsl.isolation.error_text import loggable
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.worker_threads import WorkerThreads

__all__ = [
    "Cancelled",
    "Clock",
    "Outcome",
    "SimClock",
    "Timer",
    "WallClock",
    "Work",
]

Outcome = TypeVar("Outcome")

_LOGGER = logging.getLogger(__name__)

_LONGEST_WAIT_S = 3600.0
"""The dispatcher waits at most this long before it checks its events again."""

_MIN_EVENTS_TO_CLEAN = 1_000
"""Cancelled events are removed only if there are more events than this."""

_LAST_EVENTS_OFFSET = 2**62
"""Added to the number of an event that runs after all other events of its instant; usual numbers are smaller."""

PUNCTUALITY_TOLERANCE_S = 0.01
"""An event that begins at most this long after its time counts as happening at its time.

So a run in real time is determined by its inputs, like a run in simulated time, and a replay is exact.
"""


class Cancelled(Exception):  # noqa: N818 - being cancelled is an outcome, not an error
    """Raised inside a piece of work whose outcome is no longer needed."""


class Timer:
    """A scheduled event, which can be cancelled."""

    __slots__ = ("_callback", "instant_s")

    def __init__(self, instant_s: float, callback: Callable[[], None]) -> None:
        self.instant_s = instant_s
        self._callback: Callable[[], None] | None = callback

    def take(self) -> Callable[[], None]:
        """Return the callback, and cancel the event."""
        callback, self._callback = self._callback, None
        return callback or _no_op

    def cancel(self) -> None:
        """Cancel the event. If the event has already happened, this has no effect."""
        self._callback = None

    @property
    def is_cancelled(self) -> bool:
        """Return whether the event was cancelled or has happened."""
        return self._callback is None

    def fire(self) -> None:
        """Run the callback, unless the event was cancelled."""
        self.take()()


class TimerQueue:
    """Scheduled events, in the order of their instants and, at the same instant, of their numbers.

    A cancelled event never comes first, and most cancelled events leave the memory long before their instants.
    """

    __slots__ = ("_entries", "_max_entries")

    def __init__(self) -> None:
        self._entries: list[tuple[float, int, Timer]] = []
        self._max_entries = _MIN_EVENTS_TO_CLEAN

    def add(self, timer: Timer, number: int) -> None:
        """Add an event; each event has another number."""
        heapq.heappush(self._entries, (timer.instant_s, number, timer))
        if len(self._entries) > self._max_entries:
            self._entries = [entry for entry in self._entries if not entry[2].is_cancelled]
            heapq.heapify(self._entries)
            self._max_entries = max(_MIN_EVENTS_TO_CLEAN, 2 * len(self._entries))

    def next_s(self) -> float:
        """Return the instant of the first event; infinity if there is none."""
        entries = self._entries
        while entries:
            instant_s, _, timer = entries[0]
            if timer._callback is not None:  # not a property: every event takes this way
                return instant_s
            heapq.heappop(entries)
        return math.inf

    def is_next_before(self, instant_s: float, number: int) -> bool:
        """Return whether the first event comes before an event with this instant and number."""
        return self.next_s() <= instant_s and self._entries[0][:2] < (instant_s, number)

    def pop_due(self, until_s: float) -> Timer | None:
        """Remove the first event and return it; None if no event is due up to an instant."""
        entries = self._entries
        while entries and entries[0][0] <= until_s:
            timer = heapq.heappop(entries)[2]
            if timer._callback is not None:
                return timer
        return None


class Work(ABC):
    """A piece of work, with its own time."""

    def __init__(self) -> None:
        self._is_cancelled = False

    @property
    def cancelled(self) -> bool:
        """Return whether the outcome is no longer needed."""
        return self._is_cancelled

    def cancel(self) -> None:
        """Cancel the work, because its outcome is no longer needed; the next `sleep` of the work raises `Cancelled`."""
        self._is_cancelled = True

    @abstractmethod
    def now_s(self) -> float:
        """Return the instant that the work has reached."""

    @abstractmethod
    def sleep(self, duration_s: float) -> None:
        """Let time pass for the work.

        Raises:
            Cancelled: if the outcome is no longer needed.
        """


class Clock(ABC):
    """A source of time, which also runs events and work. Instants are in seconds, as float."""

    @abstractmethod
    def now_s(self) -> float:
        """Return the present instant."""

    @abstractmethod
    def sleep(self, duration_s: float) -> None:
        """Let time pass; the events that are due in this time happen."""

    @abstractmethod
    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event. It does not happen before `instant_s`, and never inside this call.

        If `instant_s` is infinite, the event does not happen at all.
        """

    @abstractmethod
    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until `is_ready()` is true or the timeout is over; return `is_ready()`.

        `is_ready` is called often, from any thread, and must not acquire a lock.
        """

    @abstractmethod
    def notify(self) -> None:
        """Wake every `wait_until`, because its condition may have changed."""

    @abstractmethod
    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Start a piece of work in parallel to the events. In a later event, `deliver` is called with the outcome.

        The outcome is what `run` returns; `run` must not raise. The outcome of cancelled work is delivered as
        well, to report that the work has ended.

        Raises:
            RuntimeError: if the machine cannot start another piece of work.
        """


class _SimulatedWork(Work):
    """A piece of work in simulated time. Its function has already run, but the end of the work is in the future."""

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock
        self._now_s = clock.now_s()
        self._delivery: Timer | None = None

    def now_s(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        self._now_s += _checked_duration(duration_s)

    def cancel(self) -> None:
        super().cancel()
        if self._delivery is not None:
            self._clock.call_at(self._clock.now_s(), self._delivery.take())

    def deliver(self, callback: Callable[[], None]) -> None:
        self._delivery = self._clock.call_at(self._now_s, callback)


class SimClock(Clock):
    """A clock of simulated time. Time passes only inside `sleep` and `wait_until`, as fast as the events can be run.

    The clock belongs to the thread that created it.
    """

    def __init__(self, start_s: float = 0.0) -> None:
        self._now_s = start_s
        self._events = TimerQueue()
        self._event_count = 0
        self._is_inside_event = False
        self._thread = threading.get_ident()

    def now_s(self) -> float:
        """Return the present instant."""
        return self._now_s

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event. If its instant is in the past, the event happens at the present instant."""
        self._check_thread()
        timer = Timer(max(instant_s, self._now_s), callback)
        if instant_s < math.inf:
            self._events.add(timer, self._event_count)
            self._event_count += 1
        return timer

    def call_last_at(self, instant_s: float, callback: Callable[[], None]) -> None:
        """Schedule an event after all other events of its instant, including events that are scheduled later."""
        self._check_thread()
        self._event_count += 1
        self._events.add(Timer(max(instant_s, self._now_s), callback), _LAST_EVENTS_OFFSET + self._event_count)

    def sleep(self, duration_s: float) -> None:
        """Let `duration_s` seconds pass, and run all events in this time, including those at its start and end."""
        self.wait_until(lambda: False, _checked_duration(duration_s))

    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        """Run events until `is_ready()` is true, or `timeout_s` is over.

        `is_ready` is called before the first event and after each event.
        """
        self._check_thread()
        if self._is_inside_event:
            raise RuntimeError("an event (a perception function, a callback) must not wait on the clock: use job.sleep")
        end_s = self._now_s + _checked_duration(timeout_s)
        while not is_ready():
            timer = self._events.pop_due(end_s)
            if timer is None:
                if end_s == math.inf:
                    raise RuntimeError("this would wait forever: no event is left that could end it")
                self._now_s = end_s
                return is_ready()
            self._run(timer)
        return True

    def notify(self) -> None:
        """Do nothing: `wait_until` checks its condition after every event."""

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Run the work at once. Deliver the outcome later, after the total duration of the sleeps of the work."""
        work = _SimulatedWork(self)
        was_inside_event, self._is_inside_event = self._is_inside_event, True
        try:
            outcome = run(work)
        finally:
            self._is_inside_event = was_inside_event
        work.deliver(lambda: deliver(outcome))
        return work

    def _run(self, timer: Timer) -> None:
        self._now_s, self._is_inside_event = timer.instant_s, True
        try:
            timer.fire()
        finally:
            self._is_inside_event = False

    def _check_thread(self) -> None:
        if threading.get_ident() != self._thread:
            raise RuntimeError("a SimClock belongs to the thread that created it: use WallClock with threads")


class _RealWork(Work):
    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self._clock = clock
        self._cancel_event = threading.Event()

    def now_s(self) -> float:
        return self._clock.now_s()

    def cancel(self) -> None:
        super().cancel()
        self._cancel_event.set()

    def sleep(self, duration_s: float) -> None:
        if self._cancel_event.wait(min(_checked_duration(duration_s), threading.TIMEOUT_MAX)):
            raise Cancelled


class WallClock(Clock):
    """A clock of real time, based on the monotonic clock of the system.

    Events run one after another in a dispatcher thread. You may leave the clock open until the process ends, because
    its threads are daemons.
    """

    def __init__(self, start_s: float | None = None) -> None:
        """Start the dispatcher.

        Args:
            start_s: the instant that the clock shows now; by default the number of seconds since 1970.
        """
        self._offset_s = (time.time() if start_s is None else start_s) - time.monotonic()
        self._condition = threading.Condition(new_lock())
        self._events = TimerQueue()
        self._event_count = 0
        self._waiter_count = 0
        self._is_closed = False
        self._worker_threads = WorkerThreads("codra-work")
        self._dispatcher = threading.Thread(target=self._dispatch, name="codra-clock", daemon=True)
        self._dispatcher.start()

    def __enter__(self) -> WallClock:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Run no more events, and let waiting calls return."""
        with self._condition:
            self._is_closed = True
            self._condition.notify_all()
        self._worker_threads.close()

    def now_s(self) -> float:
        """Return the present instant."""
        return monotonic() + self._offset_s

    def sleep(self, duration_s: float) -> None:
        """Let real time pass."""
        self._check_thread()
        time.sleep(min(_checked_duration(duration_s), threading.TIMEOUT_MAX))

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event in the dispatcher thread."""
        timer = Timer(instant_s, callback)
        if instant_s < math.inf:
            with self._condition:
                self._events.add(timer, self._event_count)
                self._event_count += 1
                self._condition.notify_all()
        return timer

    def wait_until(self, is_ready: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `is_ready()` is true, the timeout is over, or the clock is closed.

        `is_ready` is called at the start, and again after each `notify`.
        """
        self._check_thread()
        with self._condition:
            self._waiter_count += 1
            try:
                wait_s = min(_checked_duration(timeout_s), threading.TIMEOUT_MAX)
                self._condition.wait_for(lambda: is_ready() or self._is_closed, wait_s)
                return is_ready()
            finally:
                self._waiter_count -= 1

    def notify(self) -> None:
        """Wake all waiting threads.

        A waiting thread increases `_waiter_count` before it checks its condition. A thread that changes something reads
        `_waiter_count` after the change. So no change is missed.
        """
        if self._waiter_count:
            with self._condition:
                self._condition.notify_all()

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Run the work in a daemon thread that runs nothing else meanwhile."""
        work = _RealWork(self)

        def run_and_deliver() -> None:
            outcome = run(work)
            self.call_at(self.now_s(), lambda: deliver(outcome))

        self._worker_threads.run(run_and_deliver)
        return work

    def _dispatch(self) -> None:
        while (timer := self._next_due_timer()) is not None:
            try:
                timer.fire()
            except BaseException as error:
                _LOGGER.error("an event failed", exc_info=loggable(error))

    def _check_thread(self) -> None:
        if threading.current_thread() is self._dispatcher:
            raise RuntimeError("an event (a callback) must not wait on the clock")

    def _next_due_timer(self) -> Timer | None:
        with self._condition:
            while not self._is_closed:
                now_s = self.now_s()
                timer = self._events.pop_due(now_s)
                if timer is not None:
                    return timer
                next_s = self._events.next_s()
                self._condition.wait(None if next_s == math.inf else min(next_s - now_s, _LONGEST_WAIT_S))
        return None


def is_interrupt(error: BaseException) -> bool:
    """Return whether user code was interrupted by Ctrl-C, which must end the program.

    In simulated time, user code can run in the main thread.
    """
    # `isinstance` could run code of the exception: its class can define `__class__` as a property
    is_keyboard_interrupt = issubclass(type(error), KeyboardInterrupt)
    return is_keyboard_interrupt and threading.current_thread() is threading.main_thread()


def _no_op() -> None:
    pass


def _checked_duration(duration_s: float) -> float:
    if not duration_s >= 0:
        raise ValueError(f"a duration is zero or more seconds, not {duration_s!r}")
    return duration_s
