"""Import a DSR graph as the start of a knowledge graph; the parts that it cannot hold are kept for export."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import UnknownNameError
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.declarations import RT, TASK, EdgeModel, KnowledgeModel, NodeModel
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Attribute, Node
from codra_dsl.runtime.knowledge.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue
from codra_dsl.runtime.knowledge.exchange.rigid import MILLIMETRE_M, OF_RING, pose_of
from codra_dsl.runtime.knowledge.graph_schema import EdgeType, GraphSchema
from codra_dsl.runtime.values.model import NotOfTypeError

DERIVED = ("parent", "level")
"""Attributes in which DSR repeats information of RT edges."""

EDGE_TYPE = "codra_type"
"""The attribute that states the type of an edge if its label and its ends leave a choice."""

Subject = tuple[str, ...]
"""A node; a node and an attribute; an edge as origin, label, target; an edge and an attribute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedPart:
    """A part of a DSR graph that the knowledge graph does not hold, and that is kept beside it.

    Attributes:
        subject: a node, an edge, or an attribute of a node or an edge.
        why: the reason why the knowledge graph does not hold it.
    """

    subject: str
    why: str

    def __str__(self) -> str:
        return f"{self.subject}: {self.why}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DsrImport:
    """The start of a knowledge graph.

    Attributes:
        model: the declarations, with all imported nodes, edges and values; `Knowledge` begins with it.
        document: the DSR graph.
        skipped: the parts that the knowledge graph does not hold. `export_dsr` writes them again while their node or
            edge exists.
        imported: the imported parts.
        unit_m: the unit of translations, in metres.
    """

    model: KnowledgeModel
    document: DsrGraph
    skipped: tuple[SkippedPart, ...]
    imported: frozenset[Subject]
    unit_m: float = MILLIMETRE_M


def import_dsr(model: KnowledgeModel, document: DsrGraph, *, unit_m: float = MILLIMETRE_M) -> DsrImport:
    """Return the start of a knowledge graph with the content of a DSR graph.

    Args:
        model: the declarations.
        document: the DSR graph.
        unit_m: the unit of its translations, in metres.
    """
    importer = _Import(model, document, unit_m)
    importer.import_nodes()
    importer.import_edges()
    return DsrImport(
        model=replace(model, nodes=tuple(importer.nodes.values()), edges=tuple(importer.edges.values())),
        document=document,
        skipped=tuple(importer.skipped),
        imported=frozenset(importer.imported),
        unit_m=unit_m,
    )


