"""Match patterns in a graph: paths along its edges, their absence, and conditions over attributes and poses."""

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
"""The wildcard for every name in the set of subjects that a pattern reads."""


class Match(NamedTuple):
    """One match of patterns.

    Attributes:
        called: the named places of the patterns with their nodes, in the order of the names.
        edges: the edges of the paths, in their order.
    """

    called: tuple[tuple[str, str], ...]
    edges: tuple[EdgeKey, ...]

    def node(self, name: str) -> str:
        """Return the node of a named place.

        Raises:
            KeyError: if the patterns have no place of this name.
        """
        return dict(self.called)[name]


class GraphReader(Protocol):
    """The part of a `Snapshot` that patterns read."""

    @property
    def instant_s(self) -> float:
        """Return the instant for validity, ages and poses."""
        ...

    def __contains__(self, name: object) -> bool:
        """Return whether a node of this name exists."""
        ...

    def node(self, name: str) -> Node:
        """Return a node; raise `AbsentError` if it does not exist."""
        ...

    def nodes(self, type_name: str = "") -> Iterable[Node]:
        """Return the nodes of a type, or all nodes, in the order of their insertion."""
        ...

    def keys_from(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges from a node; some of these edges may not exist."""
        ...

    def keys_to(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges to a node; some of these edges may not exist."""
        ...

    def edge_of(self, key: EdgeKey) -> Edge | None:
        """Return the edge with a key, if it exists."""
        ...

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return the reading of an attribute of a node; raise `AbsentError` if the node does not exist."""
        ...

    def distance_m(self, a: str, b: str) -> float | None:
        """Return the distance of two nodes; None if it is unknown."""
        ...

    def in_view(self, name: str, camera: str) -> bool | None:
        """Return whether a camera sees the origin of a node; None if that is unknown."""
        ...

    def fresh_until_s(self, a: str, b: str) -> float:
        """Return until when the distance of two nodes is known without new writes; infinite if it is unknown."""
        ...


def matches(snapshot: GraphReader, schema: GraphSchema, patterns: Sequence[Pattern]) -> tuple[Match, ...]:
    """Return all matches of patterns that hold together.

    The paths find nodes and edges, in the given order; absences and conditions then filter these matches.

    Raises:
        TypeError: if one of them is not a pattern.
        UnknownNameError: if one of them uses a type that is not declared.
    """
    wrong = [pattern for pattern in patterns if not isinstance(pattern, Pattern)]
    if wrong:
        raise TypeError(f"a pattern is a path, an absence or a condition, not {wrong[0]!r}")
    for path in (pattern.path if isinstance(pattern, Absence) else pattern for pattern in patterns):
        for place in path.places if isinstance(path, Path) else ():
            if place.type:
                schema.node_type(place.type)  # otherwise a misspelt type would look like a type without nodes
    filters = [pattern for pattern in patterns if not isinstance(pattern, Path)]
    return tuple(
        dict.fromkeys(
            Match(tuple(sorted(called.items())), edges)
            for called, edges in _follow_paths(snapshot, schema, patterns)
            if all(_holds(snapshot, schema, pattern, called) for pattern in filters)
        )
    )


def reads(schema: GraphSchema, patterns: Iterable[Pattern]) -> frozenset[Touched]:
    """Return the subjects whose changes can change the matches of patterns; time can change them as well."""
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
    """Return the result of a condition that uses only names of nodes; None if it is unknown."""
    result = term.evaluate(_Scope(snapshot, {}))
    return result if isinstance(result, bool) else None


def posed_pairs(term: Term) -> tuple[tuple[str, str], ...]:
    """Return the pairs of nodes whose relative pose a condition reads."""
    calls = (_CALL.fullmatch(name) for name in sorted(term.variables()))
    return tuple(dict.fromkeys((call[2], call[3]) for call in calls if call is not None))


def next_s(snapshot: GraphReader, schema: GraphSchema, patterns: Sequence[Pattern]) -> float:
    """Return when the matches of patterns can next change without new writes; infinite if never."""
    terms = [pattern for pattern in patterns if isinstance(pattern, Term)]
    instants_s = [math.inf]
    for called, _ in _follow_paths(snapshot, schema, patterns) if terms else ():
        scope = _Scope(snapshot, called)
        for term in terms:
            wait_s = term.flips_s(scope)
            instants_s.append(math.inf if wait_s is None else snapshot.instant_s + wait_s)
            instants_s.extend(scope.until_s(name) for name in term.variables())
    return min(instants_s)


_PartialMatch = tuple[Mapping[str, str], tuple[EdgeKey, ...]]
"""The named places with their nodes so far, and the edges so far."""


def _follow_paths(snapshot: GraphReader, schema: GraphSchema, patterns: Iterable[Pattern]) -> list[_PartialMatch]:
    """Return all matches of the paths among some patterns."""
    partial_matches: list[_PartialMatch] = [({}, ())]
    for path in (pattern for pattern in patterns if isinstance(pattern, Path)):
        partial_matches = [longer for before in partial_matches for longer in _along(snapshot, schema, path, before)]
    return partial_matches


def _along(snapshot: GraphReader, schema: GraphSchema, path: Path, before: _PartialMatch) -> Iterator[_PartialMatch]:
    """Yield all matches of a path, found from its first place with a known node to its end, then to its start."""
    called, edges = before
    places = path.places
    start = next((at for at, place in enumerate(places) if place.name or place.called in called), 0)
    forward_steps = [(at, at + 1, path.links[at]) for at in range(start, len(places) - 1)]
    backward_steps = [(at, at - 1, _turned(path.links[at - 1])) for at in range(start, 0, -1)]
    for name in _candidates(snapshot, schema, places[start], called):
        start_called = {**called, places[start].called: name} if places[start].called else called
        for all_called, taken in _steps(
            snapshot, schema, places, [*forward_steps, *backward_steps], name, start_called
        ):
            yield all_called, (*edges, *(taken[at] for at in range(len(path.links))))


_Steps = Sequence[tuple[int, int, Link]]
_NodesAt = dict[int, str]
_Taken = dict[int, EdgeKey]


def _steps(  # noqa: PLR0917 - shared by the two directions of a path
    snapshot: GraphReader,
    schema: GraphSchema,
    places: Sequence[Place],
    steps: _Steps,
    name: str,
    called: Mapping[str, str],
) -> Iterator[tuple[Mapping[str, str], _Taken]]:
    """Yield all matches of some steps from a node, depth first, without recursion, because paths can be very long."""
    nodes_at: _NodesAt = {steps[0][0]: name} if steps else {}
    taken: _Taken = {}
    called_before = [called]
    candidates = [_neighbours(snapshot, schema, name, steps[0][2])] if steps else []
    if not steps:
        yield called, taken
    while candidates:
        at = len(candidates) - 1
        here, there, _ = steps[at]
        edge, neighbour = next(candidates[at], (None, ""))
        if edge is None:
            candidates.pop()
            called_before.pop()
        elif _fits(snapshot, places[there], neighbour, called_before[at]):
            called_now = (
                {**called_before[at], places[there].called: neighbour} if places[there].called else called_before[at]
            )
            nodes_at[there], taken[min(here, there)] = neighbour, edge.key
            if len(candidates) == len(steps):
                yield called_now, taken
                continue
            called_before.append(called_now)
            then, _, link = steps[at + 1]
            candidates.append(_neighbours(snapshot, schema, nodes_at[then], link))


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
    """Yield the edges at a node that match a link, in the order of their insertion, each with its other end."""
    types = schema.types_of_edges(link.edge)
    is_forward = link.direction is Direction.FORWARD
    keys = snapshot.keys_from(name) if is_forward else snapshot.keys_to(name)
    edges = (snapshot.edge_of(key) for key in keys)
    suitable = [edge for edge in edges if edge is not None and edge.type in types]
    for edge in sorted(suitable, key=lambda edge: edge.number):
        yield edge, edge.target if is_forward else edge.origin


def _turned(link: Link) -> Link:
    is_forward = link.direction is Direction.FORWARD
    return Link(edge=link.edge, direction=Direction.BACKWARD if is_forward else Direction.FORWARD)


def _holds(snapshot: GraphReader, schema: GraphSchema, pattern: Pattern, called: Mapping[str, str]) -> bool:
    if isinstance(pattern, Absence):
        return not any(True for _ in _along(snapshot, schema, pattern.path, (called, ())))
    return isinstance(pattern, Term) and pattern.holds(_Scope(snapshot, called))


def _reads_of(name: str) -> Iterator[Touched]:
    """Yield the subjects whose changes can change the value of a name in a condition."""
    if _CALL.fullmatch(name):
        yield ("frame", ANY)
    else:
        node, _, attribute = name.rpartition(".")
        yield (node, attribute)
        yield (ANY, attribute)  # the name may be that of a place of a path


class _Scope:
    """The scope of a condition: attributes, as `node.attribute`, and functions of poses, as `distance(a, b)`."""

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
                return None  # the attributes of a missing node are unknown
        function, a, b = call[1], self._name(call[2]), self._name(call[3])
        if function == "distance":
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
        """Return until when the value of a name is known without new writes; infinite if it is unknown."""
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
