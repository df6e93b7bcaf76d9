"""What a graph is made of: nodes and edges, whose attributes are readings with a past.

Histories become longer. To whoever sees one version of the graph, none of it ever changes.
"""

from __future__ import annotations

from bisect import bisect_right, insort_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple, Self, TypeVar, cast

from codra_dsl.logic import Value
from codra_dsl.runtime.knowledge.declarations import AttributeModel
from codra_dsl.runtime.knowledge.permissions import Permissions
from codra_dsl.runtime.values.cell import Reading, Reason, known_reading
from codra_dsl.runtime.values.model import NotOfTypeError

_MOST_DROPPED = 64
"""Readings in front of the past that a history holds at least until there is another without them."""

_ALWAYS = -1
"""Comes before the version of every graph."""


@dataclass(frozen=True, slots=True)
class Attribute:
    """An attribute as it is declared, and who may write it.

    Attributes:
        convert: as `ValueType.convert`.
        variable: the context-variable that it is; empty if it is none.
    """

    model: AttributeModel
    permissions: Permissions
    convert: Callable[[object], Value | None]
    variable: str = ""


class History:
    """An attribute's readings, by the instant of their evidence, and with which version of the graph each came.

    Versions share it: newer evidence is appended, and who looks for an earlier version passes that over. Evidence that
    is older, or too many readings, make another history, for the versions from then on. Whoever appends holds the turn
    of the graph; looking needs no lock.

    Attributes:
        declared: the attribute.
        subject: how errors call it.
        name: of the readings.
    """

    __slots__ = ("_room", "_told", "declared", "name", "subject")

    def __init__(self, declared: Attribute, subject: str) -> None:
        """Know nothing yet; nobody but a draft has such a history."""
        self._told: list[tuple[int, Reading[Value]]] = []
        self.declared = declared
        self.subject = subject
        self.name = declared.variable or subject
        self._room = 2 * declared.model.history + _MOST_DROPPED

    def present(self, version: int) -> Reading[Value]:
        """Return the present reading of a version."""
        told = self._told
        came, reading = told[-1]
        return reading if came <= version else told[bisect_right(told, version, key=_came) - 1][1]

    def all(self, version: int) -> tuple[Reading[Value], ...]:
        """Return the readings of a version, the oldest first."""
        end = bisect_right(self._told, version, key=_came)
        return tuple(reading for _, reading in self._told[max(0, end - self.declared.model.history) : end])

    def written(
        self, agent: str, now_s: float, value: object, evidence_s: float | None, version: int
    ) -> Reading[Value]:
        """Return what an agent writes, if it may after what a version has; None and NaN are unknown."""
        declared = self.declared
        try:
            content = None if value is None else declared.convert(value)
        except NotOfTypeError as error:
            raise NotOfTypeError(f"{self.subject}: {error}") from None
        if evidence_s is None:
            evidence_s = now_s
        elif not evidence_s <= now_s:
            raise ValueError(f"evidence for {self.subject} was taken at {now_s} at the latest, not at {evidence_s}")
        else:
            evidence_s = float(evidence_s)
        if declared.permissions.is_ranked and self._told:
            before = self.present(version)
            if before.source != agent and before.at(now_s).known:
                declared.permissions.check_rank(agent, before.source, self.subject)
        if content is None:
            return Reading(
                name=self.name,
                reason=Reason.REJECTED,
                evidence_s=evidence_s,
                start_s=evidence_s,
                identified_s=now_s,
                source=agent,
            )
        expires_s = evidence_s + declared.model.valid_for_s
        return known_reading(self.name, content, evidence_s, evidence_s, now_s, expires_s, agent)

    def with_reading(self, reading: Reading[Value], version: int) -> History:
        """Return the history that has one more reading from a version on: this one, if it can be appended here."""
        told = self._told
        if not told or (reading.evidence_s >= told[-1][1].evidence_s and len(told) < self._room):
            told.append((version, reading))
            return self
        most = max(1, self.declared.model.history)
        longer = History(self.declared, self.subject)
        longer._told = [(_ALWAYS, each) for _, each in told[-most:]]
        insort_right(longer._told, (_ALWAYS, reading), key=_evidence_s)
        del longer._told[:-most]
        return longer

    def cut(self, reading: Reading[Value]) -> None:
        """Forget a reading, which came with a version that will never be the present one."""
        self._told = [each for each in self._told if each[1] is not reading]


class Node(NamedTuple):
    """A node, as it was at one time.

    Attributes:
        name: of the node.
        type: the name of its type.
        number: nodes and edges are numbered in the order in which they came.
        histories: of its attributes that were ever known, by name.
        writer: the agent that inserted it; empty if it was there from the start.
        since_s: when it was inserted.
        version: of the graph in which it is seen.
    """

    name: str
    type: str
    number: int
    histories: Mapping[str, History]
    writer: str
    since_s: float
    version: int = 0

    def with_history(self, history: History) -> Self:
        """Return it with another history of one of its attributes."""
        return self._replace(histories={**self.histories, history.declared.model.name: history})

    @property
    def attributes(self) -> Mapping[str, Reading[Any]]:
        """Return the readings of its attributes, as they were written."""
        return _readings(self.histories, self.version)


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
        version: of the graph in which it is seen.
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
        """Return what tells it from all other edges."""
        return (self.origin, self.label, self.target)

    def with_history(self, history: History) -> Self:
        """Return it with another history of one of its attributes."""
        return self._replace(histories={**self.histories, history.declared.model.name: history})

    @property
    def attributes(self) -> Mapping[str, Reading[Any]]:
        """Return the readings of its attributes, as they were written."""
        return _readings(self.histories, self.version)

    def __str__(self) -> str:
        return f"{self.origin} -{self.label}-> {self.target}"


EdgeKey = tuple[str, str, str]
"""Origin, label, target."""


ElementT = TypeVar("ElementT", Node, Edge)

NO_HISTORIES: Mapping[str, History] = MappingProxyType({})


def seen(element: ElementT, version: int) -> ElementT:
    """Return a node or edge as it is seen in a version of the graph that has it."""
    return made(type(element), (*element[:-1], version)) if element.histories else element


def present(element: Node | Edge, name: str, attribute: str) -> Reading[Value]:
    """Return the present reading of an attribute of a node or edge that is called so."""
    history = element.histories.get(attribute)
    return never(name, attribute) if history is None else history.present(element.version)


def never(name: str, attribute: str) -> Reading[Value]:
    """Return the reading of an attribute that was never written."""
    return Reading(name=f"{name}.{attribute}", reason=Reason.NEVER_OBSERVED)


def _readings(histories: Mapping[str, History], version: int) -> Mapping[str, Reading[Any]]:
    return MappingProxyType({name: cast("Reading[Any]", each.present(version)) for name, each in histories.items()})


made = tuple.__new__
"""Makes a named tuple of all its fields, in half the time that calling its class takes."""

_came = itemgetter(0)


def _evidence_s(told: tuple[int, Reading[Value]]) -> float:
    return told[1].evidence_s
