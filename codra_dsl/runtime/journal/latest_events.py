"""The latest events up to an instant: for each subject, the events that are needed to answer questions about it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol, Self, TypeVar

from codra_dsl.runtime.journal.events import Event, Kind

Found_co = TypeVar("Found_co", covariant=True)

_MAPPING_ATTRIBUTES = (
    "present_events",
    "override_events",
    "decision_events",
    "last_value_events",
    "basis_jobs",
    "observer_events",
    "job_starts",
    "job_ends",
    "host_events",
    "declaration_events",
    "expectation_events",
    "knowledge_events",
    "adaptation_events",
)

JOB_END_NAMES = frozenset({"returned", "failed", "voided", "cancelled"})


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


class EventsByName(Protocol[Found_co]):
    """A mapping from the names of subjects to their events, which may find the events when they are needed."""

    def get(self, name: str, /) -> Found_co | None:
        """Return the events of a subject; None if there are none."""
        ...


class LatestEventsView(Protocol):
    """The latest events up to an instant, for reading."""

    @property
    def present_events(self) -> EventsByName[Event]:
        """Return, for each variable, the event that gave the variable the present reading of its sources."""
        ...

    @property
    def override_events(self) -> EventsByName[Event]:
        """Return, for each variable, the last beginning or end of an override."""
        ...

    @property
    def decision_events(self) -> EventsByName[Event]:
        """Return, for each variable, the last decision on it."""
        ...

    @property
    def last_value_events(self) -> EventsByName[Event]:
        """Return, for each variable, the last event that gave the variable a value."""
        ...

    @property
    def basis_jobs(self) -> EventsByName[Event]:
        """Return, for each variable whose last value a job produced, the event that ended this job."""
        ...

    @property
    def later_events(self) -> EventsByName[EventsAfterReading]:
        """Return, for each variable, the events after its present reading."""
        ...

    @property
    def observer_events(self) -> EventsByName[Event]:
        """Return, for each observer, its last start, stop or failure."""
        ...

    @property
    def job_starts(self) -> EventsByName[Event]:
        """Return, for each algorithm, the start of its last job."""
        ...

    @property
    def job_ends(self) -> EventsByName[Event]:
        """Return, for each algorithm, the last end of a job."""
        ...

    @property
    def host_events(self) -> EventsByName[Event]:
        """Return, for each host, when it was last connected or lost."""
        ...

    @property
    def declaration_events(self) -> EventsByName[Event]:
        """Return, for each variable, its last declaration or withdrawal."""
        ...

    @property
    def expectation_events(self) -> EventsByName[Event]:
        """Return, for each variable, the last result of a skill's expectation about the variable."""
        ...

    @property
    def knowledge_events(self) -> Mapping[str, Mapping[str, Event]]:
        """Return, for each node, attribute, edge or task, its last event of each `what`."""
        ...

    @property
    def adaptation_events(self) -> Mapping[str, Mapping[str, Event]]:
        """Return the last adaptation event of each `what`.

        The key is `adaptation/NAME` for a course or parameter, and `context/NAME` for the variable that holds a course,
        parameter, metric or weight.
        """
        ...


class LatestEvents:
    """The latest events. Events are added one by one, in order.

    Attributes:
        until_s: the instant of the last event.
    """

    def __init__(self) -> None:
        self.until_s = -math.inf
        self.present_events: dict[str, Event] = {}
        self.override_events: dict[str, Event] = {}
        self.decision_events: dict[str, Event] = {}
        self.last_value_events: dict[str, Event] = {}
        self.basis_jobs: dict[str, Event] = {}
        self.later_events: dict[str, EventsAfterReading] = {}
        self.observer_events: dict[str, Event] = {}
        self.job_starts: dict[str, Event] = {}
        self.job_ends: dict[str, Event] = {}
        self.host_events: dict[str, Event] = {}
        self.declaration_events: dict[str, Event] = {}
        self.expectation_events: dict[str, Event] = {}
        self.knowledge_events: dict[str, Mapping[str, Event]] = {}
        self.adaptation_events: dict[str, Mapping[str, Event]] = {}

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
        other.later_events = {name: later_events.copy() for name, later_events in self.later_events.items()}
        return other

    def add(self, event: Event) -> None:
        """Add the next event."""
        self.until_s = event.instant_s
        match event.kind:
            case Kind.VARIABLE:
                self._add_variable_event(event)
            case Kind.OVERRIDE:
                self.override_events[event.name] = event
            case Kind.DECISION:
                self.decision_events[event.name] = event
            case Kind.JOB:
                self._add_job_event(event)
            case Kind.OBSERVER:
                self.observer_events[event.name] = event
            case Kind.HOST:
                self.host_events[event.name] = event
            case Kind.DECLARATION:
                self.declaration_events[event.name] = event
            case Kind.EXPECTATION:
                self.expectation_events[event.name] = event
            case Kind.KNOWLEDGE:
                self.knowledge_events[event.name] = _with_latest_event(self.knowledge_events.get(event.name, {}), event)
            case Kind.ADAPTATION:
                keys = [f"adaptation/{event.details.get('course', event.name)}"]
                if "variable" in event.details:
                    keys.append(f"context/{event.details['variable']}")
                keys += [f"adaptation/{name}" for name in event.details.get("adapts", ()) if name != event.name]
                if event.what == "analysed":
                    metrics_and_weights = (*event.details["metrics"], *event.details["weights"])
                    keys += [f"context/{metric_or_weight['variable']}" for metric_or_weight in metrics_and_weights]
                for key in keys:
                    self.adaptation_events[key] = _with_latest_event(self.adaptation_events.get(key, {}), event)
            case _:
                pass

    def _add_variable_event(self, event: Event) -> None:
        if not event.details.get("present"):
            self._add_later_event(event.name, event)
            return
        self.present_events[event.name] = event
        self.later_events.pop(event.name, None)
        if event.what == "identified":
            self.last_value_events[event.name] = event
            job = self.job_ends.get(event.details["source"])
            if job is not None and job.what == "returned":
                self.basis_jobs[event.name] = job
            else:
                self.basis_jobs.pop(event.name, None)

    def _add_job_event(self, event: Event) -> None:
        if event.what == "started":
            self.job_starts[event.name] = event
        elif event.what in JOB_END_NAMES:
            self.job_ends[event.name] = event
        elif event.what == "rejected":
            for variable in event.details["variables"]:
                self._add_later_event(variable, event)

    def _add_later_event(self, variable: str, event: Event) -> None:
        self.later_events.setdefault(variable, EventsAfterReading()).add(event)


def _with_latest_event(earlier_events: Mapping[str, Event], event: Event) -> Mapping[str, Event]:
    """Return a mapping with the last event of each `what`, ordered by time, after `event` is added."""
    return {**{what: other for what, other in earlier_events.items() if what != event.what}, event.what: event}
