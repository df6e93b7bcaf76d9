"""A clock of real time with one thread for all events, so that code for simulated time needs no locks."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from codra_dsl.runtime.clock import Timer, WallClock, Work

Outcome = TypeVar("Outcome")


class EventClock(WallClock):
    """Real time, in which callbacks of subscriptions and all other events run one after another in one thread.

    Like an event of simulated time, a callback must not wait.
    """

    def __init__(self, start_s: float | None = None, on_error: Callable[[BaseException], None] | None = None) -> None:
        """Start the thread.

        Args:
            start_s: the instant that the clock shows now; by default the number of seconds since 1970.
            on_error: called when an event has raised an exception; by default the exception is logged.
        """
        self._on_error = on_error
        super().__init__(start_s)

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        """Schedule an event."""
        return super().call_at(instant_s, callback if self._on_error is None else partial(self._run, callback))

    def _run(self, callback: Callable[[], None]) -> None:
        try:
            callback()
        except BaseException as error:
            if self._on_error is None:
                raise
            self._on_error(error)

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Run a callback as an event."""
        work = _EventWork(self)
        self.call_at(self.now_s(), lambda: deliver(run(work)))
        return work


class _EventWork(Work):
    def __init__(self, clock: WallClock) -> None:
        super().__init__()
        self._clock = clock

    def now_s(self) -> float:
        return self._clock.now_s()

    def sleep(self, duration_s: float) -> None:
        raise RuntimeError(f"a callback must not wait, and not {duration_s:g} s either")
