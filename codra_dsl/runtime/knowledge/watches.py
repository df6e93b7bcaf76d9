"""Subscriptions to changes of the graph, which never block a writer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

from codra_dsl.runtime.callbacks import CallbackQueue, Subscription
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.knowledge.change_set import ChangeSubject
from codra_dsl.runtime.knowledge.declarations import Pattern
from codra_dsl.runtime.knowledge.elements import EdgeKey
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import ANY, Match, next_change_s
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.values.cell import Reading

ValueT = TypeVar("ValueT")


class Change(NamedTuple):
    """The matches of patterns now, compared with the previous call of the callback.

    Attributes:
        snapshot: the snapshot that has these matches.
        matches: all present matches.
        new: the matches that did not exist at the previous call.
        ended: the matches that have ended since the previous call.
    """

    snapshot: Snapshot
    matches: tuple[Match, ...]
    new: tuple[Match, ...]
    ended: tuple[Match, ...]


class View(NamedTuple, Generic[ValueT]):
    """The value of a watch in a snapshot, and when this value can next change without new writes."""

    value: ValueT
    next_change_s: float = math.inf


_WakingMatches = tuple[tuple[int, Match, tuple[int, ...]], ...]
"""The matches that wake an agent: the number of the pattern, the match, and the numbers of its edges."""


class Watch(Generic[ValueT]):
    """Evaluates the graph after changes, and calls back if the value differs from the value before.

    If the graph changes several times before the evaluation, only its present state is evaluated, so calls cannot
    pile up.
    """

    def __init__(
        self,
        clock: Clock,
        take_snapshot: Callable[[], Snapshot],
        evaluate: Callable[[Snapshot], View[ValueT]],
        notify: Callable[[Snapshot, ValueT], None],
        on_end: Callable[[], None],
    ) -> None:
        """Wait for changes.

        Args:
            clock: runs the callback.
            take_snapshot: returns a snapshot of the present graph.
            evaluate: returns the view of a snapshot.
            notify: is called with the first value, and then with each value that differs from the value before.
            on_end: is called when the subscription has ended.
        """
        self._clock = clock
        self._take_snapshot = take_snapshot
        self._evaluate = evaluate
        self._notify = notify
        self._queue: CallbackQueue[None] = CallbackQueue(
            clock, self._evaluate_and_notify, lambda _: self._close(on_end)
        )
        self._lock = new_lock()
        self._is_queued = False
        self._is_closed = False
        self._last_view: View[ValueT] | None = None
        self._timer: Timer | None = None

    @property
    def subscription(self) -> Subscription:
        """Return the subscription that ends the watch."""
        return self._queue.subscription

    def request_evaluation(self) -> None:
        """Evaluate the graph as soon as the callback is free."""
        with self._lock:
            if self._is_queued or self._is_closed:
                return
            self._is_queued = True
        self._queue.put(None)

    def _evaluate_and_notify(self, _: None) -> None:
        with self._lock:
            self._is_queued = False
        snapshot = self._take_snapshot()
        view, last_view = self._evaluate(snapshot), self._last_view
        self._last_view = view
        self._schedule_evaluation(view.next_change_s)
        if last_view is None or last_view.value != view.value:
            self._notify(snapshot, view.value)

    def _schedule_evaluation(self, instant_s: float) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = None if self._is_closed else self._clock.call_at(instant_s, self.request_evaluation)

    def _close(self, on_end: Callable[[], None]) -> None:
        with self._lock:
            self._is_closed = True
            if self._timer is not None:
                self._timer.cancel()
        on_end()


class Watches:
    """All watches of one graph, in a table. Its keys are subjects whose changes can change the values of watches."""

    def __init__(self) -> None:
        """Begin without watches."""
        self._watches_by_subject: dict[ChangeSubject, tuple[Watch[Any], ...]] = {}
        self._lock = new_lock()

    def add(self, watch: Watch[Any], subjects: Iterable[ChangeSubject]) -> None:
        """Add a watch that evaluates the graph after each change of one of the subjects."""
        with self._lock:
            for subject in subjects:
                self._watches_by_subject[subject] = (*self._watches_by_subject.get(subject, ()), watch)

    def remove(self, watch: Watch[Any], subjects: Iterable[ChangeSubject]) -> None:
        """Remove a watch."""
        with self._lock:
            for subject in subjects:
                other_watches = tuple(
                    other for other in self._watches_by_subject.get(subject, ()) if other is not watch
                )
                if other_watches:
                    self._watches_by_subject[subject] = other_watches
                else:
                    self._watches_by_subject.pop(subject, None)

    def request_evaluations(self, subjects: Iterable[ChangeSubject]) -> None:
        """Make each watch evaluate the graph if changes of these subjects can have changed its value."""
        watches_by_subject = self._watches_by_subject
        if not watches_by_subject:
            return
        affected_watches: dict[Watch[Any], None] = {}
        for kind, name in subjects:
            for subject in ((kind, name), (kind, ANY), (ANY, name)):
                for watch in watches_by_subject.get(subject, ()):
                    affected_watches[watch] = None
        for watch in affected_watches:
            watch.request_evaluation()


def watch_functions_for_matches(
    schema: GraphSchema, patterns: Sequence[Pattern], callback: Callable[[Change], object]
) -> tuple[Callable[[Snapshot], View[tuple[Match, ...]]], Callable[[Snapshot, tuple[Match, ...]], None]]:
    """Return the functions `evaluate` and `notify` for a watch of patterns."""
    _check_callback(callback)

    def evaluate(snapshot: Snapshot) -> View[tuple[Match, ...]]:
        return View(snapshot.match(*patterns), next_change_s(snapshot, schema, patterns))

    previous_matches: dict[Match, None] = {}

    def notify(snapshot: Snapshot, present_matches: tuple[Match, ...]) -> None:
        new_matches = tuple(match for match in present_matches if match not in previous_matches)
        ended_matches = tuple(match for match in previous_matches if match not in present_matches)
        previous_matches.clear()
        previous_matches.update(dict.fromkeys(present_matches))
        if new_matches or ended_matches:
            callback(Change(snapshot, present_matches, new_matches, ended_matches))

    return evaluate, notify


def watch_functions_for_wakes(
    schema: GraphSchema, wakes: Sequence[Pattern], callback: Callable[[Change], object]
) -> tuple[Callable[[Snapshot], View[_WakingMatches]], Callable[[Snapshot, _WakingMatches], None]]:
    """Return the functions `evaluate` and `notify` for a watch of the patterns that wake an agent.

    Each pattern wakes the agent by itself, whenever it begins to hold. An edge that was deleted and inserted again is
    another edge, so a second request of a task wakes its executor again. An agent without `wakes` is called once and is
    then always active.
    """
    _check_callback(callback)

    def evaluate(snapshot: Snapshot) -> View[_WakingMatches]:
        matches = tuple(
            (number, match, tuple(_edge_number(snapshot, key) for key in match.edges))
            for number, pattern in enumerate(wakes)
            for match in snapshot.match(pattern)
        )
        return View(matches, min((next_change_s(snapshot, schema, [pattern]) for pattern in wakes), default=math.inf))

    previous_matches: _WakingMatches = ()

    def notify(snapshot: Snapshot, present_matches: _WakingMatches) -> None:
        nonlocal previous_matches
        new_matches = tuple(entry[1] for entry in present_matches if entry not in previous_matches)
        ended_matches = tuple(entry[1] for entry in previous_matches if entry not in present_matches)
        previous_matches = present_matches
        if new_matches or not wakes:
            callback(Change(snapshot, tuple(entry[1] for entry in present_matches), new_matches, ended_matches))

    return evaluate, notify


def _edge_number(snapshot: Snapshot, key: EdgeKey) -> int:
    edge = snapshot.edge_of(key)
    return -1 if edge is None else edge.number


def watch_functions_for_attribute(
    name: str, attribute: str, callback: Callable[[Reading[Any]], object]
) -> tuple[Callable[[Snapshot], View[Reading[Any] | None]], Callable[[Snapshot, Reading[Any] | None], None]]:
    """Return the functions `evaluate` and `notify` for a watch of one attribute; a missing node causes no call."""
    _check_callback(callback)

    def evaluate(snapshot: Snapshot) -> View[Reading[Any] | None]:
        if name not in snapshot:
            return View(None)
        reading = snapshot.get(name, attribute)
        return View(reading, reading.expires_s if reading.known else math.inf)

    def notify(_: Snapshot, reading: Reading[Any] | None) -> None:
        if reading is not None:
            callback(reading)

    return evaluate, notify


def _check_callback(callback: object) -> None:
    if not callable(callback):
        raise TypeError(f"the callback must be a function, not {callback!r}")
