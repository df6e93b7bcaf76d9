"""Callbacks that are told what changes, without ever holding up who changes it."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Generic, Self, TypeVar

from codra_dsl.runtime.clock import Clock, Work
from codra_dsl.runtime.values.cell import Reading

_LOGGER = logging.getLogger(__name__)

MOST_WAITING = 1_000
"""What may wait for a callback that is slower than what it is told; then the oldest goes."""

NewsT = TypeVar("NewsT")


def _nothing() -> None:
    pass


class Subscription:
    """What ends a subscription; it ends at the end of its `with` statement, too.

    Attributes:
        dropped: how much was not told, because the callback was too slow.
    """

    def __init__(self, end: Callable[[], None]) -> None:
        self.dropped = 0
        self._end = end
        self._then: Callable[[], None] = _nothing
        self._is_over = False
        self._lock = threading.Lock()

    def unsubscribe(self) -> None:
        """Call back no more; a call that is under way comes to its end."""
        self._end()
        with self._lock:
            then, self._then, self._is_over = self._then, _nothing, True
        then()

    def and_then(self, then: Callable[[], None]) -> None:
        """Do something once when the subscription ends, in the place of what was before; now if it has ended."""
        with self._lock:
            if not self._is_over:
                self._then = then
                return
        then()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.unsubscribe()


class CallbackQueue(Generic[NewsT]):
    """What waits for one callback, in order.

    The callback runs with no lock held: in simulated time as an event of its own at the same instant, in real time in a
    thread that lives while there is something to tell. So one that is slow or raises hurts neither the one who writes
    nor other subscriptions.
    """

    def __init__(
        self, clock: Clock, callback: Callable[[NewsT], object], end: Callable[[CallbackQueue[NewsT]], None]
    ) -> None:
        """Wait for news.

        Args:
            clock: which runs the callback; not one that holds a lock while events happen.
            callback: is told.
            end: called when nobody wants to be told any more.
        """
        self.subscription = Subscription(self._close)
        self._clock = clock
        self._callback = callback
        self._end = end
        self._waiting: deque[NewsT] = deque()
        self._lock = threading.Lock()
        self._is_running = False
        self._is_closed = False

    def put(self, news: NewsT) -> None:
        """Let the callback be told as soon as it is free."""
        with self._lock:
            if self._is_closed:
                return
            self._waiting.append(news)
            if len(self._waiting) > MOST_WAITING:
                self._waiting.popleft()
                self.subscription.dropped += 1
            must_start, self._is_running = not self._is_running, True
        if must_start:
            self._clock.call_at(self._clock.now_s(), self._start)

    def _start(self) -> None:
        try:
            self._clock.start(self._run, _ignore)
        except RuntimeError:  # no thread could be started: the next news tries again
            _LOGGER.exception("a callback could not be called")
            with self._lock:
                self._is_running = False

    def _run(self, _: Work) -> None:
        while (news := self._next()) is not None:
            try:
                self._callback(news[0])
            except BaseException as error:
                if isinstance(error, KeyboardInterrupt) and threading.current_thread() is threading.main_thread():
                    self._is_running = False
                    raise  # in simulated time it is the user who wants an end
                _LOGGER.exception("a callback raised: %r", self._callback)

    def _next(self) -> tuple[NewsT] | None:
        """Return what is to be told next; None if there is nothing, and then nothing runs any more."""
        with self._lock:
            if self._waiting:
                return (self._waiting.popleft(),)
            self._is_running = False
            return None

    def _close(self) -> None:
        with self._lock:
            self._is_closed = True
            self._waiting.clear()
        self._end(self)


class Subscriptions:
    """Who wants to be told of variables, and of what skills expect. Whoever tells holds the context manager's lock."""

    def __init__(self, clock: Clock, lock: threading.RLock) -> None:
        """Have no subscriber yet.

        Args:
            clock: one that holds no lock while events happen.
            lock: the context manager's.
        """
        self._clock = clock
        self._lock = lock
        self._lines: dict[str, list[CallbackQueue[Reading[Any]]]] = {}
        self._last: dict[tuple[int, str], tuple[object, object]] = {}
        self._followers: dict[str, list[CallbackQueue[None]]] = {}
        self._of_skill: dict[int, list[CallbackQueue[Any]]] = {}

    def subscribe(self, readings: Iterable[Reading[Any]], callback: Callable[[Reading[Any]], object]) -> Subscription:
        """Tell of some variables, given as what they are now: that first, then each change of it."""
        present = tuple(readings)
        line = CallbackQueue(self._clock, callback, self._forget)
        for reading in present:
            self._lines[reading.name] = [*self._lines.get(reading.name, ()), line]
            self._tell(line, reading)
        return line.subscription

    def follow(self, name: str, callback: Callable[[], object]) -> Subscription:
        """Call back whenever there is another reading of a variable, though it may only be newer evidence."""
        line: CallbackQueue[None] = CallbackQueue(
            self._clock, lambda _: callback(), lambda line: self._forget_follower(name, line)
        )
        self._followers[name] = [*self._followers.get(name, ()), line]
        return line.subscription

    def subscribe_to_skill(self, number: int, callback: Callable[[Any], object]) -> Subscription:
        """Tell what comes of the expectations of a skill."""
        line: CallbackQueue[Any] = CallbackQueue(
            self._clock, callback, lambda line: self._forget_of_skill(number, line)
        )
        self._of_skill[number] = [*self._of_skill.get(number, ()), line]
        return line.subscription

    def changed(self, name: str, read: Callable[[str], Reading[Any]]) -> None:
        """Tell of a variable that may be another than it was."""
        for line in self._lines.get(name, ()):
            self._tell(line, read(name))
        for follower in self._followers.get(name, ()):
            follower.put(None)

    def wake(self) -> None:
        """Call back all who follow a variable: the context manager has closed, and no more will come."""
        for followers in self._followers.values():
            for follower in followers:
                follower.put(None)

    def judged(self, number: int, verdict: object) -> None:
        """Tell what came of an expectation of a skill."""
        for line in self._of_skill.get(number, ()):
            line.put(verdict)

    def finished(self, number: int) -> None:
        """Forget a skill that has ended; what waits for its callbacks is still told."""
        self._of_skill.pop(number, None)

    def _tell(self, line: CallbackQueue[Reading[Any]], reading: Reading[Any]) -> None:
        key, state = (id(line), reading.name), (reading.content, reading.reason)
        if self._last.get(key) != state:
            self._last[key] = state
            line.put(reading)

    def _forget(self, line: CallbackQueue[Reading[Any]]) -> None:
        with self._lock:
            for name, lines in list(self._lines.items()):
                if line in lines:
                    self._lines[name] = [other for other in lines if other is not line]
                    self._last.pop((id(line), name), None)

    def _forget_follower(self, name: str, line: CallbackQueue[None]) -> None:
        with self._lock:
            self._followers[name] = [other for other in self._followers[name] if other is not line]

    def _forget_of_skill(self, number: int, line: CallbackQueue[Any]) -> None:
        with self._lock:
            if number in self._of_skill:
                self._of_skill[number] = [other for other in self._of_skill[number] if other is not line]


def _ignore(_: object) -> None:
    pass
