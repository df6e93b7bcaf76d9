"""Match patterns in a graph: paths along its edges, their absence, and conditions over attributes and poses."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from codra_dsl.logic import Term, Value
from codra_dsl.runtime.errors import UnknownNameError
from codra_dsl.runtime.knowledge.change_set import AbsentError, ChangeSubject
from codra_dsl.runtime.knowledge.declarations import Absence, Direction, Link, Path, Pattern, Place
from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.values.cell import Reading

_POSE_FUNCTION = re.compile(r"(distance|in_view)\((.+), (.+)\)")

ANY = ""
"""The wildcard in the subjects that a pattern reads: it matches every name."""


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

    def outgoing_keys(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges from a node; some of these edges may not exist."""
        ...

    def incoming_keys(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges to a node; some of these edges may not exist."""
        ...

    def edge_of(self, key: EdgeKey) -> Edge | None:
        """Return the edge with a key; None if the edge does not exist."""
        ...

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return the reading of an attribute of a node; raise `AbsentError` if the node does not exist."""
        ...

    def distance_m(self, a: str, b: str) -> float | None:
        """Return the distance between two nodes; None if it is unknown."""
        ...

    def in_view(self, name: str, camera: str) -> bool | None:
        """Return whether a camera sees the origin of a node; None if the answer is unknown."""
        ...

    def fresh_until_s(self, a: str, b: str) -> float:
        """Return the instant until which the distance between two nodes stays known without new writes.

        If the distance is unknown now, return infinity.
        """
        ...


def matches(snapshot: GraphReader, schema: GraphSchema, patterns: Sequence[Pattern]) -> tuple[Match, ...]:
    """Return all matches in which all of the patterns hold.

    First the paths find nodes and edges, one path after another in the given order. Then the absences and conditions
    filter these matches.

    Raises:
        TypeError: if one of `patterns` is not a pattern.
        UnknownNameError: if a pattern uses a type that is not declared.
    """
    wrong_patterns = [pattern for pattern in patterns if not isinstance(pattern, Pattern)]
    if wrong_patterns:
        raise TypeError(f"a pattern is a path, an absence or a condition, not {wrong_patterns[0]!r}")
    for path in (pattern.path if isinstance(pattern, Absence) else pattern for pattern in patterns):
        for place in path.places if isinstance(path, Path) else ():
            if place.type:
                schema.node_type(place.type)  # otherwise a misspelt type would look like a type without nodes
    filters = [pattern for pattern in patterns if not isinstance(pattern, Path)]
    return tuple(
        dict.fromkeys(
            Match(tuple(sorted(bindings.items())), edges)
            for bindings, edges in _follow_paths(snapshot, schema, patterns)
            if all(_holds(snapshot, schema, pattern, bindings) for pattern in filters)
        )
    )


def subjects_of_patterns(schema: GraphSchema, patterns: Iterable[Pattern]) -> frozenset[ChangeSubject]:
    """Return the subjects whose changes can change the matches of patterns; the matches can also change with time."""
    subjects: set[ChangeSubject] = set()
    for pattern in patterns:
        if isinstance(pattern, Term):
            subjects.update(subject for name in pattern.variables() for subject in _subjects_of_name(name))
            continue
        path = pattern.path if isinstance(pattern, Absence) else pattern
        subjects.update(("edge", name) for link in path.links for name in schema.types_of_edges(link.edge))
        if not path.links:
            subjects.add(("node", path.places[0].type or ANY))
    return frozenset(subjects)


def term_value(snapshot: GraphReader, term: Term) -> Value | None:
    """Return the value of a term without names of places; None if the value is unknown."""
    return term.evaluate(_Scope(snapshot, {}))


def relative_pose_pairs(term: Term) -> tuple[tuple[str, str], ...]:
    """Return the pairs of nodes whose relative pose a condition reads."""
    calls = (_POSE_FUNCTION.fullmatch(name) for name in sorted(term.variables()))
    return tuple(dict.fromkeys((call[2], call[3]) for call in calls if call is not None))


def next_change_s(snapshot: GraphReader, schema: GraphSchema, patterns: Sequence[Pattern]) -> float:
    """Return when the matches of patterns can next change without new writes; infinite if never."""
    terms = [pattern for pattern in patterns if isinstance(pattern, Term)]
    instants_s = [math.inf]
    for bindings, _ in _follow_paths(snapshot, schema, patterns) if terms else ():
        scope = _Scope(snapshot, bindings)
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
        partial_matches = [
            longer_match
            for partial_match in partial_matches
            for longer_match in _follow_path(snapshot, schema, path, partial_match)
        ]
    return partial_matches


def _follow_path(
    snapshot: GraphReader, schema: GraphSchema, path: Path, partial_match: _PartialMatch
) -> Iterator[_PartialMatch]:
    """Yield all matches of a path.

    The search begins at the first place whose node is known, or else at the first place of the path. It follows the
    path from this place to the end, and then from this place back to the start.
    """
    bindings, edges = partial_match
    places = path.places
    start = next((index for index, place in enumerate(places) if place.name or place.called in bindings), 0)
    forward_steps = [(index, index + 1, path.links[index]) for index in range(start, len(places) - 1)]
    backward_steps = [(index, index - 1, _reverse_link(path.links[index - 1])) for index in range(start, 0, -1)]
    for name in _candidates(snapshot, schema, places[start], bindings):
        start_bindings = {**bindings, places[start].called: name} if places[start].called else bindings
        for path_bindings, edge_keys in _follow_steps(
            snapshot, schema, places, [*forward_steps, *backward_steps], name, start_bindings
        ):
            yield path_bindings, (*edges, *(edge_keys[index] for index in range(len(path.links))))


_Steps = Sequence[tuple[int, int, Link]]
_NodesByPlace = dict[int, str]
_EdgeKeysByLink = dict[int, EdgeKey]


def _follow_steps(  # noqa: PLR0917 - shared by the two directions of a path
    snapshot: GraphReader,
    schema: GraphSchema,
    places: Sequence[Place],
    steps: _Steps,
    start_node: str,
    bindings: Mapping[str, str],
) -> Iterator[tuple[Mapping[str, str], _EdgeKeysByLink]]:
    """Yield all matches of some steps from a node, depth first, but not recursively: paths can be very long."""
    nodes_by_place: _NodesByPlace = {steps[0][0]: start_node} if steps else {}
    edge_keys: _EdgeKeysByLink = {}
    bindings_stack = [bindings]
    neighbours_stack = [_neighbours(snapshot, schema, start_node, steps[0][2])] if steps else []
    if not steps:
        yield bindings, edge_keys
    while neighbours_stack:
        step_index = len(neighbours_stack) - 1
        from_index, to_index, _ = steps[step_index]
        edge, neighbour = next(neighbours_stack[step_index], (None, ""))
        if edge is None:
            neighbours_stack.pop()
            bindings_stack.pop()
        elif _fits(snapshot, places[to_index], neighbour, bindings_stack[step_index]):
            bindings_after = (
                {**bindings_stack[step_index], places[to_index].called: neighbour}
                if places[to_index].called
                else bindings_stack[step_index]
            )
            nodes_by_place[to_index], edge_keys[min(from_index, to_index)] = neighbour, edge.key
            if len(neighbours_stack) == len(steps):
                yield bindings_after, edge_keys
                continue
            bindings_stack.append(bindings_after)
            next_index, _, link = steps[step_index + 1]
            neighbours_stack.append(_neighbours(snapshot, schema, nodes_by_place[next_index], link))


def _candidates(snapshot: GraphReader, schema: GraphSchema, place: Place, bindings: Mapping[str, str]) -> Iterable[str]:
    known_name = place.name or bindings.get(place.called, "")
    if known_name:
        return (known_name,) if _fits(snapshot, place, known_name, bindings) else ()
    if place.type:
        schema.node_type(place.type)
    return [node.name for node in snapshot.nodes(place.type)]


def _fits(snapshot: GraphReader, place: Place, name: str, bindings: Mapping[str, str]) -> bool:
    if name not in snapshot or (place.name and place.name != name):
        return False
    if place.type and snapshot.node(name).type != place.type:
        return False
    return bindings.get(place.called, name) == name


def _neighbours(snapshot: GraphReader, schema: GraphSchema, name: str, link: Link) -> Iterator[tuple[Edge, str]]:
    """Yield the edges at a node that match a link, each with the node at its other end, in order of insertion."""
    types = schema.types_of_edges(link.edge)
    is_forward = link.direction is Direction.FORWARD
    keys = snapshot.outgoing_keys(name) if is_forward else snapshot.incoming_keys(name)
    edges = (snapshot.edge_of(key) for key in keys)
    suitable_edges = [edge for edge in edges if edge is not None and edge.type in types]
    for edge in sorted(suitable_edges, key=lambda edge: edge.number):
        yield edge, edge.target if is_forward else edge.origin


def _reverse_link(link: Link) -> Link:
    is_forward = link.direction is Direction.FORWARD
    return Link(edge=link.edge, direction=Direction.BACKWARD if is_forward else Direction.FORWARD)


def _holds(snapshot: GraphReader, schema: GraphSchema, pattern: Pattern, bindings: Mapping[str, str]) -> bool:
    if isinstance(pattern, Absence):
        return not any(True for _ in _follow_path(snapshot, schema, pattern.path, (bindings, ())))
    return isinstance(pattern, Term) and pattern.holds(_Scope(snapshot, bindings))


def _subjects_of_name(name: str) -> Iterator[ChangeSubject]:
    """Yield the subjects whose changes can change the value of a name in a condition."""
    if _POSE_FUNCTION.fullmatch(name):
        yield ("frame", ANY)
    else:
        node, _, attribute = name.rpartition(".")
        yield (node, attribute)
        yield (ANY, attribute)  # the name may be the name of a place in a path


class _Scope:
    """The scope of a condition: attributes, as `node.attribute`, and functions of poses, as `distance(a, b)`."""

    __slots__ = ("_bindings", "_snapshot")

    def __init__(self, snapshot: GraphReader, bindings: Mapping[str, str]) -> None:
        self._snapshot = snapshot
        self._bindings = bindings

    def value(self, name: str) -> Value | None:
        call = _POSE_FUNCTION.fullmatch(name)
        if call is None:
            node, _, attribute = name.rpartition(".")
            try:
                return self._snapshot.get(self._node_name(node), attribute).content
            except AbsentError:
                return None  # the attributes of a missing node are unknown
        function_name, a, b = call[1], self._node_name(call[2]), self._node_name(call[3])
        if function_name == "distance":
            return self._snapshot.distance_m(a, b)
        return self._snapshot.in_view(a, b) if b in self._snapshot else None

    def age_s(self, name: str) -> float | None:
        node, _, attribute = name.rpartition(".")
        try:
            reading = self._snapshot.get(self._node_name(node), attribute)
        except AbsentError:
            return None
        return reading.age_s(self._snapshot.instant_s) if reading.known else None

    def until_s(self, name: str) -> float:
        """Return the instant until which the value of a name stays known without new writes.

        If the value is unknown now, return infinity.
        """
        call = _POSE_FUNCTION.fullmatch(name)
        if call is not None:
            return self._snapshot.fresh_until_s(self._node_name(call[2]), self._node_name(call[3]))
        node, _, attribute = name.rpartition(".")
        try:
            reading = self._snapshot.get(self._node_name(node), attribute)
        except (AbsentError, UnknownNameError):
            return math.inf
        return reading.expires_s if reading.known else math.inf

    def _node_name(self, name: str) -> str:
        return self._bindings.get(name, name)
