"""Callbacks about changes, which never delay the code that makes the changes."""

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
"""The largest number of changes that wait for a slow callback; beyond that the oldest is dropped."""

NewsT = TypeVar("NewsT")


def _no_op() -> None:
    pass


class Subscription:
    """The handle of a subscription, which can also be used in a `with` statement.

    Attributes:
        dropped: how many changes were dropped because the callback was too slow.
    """

    def __init__(self, end: Callable[[], None]) -> None:
        self.dropped = 0
        self._end = end
        self._then: Callable[[], None] = _no_op
        self._is_over = False
        self._lock = threading.Lock()

    def unsubscribe(self) -> None:
        """End the subscription; a call that is under way is completed."""
        self._end()
        with self._lock:
            then, self._then, self._is_over = self._then, _no_op, True
        then()

    def and_then(self, then: Callable[[], None]) -> None:
        """Call `then` once when the subscription ends, instead of an earlier `then`; at once if it has ended."""
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
    """The changes that wait for one callback, in order.

    The callback runs on a clock that holds no lock: in simulated time as a separate event at the same instant, in real
    time in a thread that lives while changes wait. So a callback that is slow or raises affects neither the writer nor
    other subscriptions.
    """

    def __init__(
        self, clock: Clock, callback: Callable[[NewsT], object], end: Callable[[CallbackQueue[NewsT]], None]
    ) -> None:
        """Create an empty queue.

        Args:
            clock: runs the callback; it must not hold a lock while events run.
            callback: called with each change.
            end: called when the subscription ends.
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
        """Call the callback with a change as soon as it is free."""
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
        except RuntimeError:  # no thread could be started: the next change tries again
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
                    raise  # in simulated time the user interrupts the program
                _LOGGER.exception("a callback raised: %r", self._callback)

    def _next(self) -> tuple[NewsT] | None:
        """Return the next change; None if no change waits, and then the thread ends."""
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
    """The subscriptions to variables and to expectations of skills. Callers hold the context manager's lock."""

    def __init__(self, clock: Clock, lock: threading.RLock) -> None:
        """Start without subscriptions.

        Args:
            clock: a clock that holds no lock while events run.
            lock: the lock of the context manager.
        """
        self._clock = clock
        self._lock = lock
        self._queues: dict[str, list[CallbackQueue[Reading[Any]]]] = {}
        self._last: dict[tuple[int, str], tuple[object, object]] = {}
        self._followers: dict[str, list[CallbackQueue[None]]] = {}
        self._of_skill: dict[int, list[CallbackQueue[Any]]] = {}

    def subscribe(self, readings: Iterable[Reading[Any]], callback: Callable[[Reading[Any]], object]) -> Subscription:
        """Call back with the present readings of some variables, then with each change."""
        present = tuple(readings)
        queue = CallbackQueue(self._clock, callback, self._forget)
        for reading in present:
            self._queues[reading.name] = [*self._queues.get(reading.name, ()), queue]
            self._put_change(queue, reading)
        return queue.subscription

    def follow(self, name: str, callback: Callable[[], object]) -> Subscription:
        """Call back for each other reading of a variable, including newer evidence for the same value."""
        queue: CallbackQueue[None] = CallbackQueue(
            self._clock, lambda _: callback(), lambda queue: self._forget_follower(name, queue)
        )
        self._followers[name] = [*self._followers.get(name, ()), queue]
        return queue.subscription

    def subscribe_to_skill(self, number: int, callback: Callable[[Any], object]) -> Subscription:
        """Call back with the outcomes of the expectations of a skill."""
        queue: CallbackQueue[Any] = CallbackQueue(
            self._clock, callback, lambda queue: self._forget_of_skill(number, queue)
        )
        self._of_skill[number] = [*self._of_skill.get(number, ()), queue]
        return queue.subscription

    def changed(self, name: str, read: Callable[[str], Reading[Any]]) -> None:
        """Notify the subscribers of a variable that may have changed."""
        for queue in self._queues.get(name, ()):
            self._put_change(queue, read(name))
        for follower in self._followers.get(name, ()):
            follower.put(None)

    def wake(self) -> None:
        """Call back all followers of variables, because the context manager has closed."""
        for followers in self._followers.values():
            for follower in followers:
                follower.put(None)

    def judged(self, number: int, verdict: object) -> None:
        """Notify the subscribers of a skill of an outcome."""
        for queue in self._of_skill.get(number, ()):
            queue.put(verdict)

    def finished(self, number: int) -> None:
        """Remove a skill that has ended; waiting outcomes are still delivered."""
        self._of_skill.pop(number, None)

    def _put_change(self, queue: CallbackQueue[Reading[Any]], reading: Reading[Any]) -> None:
        key, state = (id(queue), reading.name), (reading.content, reading.reason)
        if self._last.get(key) != state:
            self._last[key] = state
            queue.put(reading)

    def _forget(self, queue: CallbackQueue[Reading[Any]]) -> None:
        with self._lock:
            for name, queues in list(self._queues.items()):
                if queue in queues:
                    self._queues[name] = [other for other in queues if other is not queue]
                    self._last.pop((id(queue), name), None)

    def _forget_follower(self, name: str, queue: CallbackQueue[None]) -> None:
        with self._lock:
            self._followers[name] = [other for other in self._followers[name] if other is not queue]

    def _forget_of_skill(self, number: int, queue: CallbackQueue[Any]) -> None:
        with self._lock:
            if number in self._of_skill:
                self._of_skill[number] = [other for other in self._of_skill[number] if other is not queue]


def _ignore(_: object) -> None:
    pass
