"""The latest events of a journal's file at any instant, without holding all events in memory.

The file is read once, up to the latest instant of interest. At some offsets, the latest events are kept as a
checkpoint. For an instant before the latest one, the file is read again from the last checkpoint before this instant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.journal.reader import JournalReader, RawMessage
from codra_dsl.runtime.journal.schemas import kind_of

_MAX_CHECKPOINTS = 64
"""The maximum number of checkpoints of a file."""

_STATE_EVENT_KINDS = frozenset(Kind) - {Kind.INPUT, Kind.DECISION}
_CLOSE_FIELD = b'"what":"close"'


class Checkpoints:
    """A journal's file, up to an instant. By default, this is the end of the run, before the observers are stopped.

    Attributes:
        end_s: the instant of the last message that was read; None if the file has no event.
    """

    def __init__(self, reader: JournalReader, until_s: float = math.inf) -> None:
        """Read a file.

        Args:
            reader: a journal's reader that has not read a message yet; it must stay open while this object is used.
            until_s: the latest instant that will be passed to `latest_events`.

        Raises:
            OSError: if the file cannot be read.
        """
        self._reader = reader
        self._latest_events = LatestEvents()
        self._checkpoints: list[tuple[int, LatestEvents]] = []
        self._until_s = until_s
        self.end_s: float | None = None
        self._read_file()

    def latest_events(self, until_s: float) -> LatestEvents:
        """Return the latest events up to an instant."""
        if until_s >= self._latest_events.until_s:
            return self._latest_events
        earlier_checkpoints = (
            checkpoint for checkpoint in reversed(self._checkpoints) if checkpoint[1].until_s <= until_s
        )
        chunk_offset, latest_events = next(earlier_checkpoints)
        return LatestEvents.of(self._state_events(self._reader.raw_messages_from(chunk_offset)), until_s, latest_events)

    def _read_file(self) -> None:
        min_distance_bytes, last_message, has_closed = max(self._reader.size() // _MAX_CHECKPOINTS, 1), None, False
        for raw_message in self._reader.raw_messages():
            chunk_offset = self._reader.chunk_offset
            if not self._checkpoints or chunk_offset >= self._checkpoints[-1][0] + min_distance_bytes:
                self._checkpoints.append((chunk_offset, self._latest_events.copy()))
            kind, last_message = kind_of(raw_message.channel.topic), raw_message
            is_close_command = kind is Kind.INPUT and _CLOSE_FIELD in raw_message.message.data
            has_closed = has_closed or (self._until_s == math.inf and is_close_command)
            event = self._reader.event(raw_message) if kind in _STATE_EVENT_KINDS and not has_closed else None
            if event is not None and event.instant_s > self._until_s:
                break
            if event is not None:
                self._latest_events.add(event)
        last_event = None if last_message is None else self._reader.event(last_message)
        self.end_s = None if last_event is None else last_event.instant_s

    def _state_events(self, raw_messages: Iterator[RawMessage]) -> Iterator[Event]:
        state_messages = (
            raw_message for raw_message in raw_messages if kind_of(raw_message.channel.topic) in _STATE_EVENT_KINDS
        )
        return (event for raw_message in state_messages if (event := self._reader.event(raw_message)) is not None)
