"""Import a DSR graph as the initial content of a knowledge graph.

The parts that the knowledge graph cannot hold are kept for the export.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import UnknownNameError
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.declarations import RT, TASK, EdgeModel, KnowledgeModel, NodeModel
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Attribute, Node
from codra_dsl.runtime.knowledge.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue
from codra_dsl.runtime.knowledge.exchange.rigid import MILLIMETRE_M, POSE_ATTRIBUTES, pose_of
from codra_dsl.runtime.knowledge.graph_schema import EdgeType, GraphSchema
from codra_dsl.runtime.values.model import NotOfTypeError

DERIVED_ATTRIBUTES = ("parent", "level")
"""Attributes in which DSR repeats information of RT edges."""

EDGE_TYPE_ATTRIBUTE = "codra_type"
"""The attribute that states the type of an edge if several types fit the edge's label and ends."""

PartKey = tuple[str, ...]
"""The key of a part: a node; a node and an attribute; an edge (origin, label, target); or an edge and an attribute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedPart:
    """A part of a DSR graph that the knowledge graph does not hold, and that is kept beside it.

    Attributes:
        subject: a node, an edge, or an attribute of a node or an edge.
        reason: the reason why the knowledge graph does not hold this part.
    """

    subject: str
    reason: str

    def __str__(self) -> str:
        return f"{self.subject}: {self.reason}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DsrImport:
    """The result of an import: the initial content of a knowledge graph.

    Attributes:
        model: the declarations, with all imported nodes, edges and values; `Knowledge` begins with this model.
        document: the DSR graph.
        skipped_parts: the parts that the knowledge graph does not hold. `export_dsr` writes a part again if its node or
            edge still exists.
        imported_keys: the keys of the imported parts.
        unit_m: the unit of translations, in metres.
    """

    model: KnowledgeModel
    document: DsrGraph
    skipped_parts: tuple[SkippedPart, ...]
    imported_keys: frozenset[PartKey]
    unit_m: float = MILLIMETRE_M


def import_dsr(model: KnowledgeModel, document: DsrGraph, *, unit_m: float = MILLIMETRE_M) -> DsrImport:
    """Return a DSR graph as the initial content of a knowledge graph.

    Args:
        model: the declarations.
        document: the DSR graph.
        unit_m: the unit of the translations in the DSR graph, in metres.
    """
    importer = _Importer(model, document, unit_m)
    importer.import_nodes()
    importer.import_edges()
    return DsrImport(
        model=replace(model, nodes=tuple(importer.nodes.values()), edges=tuple(importer.edges.values())),
        document=document,
        skipped_parts=tuple(importer.skipped_parts),
        imported_keys=frozenset(importer.imported_keys),
        unit_m=unit_m,
    )


class _Importer:
    """Imports a DSR graph, node by node and edge by edge.

    Attributes:
        nodes: the initial nodes, by name.
        edges: the initial edges, by origin, label and target.
        skipped_parts: the parts that could not be imported so far.
        imported_keys: the keys of the imported parts so far.
    """

    def __init__(self, model: KnowledgeModel, document: DsrGraph, unit_m: float) -> None:
        self._schema = GraphSchema(model)
        self._document = document
        self._unit_m = unit_m
        self.nodes = {node.name: node for node in model.nodes}
        self.edges = {(edge.origin, self._schema.edge_type(edge.type).label, edge.target): edge for edge in model.edges}
        self._parents = {target: origin for origin, label, target in self.edges if label == RT}
        self.skipped_parts: list[SkippedPart] = []
        self.imported_keys: set[PartKey] = set()

    def import_nodes(self) -> None:
        """Import each node whose type is declared, with its declared attributes."""
        for node in self._document.nodes:
            reason = self._node_skip_reason(node)
            if reason:
                self._skip(f"node {node.name!r}", reason)
                continue
            self.imported_keys.add((node.name,))
            node_model = self.nodes.get(node.name) or NodeModel(name=node.name, type=node.type)
            declared_attributes = self._schema.attributes_of_node(_as_node(node.name, node.type))
            values = dict(
                self._import_values(declared_attributes, (node.name,), node.name, node.attributes, DERIVED_ATTRIBUTES)
            )
            self.nodes[node.name] = replace(node_model, values={**node_model.values, **values})

    def import_edges(self) -> None:
        """Import each edge between imported nodes whose type is declared."""
        names_by_number = {node.number: node.name for node in self._document.nodes}
        node_types_by_name = {node.name: node.type for node in self._document.nodes}
        for edge in self._document.edges:
            origin, target = names_by_number[edge.origin], names_by_number[edge.target]
            subject = f"edge {origin} -{edge.label}-> {target}"
            if (origin,) not in self.imported_keys or (target,) not in self.imported_keys:
                self._skip(subject, "one of its nodes is not in the graph")
                continue
            edge_type = self._edge_type_or_reason(
                edge, _as_node(origin, node_types_by_name[origin]), _as_node(target, node_types_by_name[target])
            )
            reason = (
                edge_type if isinstance(edge_type, str) else self._pose_skip_reason(edge, edge_type, origin, target)
            )
            if isinstance(edge_type, str) or reason:
                self._skip(subject, reason)
            else:
                self._import_edge(edge, edge_type, origin, target)

    def _import_edge(self, edge: DsrEdge, edge_type: EdgeType, origin: str, target: str) -> None:
        key = (origin, edge.label, target)
        self.imported_keys.add(key)
        handled_names = (EDGE_TYPE_ATTRIBUTE, *(POSE_ATTRIBUTES if edge_type.model.motion is not None else ()))
        declared_edge = self.edges.get(key)
        values = (
            dict(declared_edge.values)
            if declared_edge is not None and declared_edge.type == edge_type.model.name
            else {}
        )
        values.update(
            self._import_values(
                edge_type.attributes, key, f"{origin} -{edge.label}-> {target}", edge.attributes, handled_names
            )
        )
        edge_model = EdgeModel(origin=origin, type=edge_type.model.name, target=target, values=values)
        pose = self._edge_pose(edge) if edge_type.model.motion is not None else None
        if pose is not None:
            self._parents[target] = origin
        self.edges[key] = edge_model if pose is None else replace(edge_model, pose=pose)

    def _node_skip_reason(self, node: DsrNode) -> str:
        node_model = self.nodes.get(node.name)
        if node.type == TASK or node.name in self._schema.tasks:
            return "it is a task, which only the steps of its handshake write"
        if node_model is not None and node_model.type != node.type:
            return f"its type is {node.type!r}, but it is declared as {str(node_model.type)!r}"
        try:
            self._schema.node_type(node.type)
        except UnknownNameError as error:
            return str(error)
        return ""

    def _import_values(
        self,
        declared_attributes: Mapping[str, Attribute],
        owner_key: PartKey,
        subject: str,
        attributes: Mapping[str, DsrValue],
        handled_names: Iterable[str],
    ) -> Iterator[tuple[str, Value]]:
        for name, value in attributes.items():
            if name not in declared_attributes:
                if name not in handled_names:
                    self._skip(f"{subject}.{name}", "no such attribute is declared")
                continue
            try:
                converted_value = declared_attributes[name].model.type.convert(value.value)
            except NotOfTypeError as error:
                self._skip(f"{subject}.{name}", str(error))
                continue
            if converted_value is None:
                self._skip(f"{subject}.{name}", "NaN is not a value")
                continue
            self.imported_keys.add((*owner_key, name))
            yield name, converted_value

    def _edge_type_or_reason(self, edge: DsrEdge, origin: Node, target: Node) -> EdgeType | str:
        """Return the only type that fits an edge's label, ends and `EDGE_TYPE_ATTRIBUTE`; otherwise the reason."""
        labelled_types = self._schema.edge_types_with_label(edge.label)
        fitting_types = [edge_type for edge_type in labelled_types if edge_type.fits(origin, target)]
        type_value = edge.attributes.get(EDGE_TYPE_ATTRIBUTE)
        if len(fitting_types) > 1 and type_value is not None:
            fitting_types = [edge_type for edge_type in fitting_types if edge_type.model.name == type_value.value]
        if len(fitting_types) == 1:
            return fitting_types[0]
        if not labelled_types:
            return "no edges with this label are declared"
        if not fitting_types:
            return f"edges with this label do not go from {origin.type} to {target.type}"
        names = " or ".join(repr(str(edge_type.model.name)) for edge_type in fitting_types)
        return f"its type may be {names}: state the type in the attribute {EDGE_TYPE_ATTRIBUTE!r}"

    def _pose_skip_reason(self, edge: DsrEdge, edge_type: EdgeType, origin: str, target: str) -> str:
        if edge_type.model.motion is None:
            return ""
        if self._edge_pose(edge) is None:
            return (
                "it has no pose: rt_translation and rt_rotation_euler_xyz must have three finite numbers each, "
                "and rt_timestamps only numbers"
            )
        ancestor: str | None = origin
        while ancestor is not None:
            if ancestor == target:
                return f"{target!r} would be its own ancestor"
            ancestor = self._parents.get(ancestor)
        present_parent = self._parents.get(target, origin)
        return "" if present_parent == origin else f"{target!r} already has the parent {present_parent!r}"

    def _edge_pose(self, edge: DsrEdge) -> Pose | None:
        return pose_of(edge.attributes, self._unit_m)

    def _skip(self, subject: str, reason: str) -> None:
        self.skipped_parts.append(SkippedPart(subject=subject, reason=reason))


def _as_node(name: str, type_name: str) -> Node:
    return Node(name, type_name, 0, NO_HISTORIES, "", 0.0)
