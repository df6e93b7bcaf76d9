"""The record of a run: every change of a variable, every start and stop, every job and decision, in order."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from codra_dsl.runtime.clock import Clock


class Kind(StrEnum):
    """What an event is about."""

    VARIABLE = "variable"
    OBSERVER = "observer"
    JOB = "job"
    DECISION = "decision"
    DECLARATION = "declaration"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened.

    Attributes:
        instant_s: when.
        name: of the variable, observer or algorithm.
        what: what happened to it, e.g. `started`, `identified`, `fell_back`.
        details: plain values, by a name that is no other attribute's.
    """

    instant_s: float
    kind: Kind
    name: str
    what: str
    details: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> str:
        """Return the event as one line; numbers that are not finite become null."""
        plain = {"instant_s": self.instant_s, "kind": self.kind, "name": self.name, "what": self.what}
        return json.dumps(plain | _finite(self.details), ensure_ascii=False, allow_nan=False)


class Record:
    """A list of events that grows as they happen."""

    def __init__(self) -> None:
        self._events: list[Event] = []

    def __iter__(self) -> Iterator[Event]:
        return iter(tuple(self._events))

    def __len__(self) -> int:
        return len(self._events)

    def add(self, event: Event) -> None:
        """Add an event."""
        self._events.append(event)

    def of(self, kind: Kind) -> tuple[Event, ...]:
        """Return the events of one kind, in order."""
        return tuple(event for event in self._events if event.kind is kind)

    def text(self) -> str:
        """Return the record as JSON lines."""
        return "".join(f"{event.as_json()}\n" for event in self._events)


class Scribe:
    """Adds what happens to a record, at the instant that a clock shows."""

    def __init__(self, record: Record, clock: Clock) -> None:
        self._record = record
        self._clock = clock

    def tell(self, kind: Kind, name: str, what: str, /, **details: object) -> None:
        """Add an event that happens now."""
        self._record.add(Event(self._clock.now_s(), kind, name, what, details))


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
