"""Export a knowledge graph as a DSR graph, with the parts of an import that the knowledge graph does not hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.knowledge.elements import Edge, Node
from codra_dsl.runtime.knowledge.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue, ValueCode, encode_value
from codra_dsl.runtime.knowledge.exchange.import_ import DERIVED, EDGE_TYPE, DsrImport, Subject
from codra_dsl.runtime.knowledge.exchange.rigid import MILLIMETRE_M, POSE_ATTRIBUTES, attributes_of, pose_of
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema, Stage
from codra_dsl.runtime.knowledge.knowledge import Knowledge
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.values.cell import Reading


def export_dsr(knowledge: Knowledge, beside: DsrImport | None = None, *, unit_m: float = MILLIMETRE_M) -> DsrGraph:
    """Return the present graph as a DSR graph; unknown attributes are left out.

    Args:
        knowledge: the graph.
        beside: the import that the graph began with, if any. Parts of the import that the graph does not hold, and
            unchanged parts, are exported as they were read; parts that were deleted meanwhile are left out.
        unit_m: the unit of translations, in metres; ignored if `beside` is given, whose unit is used.
    """
    start = beside or DsrImport(
        model=knowledge.model, document=DsrGraph(), skipped=(), imported=frozenset(), unit_m=unit_m
    )
    exporter = _Exporter(knowledge, start)
    return DsrGraph(
        nodes=tuple(exporter.nodes()),
        edges=tuple(exporter.edges()),
        extra=start.document.extra,
        model_extra=start.document.model_extra,
    )


class _Exporter:
    """Exports one snapshot, with the import that the graph began with."""

    def __init__(self, knowledge: Knowledge, start: DsrImport) -> None:
        self._schema = GraphSchema(knowledge.model)
        self._snapshot = knowledge.snapshot()
        self._start = start
        self._nodes_before = {node.name: node for node in start.document.nodes}
        names = {node.number: node.name for node in start.document.nodes}
        self._edges_before = {
            (names[edge.origin], edge.label, names[edge.target]): edge for edge in start.document.edges
        }
        self._numbers = self._assign_numbers(names)
        kept_keys = (key for key in self._edges_before if key not in start.imported and self._is_kept_edge(key))
        edge_keys = [*kept_keys, *(edge.key for edge in self._snapshot.edges())]
        self._parents = {key[2]: key[0] for key in edge_keys if key[1] == RT}
        keys_before = sorted(
            self._edges_before, key=start.imported.__contains__
        )  # edges that the graph holds take precedence
        self._parents_before = {key[2]: key[0] for key in keys_before if key[1] == RT}

    def nodes(self) -> Iterator[DsrNode]:
        """Yield the nodes: first those of the import in their order, then the others in the order of insertion."""
        for node in self._start.document.nodes:
            if node.name in self._numbers:
                yield self._node(self._snapshot.node(node.name), node) if node.name in self._snapshot else node
        for own_node in self._snapshot.nodes():
            if own_node.name not in self._nodes_before:
                yield self._node(own_node, None)

    def edges(self) -> Iterator[DsrEdge]:
        """Yield the edges: first those of the import in their order, then the others in the order of insertion."""
        present_edges = {edge.key: edge for edge in self._snapshot.edges()}
        for key, edge in self._edges_before.items():
            if key in present_edges:
                yield self._edge(present_edges[key], edge)
            elif key not in self._start.imported and self._is_kept_edge(key):
                yield edge
        for key, own_edge in present_edges.items():
            if key not in self._edges_before:
                yield self._edge(own_edge, None)

    def _assign_numbers(self, names: Mapping[int, str]) -> dict[str, int]:
        """Return the numbers of all nodes; new nodes get unused numbers."""
        numbers = {
            name: number
            for number, name in names.items()
            if name in self._snapshot or (name,) not in self._start.imported
        }
        free_numbers = (number for number in range(1, 2**64) if number not in names)
        for node in self._snapshot.nodes():
            if node.name not in numbers:
                numbers[node.name] = next(free_numbers)
        return numbers

    def _is_kept_edge(self, key: Subject) -> bool:
        """Return whether to export an edge of the import that the graph does not hold.

        It is exported if both of its nodes are exported, unless a step of its task has superseded it.
        """
        origin, label, target = key
        is_of_task = target in self._schema.tasks and label in set(Stage)
        if is_of_task and self._snapshot.handover(target).stage is not None:
            return False
        return origin in self._numbers and target in self._numbers

    def _node(self, node: Node, node_before: DsrNode | None) -> DsrNode:
        attributes_before = (
            {} if node_before is None else self._attributes_outside_graph(node_before.attributes, (node.name,))
        )
        readings = _known_values(node.attributes, self._snapshot)
        attributes = {
            **attributes_before,
            **self._parent_attributes(node.name),
            **_encode_values(readings, node_before),
        }
        if node_before is not None:
            return replace(node_before, type=str(node.type), attributes=attributes)
        return DsrNode(number=self._numbers[node.name], name=str(node.name), type=str(node.type), attributes=attributes)

    def _edge(self, edge: Edge, edge_before: DsrEdge | None) -> DsrEdge:
        attributes_before = (
            {} if edge_before is None else self._attributes_outside_graph(edge_before.attributes, edge.key)
        )
        attributes = {
            **attributes_before,
            **self._type_attribute(edge),
            **_encode_values(_known_values(edge.attributes, self._snapshot), edge_before),
        }
        if edge.label == RT:
            attributes = self._with_pose(edge, attributes)
        if edge_before is not None:
            return replace(edge_before, attributes=attributes)
        origin, label, target = edge.key
        return DsrEdge(
            origin=self._numbers[origin], label=str(label), target=self._numbers[target], attributes=attributes
        )

    def _attributes_outside_graph(self, attributes: Mapping[str, DsrValue], owner: Subject) -> dict[str, DsrValue]:
        """Return the attributes of a node or edge that were read from the file and that the graph does not hold."""
        return {name: value for name, value in attributes.items() if (*owner, name) not in self._start.imported}

    def _with_pose(self, edge: Edge, attributes: dict[str, DsrValue]) -> dict[str, DsrValue]:
        pose = self._snapshot.transform(edge.origin, edge.target).pose
        if pose == pose_of(attributes, self._start.unit_m):
            return attributes
        other_attributes = {name: value for name, value in attributes.items() if name not in POSE_ATTRIBUTES}
        return {**other_attributes, **attributes_of(pose, self._start.unit_m)}

    def _type_attribute(self, edge: Edge) -> dict[str, DsrValue]:
        """Return the attribute that states the type of an edge, if several types fit the edge's label and ends."""
        ends = self._snapshot.node(edge.origin), self._snapshot.node(edge.target)
        fitting_types = [
            edge_type for edge_type in self._schema.edge_types_with_label(edge.label) if edge_type.fits(*ends)
        ]
        return {EDGE_TYPE: encode_value(str(edge.type))} if len(fitting_types) > 1 else {}

    def _parent_attributes(self, name: str) -> dict[str, DsrValue]:
        """Return a node's parent and depth as DSR attributes, unless they are unchanged since the import."""
        chain = _chain(name, self._parents)
        is_placed = len(chain) > 1 or name in self._parents.values()
        if name in self._nodes_before and chain == _chain(name, self._parents_before):
            return {}
        if not is_placed:
            return {}
        parent = self._numbers[chain[1]] if len(chain) > 1 else 0
        values = (DsrValue(code=ValueCode.UINT64, value=parent), DsrValue(code=ValueCode.INT32, value=len(chain) - 1))
        return dict(zip(DERIVED, values, strict=True))


def _known_values(readings: Mapping[str, Reading[Any]], snapshot: Snapshot) -> dict[str, object]:
    present_readings = {name: reading.at(snapshot.instant_s) for name, reading in readings.items()}
    return {name: reading.value for name, reading in present_readings.items() if reading.known}


def _encode_values(values: Mapping[str, object], element_before: DsrNode | DsrEdge | None) -> dict[str, DsrValue]:
    """Return values with the type codes that they had in the import, or with codes for the types of the values."""
    values_before = {} if element_before is None else element_before.attributes
    return dict(_encode_items(values.items(), values_before))


def _encode_items(
    values: Iterable[tuple[str, object]], values_before: Mapping[str, DsrValue]
) -> Iterator[tuple[str, DsrValue]]:
    for name, value in values:
        value_before = values_before.get(name)
        if value_before is None:
            yield name, encode_value(value)
        elif value_before.value == value:
            yield name, value_before
        else:
            yield name, encode_value(value, value_before.code, value_before.extra)


def _chain(name: str, parents: Mapping[str, str]) -> tuple[str, ...]:
    """Return a node, its parent, and so on up to the root."""
    chain = [name]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return tuple(chain)
