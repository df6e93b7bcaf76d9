"""What events up to an instant come to: the latest of everything that a later question may be about."""

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
class Later:
    """What came about a variable after its present reading, and did not replace it.

    Attributes:
        counts: how often, by what happened.
        last: the latest of each.
    """

    counts: dict[str, int] = field(default_factory=dict)
    last: dict[str, Event] = field(default_factory=dict)

    def take(self, event: Event) -> None:
        """Count an event."""
        self.counts[event.what] = self.counts.get(event.what, 0) + 1
        self.last[event.what] = event

    def copy(self) -> Later:
        """Return the same, to go on with apart."""
        return Later(dict(self.counts), dict(self.last))


class Ledger:
    """The latest events, kept up as events are taken in their order.

    Attributes:
        until_s: the instant of the last event.
        present: by variable, what gave it its present reading.
        known: by variable, what last gave it a value.
        basis: by variable, the job that its last value comes from, if it was a job.
        later: by variable, what came after its present reading.
        observers: by observer, its last start, stop or failure.
        started: by algorithm, the start of its last job.
        ended: by algorithm, the last end of a job.
        declared: by variable, whose need for it was declared or withdrawn last.
        expected: by variable, what last came of what a skill expects of it.
        knowledge: by node, attribute, edge or task, the last of each that became of it.
        adaptations: by `adaptation/NAME` of a course or parameter, and by `context/NAME` of the variable that holds it,
            or a metric or weight, the last of each that became of it.
    """

    def __init__(self) -> None:
        self.until_s = -math.inf
        self.present: dict[str, Event] = {}
        self.known: dict[str, Event] = {}
        self.basis: dict[str, Event] = {}
        self.later: dict[str, Later] = {}
        self.observers: dict[str, Event] = {}
        self.started: dict[str, Event] = {}
        self.ended: dict[str, Event] = {}
        self.declared: dict[str, Event] = {}
        self.expected: dict[str, Event] = {}
        self.knowledge: dict[str, Mapping[str, Event]] = {}
        self.adaptations: dict[str, Mapping[str, Event]] = {}

    @classmethod
    def of(cls, events: Iterable[Event], until_s: float, before: Ledger | None = None) -> Ledger:
        """Return what events up to an instant come to, after what came before them."""
        ledger = cls() if before is None else before.copy()
        for event in events:
            if event.instant_s > until_s:
                break
            ledger.take(event)
        return ledger

    def copy(self) -> Self:
        """Return the same, to go on with apart."""
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
                    keys += [f"context/{each['variable']}" for each in judged]
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
        self.later.setdefault(variable, Later()).take(event)


def _with(before: Mapping[str, Event], event: Event) -> Mapping[str, Event]:
    """Return the last of each that became of something, the latest last."""
    return {**{what: other for what, other in before.items() if what != event.what}, event.what: event}
