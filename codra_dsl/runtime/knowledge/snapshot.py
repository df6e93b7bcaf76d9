"""Reading the graph: everything that one snapshot tells is of one instant, whatever is written meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from codra_dsl.logic import Term, Value
from codra_dsl.runtime.errors import unknown
from codra_dsl.runtime.geometry import FrameError, Outcome, Transform
from codra_dsl.runtime.knowledge.change_set import AbsentError
from codra_dsl.runtime.knowledge.declarations import Pattern
from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node, never, present, seen
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import Match, matches
from codra_dsl.runtime.knowledge.state import Handover, State
from codra_dsl.runtime.values.cell import Reading


class Snapshot:
    """The graph at one instant. It costs nothing to take, and no lock to read.

    Attributes:
        instant_s: when it was taken: validity, ages and poses are told of then.
    """

    __slots__ = ("_schema", "_state", "instant_s")

    def __init__(self, schema: GraphSchema, state: State, instant_s: float) -> None:
        self._schema = schema
        self._state = state
        self.instant_s = instant_s

    @property
    def version(self) -> int:
        """Return how many changes had been made."""
        return self._state.version

    # Nodes and edges

    def __contains__(self, name: object) -> bool:
        return name in self._state.nodes

    def __len__(self) -> int:
        return len(self._state.nodes)

    def node(self, name: str) -> Node:
        """Return a node.

        Raises:
            AbsentError: if there is none of this name.
        """
        found = self._state.nodes.get(name)
        if found is None:
            raise AbsentError(f"there is no node {name!r}")
        return seen(found, self._state.version)

    def nodes(self, type_name: str = "", *, where: Term | None = None) -> tuple[Node, ...]:
        """Return nodes in the order in which they came.

        Args:
            type_name: of the nodes; of any type if empty.
            where: a condition over their attributes by their own names, which must certainly hold.

        Raises:
            UnknownNameError: if there is no such type, or nodes of it have no such attribute.
        """
        found: Iterable[Node] = self._state.nodes.values()
        if type_name:
            self._schema.node_type(type_name)
            nodes = self._state.nodes
            among = map(nodes.get, self._state.index.of_type(type_name))
            found = [node for node in among if node is not None and node.type == type_name]
        found = [seen(node, self._state.version) for node in found]
        if where is not None and not isinstance(where, Term):
            raise TypeError(f"where is a condition over attributes, not {where!r}")
        if where is not None:
            self._check_attributes(type_name, found, where)
            found = [node for node in found if where.holds(_Attributes(node, self.instant_s))]
        return tuple(sorted(found, key=_number))

    def _check_attributes(self, type_name: str, nodes: Iterable[Node], where: Term) -> None:
        """Refuse a condition over an attribute that no node of a type can have, apart from some nodes by their name."""
        own = self._schema.node_type(type_name).attributes if type_name else {}
        for name in where.variables():
            if type_name and name not in own and not any(name in self._schema.of_node(node) for node in nodes):
                raise unknown(f"attribute of {type_name!r}", name, own)

    def edge(self, origin: str, edge: str, target: str) -> Edge:
        """Return an edge.

        Args:
            origin: the name of a node.
            edge: the name of its type, or its label.
            target: the name of a node.

        Raises:
            AbsentError: if there is none.
            UnknownNameError: if there is no such type of edges.
        """
        for type_name in self._schema.types_of_edges(edge):
            found = self.edge_of((origin, self._schema.edge_type(type_name).label, target))
            if found is not None and found.type == type_name:
                return found
        raise AbsentError(f"there is no edge {origin} -{edge}-> {target}")

    def has_edge(self, origin: str, edge: str, target: str) -> bool:
        """Return whether there is an edge of a type, or with a label, from one node to another."""
        try:
            self.edge(origin, edge, target)
        except AbsentError:
            return False
        return True

    def edges(self, edge: str = "", *, origin: str = "", target: str = "") -> tuple[Edge, ...]:
        """Return edges in the order in which they came.

        Args:
            edge: the name of their type, or their label; any if empty.
            origin: where they begin; anywhere if empty.
            target: where they end; anywhere if empty.

        Raises:
            UnknownNameError: if there is no such type of edges.
        """
        types = self._schema.types_of_edges(edge) if edge else None
        found = map(self.edge_of, self._keys(types, origin, target))
        return tuple(
            sorted(
                (
                    each
                    for each in found
                    if each is not None
                    and (types is None or each.type in types)
                    and (not origin or each.origin == origin)
                    and (not target or each.target == target)
                ),
                key=_number,
            )
        )

    # Attributes

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return what is known of an attribute of a node.

        Raises:
            AbsentError: if there is no such node.
            UnknownNameError: if nodes of its type have no such attribute.
        """
        node = self._state.nodes.get(name) or self.node(name)
        history = node.histories.get(attribute)
        if history is None:
            self._schema.attribute(node, attribute)
            return never(name, attribute)
        reading = history.present(self._state.version)
        return reading if reading.expires_s > self.instant_s else reading.at(self.instant_s)

    def get_of_edge(self, origin: str, edge: str, target: str, attribute: str) -> Reading[Any]:
        """Return what is known of an attribute of an edge; it raises what `edge` and `get` do."""
        found = self.edge(origin, edge, target)
        self._schema.attribute_of_edge(found, attribute)
        return present(found, str(found), attribute).at(self.instant_s)

    def history(self, name: str, attribute: str) -> tuple[Reading[Any], ...]:
        """Return the readings of an attribute of a node, by their evidence; it raises what `get` does."""
        node = self.node(name)
        self._schema.attribute(node, attribute)
        history = node.histories.get(attribute)
        return () if history is None else history.all(node.version)

    # Geometry

    def transform(self, target: str, source: str, instant_s: float | None = None) -> Transform:
        """Return where one node stands in another: P2's chain of RT edges, forward and inverted.

        Args:
            target: the node to express it in.
            source: the node that is asked about.
            instant_s: when; at the instant of the snapshot, if None. The tree is followed as it stood then.

        Raises:
            FrameError: if one of them never stood anywhere, or they were not connected then.
        """
        return self._state.frames.transform(target, source, self.instant_s if instant_s is None else instant_s)

    def parent(self, name: str, instant_s: float | None = None) -> str | None:
        """Return in which node a node stands, or stood; None if in none.

        Raises:
            FrameError: if it never stood anywhere.
        """
        return self._state.frames.parent(name, self.instant_s if instant_s is None else instant_s)

    def distance_m(self, a: str, b: str) -> float | None:
        """Return how far apart two nodes are; None if one stands nowhere, or where it stands is stale."""
        found = self._standing(a, b)
        return None if found is None else math.hypot(*found.pose.translation_m)

    def in_view(self, name: str, camera: str) -> bool | None:
        """Return whether a camera sees the origin of a node; None if one stands nowhere, or where it stands is stale.

        Raises:
            AbsentError: if there is no such camera.
            ValueError: if the node has no view.
        """
        view = self._schema.node_type(self.node(camera).type).model.view
        if view is None:
            raise ValueError(f"{camera!r} is no camera: its type {self.node(camera).type!r} has no view")
        found = self._standing(camera, name)
        if found is None:
            return None
        x_m, y_m, z_m = found.pose.translation_m
        return (
            z_m > 0.0
            and view.nearest_m <= z_m <= view.farthest_m
            and abs(math.atan2(x_m, z_m)) <= view.horizontal_rad / 2.0
            and abs(math.atan2(y_m, z_m)) <= view.vertical_rad / 2.0
        )

    # Patterns

    def match(self, *patterns: Pattern) -> tuple[Match, ...]:
        """Return all ways in which patterns hold together.

        Raises:
            UnknownNameError: if a pattern names a type that is not declared.
        """
        return matches(self, self._schema, patterns)

    def holds(self, *patterns: Pattern) -> bool:
        """Return whether patterns hold together; it raises what `match` does."""
        return bool(self.match(*patterns))

    def handover(self, task: str) -> Handover:
        """Return how far a task is.

        Raises:
            UnknownNameError: if there is no such task.
        """
        if task not in self._schema.tasks:
            raise unknown("task", task, self._schema.tasks)
        return self._state.handovers.get(task) or Handover(task)

    # For those who follow paths

    def keys_from(self, name: str) -> Iterable[EdgeKey]:
        """Return what tells the edges from a node apart, in no order; not each has an edge, and `edge_of` knows."""
        return self._state.index.out(name)

    def keys_to(self, name: str) -> Iterable[EdgeKey]:
        """Return what tells the edges to a node apart, as `keys_from` does."""
        return self._state.index.into(name)

    def edge_of(self, key: EdgeKey) -> Edge | None:
        """Return the edge that a key names, if there is one."""
        found = self._state.edges.get(key)
        return None if found is None else seen(found, self._state.version)

    def fresh_until_s(self, a: str, b: str) -> float:
        """Return until when the distance of two nodes is known if nothing is written; infinite if it is not."""
        try:
            until_s = self._state.frames.fresh_until_s(a, b, self.instant_s)
        except FrameError:
            return math.inf
        return until_s if until_s > self.instant_s else math.inf

    def next_s(self, a: str, b: str) -> float:
        """Return when what poses tell of two nodes is next to be asked again; it raises what `transform` does."""
        return self._state.frames.next_s(a, b, self.instant_s)

    def frames_between(self, a: str, b: str) -> tuple[str, ...]:
        """Return the nodes from whose poses it follows where two stand; it raises what `transform` does."""
        return self._state.frames.between(a, b, self.instant_s)

    def measured_s(self, name: str) -> float:
        """Return when the newest pose of a node was measured; it raises what `parent` does."""
        return self._state.frames.track(name).newest_s

    def _keys(self, types: frozenset[str] | None, origin: str, target: str) -> Iterable[EdgeKey]:
        if origin:
            return self.keys_from(origin)
        if target:
            return self.keys_to(target)
        if types is None:
            return self._state.edges
        ends = frozenset[str]().union(*(self._schema.edge_type(name).origins for name in types))
        of_type = self._state.index.of_type
        origins = dict.fromkeys(node for end in ends for node in (end, *of_type(end)))
        return (key for node in origins for key in self.keys_from(node))

    def _standing(self, target: str, source: str) -> Transform | None:
        try:
            found = self.transform(target, source)
        except FrameError:
            return None
        return None if found.outcome is Outcome.STALE else found


class _Attributes:
    """The attributes of one node, as a condition reads them."""

    __slots__ = ("_instant_s", "_node")

    def __init__(self, node: Node, instant_s: float) -> None:
        self._node = node
        self._instant_s = instant_s

    def value(self, name: str) -> Value | None:
        return present(self._node, self._node.name, name).at(self._instant_s).content

    def age_s(self, name: str) -> float | None:
        reading = present(self._node, self._node.name, name).at(self._instant_s)
        return reading.age_s(self._instant_s) if reading.known else None


def _number(element: Node | Edge) -> int:
    return element.number
