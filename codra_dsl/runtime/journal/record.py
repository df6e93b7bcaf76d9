"""What happened in a run, in order: the one place through which every event goes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.ledger import Ledger

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.head import Head

KEPT = 100_000
"""Events that a record keeps by default: some twenty minutes of a busy robot, and some 100 MB at most."""


class Record:
    """The events of a run in memory, the newest if there are very many.

    Attributes:
        limit: how many events are kept at least.
        takes_inputs: whether it wants to be told events of `Kind.INPUT`.
    """

    takes_inputs = False

    def __init__(self, limit: float = KEPT) -> None:
        self.limit = limit
        self._events: list[Event] = []
        self._dropped = Ledger()

    def __iter__(self) -> Iterator[Event]:
        return iter(tuple(self._events))

    def __len__(self) -> int:
        return len(self._events)

    def begin(self, head: Callable[[], Head]) -> None:
        """Take note that a run begins; `head` tells what runs."""

    def add(self, event: Event) -> None:
        """Add an event."""
        self._events.append(event)
        if len(self._events) >= 2 * self.limit:
            self._drop()

    def end(self) -> None:
        """Take note that the run has ended."""

    def of(self, kind: Kind) -> tuple[Event, ...]:
        """Return the events of one kind, in order."""
        return tuple(event for event in self if event.kind is kind)

    def text(self) -> str:
        """Return the record as JSON lines."""
        return "".join(f"{event.as_json()}\n" for event in self)

    def copy(self) -> Record:
        """Return what is in memory now, as a record that does not grow; whoever asks keeps others from adding."""
        copied = Record(math.inf)
        copied._events, copied._dropped = self._events.copy(), self._dropped.copy()
        return copied

    def ledger(self, until_s: float) -> Ledger:
        """Return what the events up to an instant come to.

        Raises:
            ValueError: if the events of that time are not kept any more.
        """
        if self._dropped.until_s > until_s:
            raise ValueError(f"events from before {self._dropped.until_s} s are not kept any more: ask the journal")
        return Ledger.of(self._events, until_s, self._dropped)

    def _drop(self) -> None:
        surplus = len(self._events) - int(self.limit)
        for event in self._events[:surplus]:
            self._dropped.take(event)
        del self._events[:surplus]


class Scribe:
    """Adds what happens to a record, at the instant that a clock shows.

    Attributes:
        takes_inputs: whether the record wants to be told events of `Kind.INPUT`.
    """

    def __init__(
        self, record: Record, clock: Clock, place: Callable[[], Mapping[str, object]] = lambda: {"step": 0}
    ) -> None:
        """Write into a record.

        Args:
            record: takes the events.
            clock: tells when they happen.
            place: tells the place of an input among all that happens.
        """
        self.takes_inputs = record.takes_inputs
        self._record = record
        self._clock = clock
        self._place = place

    def tell(self, kind: Kind, name: str, what: str, /, **details: object) -> None:
        """Add an event that happens now."""
        self._record.add(Event(self._clock.now_s(), kind, name, what, details))

    def tell_input(self, name: str, what: str, /, **details: object) -> None:
        """Add that something reached the context manager from outside, if the record wants to know."""
        if self.takes_inputs:
            self.tell(Kind.INPUT, name, what, **self._place(), **details)
