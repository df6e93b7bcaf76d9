"""Compare the events that a replay derives with those of its journal, one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from codra_dsl.runtime.journal.event_log import EventLog
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.journal.spec_summary_changes import Change
from codra_dsl.runtime.replay.decision_counts import DecisionCounts
from codra_dsl.runtime.replay.recording import RecordedEvent, Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """The first difference between a replay and its journal.

    Attributes:
        position: the position of the event among all compared events, from 1.
        recorded: the event of the journal; None if the journal has no event at this position.
        replayed: the event of the replay; None if the replay has no event at this position.
        because: why the replay could not follow the journal, e.g. a variable that the package lacks; may be empty.
        changes: the changes of the package since the run. The changes that are nearest to the event in the dependency
            graph come first.
    """

    position: int
    recorded: Event | None
    replayed: Event | None
    because: str = ""
    changes: tuple[Change, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """The result of a replay.

    Attributes:
        compared: the number of equal events.
        derived: the number of derived events by kind, including the events after a difference.
        absent: kinds of events that the journal does not hold, and that were therefore not compared.
        difference: the first difference, if there is one.
        decisions: how the decisions on each variable were answered in the run and in the replay.
        previews: how the previews of each skill were answered in the run and in the replay.
        missing_looks: the number of looks in the replay whose results the run does not have, by algorithm or
            `main_execution`.
        skipped_inputs: after a difference, the number of inputs that were not possible in the replay, by kind of input.
        ended_because: why the replay ended before the journal; empty if it did not.
    """

    compared: int
    derived: Mapping[Kind, int]
    absent: tuple[Kind, ...]
    difference: Difference | None
    decisions: Mapping[str, DecisionCounts] = field(default_factory=dict)
    previews: Mapping[str, DecisionCounts] = field(default_factory=dict)
    missing_looks: Mapping[str, int] = field(default_factory=dict)
    skipped_inputs: Mapping[str, int] = field(default_factory=dict)
    ended_because: str = ""


class Comparison(EventLog):
    """An event log that compares the events of a replay, one by one, with those of the journal.

    Attributes:
        may_continue: whether further events may follow the expected ones.
        header: the run header of the replay; None before the replay begins.
        accepts_inputs: whether the log accepts inputs; only `copy_log` needs them.
        position: the number of equal events so far.
        compared: the number of equal events so far that are not earlier than `from_s`.
        derived: the number of derived events by kind that are not earlier.
        difference: the first difference, if there is one so far.
        on_event: called with each derived event.
    """

    def __init__(self, recording: Recording, copy_log: EventLog | None, from_s: float = -math.inf) -> None:
        super().__init__(limit=1)
        self.may_continue = False
        self.header: RunHeader | None = None
        self.accepts_inputs = copy_log is not None
        self.position = 0
        self.derived: dict[Kind, int] = {}
        self.difference: Difference | None = None
        self.on_event: Callable[[Event], None] = lambda _: None
        self.compared = 0
        self._from_s = from_s
        self._recording = recording
        self._copy_log = copy_log

    @property
    def is_over(self) -> bool:
        """Return whether the comparison is complete: a difference was found, or all events were compared."""
        return self.difference is not None or self._recording.next_expected_event() is None

    def begin(self, make_header: Callable[[], RunHeader]) -> None:
        """Store the run header, and begin the copy."""
        header = self.header = make_header()
        if self._copy_log is not None:
            self._copy_log.begin(lambda: header)

    def add(self, event: Event) -> None:
        """Compare an event with the next one of the journal."""
        if self._copy_log is not None:
            self._copy_log.add(event)
        if event.kind is not Kind.INPUT:
            if event.instant_s >= self._from_s:
                self.derived[event.kind] = self.derived.get(event.kind, 0) + 1
            self.on_event(event)
            if event.kind in self._recording.kinds and self.difference is None:
                self._compare(event)

    def end(self) -> None:
        """End the copy, because the replay has ended."""
        if self._copy_log is not None:
            self._copy_log.end()

    def check_completeness(self, because: str = "") -> None:
        """Store a difference if the replay ended before the recorded events did."""
        recorded_event = None if self.difference is not None else self._recording.next_readable_event()
        if recorded_event is not None:
            self._add_difference(recorded_event, replayed=None, because=because)

    def absent(self) -> tuple[Kind, ...]:
        """Return the kinds of events that were derived and that the journal does not hold."""
        return tuple(kind for kind in self.derived if kind not in self._recording.kinds)

    def _compare(self, event: Event) -> None:
        recorded_event = self._recording.next_expected_event()
        is_equal = recorded_event is not None and recorded_event.is_equal(event)
        if recorded_event is not None and not is_equal:
            recorded_event = self._recording.next_readable_event()
            is_equal = recorded_event is not None and recorded_event.is_equal(event)
        if is_equal:
            self._recording.drop_expected_event()
            self.position += 1
            self.compared += event.instant_s >= self._from_s
        elif recorded_event is not None or not self.may_continue:
            self._add_difference(recorded_event, replayed=event)

    def _add_difference(self, recorded_event: RecordedEvent | None, replayed: Event | None, because: str = "") -> None:
        recorded = None if recorded_event is None else recorded_event.event
        self.difference = Difference(position=self.position + 1, recorded=recorded, replayed=replayed, because=because)