class _Import:
    """Imports a DSR graph, node by node and edge by edge.

    Attributes:
        nodes: the nodes of the start, by name.
        edges: the edges of the start, by origin, label and target.
        skipped: the parts that could not be imported so far.
        imported: the imported parts so far.
    """

    def __init__(self, model: KnowledgeModel, document: DsrGraph, unit_m: float) -> None:
        self._schema = GraphSchema(model)
        self._document = document
        self._unit_m = unit_m
        self.nodes = {node.name: node for node in model.nodes}
        self.edges = {(edge.origin, self._schema.edge_type(edge.type).label, edge.target): edge for edge in model.edges}
        self._above = {target: origin for origin, label, target in self.edges if label == RT}
        self.skipped: list[SkippedPart] = []
        self.imported: set[Subject] = set()

    def import_nodes(self) -> None:
        """Import the nodes with declared types, with their declared attributes."""
        for node in self._document.nodes:
            why = self._why_not(node)
            if why:
                self._skip(f"node {node.name!r}", why)
                continue
            self.imported.add((node.name,))
            begun = self.nodes.get(node.name) or NodeModel(name=node.name, type=node.type)
            declared = self._schema.of_node(_as_node(node.name, node.type))
            values = dict(self._values(declared, (node.name,), node.name, node.attributes, DERIVED))
            self.nodes[node.name] = replace(begun, values={**begun.values, **values})

    def import_edges(self) -> None:
        """Import the edges with declared types between imported nodes."""
        names = {node.number: node.name for node in self._document.nodes}
        types = {node.name: node.type for node in self._document.nodes}
        for edge in self._document.edges:
            origin, target = names[edge.origin], names[edge.target]
            subject = f"edge {origin} -{edge.label}-> {target}"
            if (origin,) not in self.imported or (target,) not in self.imported:
                self._skip(subject, "one of its nodes is not in the graph")
                continue
            kind = self._type_of(edge, _as_node(origin, types[origin]), _as_node(target, types[target]))
            why = kind if isinstance(kind, str) else self._why_not_rigid(edge, kind, origin, target)
            if isinstance(kind, str) or why:
                self._skip(subject, why)
            else:
                self._import_edge(edge, kind, origin, target)

    def _import_edge(self, edge: DsrEdge, kind: EdgeType, origin: str, target: str) -> None:
        key = (origin, edge.label, target)
        self.imported.add(key)
        understood = (EDGE_TYPE, *(OF_RING if kind.model.motion is not None else ()))
        begun = self.edges.get(key)
        values = dict(begun.values) if begun is not None and begun.type == kind.model.name else {}
        values.update(
            self._values(kind.attributes, key, f"{origin} -{edge.label}-> {target}", edge.attributes, understood)
        )
        made = EdgeModel(origin=origin, type=kind.model.name, target=target, values=values)
        pose = self._pose(edge) if kind.model.motion is not None else None
        if pose is not None:
            self._above[target] = origin
        self.edges[key] = made if pose is None else replace(made, pose=pose)

    def _why_not(self, node: DsrNode) -> str:
        begun = self.nodes.get(node.name)
        if node.type == TASK or node.name in self._schema.tasks:
            return "it is a task, which only the steps of its handshake write"
        if begun is not None and begun.type != node.type:
            return f"its type is {node.type!r}, but it is declared as {str(begun.type)!r}"
        try:
            self._schema.node_type(node.type)
        except UnknownNameError as error:
            return str(error)
        return ""

    def _values(
        self,
        declared: Mapping[str, Attribute],
        owner: Subject,
        subject: str,
        attributes: Mapping[str, DsrValue],
        understood: Iterable[str],
    ) -> Iterator[tuple[str, Value]]:
        for name, value in attributes.items():
            if name not in declared:
                if name not in understood:
                    self._skip(f"{subject}.{name}", "no such attribute is declared")
                continue
            try:
                content = declared[name].model.type.convert(value.value)
            except NotOfTypeError as error:
                self._skip(f"{subject}.{name}", str(error))
                continue
            if content is None:
                self._skip(f"{subject}.{name}", "NaN is not a value")
                continue
            self.imported.add((*owner, name))
            yield name, content

    def _type_of(self, edge: DsrEdge, origin: Node, target: Node) -> EdgeType | str:
        """Return the type of an edge by its label and its ends, or the reason why it has no type."""
        labelled = self._schema.labelled(edge.label)
        fitting = [kind for kind in labelled if kind.fits(origin, target)]
        chosen = edge.attributes.get(EDGE_TYPE)
        if len(fitting) > 1 and chosen is not None:
            fitting = [kind for kind in fitting if kind.model.name == chosen.value]
        if len(fitting) == 1:
            return fitting[0]
        if not labelled:
            return "no edges with this label are declared"
        if not fitting:
            return f"edges with this label do not go from {origin.type} to {target.type}"
        return f"it may be a {' or a '.join(kind.model.name for kind in fitting)}: state which in {EDGE_TYPE!r}"

    def _why_not_rigid(self, edge: DsrEdge, kind: EdgeType, origin: str, target: str) -> str:
        if kind.model.motion is None:
            return ""
        if self._pose(edge) is None:
            return "it has no pose: three numbers each as rt_translation and rt_rotation_euler_xyz"
        at: str | None = origin
        while at is not None:
            if at == target:
                return f"{target!r} would be its own parent"
            at = self._above.get(at)
        other = self._above.get(target, origin)
        return "" if other == origin else f"{target!r} already has the parent {other!r}"

    def _pose(self, edge: DsrEdge) -> Pose | None:
        return pose_of(edge.attributes, self._unit_m)

    def _skip(self, subject: str, why: str) -> None:
        self.skipped.append(SkippedPart(subject=subject, why=why))


def _as_node(name: str, type_name: str) -> Node:
    return Node(name, type_name, 0, NO_HISTORIES, "", 0.0)
