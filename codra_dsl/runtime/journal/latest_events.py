"""The latest events up to an instant: for each subject, the events that are needed to answer questions about it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Self

from codra_dsl.runtime.journal.events import Event, Kind

_MAPPING_ATTRIBUTES = (
    "present",
    "known",
    "basis",
    "observers",
    "started",
    "ended",
    "declared",
    "expected",
    "knowledge",
    "adaptations",
)

_JOB_END_NAMES = frozenset({"returned", "failed", "voided", "cancelled"})


@dataclass(slots=True)
class EventsAfterReading:
    """The events about a variable that came after its present reading and did not replace this reading.

    Attributes:
        event_counts: for each `what`, the number of events.
        last_events: for each `what`, the last event.
    """

    event_counts: dict[str, int] = field(default_factory=dict)
    last_events: dict[str, Event] = field(default_factory=dict)

    def add(self, event: Event) -> None:
        """Count an event."""
        self.event_counts[event.what] = self.event_counts.get(event.what, 0) + 1
        self.last_events[event.what] = event

    def copy(self) -> EventsAfterReading:
        """Return an independent copy."""
        return EventsAfterReading(dict(self.event_counts), dict(self.last_events))


class LatestEvents:
    """The latest events. Events are added one by one, in order. All attributes except `until_s` are mappings.

    Attributes:
        until_s: the instant of the last event.
        present: for each variable, the event that gave the variable its present reading.
        known: for each variable, the last event that gave the variable a value.
        basis: for each variable whose last value a job produced, the event of this job.
        later: for each variable, the events after its present reading.
        observers: for each observer, its last start, stop or failure.
        started: for each algorithm, the start of its last job.
        ended: for each algorithm, the last end of a job.
        declared: for each variable, its last declaration or withdrawal.
        expected: for each variable, the last result of a skill's expectation about the variable.
        knowledge: for each node, attribute, edge or task, its last event of each `what`.
        adaptations: the last event of each `what`. The key is `adaptation/NAME` for a course or parameter, and
            `context/NAME` for the variable that holds a course, parameter, metric or weight.
    """

    def __init__(self) -> None:
        self.until_s = -math.inf
        self.present: dict[str, Event] = {}
        self.known: dict[str, Event] = {}
        self.basis: dict[str, Event] = {}
        self.later: dict[str, EventsAfterReading] = {}
        self.observers: dict[str, Event] = {}
        self.started: dict[str, Event] = {}
        self.ended: dict[str, Event] = {}
        self.declared: dict[str, Event] = {}
        self.expected: dict[str, Event] = {}
        self.knowledge: dict[str, Mapping[str, Event]] = {}
        self.adaptations: dict[str, Mapping[str, Event]] = {}

    @classmethod
    def of(cls, events: Iterable[Event], until_s: float, earlier_events: LatestEvents | None = None) -> LatestEvents:
        """Return the latest events up to an instant; `earlier_events` has the latest events before `events`."""
        latest_events = cls() if earlier_events is None else earlier_events.copy()
        for event in events:
            if event.instant_s > until_s:
                break
            latest_events.add(event)
        return latest_events

    def copy(self) -> Self:
        """Return an independent copy."""
        other = type(self)()
        other.until_s = self.until_s
        for name in _MAPPING_ATTRIBUTES:
            setattr(other, name, dict(getattr(self, name)))
        other.later = {name: later.copy() for name, later in self.later.items()}
        return other

    def add(self, event: Event) -> None:
        """Add the next event."""
        self.until_s = event.instant_s
        match event.kind:
            case Kind.VARIABLE:
                self._add_variable_event(event)
            case Kind.JOB:
                self._add_job_event(event)
            case Kind.OBSERVER:
                self.observers[event.name] = event
            case Kind.DECLARATION:
                self.declared[event.name] = event
            case Kind.EXPECTATION:
                self.expected[event.name] = event
            case Kind.KNOWLEDGE:
                self.knowledge[event.name] = _with_latest_event(self.knowledge.get(event.name, {}), event)
            case Kind.ADAPTATION:
                keys = [f"adaptation/{event.details.get('course', event.name)}"]
                if "variable" in event.details:
                    keys.append(f"context/{event.details['variable']}")
                keys += [f"adaptation/{name}" for name in event.details.get("adapts", ()) if name != event.name]
                if event.what == "analysed":
                    metrics_and_weights = (*event.details["metrics"], *event.details["weights"])
                    keys += [f"context/{metric_or_weight['variable']}" for metric_or_weight in metrics_and_weights]
                for key in keys:
                    self.adaptations[key] = _with_latest_event(self.adaptations.get(key, {}), event)
            case _:
                pass

    def _add_variable_event(self, event: Event) -> None:
        if not event.details.get("present"):
            self._add_later_event(event.name, event)
            return
        self.present[event.name] = event
        self.later.pop(event.name, None)
        if event.what == "identified":
            self.known[event.name] = event
            job = self.ended.get(event.details["source"])
            if job is not None and job.what == "returned":
                self.basis[event.name] = job
            else:
                self.basis.pop(event.name, None)

    def _add_job_event(self, event: Event) -> None:
        if event.what == "started":
            self.started[event.name] = event
        elif event.what in _JOB_END_NAMES:
            self.ended[event.name] = event
        elif event.what == "rejected":
            for variable in event.details["variables"]:
                self._add_later_event(variable, event)

    def _add_later_event(self, variable: str, event: Event) -> None:
        self.later.setdefault(variable, EventsAfterReading()).add(event)


def _with_latest_event(earlier_events: Mapping[str, Event], event: Event) -> Mapping[str, Event]:
    """Return a mapping with the last event of each `what`, ordered by time, after `event` is added."""
    return {**{what: other for what, other in earlier_events.items() if what != event.what}, event.what: event}
