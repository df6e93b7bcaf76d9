"""What happened in a run, in order: the one place through which every event goes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reading, Reason
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.ledger import Ledger

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.head import Head

Noted = tuple[float, str, Value | None, Reason | None, str, float, str, bool]
"""That a variable has a reading, before somebody asks for the event: when, and what of the reading is told.

Python's collector never looks again at a tuple of plain values; at as many readings or events it would, for long.
"""

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
        self._most = 2 * limit
        self._events: list[Event | Noted] = []
        self._dropped = Ledger()

    def __iter__(self) -> Iterator[Event]:
        return map(_event, tuple(self._events))

    def __len__(self) -> int:
        return len(self._events)

    def begin(self, head: Callable[[], Head]) -> None:
        """Take note that a run begins; `head` tells what runs."""

    def add(self, event: Event) -> None:
        """Add an event."""
        self._events.append(event)
        if len(self._events) >= self._most:
            self._drop()

    def note(self, told: Noted) -> None:
        """Add that a variable has a reading; it becomes an event when somebody asks for it."""
        self._events.append(told)
        if len(self._events) >= self._most:
            self._drop()

    def end(self) -> None:
        """Take note that the run has ended."""

    def of(self, kind: Kind, name: str | None = None) -> tuple[Event, ...]:
        """Return the events of one kind, in order; of one name alone, if one is given."""
        return tuple(map(_event, _of(tuple(self._events), kind, name)))

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
        return Ledger.of(map(_event, self._events), until_s, self._dropped)

    def _drop(self) -> None:
        surplus = len(self._events) - int(self.limit)
        for event in self._events[:surplus]:
            self._dropped.take(_event(event))
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
        self._note = record.note if type(record).add is Record.add else self._add_at_once
        self._record = record
        self._clock = clock
        self._place = place

    def tell(self, kind: Kind, name: str, what: str, /, **details: object) -> None:
        """Add an event that happens now."""
        self._record.add(Event(self._clock.now_s(), kind, name, what, details))

    def tell_reading(self, instant_s: float, reading: Reading[Value], is_present: bool) -> None:
        """Add that a variable has a reading, as its present one or in its history only."""
        content, reason, detail = reading.content, reading.reason, reading.detail
        self._note((instant_s, reading.name, content, reason, detail, reading.evidence_s, reading.source, is_present))

    def tell_input(self, name: str, what: str, /, **details: object) -> None:
        """Add that something reached the context manager from outside, if the record wants to know."""
        if self.takes_inputs:
            self.tell(Kind.INPUT, name, what, **self._place(), **details)

    def _add_at_once(self, told: Noted) -> None:
        """Add an event, for a record that does more than keep it."""
        self._record.add(_event(told))


def _of(events: Sequence[Event | Noted], kind: Kind, name: str | None) -> list[Event | Noted]:
    """Return the events of one kind, and of one name if one is given; there may be very many."""
    is_noted = kind is Kind.VARIABLE
    if name is None:
        return [told for told in events if (is_noted if isinstance(told, tuple) else told.kind is kind)]
    return [
        told
        for told in events
        if (is_noted and told[1] == name if isinstance(told, tuple) else told.kind is kind and told.name == name)
    ]


def _event(told: Event | Noted) -> Event:
    """Return an event, which is made here of what was only noted."""
    if isinstance(told, Event):
        return told
    instant_s, name, content, reason, detail, evidence_s, source, is_present = told
    details = {
        "value": content,
        "reason": reason,
        "detail": detail,
        "evidence_s": evidence_s,
        "source": source,
        "present": is_present,
    }
    return Event(instant_s, Kind.VARIABLE, name, "identified" if reason is None else "unknown", details)
