"""Who is told when the graph changes, without ever holding up who changes it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

from codra_dsl.runtime.callbacks import CallbackQueue, Subscription
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.knowledge.change_set import Touched
from codra_dsl.runtime.knowledge.declarations import Pattern
from codra_dsl.runtime.knowledge.elements import EdgeKey
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import ANY, Match, next_s
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.values.cell import Reading

SeenT = TypeVar("SeenT")


class Change(NamedTuple):
    """How patterns hold now, beside how they held when a callback was last told.

    Attributes:
        snapshot: the graph in which they do.
        matches: all ways in which they hold now.
        new: the ways in which they did not hold before.
        over: the ways in which they held before.
    """

    snapshot: Snapshot
    matches: tuple[Match, ...]
    new: tuple[Match, ...]
    over: tuple[Match, ...]


class View(NamedTuple, Generic[SeenT]):
    """What a watch sees in a snapshot, and when that can next be something else though nothing is written."""

    seen: SeenT
    next_s: float = math.inf


_Woken = tuple[tuple[int, Match, tuple[int, ...]], ...]
"""What wakes an agent: by the number of its pattern, a way in which it holds, and the numbers of the edges."""


class Watch(Generic[SeenT]):
    """What looks at the graph after it has changed, and tells a callback what is different.

    However often the graph changes before it comes to look, it looks once, at the present: nothing piles up.
    """

    def __init__(
        self,
        clock: Clock,
        take: Callable[[], Snapshot],
        look: Callable[[Snapshot], View[SeenT]],
        tell: Callable[[Snapshot, SeenT], None],
        end: Callable[[], None],
    ) -> None:
        """Wait for changes.

        Args:
            clock: which runs the callback.
            take: takes a snapshot of the present.
            look: sees something in a snapshot.
            tell: is told the first sight, and then each that is different from the one before it.
            end: called when nobody wants to be told any more.
        """
        self._clock = clock
        self._take = take
        self._look_at = look
        self._tell = tell
        self._line: CallbackQueue[None] = CallbackQueue(clock, self._look, lambda _: self._close(end))
        self._lock = threading.Lock()
        self._is_waiting = False
        self._is_closed = False
        self._last: View[SeenT] | None = None
        self._timer: Timer | None = None

    @property
    def subscription(self) -> Subscription:
        """Return what ends the watch."""
        return self._line.subscription

    def changed(self) -> None:
        """Look as soon as the callback is free."""
        with self._lock:
            if self._is_waiting or self._is_closed:
                return
            self._is_waiting = True
        self._line.put(None)

    def _look(self, _: None) -> None:
        with self._lock:
            self._is_waiting = False
        snapshot = self._take()
        view, last = self._look_at(snapshot), self._last
        self._last = view
        self._wake_at(view.next_s)
        if last is None or last.seen != view.seen:
            self._tell(snapshot, view.seen)

    def _wake_at(self, instant_s: float) -> None:
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            self._timer = None if self._is_closed else self._clock.call_at(instant_s, self.changed)

    def _close(self, end: Callable[[], None]) -> None:
        with self._lock:
            self._is_closed = True
            if self._timer is not None:
                self._timer.cancel()
        end()


class Watches:
    """All that look at one graph, by what must be touched before they see something else."""

    def __init__(self) -> None:
        """Watch nothing yet."""
        self._of: dict[Touched, tuple[Watch[Any], ...]] = {}
        self._lock = threading.Lock()

    def add(self, watch: Watch[Any], touched: Iterable[Touched]) -> None:
        """Let a watch look whenever something of this is touched."""
        with self._lock:
            for each in touched:
                self._of[each] = (*self._of.get(each, ()), watch)

    def remove(self, watch: Watch[Any], touched: Iterable[Touched]) -> None:
        """Let a watch look no more."""
        with self._lock:
            for each in touched:
                left = tuple(other for other in self._of.get(each, ()) if other is not watch)
                if left:
                    self._of[each] = left
                else:
                    self._of.pop(each, None)

    def changed(self, touched: Iterable[Touched]) -> None:
        """Let all look for whom something may be different."""
        of = self._of
        if not of:
            return
        woken: dict[Watch[Any], None] = {}
        for kind, name in touched:
            for key in ((kind, name), (kind, ANY), (ANY, name)):
                for watch in of.get(key, ()):
                    woken[watch] = None
        for watch in woken:
            watch.changed()


def of_matches(
    schema: GraphSchema, patterns: Sequence[Pattern], callback: Callable[[Change], object]
) -> tuple[Callable[[Snapshot], View[tuple[Match, ...]]], Callable[[Snapshot, tuple[Match, ...]], None]]:
    """Return how a watch of patterns looks and tells."""
    _check_callback(callback)

    def look(snapshot: Snapshot) -> View[tuple[Match, ...]]:
        return View(snapshot.match(*patterns), next_s(snapshot, schema, patterns))

    before: dict[Match, None] = {}

    def tell(snapshot: Snapshot, present: tuple[Match, ...]) -> None:
        new = tuple(match for match in present if match not in before)
        over = tuple(match for match in before if match not in present)
        before.clear()
        before.update(dict.fromkeys(present))
        if new or over:
            callback(Change(snapshot, present, new, over))

    return look, tell


def of_wakes(
    schema: GraphSchema, wakes: Sequence[Pattern], callback: Callable[[Change], object]
) -> tuple[Callable[[Snapshot], View[_Woken]], Callable[[Snapshot, _Woken], None]]:
    """Return how a watch of what wakes an agent looks and tells: each pattern wakes by itself, when it comes to hold.

    An edge that was deleted and drawn again is another edge, so a task that is asked for once more wakes once more.
    An agent that nothing wakes is called once, and is active from then on.
    """
    _check_callback(callback)

    def look(snapshot: Snapshot) -> View[_Woken]:
        seen = tuple(
            (number, match, tuple(_number_of(snapshot, key) for key in match.edges))
            for number, pattern in enumerate(wakes)
            for match in snapshot.match(pattern)
        )
        return View(seen, min((next_s(snapshot, schema, [pattern]) for pattern in wakes), default=math.inf))

    before: _Woken = ()

    def tell(snapshot: Snapshot, present: _Woken) -> None:
        nonlocal before
        new = tuple(each[1] for each in present if each not in before)
        over = tuple(each[1] for each in before if each not in present)
        before = present
        if new or not wakes:
            callback(Change(snapshot, tuple(each[1] for each in present), new, over))

    return look, tell


def _number_of(snapshot: Snapshot, key: EdgeKey) -> int:
    edge = snapshot.edge_of(key)
    return -1 if edge is None else edge.number


def of_attribute(
    name: str, attribute: str, callback: Callable[[Reading[Any]], object]
) -> tuple[Callable[[Snapshot], View[Reading[Any] | None]], Callable[[Snapshot, Reading[Any] | None], None]]:
    """Return how a watch of one attribute looks and tells; of a node that is not there it tells nothing."""
    _check_callback(callback)

    def look(snapshot: Snapshot) -> View[Reading[Any] | None]:
        if name not in snapshot:
            return View(None)
        reading = snapshot.get(name, attribute)
        return View(reading, reading.expires_s if reading.known else math.inf)

    def tell(_: Snapshot, reading: Reading[Any] | None) -> None:
        if reading is not None:
            callback(reading)

    return look, tell


def _check_callback(callback: object) -> None:
    if not callable(callback):
        raise TypeError(f"what is called back is a function, not {callback!r}")
