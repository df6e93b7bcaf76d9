"""The nodes and edges of a graph, with histories of readings for their attributes.

Histories grow, but a version of the graph never changes: its readers see only the readings that belong to it.
"""

from __future__ import annotations

import math
from bisect import bisect_right, insort_right
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from operator import itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple, Self, TypeVar, cast

from codra_dsl.logic import Value
from codra_dsl.runtime.knowledge.declarations import AttributeModel
from codra_dsl.runtime.knowledge.permissions import Permissions
from codra_dsl.runtime.values.cell import Override, Reading, Reason, known_reading
from codra_dsl.runtime.values.model import NotOfTypeError

_MIN_OUTDATED_READINGS = 64
"""The minimum number of outdated readings that a history holds before a new history without them replaces it."""

_VERSION_BEFORE_ALL = -1
"""A number below every version of a graph."""


@dataclass(frozen=True, slots=True)
class Attribute:
    """The declaration of an attribute, with its permissions.

    Attributes:
        convert: converts a value, as `ValueType.convert` does.
        variable: the name of the context-variable, if the attribute is one; otherwise empty.
    """

    model: AttributeModel
    permissions: Permissions
    convert: Callable[[object], Value | None]
    variable: str = ""


class History:
    """An attribute's readings, ordered by evidence, each with the first version of the graph that has the reading.

    Versions of the graph share a history. A reading with newer evidence is appended, and access to an earlier version
    skips this reading, so writing an attribute copies no node. If the evidence is older than that of the last reading,
    or the history has too many readings, the new version and the versions after it get a new history. A thread may
    append only while it holds the graph's lock for writes; reading needs no lock.

    Attributes:
        attribute: the declaration of the attribute.
        subject: the name of the attribute in error messages.
        name: the name that the readings have: the context-variable, if the attribute is one, otherwise `subject`.
        override: the operator's override of the context-variable, which hides the readings; None if there is none.
    """

    __slots__ = ("_capacity", "_entries", "attribute", "name", "override", "subject")

    def __init__(self, attribute: Attribute, subject: str) -> None:
        """Create an empty history; only change sets hold empty histories."""
        self._entries: list[tuple[int, Reading[Value]]] = []
        self.override: Override | None = None
        self.attribute = attribute
        self.subject = subject
        self.name = attribute.variable or subject
        self._capacity = 2 * attribute.model.history + _MIN_OUTDATED_READINGS

    @classmethod
    def of(
        cls, attribute: Attribute, subject: str, readings: Iterable[Reading[Value]], override: Override | None
    ) -> History:
        """Return the history of these readings, which are ordered by their evidence and belong to every version."""
        history = cls(attribute, subject)
        history._entries, history.override = [(_VERSION_BEFORE_ALL, reading) for reading in readings], override
        return history

    def reading_at(self, version: int) -> Reading[Value]:
        """Return the override, or the newest reading in a version of the graph."""
        return self._newest_reading(version) if self.override is None else self.override

    def _newest_reading(self, version: int) -> Reading[Value]:
        entries = self._entries
        first_version, reading = entries[-1]
        return (
            reading
            if first_version <= version
            else entries[bisect_right(entries, version, key=_get_first_version) - 1][1]
        )

    def readings_at(self, version: int) -> tuple[Reading[Value], ...]:
        """Return the readings in a version of the graph, the oldest first; an override is the last one."""
        readings, override = self.readings_of_sources_at(version), self.override
        if override is None:
            return readings
        return (*(reading for reading in readings if reading.holds_from_s < override.evidence_s), override)

    def readings_of_sources_at(self, version: int) -> tuple[Reading[Value], ...]:
        """Return the readings in a version of the graph without an override, the oldest first."""
        end = bisect_right(self._entries, version, key=_get_first_version)
        return tuple(reading for _, reading in self._entries[max(0, end - self.attribute.model.history) : end])

    def make_reading(
        self, agent: str, now_s: float, value: object, evidence_s: float | None, version: int
    ) -> Reading[Value]:
        """Return the reading for a value that an agent writes; None and NaN give an unknown reading.

        If another agent wrote the newest reading in `version`, and this reading is still valid, the rank is checked.
        """
        attribute = self.attribute
        try:
            content = None if value is None else attribute.convert(value)
        except NotOfTypeError as error:
            raise NotOfTypeError(f"{self.subject}: {error}") from None
        if evidence_s is None:
            evidence_s = now_s
        elif not -math.inf < evidence_s <= now_s:
            raise ValueError(f"evidence for {self.subject} cannot be from {evidence_s}: the present instant is {now_s}")
        else:
            evidence_s = float(evidence_s)
        if attribute.permissions.is_ranked and self._entries:
            present_reading = self._newest_reading(version)
            if present_reading.source != agent and present_reading.at(now_s).known:
                attribute.permissions.check_rank(agent, present_reading.source, self.subject)
        if content is None:
            return Reading(
                name=self.name,
                reason=Reason.REJECTED,
                evidence_s=evidence_s,
                start_s=evidence_s,
                identified_s=now_s,
                source=agent,
            )
        expires_s = evidence_s + attribute.model.valid_for_s
        return known_reading(self.name, content, evidence_s, evidence_s, now_s, expires_s, agent)

    def with_reading(self, reading: Reading[Value], version: int) -> History:
        """Return a history with one more reading, which is part of `version` and of later versions.

        If the reading can be appended to this history, this history itself is returned.
        """
        entries = self._entries
        is_newest = not entries or reading.holds_from_s >= entries[-1][1].holds_from_s
        if is_newest and (not entries or len(entries) < self._capacity):
            entries.append((version, reading))
            return self
        max_readings = max(1, self.attribute.model.history)
        new_history = self.with_override(self.override)
        new_history._entries = [(_VERSION_BEFORE_ALL, kept_reading) for _, kept_reading in entries[-max_readings:]]
        insort_right(new_history._entries, (_VERSION_BEFORE_ALL, reading), key=lambda entry: entry[1].holds_from_s)
        del new_history._entries[:-max_readings]
        return new_history

    def with_override(self, override: Override | None) -> History:
        """Return a history of the same readings with an override, or without one."""
        new_history = History(self.attribute, self.subject)
        new_history._entries, new_history.override = self._entries, override
        return new_history

    @property
    def is_empty(self) -> bool:
        """Return whether the attribute was never written and is not overridden."""
        return not self._entries and self.override is None

    def remove(self, reading: Reading[Value]) -> None:
        """Remove a reading that was added for a version which will never be the present one."""
        self._entries = [entry for entry in self._entries if entry[1] is not reading]


