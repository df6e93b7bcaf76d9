"""Export a knowledge graph as a DSR graph, together with the parts of an imported graph that it does not hold."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.knowledge.elements import Edge, Node
from codra_dsl.runtime.knowledge.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue, ValueCode, encode_value
from codra_dsl.runtime.knowledge.exchange.import_ import DERIVED, EDGE_TYPE, DsrImport, Subject
from codra_dsl.runtime.knowledge.exchange.rigid import MILLIMETRE_M, OF_RING, attributes_of, pose_of
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema, Stage
from codra_dsl.runtime.knowledge.knowledge import Knowledge
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.values.cell import Reading


def export_dsr(knowledge: Knowledge, beside: DsrImport | None = None, *, unit_m: float = MILLIMETRE_M) -> DsrGraph:
    """Return the present graph as a DSR graph; unknown attributes are left out.

    Args:
        knowledge: the graph.
        beside: the import that the graph began with, if any. Parts that the graph does not hold, and unchanged parts,
            are exported as they were read; parts that were deleted meanwhile are left out.
        unit_m: the unit of translations, in metres; ignored if `beside` is given, whose unit is used.
    """
    start = beside or DsrImport(
        model=knowledge.model, document=DsrGraph(), skipped=(), imported=frozenset(), unit_m=unit_m
    )
    export = _Export(knowledge, start)
    return DsrGraph(
        nodes=tuple(export.nodes()),
        edges=tuple(export.edges()),
        extra=start.document.extra,
        model_extra=start.document.model_extra,
    )


class _Export:
    """The export of one snapshot, with the imported start."""

    def __init__(self, knowledge: Knowledge, start: DsrImport) -> None:
        self._schema = GraphSchema(knowledge.model)
        self._seen = knowledge.snapshot()
        self._start = start
        self._before = {node.name: node for node in start.document.nodes}
        names = {node.number: node.name for node in start.document.nodes}
        self._edges_before = {
            (names[edge.origin], edge.label, names[edge.target]): edge for edge in start.document.edges
        }
        self._numbers = self._numbered(names)
        left = (key for key in self._edges_before if key not in start.imported and self._is_kept(key))
        placed = [*left, *(edge.key for edge in self._seen.edges())]
        self._parents = {key[2]: key[0] for key in placed if key[1] == RT}
        read = sorted(self._edges_before, key=start.imported.__contains__)  # edges that the graph holds take precedence
        self._parents_before = {key[2]: key[0] for key in read if key[1] == RT}

    def nodes(self) -> Iterator[DsrNode]:
        """Yield the nodes: first those of the import, then the others, in their respective orders."""
        for node in self._start.document.nodes:
            if node.name in self._numbers:
                yield self._node(self._seen.node(node.name), node) if node.name in self._seen else node
        for mine in self._seen.nodes():
            if mine.name not in self._before:
                yield self._node(mine, None)

    def edges(self) -> Iterator[DsrEdge]:
        """Yield the edges, in the same order."""
        present = {edge.key: edge for edge in self._seen.edges()}
        for key, edge in self._edges_before.items():
            if key in present:
                yield self._edge(present[key], edge)
            elif key not in self._start.imported and self._is_kept(key):
                yield edge
        for key, mine in present.items():
            if key not in self._edges_before:
                yield self._edge(mine, None)

    def _numbered(self, names: Mapping[int, str]) -> dict[str, int]:
        """Return the numbers of all nodes; new nodes get unused numbers."""
        numbers = {
            name: number for number, name in names.items() if name in self._seen or (name,) not in self._start.imported
        }
        free = (number for number in range(1, 2**64) if number not in names)
        for node in self._seen.nodes():
            if node.name not in numbers:
                numbers[node.name] = next(free)
        return numbers

    def _is_kept(self, key: Subject) -> bool:
        """Return whether an edge outside the graph has both its nodes, and no step of its task has superseded it."""
        origin, label, target = key
        is_of_task = target in self._schema.tasks and label in set(Stage)
        if is_of_task and self._seen.handover(target).stage is not None:
            return False
        return origin in self._numbers and target in self._numbers

    def _node(self, node: Node, before: DsrNode | None) -> DsrNode:
        kept = {} if before is None else self._kept(before.attributes, (node.name,))
        readings = _known(node.attributes, self._seen)
        attributes = {**kept, **self._derived(node.name), **_encoded(readings, before)}
        if before is not None:
            return replace(before, type=str(node.type), attributes=attributes)
        return DsrNode(number=self._numbers[node.name], name=str(node.name), type=str(node.type), attributes=attributes)

    def _edge(self, edge: Edge, before: DsrEdge | None) -> DsrEdge:
        kept = {} if before is None else self._kept(before.attributes, edge.key)
        attributes = {**kept, **self._choice(edge), **_encoded(_known(edge.attributes, self._seen), before)}
        if edge.label == RT:
            attributes = self._posed(edge, attributes)
        if before is not None:
            return replace(before, attributes=attributes)
        origin, label, target = edge.key
        return DsrEdge(
            origin=self._numbers[origin], label=str(label), target=self._numbers[target], attributes=attributes
        )

    def _kept(self, attributes: Mapping[str, DsrValue], owner: Subject) -> dict[str, DsrValue]:
        """Return the imported attributes of a node or edge that the graph does not hold."""
        return {name: value for name, value in attributes.items() if (*owner, name) not in self._start.imported}

    def _posed(self, edge: Edge, attributes: dict[str, DsrValue]) -> dict[str, DsrValue]:
        pose = self._seen.transform(edge.origin, edge.target).pose
        if pose == pose_of(attributes, self._start.unit_m):
            return attributes
        others = {name: value for name, value in attributes.items() if name not in OF_RING}
        return {**others, **attributes_of(pose, self._start.unit_m)}

    def _choice(self, edge: Edge) -> dict[str, DsrValue]:
        """Return the attribute that states the type of an edge, if its label and ends leave a choice."""
        ends = self._seen.node(edge.origin), self._seen.node(edge.target)
        fitting = [kind for kind in self._schema.labelled(edge.label) if kind.fits(*ends)]
        return {EDGE_TYPE: encode_value(str(edge.type))} if len(fitting) > 1 else {}

    def _derived(self, name: str) -> dict[str, DsrValue]:
        """Return a node's parent and depth as DSR attributes, unless they are unchanged since the import."""
        chain = _chain(name, self._parents)
        is_placed = len(chain) > 1 or name in self._parents.values()
        if name in self._before and chain == _chain(name, self._parents_before):
            return {}
        if not is_placed:
            return {}
        parent = self._numbers[chain[1]] if len(chain) > 1 else 0
        values = (DsrValue(code=ValueCode.UINT64, value=parent), DsrValue(code=ValueCode.INT32, value=len(chain) - 1))
        return dict(zip(DERIVED, values, strict=True))


def _known(readings: Mapping[str, Reading[Any]], seen: Snapshot) -> dict[str, object]:
    present = {name: reading.at(seen.instant_s) for name, reading in readings.items()}
    return {name: reading.value for name, reading in present.items() if reading.known}


def _encoded(values: Mapping[str, object], before: DsrNode | DsrEdge | None) -> dict[str, DsrValue]:
    """Return values with the codes of the import, or with codes for their types."""
    was = {} if before is None else before.attributes
    return dict(_encoded_items(values.items(), was))


def _encoded_items(values: Iterable[tuple[str, object]], was: Mapping[str, DsrValue]) -> Iterator[tuple[str, DsrValue]]:
    for name, value in values:
        known = was.get(name)
        if known is None:
            yield name, encode_value(value)
        elif known.value == value:
            yield name, known
        else:
            yield name, encode_value(value, known.code, known.extra)


def _chain(name: str, parents: Mapping[str, str]) -> tuple[str, ...]:
    """Return a node, its parent, and so on up to the root."""
    chain = [name]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return tuple(chain)
