"""The event log of a run, in memory; every event of a run passes through it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.values.cell import Reading, Reason

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.run_header import RunHeader

StoredReading = tuple[float, str, Value | None, Reason | None, str, float, str, bool]
"""A new reading of a variable, as a tuple of its instant and its fields. It becomes an event when events are read.

Python's garbage collector stops tracking tuples of plain values, but it would need a long time to traverse the same
number of `Reading` or `Event` objects.
"""

DEFAULT_EVENT_LIMIT = 100_000
"""The number of events that an event log keeps by default: about twenty minutes of a busy robot.

These events need about 100 MB at most.
"""


class EventLog:
    """The events of a run in memory; if there are very many, old events are dropped.

    Attributes:
        limit: at least this many of the newest events are kept.
        accepts_inputs: whether the log accepts events of `Kind.INPUT`.
    """

    accepts_inputs = False

    def __init__(self, limit: float = DEFAULT_EVENT_LIMIT) -> None:
        self.limit = limit
        self._max_events = 2 * limit
        self._events: list[Event | StoredReading] = []
        self._latest_dropped_events = LatestEvents()

    def __iter__(self) -> Iterator[Event]:
        return map(_to_event, tuple(self._events))

    def __len__(self) -> int:
        return len(self._events)

    def begin(self, make_header: Callable[[], RunHeader]) -> None:
        """Handle the beginning of a run; `make_header` returns the run header."""

    def add(self, event: Event) -> None:
        """Add an event."""
        self._events.append(event)
        if len(self._events) >= self._max_events:
            self._drop_surplus_events()

    def add_reading(self, reading: StoredReading) -> None:
        """Add a new reading of a variable. It becomes an event when events are read."""
        self._events.append(reading)
        if len(self._events) >= self._max_events:
            self._drop_surplus_events()

    def end(self) -> None:
        """Handle the end of the run."""

    def of(self, kind: Kind, name: str | None = None) -> tuple[Event, ...]:
        """Return the events of one kind in order; if a name is given, only the events with this name."""
        return tuple(map(_to_event, _select_events(tuple(self._events), kind, name)))

    def text(self) -> str:
        """Return the event log as JSON lines."""
        return "".join(f"{event.as_json()}\n" for event in self)

    def copy(self) -> EventLog:
        """Return the events in memory as a separate event log. Meanwhile, the caller must prevent additions."""
        event_log = EventLog(math.inf)
        event_log._events, event_log._latest_dropped_events = self._events.copy(), self._latest_dropped_events.copy()
        return event_log

    def latest_events(self, until_s: float, before: Event | None = None) -> LatestEvents:
        """Return the latest events up to an instant, or only those before one of the events of this log.

        Raises:
            ValueError: if the events of that time have been dropped, or the log does not have the event.
        """
        if self._latest_dropped_events.until_s > until_s:
            raise ValueError(
                f"events before {self._latest_dropped_events.until_s} s have been dropped from memory: read the journal"
            )
        events = map(_to_event, self._events)
        return LatestEvents.of(
            events if before is None else _events_before(before, tuple(events)), until_s, self._latest_dropped_events
        )

    def _drop_surplus_events(self) -> None:
        surplus_count = len(self._events) - int(self.limit)
        for event in self._events[:surplus_count]:
            self._latest_dropped_events.add(_to_event(event))
        del self._events[:surplus_count]


class EventWriter:
    """Adds events to an event log, at the current instant of a clock.

    Attributes:
        accepts_inputs: whether the event log accepts events of `Kind.INPUT`.
    """

    def __init__(
        self, event_log: EventLog, clock: Clock, find_position: Callable[[], Mapping[str, object]] = lambda: {"step": 0}
    ) -> None:
        """Write to an event log.

        Args:
            event_log: the event log.
            clock: gives the instants of the events.
            find_position: returns the details that state an input's position in the order of all events.
        """
        self.accepts_inputs = event_log.accepts_inputs
        self._add_reading = event_log.add_reading if type(event_log).add is EventLog.add else self._add_as_event
        self._event_log = event_log
        self._clock = clock
        self._find_position = find_position

    def write(self, kind: Kind, name: str, what: str, /, **details: object) -> None:
        """Add an event at the current instant."""
        self._event_log.add(Event(self._clock.now_s(), kind, name, what, details))

    def write_reading(self, instant_s: float, reading: Reading[Value], is_present: bool) -> None:
        """Add a new reading of a variable: its present reading or, if not `is_present`, only a part of its history."""
        content, reason, detail = reading.content, reading.reason, reading.detail
        self._add_reading(
            (instant_s, reading.name, content, reason, detail, reading.evidence_s, reading.source, is_present)
        )

    def write_input(self, name: str, what: str, /, **details: object) -> None:
        """Add an event for something that reached the context manager from outside, if the event log accepts inputs."""
        if self.accepts_inputs:
            self.write(Kind.INPUT, name, what, **self._find_position(), **details)

    def _add_as_event(self, reading: StoredReading) -> None:
        """Add a reading as an event, for an event log whose `add` does more than store events in memory."""
        self._event_log.add(_to_event(reading))


def _select_events(
    events: Sequence[Event | StoredReading], kind: Kind, name: str | None
) -> list[Event | StoredReading]:
    """Return the events of one kind and, if a name is given, with this name.

    Comprehensions are fast enough for very many events.
    """
    includes_readings = kind is Kind.VARIABLE
    if name is None:
        return [entry for entry in events if (includes_readings if isinstance(entry, tuple) else entry.kind is kind)]
    return [
        entry
        for entry in events
        if (
            includes_readings and entry[1] == name
            if isinstance(entry, tuple)
            else entry.kind is kind and entry.name == name
        )
    ]


def _events_before(event: Event, events: tuple[Event, ...]) -> tuple[Event, ...]:
    """Return the events before one of them; raise ValueError if it is not among them."""
    if event not in events:
        raise ValueError(f"the event log has no such event: {event.kind} {event.name} {event.what}")
    return events[: events.index(event)]


def _to_event(entry: Event | StoredReading) -> Event:
    """Return an event; if only a reading was stored, create the event from it."""
    if isinstance(entry, Event):
        return entry
    instant_s, name, content, reason, detail, evidence_s, source, is_present = entry
    details = {
        "value": content,
        "reason": reason,
        "detail": detail,
        "evidence_s": evidence_s,
        "source": source,
        "present": is_present,
    }
    return Event(instant_s, Kind.VARIABLE, name, "identified" if reason is None else "unknown", details)