class Node(NamedTuple):
    """A node in one version of the graph.

    Attributes:
        name: the name of the node.
        type: the name of the node's type.
        number: the number of the node; nodes and edges are numbered in the order of their insertion.
        histories: the histories of the node's attributes, by name; attributes that were never written have none.
        writer: the agent that inserted the node; empty for an initial node.
        since_s: when the node was inserted.
        version: the version of the graph.
    """

    name: str
    type: str
    number: int
    histories: Mapping[str, History]
    writer: str
    since_s: float
    version: int = 0

    def with_history(self, history: History) -> Self:
        """Return the node with another history of one of its attributes."""
        return self._replace(histories={**self.histories, history.attribute.model.name: history})

    def without_history(self, name: str) -> Self:
        """Return the node as if an attribute had never been written."""
        return self._replace(histories={key: history for key, history in self.histories.items() if key != name})

    @property
    def attributes(self) -> Mapping[str, Reading[Any]]:
        """Return the newest reading of each attribute as it was written, even if it is no longer valid."""
        return _readings(self.histories, self.version)


class Edge(NamedTuple):
    """An edge in one version of the graph.

    Attributes:
        origin: the name of the node from which the edge goes.
        label: the label of the edge; two nodes have at most one edge per label and direction.
        target: the name of the node to which the edge goes.
        type: the name of the edge's type.
        number: the number of the edge; nodes and edges are numbered in the order of their insertion.
        histories: the histories of the edge's attributes, by name; attributes that were never written have none.
        writer: the agent that wrote the edge last; empty for an initial edge.
        since_s: when the edge was inserted.
        version: the version of the graph.
    """

    origin: str
    label: str
    target: str
    type: str
    number: int
    histories: Mapping[str, History]
    writer: str
    since_s: float
    version: int = 0

    @property
    def key(self) -> EdgeKey:
        """Return the key that identifies the edge."""
        return (self.origin, self.label, self.target)

    def with_history(self, history: History) -> Self:
        """Return the edge with another history of one of its attributes."""
        return self._replace(histories={**self.histories, history.attribute.model.name: history})

    @property
    def attributes(self) -> Mapping[str, Reading[Any]]:
        """Return the newest reading of each attribute as it was written, even if it is no longer valid."""
        return _readings(self.histories, self.version)

    def __str__(self) -> str:
        return f"{self.origin} -{self.label}-> {self.target}"


EdgeKey = tuple[str, str, str]
"""The key of an edge: its origin, label and target."""


ElementT = TypeVar("ElementT", Node, Edge)

NO_HISTORIES: Mapping[str, History] = MappingProxyType({})


def element_at_version(element: ElementT, version: int) -> ElementT:
    """Return a node or edge as it is in a version of the graph; this version must contain the node or edge."""
    return make_tuple(type(element), (*element[:-1], version)) if element.histories else element


def present_reading(element: Node | Edge, name: str, attribute: str) -> Reading[Value]:
    """Return the newest reading of an attribute; `name` is the name of the node or edge."""
    history = element.histories.get(attribute)
    return never_observed_reading(name, attribute) if history is None else history.reading_at(element.version)


def never_observed_reading(name: str, attribute: str) -> Reading[Value]:
    """Return the reading of an attribute that was never written."""
    return Reading(name=f"{name}.{attribute}", reason=Reason.NEVER_OBSERVED)


def _readings(histories: Mapping[str, History], version: int) -> Mapping[str, Reading[Any]]:
    return MappingProxyType(
        {name: cast("Reading[Any]", history.reading_at(version)) for name, history in histories.items()}
    )


make_tuple = tuple.__new__
"""Creates a named tuple from all its fields, in half the time that a call of the class takes."""

_get_first_version = itemgetter(0)
