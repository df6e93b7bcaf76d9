"""Export a knowledge graph as a DSR graph, with the parts of an import that the knowledge graph does not hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.knowledge.elements import Edge, Node
from codra_dsl.runtime.knowledge.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue, ValueCode, encode_value
from codra_dsl.runtime.knowledge.exchange.import_ import DERIVED_ATTRIBUTES, EDGE_TYPE_ATTRIBUTE, DsrImport, PartKey
from codra_dsl.runtime.knowledge.exchange.rigid import MILLIMETRE_M, POSE_ATTRIBUTES, attributes_of, pose_of
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema, Stage
from codra_dsl.runtime.knowledge.knowledge import Knowledge
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.values.cell import Reading


def export_dsr(
    knowledge: Knowledge, initial_import: DsrImport | None = None, *, unit_m: float = MILLIMETRE_M
) -> DsrGraph:
    """Return the present graph as a DSR graph; unknown attributes are left out.

    Args:
        knowledge: the graph.
        initial_import: the import that the graph began with, if any. Parts of the import that the graph does not hold,
            and unchanged parts, are exported as they were read; parts that were deleted meanwhile are left out.
        unit_m: the unit of translations, in metres. If `initial_import` is given, its unit is used instead.
    """
    dsr_import = initial_import or DsrImport(
        model=knowledge.model, document=DsrGraph(), skipped_parts=(), imported_keys=frozenset(), unit_m=unit_m
    )
    exporter = _Exporter(knowledge, dsr_import)
    return DsrGraph(
        nodes=tuple(exporter.nodes()),
        edges=tuple(exporter.edges()),
        extra=dsr_import.document.extra,
        model_extra=dsr_import.document.model_extra,
    )


class _Exporter:
    """Exports one snapshot, with the import that the graph began with."""

    def __init__(self, knowledge: Knowledge, dsr_import: DsrImport) -> None:
        self._schema = GraphSchema(knowledge.model)
        self._snapshot = knowledge.snapshot()
        self._dsr_import = dsr_import
        self._document_nodes = {node.name: node for node in dsr_import.document.nodes}
        names_by_number = {node.number: node.name for node in dsr_import.document.nodes}
        self._document_edges = {
            (names_by_number[edge.origin], edge.label, names_by_number[edge.target]): edge
            for edge in dsr_import.document.edges
        }
        self._node_numbers = self._assign_numbers(names_by_number)
        kept_keys = (
            key for key in self._document_edges if key not in dsr_import.imported_keys and self._is_kept_edge(key)
        )
        edge_keys = [*kept_keys, *(edge.key for edge in self._snapshot.edges())]
        self._parents = {key[2]: key[0] for key in edge_keys if key[1] == RT}
        document_keys = sorted(
            self._document_edges, key=dsr_import.imported_keys.__contains__
        )  # edges that the graph holds come last and take precedence
        self._document_parents = {key[2]: key[0] for key in document_keys if key[1] == RT}

    def nodes(self) -> Iterator[DsrNode]:
        """Yield the nodes: first those of the import in their order, then the others in the order of insertion."""
        for node in self._dsr_import.document.nodes:
            if node.name in self._node_numbers:
                yield self._export_node(self._snapshot.node(node.name), node) if node.name in self._snapshot else node
        for graph_node in self._snapshot.nodes():
            if graph_node.name not in self._document_nodes:
                yield self._export_node(graph_node, None)

    def edges(self) -> Iterator[DsrEdge]:
        """Yield the edges: first those of the import in their order, then the others in the order of insertion."""
        present_edges = {edge.key: edge for edge in self._snapshot.edges()}
        for key, edge in self._document_edges.items():
            if key in present_edges:
                yield self._export_edge(present_edges[key], edge)
            elif key not in self._dsr_import.imported_keys and self._is_kept_edge(key):
                yield edge
        for key, graph_edge in present_edges.items():
            if key not in self._document_edges:
                yield self._export_edge(graph_edge, None)

    def _assign_numbers(self, names_by_number: Mapping[int, str]) -> dict[str, int]:
        """Return the numbers of all nodes; new nodes get unused numbers."""
        node_numbers = {
            name: number
            for number, name in names_by_number.items()
            if name in self._snapshot or (name,) not in self._dsr_import.imported_keys
        }
        free_numbers = (number for number in range(1, 2**64) if number not in names_by_number)
        for node in self._snapshot.nodes():
            if node.name not in node_numbers:
                node_numbers[node.name] = next(free_numbers)
        return node_numbers

    def _is_kept_edge(self, key: PartKey) -> bool:
        """Return whether to export an edge of the import that the graph does not hold.

        The edge is exported if both of its nodes are exported, unless a step of the edge's task has superseded it.
        """
        origin, label, target = key
        is_task_edge = target in self._schema.tasks and label in set(Stage)
        if is_task_edge and self._snapshot.handover(target).stage is not None:
            return False
        return origin in self._node_numbers and target in self._node_numbers

    def _export_node(self, node: Node, document_node: DsrNode | None) -> DsrNode:
        kept_attributes = (
            {} if document_node is None else self._attributes_outside_graph(document_node.attributes, (node.name,))
        )
        values = _known_values(node.attributes, self._snapshot)
        attributes = {
            **kept_attributes,
            **self._parent_attributes(node.name),
            **_encode_values(values, document_node),
        }
        if document_node is not None:
            return replace(document_node, type=str(node.type), attributes=attributes)
        return DsrNode(
            number=self._node_numbers[node.name], name=str(node.name), type=str(node.type), attributes=attributes
        )

    def _export_edge(self, edge: Edge, document_edge: DsrEdge | None) -> DsrEdge:
        kept_attributes = (
            {} if document_edge is None else self._attributes_outside_graph(document_edge.attributes, edge.key)
        )
        attributes = {
            **kept_attributes,
            **self._type_attributes(edge),
            **_encode_values(_known_values(edge.attributes, self._snapshot), document_edge),
        }
        if edge.label == RT:
            attributes = self._attributes_with_pose(edge, attributes)
        if document_edge is not None:
            return replace(document_edge, attributes=attributes)
        origin, label, target = edge.key
        return DsrEdge(
            origin=self._node_numbers[origin],
            label=str(label),
            target=self._node_numbers[target],
            attributes=attributes,
        )

    def _attributes_outside_graph(self, attributes: Mapping[str, DsrValue], owner: PartKey) -> dict[str, DsrValue]:
        """Return the attributes of a node or edge that were read from the file and that the graph does not hold."""
        return {
            name: value for name, value in attributes.items() if (*owner, name) not in self._dsr_import.imported_keys
        }

    def _attributes_with_pose(self, edge: Edge, attributes: dict[str, DsrValue]) -> dict[str, DsrValue]:
        pose = self._snapshot.transform(edge.origin, edge.target).pose
        if pose == pose_of(attributes, self._dsr_import.unit_m):
            return attributes
        other_attributes = {name: value for name, value in attributes.items() if name not in POSE_ATTRIBUTES}
        return {**other_attributes, **attributes_of(pose, self._dsr_import.unit_m)}

    def _type_attributes(self, edge: Edge) -> dict[str, DsrValue]:
        """Return the attribute that states the type of an edge, if several types fit the edge's label and ends."""
        end_nodes = self._snapshot.node(edge.origin), self._snapshot.node(edge.target)
        fitting_types = [
            edge_type for edge_type in self._schema.edge_types_with_label(edge.label) if edge_type.fits(*end_nodes)
        ]
        return {EDGE_TYPE_ATTRIBUTE: encode_value(str(edge.type))} if len(fitting_types) > 1 else {}

    def _parent_attributes(self, name: str) -> dict[str, DsrValue]:
        """Return a node's parent and depth as DSR attributes.

        The result is empty if both are unchanged since the import, or if the node has no RT edge.
        """
        ancestor_chain = _ancestor_chain(name, self._parents)
        is_placed = len(ancestor_chain) > 1 or name in self._parents.values()
        if name in self._document_nodes and ancestor_chain == _ancestor_chain(name, self._document_parents):
            return {}
        if not is_placed:
            return {}
        parent_number = self._node_numbers[ancestor_chain[1]] if len(ancestor_chain) > 1 else 0
        values = (
            DsrValue(code=ValueCode.UINT64, value=parent_number),
            DsrValue(code=ValueCode.INT32, value=len(ancestor_chain) - 1),
        )
        return dict(zip(DERIVED_ATTRIBUTES, values, strict=True))


def _known_values(readings: Mapping[str, Reading[Any]], snapshot: Snapshot) -> dict[str, object]:
    present_readings = {name: reading.at(snapshot.instant_s) for name, reading in readings.items()}
    return {name: reading.value for name, reading in present_readings.items() if reading.known}


def _encode_values(values: Mapping[str, object], document_element: DsrNode | DsrEdge | None) -> dict[str, DsrValue]:
    """Return values with the type codes that they had in the import, or with codes for the types of the values."""
    document_values = {} if document_element is None else document_element.attributes
    return dict(_encode_items(values.items(), document_values))


def _encode_items(
    values: Iterable[tuple[str, object]], document_values: Mapping[str, DsrValue]
) -> Iterator[tuple[str, DsrValue]]:
    for name, value in values:
        document_value = document_values.get(name)
        if document_value is None:
            yield name, encode_value(value)
        elif document_value.value == value:
            yield name, document_value
        else:
            yield name, encode_value(value, document_value.code, document_value.extra)


def _ancestor_chain(name: str, parents: Mapping[str, str]) -> tuple[str, ...]:
    """Return a node, its parent, and so on up to the root."""
    chain = [name]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return tuple(chain)
