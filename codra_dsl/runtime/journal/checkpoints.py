"""The latest events of a journal's file at any instant, without all events in memory.

The file is read once, up to the latest instant of interest. The latest events are kept as checkpoints at some offsets;
for an earlier instant, the file is read again from the last checkpoint before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.journal.reader import JournalReader, RawMessage
from codra_dsl.runtime.journal.schemas import kind_of

_PLACES = 64
"""The maximum number of checkpoints of a file."""

_NEEDED = frozenset(Kind) - {Kind.INPUT, Kind.DECISION}
_CLOSE = b'"what":"close"'


class Checkpoints:
    """A journal's file up to an instant or, by default, up to where the observers stopped because the run ended.

    Attributes:
        end_s: the instant of the last message that was read; None if the file has no event.
    """

    def __init__(self, reader: JournalReader, until_s: float = math.inf) -> None:
        """Read a file.

        Args:
            reader: a journal's reader before its first message; it must stay open while this object is used.
            until_s: the latest instant that will be passed to `latest_events`.

        Raises:
            OSError: if it cannot be read.
        """
        self._reader = reader
        self._last = LatestEvents()
        self._places: list[tuple[int, LatestEvents]] = []
        self._until_s = until_s
        self.end_s: float | None = None
        self._read()

    def latest_events(self, until_s: float) -> LatestEvents:
        """Return the latest events up to an instant."""
        if until_s >= self._last.until_s:
            return self._last
        place, latest_events = next(entry for entry in reversed(self._places) if entry[1].until_s <= until_s)
        return LatestEvents.of(self._needed(self._reader.notes_from(place)), until_s, latest_events)

    def _read(self) -> None:
        far, last, has_closed = max(self._reader.size() // _PLACES, 1), None, False
        for note in self._reader.notes():
            place = self._reader.place
            if not self._places or place >= self._places[-1][0] + far:
                self._places.append((place, self._last.copy()))
            kind, last = kind_of(note.channel.topic), note
            has_closed = has_closed or (self._until_s == math.inf and _is_close(kind, note))
            event = self._reader.event(note) if kind in _NEEDED and not has_closed else None
            if event is not None and event.instant_s > self._until_s:
                break
            if event is not None:
                self._last.take(event)
        last_event = None if last is None else self._reader.event(last)
        self.end_s = None if last_event is None else last_event.instant_s

    def _needed(self, notes: Iterator[RawMessage]) -> Iterator[Event]:
        chosen = (note for note in notes if kind_of(note.channel.topic) in _NEEDED)
        return (event for note in chosen if (event := self._reader.event(note)) is not None)


def _is_close(kind: Kind | None, note: RawMessage) -> bool:
    return kind is Kind.INPUT and _CLOSE in note.message.data
