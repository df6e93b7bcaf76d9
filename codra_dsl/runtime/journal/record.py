"""What happened in a run, in order: the one place through which every event goes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reading
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.ledger import Ledger

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.head import Head

_Noted = Reading[Value] | tuple[float, Reading[Value], bool]
"""That a variable has a reading: when it was told, and whether it is the present one. Alone it is, from the first."""

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
        self._events: list[Event | _Noted] = []
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

    def note_reading(self, instant_s: float, reading: Reading[Value], is_present: bool) -> None:
        """Add that a variable has a reading; it becomes an event when somebody asks for it."""
        is_told_by_itself = is_present and reading.identified_s == instant_s
        self._events.append(reading if is_told_by_itself else (instant_s, reading, is_present))
        if len(self._events) >= self._most:
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
        self._note_reading = record.note_reading if type(record).add is Record.add else self._add_reading
        self._record = record
        self._clock = clock
        self._place = place

    def tell(self, kind: Kind, name: str, what: str, /, **details: object) -> None:
        """Add an event that happens now."""
        self._record.add(Event(self._clock.now_s(), kind, name, what, details))

    def tell_reading(self, reading: Reading[Value], is_present: bool) -> None:
        """Add that a variable has a reading, as its present one or in its history only."""
        self._note_reading(self._clock.now_s(), reading, is_present)

    def tell_input(self, name: str, what: str, /, **details: object) -> None:
        """Add that something reached the context manager from outside, if the record wants to know."""
        if self.takes_inputs:
            self.tell(Kind.INPUT, name, what, **self._place(), **details)

    def _add_reading(self, instant_s: float, reading: Reading[Value], is_present: bool) -> None:
        """Add it as an event at once, for a record that does more than keep it."""
        self._record.add(_event((instant_s, reading, is_present)))


def _event(told: Event | _Noted) -> Event:
    """Return an event, which is made here of what was only noted."""
    if isinstance(told, Event):
        return told
    instant_s, reading, is_present = (told.identified_s, told, True) if isinstance(told, Reading) else told
    details = {
        "value": reading.content,
        "reason": reading.reason,
        "detail": reading.detail,
        "evidence_s": reading.evidence_s,
        "source": reading.source,
        "present": is_present,
    }
    return Event(instant_s, Kind.VARIABLE, reading.name, "identified" if reading.known else "unknown", details)
