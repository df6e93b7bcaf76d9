"""The latest events of a journal's file at any instant, found in the file when they are needed.

Each subject has a topic, and the index of the file states which chunks have messages of a topic. Therefore the last
events of a subject are found backwards from the end, without reading the other chunks. Only the events about knowledge
and adaptation share topics. They are read forwards, and copies of the latest events are kept at some chunks.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Generic, TypeVar

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.latest_events import JOB_END_NAMES, EventsAfterReading, LatestEvents
from codra_dsl.runtime.journal.reader import JournalReader, RawMessage
from codra_dsl.runtime.journal.schemas import topic_of
from codra_dsl.runtime.journal.spec_summary import SpecSummary

_MAX_KEPT_CHUNKS = 16
_MAX_CHECKPOINTS = 64
_CHUNK_TIME_TOLERANCE_S = 0.001
"""Instants are stored in nanoseconds as well, which rounds them."""

_CLOSE_FIELD = b'"what":"close"'
_SHARED_TOPICS = (topic_of(Kind.KNOWLEDGE, ""), topic_of(Kind.ADAPTATION, ""))

EventsT = TypeVar("EventsT")
Position = tuple[int, int]
"""The number of a chunk, and the number of a message in this chunk."""


class EventsInFile:
    """The events of a journal's file.

    Attributes:
        summary: the spec summary of the journal.
        end_s: the instant of the last event; None if the file has no event.
    """

    def __init__(self, reader: JournalReader, summary: SpecSummary, *, ends_before_close: bool = True) -> None:
        """Read the index of a file.

        Args:
            reader: a journal's reader that has not read a message yet; it must stay open while this object is used.
            summary: the spec summary of the journal.
            ends_before_close: whether to leave out the events of the step that closed the context manager, because this
                step stops all observers.

        Raises:
            JournalError: if the file exceeds a limit; other methods raise it as well.
            OSError: if the file cannot be read.
        """
        self.summary = summary
        self._reader = reader
        self._chunks = reader.index()
        self._channel_ids = reader.channel_ids()
        self._messages_of: Callable[[int, frozenset[int] | None], list[tuple[int, RawMessage]]]
        self._messages_of = lru_cache(_MAX_KEPT_CHUNKS)(self._read_chunk)
        self._kept_events: dict[Position, Event] = {}
        self._unreadable_positions: set[Position] = set()
        self._checkpoints: list[tuple[int, LatestEvents]] = [(0, LatestEvents())]
        file_end = (len(self._chunks), 0)
        last_event = next((event for _, event in self._events_before(file_end)), None)
        self.end_s = None if last_event is None else last_event.instant_s
        self._end = self._position_of_close(file_end) if ends_before_close else file_end

    def latest_events(self, until_s: float) -> LatestEventsInFile:
        """Return the latest events up to an instant."""
        return LatestEventsInFile(self, min(self._position_after(until_s), self._end))

    def find(self, end: Position, topic: str, is_wanted: Callable[[Event], bool]) -> tuple[Position, Event] | None:
        """Return the last wanted event of a topic before a position, with its own position; None if there is none.

        The same event is always the same object.
        """
        for position, event in self.before(end, topic):
            if is_wanted(event):
                return position, self._kept_events.setdefault(position, event)
        return None

    def before(self, end: Position, *topics: str) -> Iterator[tuple[Position, Event]]:
        """Yield the events of some topics before a position, with their positions, the last one first."""
        return self._events_before(end, frozenset().union(*(self._channel_ids.get(topic, ()) for topic in topics)))

    def shared_events(self, end: Position) -> LatestEvents:
        """Return the latest events about knowledge and adaptation before a position."""
        channel_ids = frozenset().union(*(self._channel_ids.get(topic, ()) for topic in _SHARED_TOPICS))
        first = bisect_right(self._checkpoints, end[0], key=lambda checkpoint: checkpoint[0]) - 1
        first_chunk, checkpoint = self._checkpoints[first]
        latest_events = checkpoint.copy()
        for chunk_number in range(first_chunk, min(end[0] + 1, len(self._chunks))):
            if (chunk_number - self._checkpoints[-1][0]) * _MAX_CHECKPOINTS > len(self._chunks):
                self._checkpoints.append((chunk_number, latest_events.copy()))
            for number, raw_message in self._messages_with(chunk_number, channel_ids):
                event = self._event(chunk_number, number, raw_message) if (chunk_number, number) < end else None
                if event is not None:
                    latest_events.add(event)
        return latest_events

    # Internal

    def _read_chunk(self, chunk_number: int, channel_ids: frozenset[int] | None) -> list[tuple[int, RawMessage]]:
        return self._reader.messages_in(self._chunks[chunk_number], channel_ids)

    def _event(self, chunk_number: int, number: int, raw_message: RawMessage) -> Event | None:
        """Return the event of a message, or None; a message that cannot be read is reported only once."""
        position = (chunk_number, number)
        event = None if position in self._unreadable_positions else self._reader.event(raw_message)
        if event is None:
            self._unreadable_positions.add(position)
        return event

    def _messages_with(self, chunk_number: int, channel_ids: frozenset[int] | None) -> list[tuple[int, RawMessage]]:
        """Return the messages of a chunk in some channels, or in all, with their numbers."""
        if channel_ids is not None and channel_ids.isdisjoint(self._chunks[chunk_number].channel_ids):
            return []
        return self._messages_of(chunk_number, channel_ids)

    def _messages_before(
        self, end: Position, channel_ids: frozenset[int] | None
    ) -> Iterator[tuple[Position, RawMessage]]:
        for chunk_number in range(min(end[0], len(self._chunks) - 1), -1, -1):
            for number, raw_message in reversed(self._messages_with(chunk_number, channel_ids)):
                if (chunk_number, number) < end:
                    yield (chunk_number, number), raw_message

    def _events_before(
        self, end: Position, channel_ids: frozenset[int] | None = None
    ) -> Iterator[tuple[Position, Event]]:
        for position, raw_message in self._messages_before(end, channel_ids):
            event = self._event(*position, raw_message)
            if event is not None:
                yield position, event

    def _position_after(self, until_s: float) -> Position:
        """Return the position after the last event up to an instant; the instants of a run never decrease."""
        latest_s = max(until_s, 0.0) + _CHUNK_TIME_TOLERANCE_S  # a negative instant is stored as 0
        after = (bisect_right(self._chunks, latest_s, key=lambda chunk: chunk.start_s), 0)
        for position, raw_message in self._messages_before(after, None):
            event = self._event(*position, raw_message) if raw_message.message.log_time / 1e9 <= latest_s else None
            if event is not None and event.instant_s <= until_s:
                return position[0], position[1] + 1
        return 0, 0

    def _position_of_close(self, file_end: Position) -> Position:
        """Return the position of the input that closed the context manager; the end of the file if there is none.

        All later events have the same instant, because closing is one step.
        """
        position_of_close, input_ids = file_end, self._channel_ids.get(topic_of(Kind.INPUT, ""), frozenset())
        last_ns = None
        for position, raw_message in self._messages_before(file_end, None):
            message = raw_message.message
            last_ns = message.log_time if last_ns is None else last_ns
            if message.log_time < last_ns:
                break
            if message.channel_id in input_ids and _CLOSE_FIELD in message.data:
                position_of_close = position
        return position_of_close


class LazyEventsByName(Generic[EventsT]):
    """Finds the events of a subject when they are first needed."""

    def __init__(self, find: Callable[[str], EventsT | None]) -> None:
        self._find = find
        self._events_by_name: dict[str, EventsT | None] = {}

    def get(self, name: str) -> EventsT | None:
        """Return the events of a subject; None if there are none."""
        if name not in self._events_by_name:
            self._events_by_name[name] = self._find(name)
        return self._events_by_name[name]


class LatestEventsInFile:
    """The latest events before a position in a file; `LatestEventsView` describes the attributes."""

    def __init__(self, file: EventsInFile, end: Position) -> None:
        self._file = file
        self._end = end
        self._shared_events: LatestEvents | None = None
        self._present = LazyEventsByName(lambda name: self._find_reading(name, is_value=False))
        self._last_value = LazyEventsByName(lambda name: self._find_reading(name, is_value=True))
        self.present_events = LazyEventsByName(lambda name: _event_of(self._present.get(name)))
        self.override_events = LazyEventsByName(lambda name: self._find_last(Kind.OVERRIDE, name))
        self.decision_events = LazyEventsByName(lambda name: self._find_last(Kind.DECISION, name))
        self.last_value_events = LazyEventsByName(lambda name: _event_of(self._last_value.get(name)))
        self.basis_jobs = LazyEventsByName(self._find_basis_job)
        self.later_events = LazyEventsByName(self._find_later_events)
        self.observer_events = LazyEventsByName(lambda name: self._find_last(Kind.OBSERVER, name))
        self.host_events = LazyEventsByName(lambda name: self._find_last(Kind.HOST, name))
        self.declaration_events = LazyEventsByName(lambda name: self._find_last(Kind.DECLARATION, name))
        self.expectation_events = LazyEventsByName(lambda name: self._find_last(Kind.EXPECTATION, name))
        self.job_starts = LazyEventsByName(lambda name: self._find_last(Kind.JOB, name, {"started"}))
        self.job_ends = LazyEventsByName(lambda name: self._find_last(Kind.JOB, name, JOB_END_NAMES))

    @property
    def knowledge_events(self) -> Mapping[str, Mapping[str, Event]]:
        """Return the last event of each `what` for each element of the knowledge graph."""
        return self._shared().knowledge_events

    @property
    def adaptation_events(self) -> Mapping[str, Mapping[str, Event]]:
        """Return the last adaptation event of each `what`."""
        return self._shared().adaptation_events

    def _shared(self) -> LatestEvents:
        if self._shared_events is None:
            self._shared_events = self._file.shared_events(self._end)
        return self._shared_events

    def _find_last(self, kind: Kind, name: str, what_values: frozenset[str] | set[str] | None = None) -> Event | None:
        topic = topic_of(kind, name)
        return _event_of(
            self._file.find(self._end, topic, lambda event: what_values is None or event.what in what_values)
        )

    def _find_reading(self, variable: str, *, is_value: bool) -> tuple[Position, Event] | None:
        return self._file.find(
            self._end,
            topic_of(Kind.VARIABLE, variable),
            lambda event: bool(event.details.get("present")) and (not is_value or event.what == "identified"),
        )

    def _find_basis_job(self, variable: str) -> Event | None:
        last_value = self._last_value.get(variable)
        if last_value is None:
            return None
        position, event = last_value
        topic = topic_of(Kind.JOB, event.details["source"])
        job = _event_of(self._file.find(position, topic, lambda job: job.what in JOB_END_NAMES))
        return job if job is not None and job.what == "returned" else None

    def _find_later_events(self, variable: str) -> EventsAfterReading | None:
        present = self._present.get(variable)
        start = (-1, 0) if present is None else present[0]
        algorithms = self._file.summary.find_algorithms(variable)
        topics = [topic_of(Kind.VARIABLE, variable), *(topic_of(Kind.JOB, algorithm.name) for algorithm in algorithms)]
        events = list[Event]()
        for position, event in self._file.before(self._end, *topics):
            if position <= start:
                break
            if event.kind is Kind.VARIABLE or (event.what == "rejected" and variable in event.details["variables"]):
                events.append(event)
        later_events = EventsAfterReading()
        for event in reversed(events):
            later_events.add(event)
        return later_events if events else None


def _event_of(position_and_event: tuple[Position, Event] | None) -> Event | None:
    return None if position_and_event is None else position_and_event[1]
