"""What the events of a journal's file come to, at any instant, without all of them in memory.

The file is read once, as far as the question goes. What its events come to is kept at some places on the way; for an
earlier instant the file is read again from the last of them before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.ledger import Ledger
from codra_dsl.runtime.journal.reading import JournalReader, Note
from codra_dsl.runtime.journal.schemas import kind_of

_PLACES = 64
"""At how many places of a file is kept what its events come to, at most."""

_NEEDED = frozenset(Kind) - {Kind.INPUT, Kind.DECISION}
_CLOSE = b'"what":"close"'


class Past:
    """A journal's file up to an instant, or else up to where the observers stopped because the run ended.

    Attributes:
        end_s: the instant of the last message that was read; None if there is no event.
    """

    def __init__(self, reader: JournalReader, until_s: float = math.inf) -> None:
        """Read a file.

        Args:
            reader: of a journal, of which nothing has been read yet; it stays open as long as questions are asked.
            until_s: the latest instant that will be asked about.

        Raises:
            OSError: if it cannot be read.
        """
        self._reader = reader
        self._last = Ledger()
        self._places: list[tuple[int, Ledger]] = []
        self._until_s = until_s
        self.end_s: float | None = None
        self._read()

    def ledger(self, until_s: float) -> Ledger:
        """Return what the events up to an instant come to."""
        if until_s >= self._last.until_s:
            return self._last
        place, ledger = next(each for each in reversed(self._places) if each[1].until_s <= until_s)
        return Ledger.of(self._needed(self._reader.notes_from(place)), until_s, ledger)

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
        found = None if last is None else self._reader.event(last)
        self.end_s = None if found is None else found.instant_s

    def _needed(self, notes: Iterator[Note]) -> Iterator[Event]:
        chosen = (note for note in notes if kind_of(note.channel.topic) in _NEEDED)
        return (event for note in chosen if (event := self._reader.event(note)) is not None)


def _is_close(kind: Kind | None, note: Note) -> bool:
    return kind is Kind.INPUT and _CLOSE in note.message.data
