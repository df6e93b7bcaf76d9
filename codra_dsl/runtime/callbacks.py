"""Callbacks that report changes. They never delay the code that makes the changes."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from functools import partial
from typing import Any, Generic, Self, TypeVar

from codra_dsl.isolation.error_text import loggable, shown
from codra_dsl.runtime.clock import Clock, Work, is_interrupt
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.values.cell import Reading

_LOGGER = logging.getLogger(__name__)

MAX_WAITING_CHANGES = 1_000
"""The largest number of changes that wait for a slow callback. If there are more, the oldest one is dropped."""

ChangeT = TypeVar("ChangeT")
KeyT = TypeVar("KeyT")
StateT = TypeVar("StateT")

_State = tuple[object, object]
"""The value of a variable, and the reason why it is unknown."""


def _no_op() -> None:
    pass


def log_raised(callback: object, error: BaseException) -> None:
    """Log an exception of a callback."""
    _LOGGER.error("a callback raised: %s", shown(callback), exc_info=loggable(error))


class Subscription:
    """A handle that can end a subscription. In a `with` statement, the subscription ends when the statement ends.

    Attributes:
        dropped: how many changes were dropped because the callback was too slow.
    """

    def __init__(self, end: Callable[[], None]) -> None:
        self.dropped = 0
        self._end = end
        self._on_end: Callable[[], None] = _no_op
        self._is_over = False
        self._lock = new_lock()

    def unsubscribe(self) -> None:
        """End the subscription. If the callback is running, it runs to its end."""
        self._end()
        with self._lock:
            on_end, self._on_end, self._is_over = self._on_end, _no_op, True
        on_end()

    def and_then(self, then: Callable[[], None]) -> None:
        """Call `then` once when the subscription ends; if the subscription has ended, call it at once.

        A later call of this method replaces `then`.
        """
        with self._lock:
            if not self._is_over:
                self._on_end = then
                return
        then()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.unsubscribe()


class CallbackQueue(Generic[ChangeT]):
    """The changes that wait for one callback, in order.

    The callback runs on a clock that holds no lock. In simulated time, it runs in a separate event at the same instant;
    in real time, it runs in a thread that exists while changes wait. So a slow or failing callback affects neither
    the code that makes the changes nor other subscriptions.
    """

    def __init__(
        self, clock: Clock, callback: Callable[[ChangeT], object], end: Callable[[CallbackQueue[ChangeT]], None]
    ) -> None:
        """Create an empty queue.

        Args:
            clock: runs the callback; this clock must not hold a lock while events run.
            callback: called with each change.
            end: called with this queue when the subscription ends.
        """
        self.subscription = Subscription(self._close)
        self._clock = clock
        self._callback = callback
        self._end = end
        self._waiting_changes: deque[ChangeT] = deque()
        self._lock = new_lock()
        self._is_running = False
        self._is_closed = False

    def put(self, change: ChangeT) -> None:
        """Call the callback with a change as soon as the callback has finished with earlier changes."""
        with self._lock:
            if self._is_closed:
                return
            self._waiting_changes.append(change)
            if len(self._waiting_changes) > MAX_WAITING_CHANGES:
                self._waiting_changes.popleft()
                self.subscription.dropped += 1
            must_start, self._is_running = not self._is_running, True
        if must_start:
            self._clock.call_at(self._clock.now_s(), self._start)

    def _start(self) -> None:
        try:
            self._clock.start(self._run, lambda _: None)
        except RuntimeError:  # no thread could be started: the next change tries again
            _LOGGER.exception("a callback could not be called")
            with self._lock:
                self._is_running = False

    def _run(self, _: Work) -> None:
        while (change := self._next_change()) is not None:
            try:
                self._callback(change[0])
            except BaseException as error:
                if is_interrupt(error):
                    self._is_running = False
                    raise
                log_raised(self._callback, error)

    def _next_change(self) -> tuple[ChangeT] | None:
        """Return the next change. If no change waits, mark the queue as not running and return None."""
        with self._lock:
            if self._waiting_changes:
                return (self._waiting_changes.popleft(),)
            self._is_running = False
            return None

    def _close(self) -> None:
        with self._lock:
            self._is_closed = True
            self._waiting_changes.clear()
        self._end(self)


class Subscriptions:
    """The subscriptions to variables and to expectations of skills. Callers hold the context manager's lock."""

    def __init__(self, clock: Clock, lock: AbstractContextManager[object]) -> None:
        """Start without subscriptions.

        Args:
            clock: a clock that holds no lock while events run.
            lock: the lock of the context manager.
        """
        self._clock = clock
        self._lock = lock
        self._variable_queues: dict[str, dict[CallbackQueue[Reading[Any]], _State | None]] = {}
        self._follower_queues: dict[str, dict[CallbackQueue[None], None]] = {}
        self._skill_queues: dict[int, dict[CallbackQueue[Any], None]] = {}

    def subscribe(self, readings: Iterable[Reading[Any]], callback: Callable[[Reading[Any]], object]) -> Subscription:
        """Call `callback` with the present readings of some variables, then whenever a value or a reason changes."""
        present_readings = tuple(readings)
        names = [reading.name for reading in present_readings]
        queue = CallbackQueue(self._clock, callback, partial(self._remove_queue, self._variable_queues, names))
        for reading in present_readings:
            states = self._variable_queues.setdefault(reading.name, {})
            states[queue] = None
            _put_if_changed(queue, states, reading)
        return queue.subscription

    def follow(self, name: str, callback: Callable[[], object]) -> Subscription:
        """Call `callback` for each new reading of a variable, even if only its evidence is newer."""
        queue: CallbackQueue[None] = CallbackQueue(
            self._clock, lambda _: callback(), partial(self._remove_queue, self._follower_queues, (name,))
        )
        self._follower_queues.setdefault(name, {})[queue] = None
        return queue.subscription

    def subscribe_to_skill(self, skill_number: int, callback: Callable[[Any], object]) -> Subscription:
        """Call `callback` with the outcome of each expectation of a skill."""
        queue: CallbackQueue[Any] = CallbackQueue(
            self._clock, callback, partial(self._remove_queue, self._skill_queues, (skill_number,))
        )
        self._skill_queues.setdefault(skill_number, {})[queue] = None
        return queue.subscription

    def notify_change(self, name: str, read_reading: Callable[[str], Reading[Any]]) -> None:
        """Notify the subscribers and followers of a variable that may have changed."""
        states = self._variable_queues.get(name, {})
        for queue in tuple(states):
            _put_if_changed(queue, states, read_reading(name))
        for follower_queue in tuple(self._follower_queues.get(name, ())):
            follower_queue.put(None)

    def wake_followers(self) -> None:
        """Call all followers of variables, because the context manager has closed and no reading will follow."""
        for follower_queues in tuple(self._follower_queues.values()):
            for follower_queue in tuple(follower_queues):
                follower_queue.put(None)

    def notify_verdict(self, skill_number: int, verdict: object) -> None:
        """Report the outcome of an expectation to the subscribers of the skill."""
        for queue in tuple(self._skill_queues.get(skill_number, ())):
            queue.put(verdict)

    def remove_skill(self, skill_number: int) -> None:
        """Remove the subscriptions to a skill that has ended; outcomes that still wait are delivered."""
        self._skill_queues.pop(skill_number, None)

    def _remove_queue(
        self,
        queues_by_key: dict[KeyT, dict[CallbackQueue[ChangeT], StateT]],
        keys: Iterable[KeyT],
        queue: CallbackQueue[ChangeT],
    ) -> None:
        """Remove an ended queue; the cost does not depend on the number of other subscriptions."""
        with self._lock:
            for key in keys:
                queues_by_key.get(key, {}).pop(queue, None)


def _put_if_changed(
    queue: CallbackQueue[Reading[Any]],
    states: dict[CallbackQueue[Reading[Any]], _State | None],
    reading: Reading[Any],
) -> None:
    state = (reading.content, reading.reason)
    if states.get(queue) != state:
        states[queue] = state
        queue.put(reading)
