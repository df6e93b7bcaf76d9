"""Snapshots of the graph: all results of a snapshot belong to one instant, regardless of later writes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from codra_dsl.logic import Term, Value
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.geometry import FrameError, Outcome, Transform
from codra_dsl.runtime.knowledge.change_set import AbsentError, ChangeSubject
from codra_dsl.runtime.knowledge.declarations import Pattern
from codra_dsl.runtime.knowledge.elements import (
    Edge,
    EdgeKey,
    Node,
    element_at_version,
    never_observed_reading,
    present_reading,
)
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.matching import Match, matches, subjects_of_patterns
from codra_dsl.runtime.knowledge.state import Handover, State
from codra_dsl.runtime.values.cell import Reading


class Snapshot:
    """The graph at one instant. Taking a snapshot copies nothing, and reading it takes no lock.

    Attributes:
        instant_s: the instant of the snapshot, for validity, ages and poses.
    """

    __slots__ = ("_schema", "_state", "instant_s")

    def __init__(self, schema: GraphSchema, state: State, instant_s: float) -> None:
        self._schema = schema
        self._state = state
        self.instant_s = instant_s

    @property
    def version(self) -> int:
        """Return the number of changes so far."""
        return self._state.version

    # Nodes and edges

    def __contains__(self, name: object) -> bool:
        return name in self._state.nodes

    def __len__(self) -> int:
        return len(self._state.nodes)

    def node(self, name: str) -> Node:
        """Return a node.

        Raises:
            AbsentError: if the node does not exist.
        """
        node = self._state.nodes.get(name)
        if node is None:
            raise AbsentError(f"the node {name!r} does not exist")
        return element_at_version(node, self._state.version)

    def nodes(self, type_name: str = "", *, where: Term | None = None) -> tuple[Node, ...]:
        """Return nodes in the order of their insertion.

        Args:
            type_name: the type of the nodes; any type if empty.
            where: a condition that uses attributes of the nodes by name. Nodes for which the condition is false or
                unknown are left out.

        Raises:
            UnknownNameError: if the type is not declared, or its nodes lack an attribute that the condition reads.
        """
        selected_nodes: Iterable[Node] = self._state.nodes.values()
        if type_name:
            self._schema.node_type(type_name)
            nodes = self._state.nodes
            candidates = map(nodes.get, self._state.index.names_of_type(type_name))
            selected_nodes = [node for node in candidates if node is not None and node.type == type_name]
        selected_nodes = [element_at_version(node, self._state.version) for node in selected_nodes]
        if where is not None and not isinstance(where, Term):
            raise TypeError(f"`where` must be a condition over attributes, not {where!r}")
        if where is not None:
            self._check_attributes(type_name, selected_nodes, where)
            selected_nodes = [node for node in selected_nodes if where.holds(_Attributes(node, self.instant_s))]
        return tuple(sorted(selected_nodes, key=_get_number))

    def _check_attributes(self, type_name: str, nodes: Iterable[Node], where: Term) -> None:
        """Raise an error if a condition reads an attribute that neither the type nor one of the nodes declares."""
        type_attributes = self._schema.node_type(type_name).attributes if type_name else {}
        for name in where.variables():
            if (
                type_name
                and name not in type_attributes
                and not any(name in self._schema.attributes_of_node(node) for node in nodes)
            ):
                raise unknown_name_error(f"attribute of {type_name!r}", name, type_attributes)

    def edge(self, origin: str, edge: str, target: str) -> Edge:
        """Return an edge.

        Args:
            origin: the name of a node.
            edge: the name of the edge's type, or the edge's label.
            target: the name of a node.

        Raises:
            AbsentError: if the edge does not exist.
            UnknownNameError: if the type of edges is not declared.
        """
        for type_name in self._schema.types_of_edges(edge):
            candidate = self.edge_of((origin, self._schema.edge_type(type_name).label, target))
            if candidate is not None and candidate.type == type_name:
                return candidate
        raise AbsentError(f"the edge {origin} -{edge}-> {target} does not exist")

    def has_edge(self, origin: str, edge: str, target: str) -> bool:
        """Return whether an edge with a type or label goes from one node to another."""
        try:
            self.edge(origin, edge, target)
        except AbsentError:
            return False
        return True

    def edges(self, edge: str = "", *, origin: str = "", target: str = "") -> tuple[Edge, ...]:
        """Return edges in the order of their insertion.

        Args:
            edge: the name of the edges' type, or the edges' label; if empty, edges of all types are returned.
            origin: the name of the edges' origin; if empty, edges from all nodes are returned.
            target: the name of the edges' target; if empty, edges to all nodes are returned.

        Raises:
            UnknownNameError: if the type of edges is not declared.
        """
        types = self._schema.types_of_edges(edge) if edge else None
        candidates = map(self.edge_of, self._candidate_keys(types, origin, target))
        return tuple(
            sorted(
                (
                    candidate
                    for candidate in candidates
                    if candidate is not None
                    and (types is None or candidate.type in types)
                    and (not origin or candidate.origin == origin)
                    and (not target or candidate.target == target)
                ),
                key=_get_number,
            )
        )

    # Attributes

    def get(self, name: str, attribute: str) -> Reading[Any]:
        """Return the reading of an attribute of a node.

        Raises:
            AbsentError: if the node does not exist.
            UnknownNameError: if nodes of its type have no such attribute.
        """
        node = self._state.nodes.get(name) or self.node(name)
        history = node.histories.get(attribute)
        if history is None:
            self._schema.attribute(node, attribute)
            return never_observed_reading(name, attribute)
        reading = history.reading_at(self._state.version)
        return reading if reading.expires_s > self.instant_s else reading.at(self.instant_s)

    def get_of_edge(self, origin: str, edge: str, target: str, attribute: str) -> Reading[Any]:
        """Return the reading of an attribute of an edge; this raises the errors of `edge` and `get`."""
        element = self.edge(origin, edge, target)
        self._schema.attribute_of_edge(element, attribute)
        return present_reading(element, str(element), attribute).at(self.instant_s)

    def history(self, name: str, attribute: str) -> tuple[Reading[Any], ...]:
        """Return the readings of an attribute of a node, ordered by evidence; this raises the errors of `get`."""
        node = self.node(name)
        self._schema.attribute(node, attribute)
        history = node.histories.get(attribute)
        return () if history is None else history.readings_at(node.version)

    # Geometry

    def transform(self, target: str, source: str, instant_s: float | None = None) -> Transform:
        """Return the pose of a node relative to another node.

        The pose is computed along P2's chain of RT edges; each edge is used forward or inverted.

        Args:
            target: the node that is the frame of reference.
            source: the node whose pose is returned.
            instant_s: the instant whose edges are used; None means the instant of the snapshot.

        Raises:
            FrameError: if one of the nodes never had a pose, or the nodes were not connected at that instant.
        """
        return self._state.frames.transform(target, source, self.instant_s if instant_s is None else instant_s)

    def parent(self, name: str, instant_s: float | None = None) -> str | None:
        """Return the parent of a node at an instant; None if the node had no parent.

        Raises:
            FrameError: if the node never had a pose.
        """
        return self._state.frames.parent(name, self.instant_s if instant_s is None else instant_s)

    def distance_m(self, a: str, b: str) -> float | None:
        """Return the distance between two nodes; None if a pose between them is missing or stale."""
        transform = self._fresh_transform(a, b)
        return None if transform is None else math.hypot(*transform.pose.translation_m)

    def in_view(self, name: str, camera: str) -> bool | None:
        """Return whether a camera sees the origin of a node; None if a pose between them is missing or stale.

        Raises:
            AbsentError: if the camera does not exist.
            ValueError: if the type of the camera declares no field of view.
        """
        view = self._schema.node_type(self.node(camera).type).model.view
        if view is None:
            raise ValueError(f"{camera!r} is not a camera: its type {self.node(camera).type!r} has no view")
        transform = self._fresh_transform(camera, name)
        if transform is None:
            return None
        x_m, y_m, z_m = transform.pose.translation_m
        return (
            z_m > 0.0
            and view.nearest_m <= z_m <= view.farthest_m
            and abs(math.atan2(x_m, z_m)) <= view.horizontal_rad / 2.0
            and abs(math.atan2(y_m, z_m)) <= view.vertical_rad / 2.0
        )

    # Patterns

    def match(self, *patterns: Pattern) -> tuple[Match, ...]:
        """Return all matches in which all of the patterns hold.

        Raises:
            UnknownNameError: if a pattern uses a type that is not declared.
        """
        return matches(self, self._schema, patterns)

    def subjects_of(self, *patterns: Pattern) -> frozenset[ChangeSubject]:
        """Return the subjects of changes after which the matches of patterns can differ from those in this snapshot."""
        return subjects_of_patterns(self._schema, patterns)

    def holds(self, *patterns: Pattern) -> bool:
        """Return whether there is a match in which all of the patterns hold; this raises the errors of `match`."""
        return bool(self.match(*patterns))

    def handover(self, task: str) -> Handover:
        """Return the handover of a task: its stage, request and result.

        Raises:
            UnknownNameError: if the task is not declared.
        """
        if task not in self._schema.tasks:
            raise unknown_name_error("task", task, self._schema.tasks)
        return self._state.handovers.get(task) or Handover(task)

    # For matching paths

    def outgoing_keys(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges from a node, in no order. Some of these edges may not exist; see `edge_of`."""
        return self._state.index.outgoing_keys(name)

    def incoming_keys(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges to a node, as `outgoing_keys` does."""
        return self._state.index.incoming_keys(name)

    def edge_of(self, key: EdgeKey) -> Edge | None:
        """Return the edge with a key; None if the edge does not exist."""
        edge = self._state.edges.get(key)
        return None if edge is None else element_at_version(edge, self._state.version)

    def fresh_until_s(self, a: str, b: str) -> float:
        """Return the instant until which the distance between two nodes stays known without new writes.

        If the distance is unknown now, return infinity.
        """
        try:
            until_s = self._state.frames.fresh_until_s(a, b, self.instant_s)
        except FrameError:
            return math.inf
        return until_s if until_s > self.instant_s else math.inf

    def next_update_s(self, a: str, b: str) -> float:
        """Return when the relative pose of two nodes must next be computed; this raises the errors of `transform`."""
        return self._state.frames.next_update_s(a, b, self.instant_s)

    def frames_between(self, a: str, b: str) -> tuple[str, ...]:
        """Return the nodes whose poses define the relative pose of two nodes; this raises the errors of `transform`."""
        return self._state.frames.frames_between(a, b, self.instant_s)

    def measured_s(self, name: str) -> float:
        """Return when the newest pose of a node was measured; this raises the errors of `parent`."""
        return self._state.frames.track(name).newest_s

    def _candidate_keys(self, types: frozenset[str] | None, origin: str, target: str) -> Iterable[EdgeKey]:
        if origin:
            return self.outgoing_keys(origin)
        if target:
            return self.incoming_keys(target)
        if types is None:
            return self._state.edges
        ends = frozenset[str]().union(*(self._schema.edge_type(name).origins for name in types))
        names_of_type = self._state.index.names_of_type
        origins = dict.fromkeys(node for end in ends for node in (end, *names_of_type(end)))
        return (key for node in origins for key in self.outgoing_keys(node))

    def _fresh_transform(self, target: str, source: str) -> Transform | None:
        try:
            transform = self.transform(target, source)
        except FrameError:
            return None
        return None if transform.outcome is Outcome.STALE else transform


class _Attributes:
    """The scope of a condition over the attributes of one node."""

    __slots__ = ("_instant_s", "_node")

    def __init__(self, node: Node, instant_s: float) -> None:
        self._node = node
        self._instant_s = instant_s

    def value(self, name: str) -> Value | None:
        return present_reading(self._node, self._node.name, name).at(self._instant_s).content

    def age_s(self, name: str) -> float | None:
        reading = present_reading(self._node, self._node.name, name).at(self._instant_s)
        return reading.age_s(self._instant_s) if reading.known else None


def _get_number(element: Node | Edge) -> int:
    return element.number
