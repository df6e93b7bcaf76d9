"""What a graph is made of: nodes and edges, whose attributes are readings with a past. None of it ever changes."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, cast

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reading, Reason

_MOST_DROPPED = 64
"""Readings in front of the past that a list holds at least until it is copied without them."""


class History:
    """An attribute's readings, by the instant of their evidence; the last is the present one. It never changes.

    Histories share their list: one that is longer by newer evidence appends to the list that the shorter one has, which
    does not look beyond its own end. Those that share a list are made longer by one thread at a time.
    """

    __slots__ = ("_end", "_readings", "_start", "present")

    present: Reading[Value]

    def __init__(self) -> None:
        """Know nothing yet; `present` is there from the first reading on."""
        self._readings: list[Reading[Value]] = []
        self._start = 0
        self._end = 0

    def __len__(self) -> int:
        return self._end - self._start

    def with_reading(self, reading: Reading[Value], most: int) -> History:
        """Return the history with one more reading, of which the newest are kept."""
        made: History = _new(History)
        readings, start, end = self._readings, self._start, self._end
        if len(readings) != end or (end and reading.evidence_s < self.present.evidence_s):
            readings = readings[start:end]
            readings.insert(bisect_right(readings, reading.evidence_s, key=_evidence_s), reading)
            start, end = 0, len(readings)
        else:
            readings.append(reading)
            end += 1
        if end - start > most:
            start = end - most
            if start > _MOST_DROPPED and start > most:
                readings = readings[start:end]
                start, end = 0, most
        made._readings, made._start, made._end = readings, start, end
        made.present = readings[end - 1]
        return made

    def all(self) -> tuple[Reading[Value], ...]:
        """Return the readings, the oldest first."""
        return tuple(self._readings[self._start : self._end])


class Node(NamedTuple):
    """A node, as it was at one time.

    Attributes:
        name: of the node.
        type: the name of its type.
        number: nodes and edges are numbered in the order in which they came.
        histories: of its attributes that were ever known, by name.
        writer: the agent that inserted it; empty if it was there from the start.
        since_s: when it was inserted.
    """

    name: str
    type: str
    number: int
    histories: Mapping[str, History]
    writer: str
    since_s: float

    @property
    def attributes(self) -> Mapping[str, Reading[Any]]:
        """Return the readings of its attributes, as they were written."""
        return _readings(self.histories)


class Edge(NamedTuple):
    """An edge, as it was at one time.

    Attributes:
        origin: the name of a node.
        label: between two nodes there is at most one edge of each.
        target: the name of a node.
        type: the name of its type.
        number: nodes and edges are numbered in the order in which they came.
        histories: of its attributes that were ever known, by name.
        writer: the agent that wrote it last; empty if it was there from the start.
        since_s: when it was inserted.
    """

    origin: str
    label: str
    target: str
    type: str
    number: int
    histories: Mapping[str, History]
    writer: str
    since_s: float

    @property
    def key(self) -> EdgeKey:
        """Return what tells it from all other edges."""
        return (self.origin, self.label, self.target)

    @property
    def attributes(self) -> Mapping[str, Reading[Any]]:
        """Return the readings of its attributes, as they were written."""
        return _readings(self.histories)

    def __str__(self) -> str:
        return f"{self.origin} -{self.label}-> {self.target}"


EdgeKey = tuple[str, str, str]
"""Origin, label, target."""


NO_HISTORIES: Mapping[str, History] = MappingProxyType({})


def present(histories: Mapping[str, History], name: str, attribute: str) -> Reading[Value]:
    """Return the present reading of an attribute; one that was never written is unknown."""
    history = histories.get(attribute)
    if history is None:
        return Reading(name=f"{name}.{attribute}", reason=Reason.NEVER_OBSERVED)
    return history.present


def _readings(histories: Mapping[str, History]) -> Mapping[str, Reading[Any]]:
    return MappingProxyType({name: cast("Reading[Any]", each.present) for name, each in histories.items()})


made = tuple.__new__
"""Makes a named tuple of all its fields, in half the time that calling its class takes."""

_new: Callable[[type[History]], History] = object.__new__


def _evidence_s(reading: Reading[Value]) -> float:
    return reading.evidence_s
