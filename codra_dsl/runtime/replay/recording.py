"""The events of a journal for a replay, read once, from the start to the end, and only as far as the replay needs them.

A replay passes the inputs of a run to a context manager, and compares the events that this context manager derives with
the other events. The events between two inputs follow from the first input, and from what jobs reported and called
meanwhile. Therefore a recording is read up to the next input of a program before an input is passed.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import islice
from typing import Self

from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.reader import JournalReader, RawMessage
from codra_dsl.runtime.journal.schemas import kind_of

_USED_KINDS = frozenset({Kind.INPUT, Kind.DECISION, Kind.PREVIEW})
"""Kinds whose events are decoded when they are read."""

_WHAT_KEY = b'"what":'
_STARTED = b'"started"'
_MAX_DELAY_S = 60.0
_MAX_DELAY_AT_END_S = 1.0
_MAX_INPUTS_BEFORE_LATE_STEP = 10_000


class RecordedEvent:
    """An event of a journal, which is decoded only if it is needed.

    Attributes:
        kind: the kind of the event.
    """

    __slots__ = ("_data", "_decode", "_event", "kind")

    def __init__(self, kind: Kind, data: bytes, decode: Callable[[], Event | None]) -> None:
        self.kind = kind
        self._data = data
        self._decode = decode
        self._event: Event | None = None

    @property
    def is_job_end(self) -> bool:
        """Return whether the event may be the end of a job."""
        if self.kind is not Kind.JOB:
            return False
        what_position = self._data.find(_WHAT_KEY) + len(_WHAT_KEY)  # a result of the job may have the same key, later
        return not self._data.startswith(_STARTED, what_position)

    @property
    def event(self) -> Event | None:
        """Return the event; None if it cannot be decoded."""
        if self._event is None:
            self._event = self._decode()
        return self._event

    def is_equal(self, event: Event) -> bool:
        """Return whether the event equals another one. Earlier versions have encoded some events differently."""
        message = message_of(event)
        if self.kind is not event.kind or self._data == message:
            return self.kind is event.kind
        return self.event is not None and message_of(self.event) == message


class Recording:
    """The events of a journal, in order.

    Attributes:
        kinds: the kinds of events that the journal has.
        on_job_event: called with each event about a job's evidence or end, when it is read; after `expect_nothing`,
            also with each start of a job.
        on_decision: called with each event of a decision or preview, when it is read.
        calls: for each job, the inputs that are calls of its function; after `expect_nothing`, such calls are inputs as
            all others. The key is the number of the job.
    """

    def __init__(self, kinds: Iterable[Kind], events: Iterator[RecordedEvent]) -> None:
        """Store the arguments.

        Args:
            kinds: the kinds of events that the journal has.
            events: the events, in order.
        """
        # Every replay needs the events of jobs. So a journal without them is the journal of a run without jobs.
        self.kinds = frozenset({*kinds, Kind.JOB})
        self.on_job_event: Callable[[Event], None] = lambda _: None
        self.on_decision: Callable[[Event], None] = lambda _: None
        self.calls: dict[int, list[Event]] = {}
        self._events = events
        self._failure: Exception | None = None
        self._last_event: RecordedEvent | None = None
        self._inputs: deque[tuple[Event, int]] = deque()  # with the number of expected events before the input
        self._program_input_count = 0
        self._expected_events: deque[RecordedEvent] = deque()
        self._expected_event_count = 0
        self._expected_event_count_before_input = 0
        self._is_expecting = True
        self._late_steps: set[int] = set()

    @classmethod
    def of(cls, events: Sequence[Event]) -> Self:
        """Return a recording of events in memory."""
        return cls({event.kind for event in events}, map(_recorded_event, events))

    @classmethod
    def of_file(
        cls,
        reader: JournalReader,
        kinds: Iterable[Kind],
        to_s: float = math.inf,
        max_messages: int | None = None,
    ) -> Self:
        """Return a recording of a journal's file, up to an instant.

        Args:
            reader: a reader that has not read a message yet; it stays open.
            kinds: the kinds of events that the journal has.
            to_s: the instant.
            max_messages: the number of messages that belong to the recording, if a program is still writing the file.
        """
        messages = islice(reader.raw_messages(), max_messages)
        return cls(kinds, _recorded_events(reader, messages, to_s * 1e9 + 0.5))

    @property
    def end_s(self) -> float | None:
        """Return the instant of the last event that was read; None if there is none."""
        event = None if self._last_event is None else self._last_event.event
        return None if event is None else event.instant_s

    def take_input(self) -> tuple[Event, bool] | None:
        """Return the next input that no job's function made, and whether it is the last one of a program.

        Return None if there is none. The events up to the following input of a program have been read.
        """
        while self._program_input_count < 2 and self._read_next():
            pass
        self.check()
        if not self._inputs:
            return None
        event, self._expected_event_count_before_input = self._inputs.popleft()
        is_of_program = event.what != "evidence"
        self._program_input_count -= is_of_program
        return event, is_of_program and not self._program_input_count

    def is_late(self, step: int, due_s: float) -> bool:
        """Return whether the run may have made a step more than a tolerance after the step was due.

        A late step is an input of its own. The journal is read until it shows whether there was one, but only up to
        limits that nearly all late steps keep.
        """
        while step not in self._late_steps:
            last_input = self._inputs[-1][0] if self._inputs else None
            if last_input is not None and (
                last_input.details["step"] > step
                or last_input.instant_s > due_s + _MAX_DELAY_S
                or len(self._inputs) > _MAX_INPUTS_BEFORE_LATE_STEP
            ):
                return False
            if not self._read_next():
                return last_input is None or last_input.instant_s <= due_s + _MAX_DELAY_AT_END_S
        return True

    def expects_event_before_input(self) -> bool:
        """Return whether an event is expected that the run had before the input that was taken last."""
        while self._expected_event_count - len(self._expected_events) < self._expected_event_count_before_input:
            if self._expected_events[0].event is not None:
                return True
            self.drop_expected_event()  # it cannot be decoded
        return False

    def expect_nothing(self) -> None:
        """From now on, keep no events for a comparison, because the replay has differed from the run."""
        self._is_expecting = False
        for recorded_event in self._expected_events:
            if recorded_event.kind is Kind.JOB and not recorded_event.is_job_end and recorded_event.event is not None:
                self.on_job_event(recorded_event.event)
        self._expected_events.clear()

    def check(self) -> None:
        """Raise the error that ended the reading of the journal; do nothing if there was none."""
        if self._failure is not None:
            raise self._failure

    def next_expected_event(self) -> RecordedEvent | None:
        """Return the next event that is not an input; None at the end of the journal."""
        while not self._expected_events and self._read_next():
            pass
        return self._expected_events[0] if self._expected_events else None

    def next_readable_event(self) -> RecordedEvent | None:
        """Drop the next events that cannot be decoded; return the next event that is not an input, or None."""
        while (recorded_event := self.next_expected_event()) is not None and recorded_event.event is None:
            self.drop_expected_event()
        return recorded_event

    def drop_expected_event(self) -> None:
        """Go to the event after the next one that is not an input."""
        self._expected_events.popleft()

    def _read_next(self) -> bool:
        """Read an event; return False at the end of the journal, or at the first event that no run has written.

        Events are also read within ticks, which contain all errors. Therefore an error is kept for `check`.
        """
        try:
            recorded_event = None if self._failure is not None else next(self._events, None)
            if recorded_event is not None:
                self._add(recorded_event)
        except Exception as error:  # noqa: BLE001 - forged journals can cause any error
            self._failure, recorded_event = error, None
        return recorded_event is not None

    def _add(self, recorded_event: RecordedEvent) -> None:
        self._last_event = recorded_event
        if recorded_event.kind is not Kind.INPUT and self._is_expecting:
            self._expected_events.append(recorded_event)
            self._expected_event_count += 1
        is_used = recorded_event.kind in _USED_KINDS or recorded_event.is_job_end
        is_job_start = recorded_event.kind is Kind.JOB and not self._is_expecting
        event = recorded_event.event if is_used or is_job_start else None
        if event is None:
            return
        if event.kind in (Kind.DECISION, Kind.PREVIEW):
            self.on_decision(event)
        if "index" in event.details:
            self.on_job_event(event)
        if event.kind is Kind.INPUT and "work" in event.details and self._is_expecting:
            self.calls.setdefault(event.details["work"], []).append(event)
        elif event.kind is Kind.INPUT:
            self._inputs.append((event, self._expected_event_count))
            if event.what == "late":
                self._late_steps.add(event.details["step"])
            self._program_input_count += event.what != "evidence"


def _recorded_events(
    reader: JournalReader, raw_messages: Iterable[RawMessage], last_ns: float
) -> Iterator[RecordedEvent]:
    for raw_message in raw_messages:
        message, kind = raw_message.message, kind_of(raw_message.channel.topic)
        if message.log_time > last_ns:
            return
        if kind is not None:
            yield RecordedEvent(kind, message.data, partial(reader.event, raw_message))


def _recorded_event(event: Event) -> RecordedEvent:
    return RecordedEvent(event.kind, message_of(event), lambda: event)
