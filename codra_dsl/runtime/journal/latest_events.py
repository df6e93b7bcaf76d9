"""The latest events up to an instant: per subject, those that a later question may ask for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Self

from codra_dsl.runtime.journal.events import Event, Kind

_BY_NAME = (
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

_ENDS = frozenset({"returned", "failed", "voided", "cancelled"})


@dataclass(slots=True)
class Superseded:
    """Events about a variable that came after its present reading and did not replace it.

    Attributes:
        counts: the number of events by `what`.
        last: the latest event by `what`.
    """

    counts: dict[str, int] = field(default_factory=dict)
    last: dict[str, Event] = field(default_factory=dict)

    def take(self, event: Event) -> None:
        """Count an event."""
        self.counts[event.what] = self.counts.get(event.what, 0) + 1
        self.last[event.what] = event

    def copy(self) -> Superseded:
        """Return an independent copy."""
        return Superseded(dict(self.counts), dict(self.last))


class LatestEvents:
    """The latest events, updated as events are taken in order.

    Attributes:
        until_s: the instant of the last event.
        present: by variable, the event that gave it its present reading.
        known: by variable, the last event that gave it a value.
        basis: by variable, the job that produced its last value, if a job did.
        later: by variable, the events after its present reading.
        observers: by observer, its last start, stop or failure.
        started: by algorithm, the start of its last job.
        ended: by algorithm, the last end of a job.
        declared: by variable, the last declaration or withdrawal.
        expected: by variable, the last result of a skill's expectation about it.
        knowledge: by node, attribute, edge or task, its last event of each `what`.
        adaptations: by `adaptation/NAME` for a course or parameter, and by `context/NAME` for the variable that holds a
            course, parameter, metric or weight, its last event of each `what`.
    """

    def __init__(self) -> None:
        self.until_s = -math.inf
        self.present: dict[str, Event] = {}
        self.known: dict[str, Event] = {}
        self.basis: dict[str, Event] = {}
        self.later: dict[str, Superseded] = {}
        self.observers: dict[str, Event] = {}
        self.started: dict[str, Event] = {}
        self.ended: dict[str, Event] = {}
        self.declared: dict[str, Event] = {}
        self.expected: dict[str, Event] = {}
        self.knowledge: dict[str, Mapping[str, Event]] = {}
        self.adaptations: dict[str, Mapping[str, Event]] = {}

    @classmethod
    def of(cls, events: Iterable[Event], until_s: float, before: LatestEvents | None = None) -> LatestEvents:
        """Return the latest events up to an instant, starting from those before the given events."""
        latest_events = cls() if before is None else before.copy()
        for event in events:
            if event.instant_s > until_s:
                break
            latest_events.take(event)
        return latest_events

    def copy(self) -> Self:
        """Return an independent copy."""
        other = type(self)()
        other.until_s = self.until_s
        for name in _BY_NAME:
            setattr(other, name, dict(getattr(self, name)))
        other.later = {name: later.copy() for name, later in self.later.items()}
        return other

    def take(self, event: Event) -> None:
        """Take the next event."""
        self.until_s = event.instant_s
        match event.kind:
            case Kind.VARIABLE:
                self._take_variable(event)
            case Kind.JOB:
                self._take_job(event)
            case Kind.OBSERVER:
                self.observers[event.name] = event
            case Kind.DECLARATION:
                self.declared[event.name] = event
            case Kind.EXPECTATION:
                self.expected[event.name] = event
            case Kind.KNOWLEDGE:
                self.knowledge[event.name] = _with(self.knowledge.get(event.name, {}), event)
            case Kind.ADAPTATION:
                keys = [f"adaptation/{event.details.get('course', event.name)}"]
                if "variable" in event.details:
                    keys.append(f"context/{event.details['variable']}")
                keys += [f"adaptation/{name}" for name in event.details.get("adapts", ()) if name != event.name]
                if event.what == "analysed":
                    judged = (*event.details["metrics"], *event.details["weights"])
                    keys += [f"context/{judgement['variable']}" for judgement in judged]
                for key in keys:
                    self.adaptations[key] = _with(self.adaptations.get(key, {}), event)
            case _:
                pass

    def _take_variable(self, event: Event) -> None:
        if not event.details.get("present"):
            self._note(event.name, event)
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

    def _take_job(self, event: Event) -> None:
        if event.what == "started":
            self.started[event.name] = event
        elif event.what in _ENDS:
            self.ended[event.name] = event
        elif event.what == "rejected":
            for variable in event.details["variables"]:
                self._note(variable, event)

    def _note(self, variable: str, event: Event) -> None:
        self.later.setdefault(variable, Superseded()).take(event)


def _with(before: Mapping[str, Event], event: Event) -> Mapping[str, Event]:
    """Return the last event of each `what`, ordered by time, with an event added."""
    return {**{what: other for what, other in before.items() if what != event.what}, event.what: event}
