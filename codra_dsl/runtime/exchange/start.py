"""What of a graph of others a graph of ours can begin with. The rest is kept beside it, and told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from codra_dsl.logic import Value
from codra_dsl.runtime.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue
from codra_dsl.runtime.exchange.rigid import MILLIMETRE_M, OF_RING, pose_of
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.declarations import RT, TASK, EdgeModel, KnowledgeModel, NodeModel
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Node
from codra_dsl.runtime.knowledge.words import Attribute, EdgeType, Words
from codra_dsl.runtime.model import NotOfTypeError
from codra_dsl.runtime.names import UnknownNameError

DERIVED = ("parent", "level")
"""Attributes in which DSR repeats what RT edges tell."""

EDGE_TYPE = "codra_type"
"""The attribute by which an edge tells its type where its label and its ends would leave a choice."""

Subject = tuple[str, ...]
"""A node, a node and an attribute; an edge as origin, label, target, and one with an attribute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Foreign:
    """Something that a graph of ours does not hold, and that is kept beside it.

    Attributes:
        subject: a node, an attribute of it, an edge, or an attribute of that.
        why: it is not held.
    """

    subject: str
    why: str

    def __str__(self) -> str:
        return f"{self.subject}: {self.why}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """What a graph begins with.

    Attributes:
        model: the declarations, with all that was there and that they can hold; `Knowledge` begins with it.
        document: what was read.
        foreign: what of it the graph does not hold. `dsr_of` writes it again, as long as its node or edge is there.
        taken: what it does hold.
        unit_m: how many metres the unit of translations is.
    """

    model: KnowledgeModel
    document: DsrGraph
    foreign: tuple[Foreign, ...]
    taken: frozenset[Subject]
    unit_m: float = MILLIMETRE_M


def begun_with(model: KnowledgeModel, document: DsrGraph, *, unit_m: float = MILLIMETRE_M) -> Start:
    """Return what a graph begins with that is to know what another graph told.

    Args:
        model: what is declared.
        document: the other graph.
        unit_m: how many metres the unit of its translations is.
    """
    taking = _Taking(model, document, unit_m)
    taking.take_nodes()
    taking.take_edges()
    return Start(
        model=replace(model, nodes=tuple(taking.nodes.values()), edges=tuple(taking.edges.values())),
        document=document,
        foreign=tuple(taking.foreign),
        taken=frozenset(taking.taken),
        unit_m=unit_m,
    )


class _Taking:
    """Goes through a graph of others, node by node and edge by edge.

    Attributes:
        nodes: of the start, by name.
        edges: of the start, by origin, label and target.
        foreign: what was not taken so far.
        taken: what was.
    """

    def __init__(self, model: KnowledgeModel, document: DsrGraph, unit_m: float) -> None:
        self._words = Words(model)
        self._document = document
        self._unit_m = unit_m
        self.nodes = {node.name: node for node in model.nodes}
        self.edges = {(edge.origin, self._words.edge_type(edge.type).label, edge.target): edge for edge in model.edges}
        self._above = {target: origin for origin, label, target in self.edges if label == RT}
        self.foreign: list[Foreign] = []
        self.taken: set[Subject] = set()

    def take_nodes(self) -> None:
        """Take the nodes whose types are declared, with the attributes that are."""
        for node in self._document.nodes:
            why = self._why_not(node)
            if why:
                self._leave(f"node {node.name!r}", why)
                continue
            self.taken.add((node.name,))
            begun = self.nodes.get(node.name) or NodeModel(name=node.name, type=node.type)
            declared = self._words.of_node(_as_node(node.name, node.type))
            values = dict(self._values(declared, (node.name,), node.name, node.attributes, DERIVED))
            self.nodes[node.name] = replace(begun, values={**begun.values, **values})

    def take_edges(self) -> None:
        """Take the edges between nodes that were taken, of the types that are declared."""
        names = {node.number: node.name for node in self._document.nodes}
        types = {node.name: node.type for node in self._document.nodes}
        for edge in self._document.edges:
            origin, target = names[edge.origin], names[edge.target]
            told = f"edge {origin} -{edge.label}-> {target}"
            if (origin,) not in self.taken or (target,) not in self.taken:
                self._leave(told, "one of its nodes is not held")
                continue
            kind = self._type_of(edge, _as_node(origin, types[origin]), _as_node(target, types[target]))
            why = kind if isinstance(kind, str) else self._why_not_rigid(edge, kind, origin, target)
            if isinstance(kind, str) or why:
                self._leave(told, why)
            else:
                self._take_edge(edge, kind, origin, target)

    def _take_edge(self, edge: DsrEdge, kind: EdgeType, origin: str, target: str) -> None:
        key = (origin, edge.label, target)
        self.taken.add(key)
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
        if node.type == TASK or node.name in self._words.tasks:
            return "it is a task, which only the steps of its handshake write"
        if begun is not None and begun.type != node.type:
            return f"its type is {node.type!r}, and it is declared as {str(begun.type)!r}"
        try:
            self._words.node_type(node.type)
        except UnknownNameError as error:
            return str(error)
        return ""

    def _values(
        self,
        declared: Mapping[str, Attribute],
        owner: Subject,
        told: str,
        attributes: Mapping[str, DsrValue],
        understood: Iterable[str],
    ) -> Iterator[tuple[str, Value]]:
        for name, value in attributes.items():
            if name not in declared:
                if name not in understood:
                    self._leave(f"{told}.{name}", "no such attribute is declared")
                continue
            try:
                content = declared[name].model.type.convert(value.value)
            except NotOfTypeError as error:
                self._leave(f"{told}.{name}", str(error))
                continue
            if content is None:
                self._leave(f"{told}.{name}", "NaN is no value")
                continue
            self.taken.add((*owner, name))
            yield name, content

    def _type_of(self, edge: DsrEdge, origin: Node, target: Node) -> EdgeType | str:
        """Return the type of an edge by its label and its ends, or why there is none."""
        labelled = self._words.labelled(edge.label)
        fitting = [each for each in labelled if each.fits(origin, target)]
        chosen = edge.attributes.get(EDGE_TYPE)
        if len(fitting) > 1 and chosen is not None:
            fitting = [each for each in fitting if each.model.name == chosen.value]
        if len(fitting) == 1:
            return fitting[0]
        if not labelled:
            return "no edges with this label are declared"
        if not fitting:
            return f"edges with this label do not go from {origin.type} to {target.type}"
        return f"it may be a {' or a '.join(each.model.name for each in fitting)}: say which as {EDGE_TYPE!r}"

    def _why_not_rigid(self, edge: DsrEdge, kind: EdgeType, origin: str, target: str) -> str:
        if kind.model.motion is None:
            return ""
        if self._pose(edge) is None:
            return "it has no pose: three numbers each as rt_translation and rt_rotation_euler_xyz"
        at: str | None = origin
        while at is not None:
            if at == target:
                return f"{target!r} would stand in itself"
            at = self._above.get(at)
        other = self._above.get(target, origin)
        return "" if other == origin else f"{target!r} stands in {other!r} already"

    def _pose(self, edge: DsrEdge) -> Pose | None:
        return pose_of(edge.attributes, self._unit_m)

    def _leave(self, subject: str, why: str) -> None:
        self.foreign.append(Foreign(subject=subject, why=why))


def _as_node(name: str, type_name: str) -> Node:
    return Node(name, type_name, 0, NO_HISTORIES, "", 0.0)
