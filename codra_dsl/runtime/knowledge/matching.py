"""How patterns hold in a graph: paths along its edges, their absence, and conditions over attributes and poses."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from codra_dsl.logic import Term, Value
from codra_dsl.runtime.errors import UnknownNameError
from codra_dsl.runtime.knowledge.change_set import AbsentError, Touched
from codra_dsl.runtime.knowledge.declarations import Absence, Direction, Link, Path, Pattern, Place
from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.values.cell import Reading

_CALL = re.compile(r"(distance|in_view)\((.+), (.+)\)")

ANY = ""
"""Stands for every name in what a pattern reads."""


class Match(NamedTuple):
    """One way in which patterns hold.

    Attributes:
        called: the nodes that the patterns call by a name, in the order of these names.
        edges: the edges of the paths, in their order.
    """

    called: tuple[tuple[str, str], ...]
    edges: tuple[EdgeKey, ...]

    def node(self, name: str) -> str:
        """Return the node that the patterns call by a name.

        Raises:
            KeyError: if they call none so.
        """
        return dict(self.called)[name]


class GraphReader(Protocol):
    """One version of the graph, as far as patterns read it: a `Snapshot`."""

    @property
    def instant_s(self) -> float:
        """Return the instant at which validity, ages and poses are judged."""
        ...

    def __contains__(self, name: object) -> bool:
        """Return whether there is a node of this name."""
        ...

    def node(self, name: str) -> Node:
        """Return a node; raise `AbsentError` if there is none of this name."""
        ...

    def nodes(self, type_name: str = "") -> Iterable[Node]:
        """Return nodes of a type, or all nodes, in the order in which they came."""
        ...

    def keys_from(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges from a node; some may have no edge."""
        ...

    def keys_to(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges to a node; some may have no edge."""
        ...

    def edge_of(self, key: EdgeKey) -> Edge | None:
        """Return the edge of a key, if there is one."""
        ...

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return what is known of an attribute of a node; raise `AbsentError` if there is no such node."""
        ...

    def distance_m(self, a: str, b: str) -> float | None:
        """Return the distance of two nodes; None if it is unknown."""
        ...

    def in_view(self, name: str, camera: str) -> bool | None:
        """Return whether a camera sees the origin of a node; None if that is unknown."""
        ...

    def fresh_until_s(self, a: str, b: str) -> float:
        """Return until when the distance of two nodes is known if nothing is written; infinite if it is unknown."""
        ...


def matches(snapshot: GraphReader, schema: GraphSchema, patterns: Sequence[Pattern]) -> tuple[Match, ...]:
    """Return all ways in which patterns hold together.

    Paths find nodes and edges, in the order in which they are given; absences and conditions then judge what was found.

    Raises:
        TypeError: if one of them is no pattern.
        UnknownNameError: if one of them names a type that is not declared.
    """
    wrong = [each for each in patterns if not isinstance(each, Pattern)]
    if wrong:
        raise TypeError(f"a pattern is a path, an absence or a condition, not {wrong[0]!r}")
    for path in (each.path if isinstance(each, Absence) else each for each in patterns):
        for place in path.places if isinstance(path, Path) else ():
            if place.type:
                schema.node_type(place.type)  # else a type that is misspelt would be one of which there is no node
    judges = [each for each in patterns if not isinstance(each, Path)]
    return tuple(
        dict.fromkeys(
            Match(tuple(sorted(called.items())), edges)
            for called, edges in _found(snapshot, schema, patterns)
            if all(_holds(snapshot, schema, judge, called) for judge in judges)
        )
    )


def reads(schema: GraphSchema, patterns: Iterable[Pattern]) -> frozenset[Touched]:
    """Return what must be touched before patterns can hold in other ways, time aside."""
    read: set[Touched] = set()
    for pattern in patterns:
        if isinstance(pattern, Term):
            read.update(touched for name in pattern.variables() for touched in _reads_of(name))
            continue
        path = pattern.path if isinstance(pattern, Absence) else pattern
        read.update(("edge", name) for link in path.links for name in schema.types_of_edges(link.edge))
        if not path.links:
            read.add(("node", path.places[0].type or ANY))
    return frozenset(read)


def truth(snapshot: GraphReader, term: Term) -> bool | None:
    """Return what a condition comes to in a graph that calls no node by another name; None if that is unknown."""
    found = term.evaluate(_Scope(snapshot, {}))
    return found if isinstance(found, bool) else None


def asked_of(term: Term) -> tuple[tuple[str, str], ...]:
    """Return the pairs of nodes of which a condition asks where one stands to the other."""
    calls = (_CALL.fullmatch(name) for name in sorted(term.variables()))
    return tuple(dict.fromkeys((call[2], call[3]) for call in calls if call is not None))


def next_s(snapshot: GraphReader, schema: GraphSchema, patterns: Sequence[Pattern]) -> float:
    """Return when patterns can next hold in other ways though nothing is written; infinite if never."""
    terms = [each for each in patterns if isinstance(each, Term)]
    instants_s = [math.inf]
    for called, _ in _found(snapshot, schema, patterns) if terms else ():
        scope = _Scope(snapshot, called)
        for term in terms:
            wait_s = term.flips_s(scope)
            instants_s.append(math.inf if wait_s is None else snapshot.instant_s + wait_s)
            instants_s.extend(scope.until_s(name) for name in term.variables())
    return min(instants_s)


_Found = tuple[Mapping[str, str], tuple[EdgeKey, ...]]
"""The nodes that are called by a name so far, and the edges."""


def _found(snapshot: GraphReader, schema: GraphSchema, patterns: Iterable[Pattern]) -> list[_Found]:
    """Return all ways to follow the paths among some patterns."""
    found: list[_Found] = [({}, ())]
    for path in (each for each in patterns if isinstance(each, Path)):
        found = [more for each in found for more in _along(snapshot, schema, path, each)]
    return found


def _along(snapshot: GraphReader, schema: GraphSchema, path: Path, found: _Found) -> Iterator[_Found]:
    """Yield all ways to follow a path: from the first place that is one certain node, to the end, then to the start."""
    called, edges = found
    places = path.places
    start = next((at for at, place in enumerate(places) if place.name or place.called in called), 0)
    to_end = [(at, at + 1, path.links[at]) for at in range(start, len(places) - 1)]
    to_start = [(at, at - 1, _turned(path.links[at - 1])) for at in range(start, 0, -1)]
    for name in _candidates(snapshot, schema, places[start], called):
        begun = {**called, places[start].called: name} if places[start].called else called
        for more, taken in _steps(snapshot, schema, places, [*to_end, *to_start], name, begun):
            yield more, (*edges, *(taken[at] for at in range(len(path.links))))


_Steps = Sequence[tuple[int, int, Link]]
_Standing = dict[int, str]
_Taken = dict[int, EdgeKey]


def _steps(  # noqa: PLR0917 - what the two ends of a path share
    snapshot: GraphReader,
    schema: GraphSchema,
    places: Sequence[Place],
    steps: _Steps,
    name: str,
    called: Mapping[str, str],
) -> Iterator[tuple[Mapping[str, str], _Taken]]:
    """Yield all ways to take some steps from a node, depth first; a path may be longer than Python can call itself."""
    standing: _Standing = {steps[0][0]: name} if steps else {}
    taken: _Taken = {}
    begun = [called]
    ways = [_neighbours(snapshot, schema, name, steps[0][2])] if steps else []
    if not steps:
        yield called, taken
    while ways:
        at = len(ways) - 1
        here, there, _ = steps[at]
        edge, found = next(ways[at], (None, ""))
        if edge is None:
            ways.pop()
            begun.pop()
        elif _fits(snapshot, places[there], found, begun[at]):
            more = {**begun[at], places[there].called: found} if places[there].called else begun[at]
            standing[there], taken[min(here, there)] = found, edge.key
            if len(ways) == len(steps):
                yield more, taken
                continue
            begun.append(more)
            then, _, link = steps[at + 1]
            ways.append(_neighbours(snapshot, schema, standing[then], link))


def _candidates(snapshot: GraphReader, schema: GraphSchema, place: Place, called: Mapping[str, str]) -> Iterable[str]:
    certain = place.name or called.get(place.called, "")
    if certain:
        return (certain,) if _fits(snapshot, place, certain, called) else ()
    if place.type:
        schema.node_type(place.type)
    return [node.name for node in snapshot.nodes(place.type)]


def _fits(snapshot: GraphReader, place: Place, name: str, called: Mapping[str, str]) -> bool:
    if name not in snapshot or (place.name and place.name != name):
        return False
    if place.type and snapshot.node(name).type != place.type:
        return False
    return called.get(place.called, name) == name


def _neighbours(snapshot: GraphReader, schema: GraphSchema, name: str, link: Link) -> Iterator[tuple[Edge, str]]:
    """Yield the edges that a link can be at a node, in the order in which they came, and where they lead."""
    types = schema.types_of_edges(link.edge)
    is_forward = link.direction is Direction.FORWARD
    keys = snapshot.keys_from(name) if is_forward else snapshot.keys_to(name)
    edges = (snapshot.edge_of(key) for key in keys)
    suitable = [edge for edge in edges if edge is not None and edge.type in types]
    for edge in sorted(suitable, key=lambda each: each.number):
        yield edge, edge.target if is_forward else edge.origin


def _turned(link: Link) -> Link:
    is_forward = link.direction is Direction.FORWARD
    return Link(edge=link.edge, direction=Direction.BACKWARD if is_forward else Direction.FORWARD)


def _holds(snapshot: GraphReader, schema: GraphSchema, pattern: Pattern, called: Mapping[str, str]) -> bool:
    if isinstance(pattern, Absence):
        return not any(True for _ in _along(snapshot, schema, pattern.path, (called, ())))
    return isinstance(pattern, Term) and pattern.holds(_Scope(snapshot, called))


def _reads_of(name: str) -> Iterator[Touched]:
    """Yield what must be touched before a name in a condition can be something else."""
    if _CALL.fullmatch(name):
        yield ("frame", ANY)
    else:
        node, _, attribute = name.rpartition(".")
        yield (node, attribute)
        yield (ANY, attribute)  # the name of a node may be what a path calls it


class _Scope:
    """Where a condition finds attributes, as `node.attribute`, and what poses tell, as `distance(a, b)`."""

    __slots__ = ("_called", "_snapshot")

    def __init__(self, snapshot: GraphReader, called: Mapping[str, str]) -> None:
        self._snapshot = snapshot
        self._called = called

    def value(self, name: str) -> Value | None:
        call = _CALL.fullmatch(name)
        if call is None:
            node, _, attribute = name.rpartition(".")
            try:
                return self._snapshot.get(self._name(node), attribute).content
            except AbsentError:
                return None  # nothing is known of what is not there
        word, a, b = call[1], self._name(call[2]), self._name(call[3])
        if word == "distance":
            return self._snapshot.distance_m(a, b)
        return self._snapshot.in_view(a, b) if b in self._snapshot else None

    def age_s(self, name: str) -> float | None:
        node, _, attribute = name.rpartition(".")
        try:
            reading = self._snapshot.get(self._name(node), attribute)
        except AbsentError:
            return None
        return reading.age_s(self._snapshot.instant_s) if reading.known else None

    def until_s(self, name: str) -> float:
        """Return until when what a name stands for is known, if it is and nothing is written."""
        call = _CALL.fullmatch(name)
        if call is not None:
            return self._snapshot.fresh_until_s(self._name(call[2]), self._name(call[3]))
        node, _, attribute = name.rpartition(".")
        try:
            reading = self._snapshot.get(self._name(node), attribute)
        except (AbsentError, UnknownNameError):
            return math.inf
        return reading.expires_s if reading.known else math.inf

    def _name(self, name: str) -> str:
        return self._called.get(name, name)
