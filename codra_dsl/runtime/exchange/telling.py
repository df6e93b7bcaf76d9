"""A graph of ours as others read it, with what they told beside it when it began."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.cell import Reading
from codra_dsl.runtime.exchange.document import DsrEdge, DsrGraph, DsrNode, DsrValue, ValueCode, coded
from codra_dsl.runtime.exchange.rigid import MILLIMETRE_M, OF_RING, attributes_of, pose_of
from codra_dsl.runtime.exchange.start import DERIVED, EDGE_TYPE, Start, Subject
from codra_dsl.runtime.knowledge import Edge, Knowledge, Node, Snapshot, Stage
from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.knowledge.words import Words


def dsr_of(knowledge: Knowledge, beside: Start | None = None, *, unit_m: float = MILLIMETRE_M) -> DsrGraph:
    """Return a graph as it is now, as DSR has it; attributes that are unknown are not told.

    Args:
        knowledge: the graph.
        beside: what it began with, if that was read: all that it does not hold, and what has not changed, is told as
            it was read. What was deleted meanwhile is not.
        unit_m: how many metres the unit of translations is to be; that of `beside`, if it is there.
    """
    start = beside or Start(model=knowledge.model, document=DsrGraph(), foreign=(), taken=frozenset(), unit_m=unit_m)
    telling = _Telling(knowledge, start)
    return DsrGraph(
        nodes=tuple(telling.nodes()),
        edges=tuple(telling.edges()),
        extra=start.document.extra,
        model_extra=start.document.model_extra,
    )


class _Telling:
    """One snapshot, beside what there was at the start."""

    def __init__(self, knowledge: Knowledge, start: Start) -> None:
        self._words = Words(knowledge.model)
        self._seen = knowledge.snapshot()
        self._start = start
        self._before = {node.name: node for node in start.document.nodes}
        names = {node.number: node.name for node in start.document.nodes}
        self._edges_before = {
            (names[edge.origin], edge.label, names[edge.target]): edge for edge in start.document.edges
        }
        self._numbers = self._numbered(names)
        left = (key for key in self._edges_before if key not in start.taken and self._still_holds(key))
        placed = [*left, *(edge.key for edge in self._seen.edges())]
        self._parents = {key[2]: key[0] for key in placed if key[1] == RT}
        read = sorted(self._edges_before, key=start.taken.__contains__)  # what the graph holds counts most
        self._parents_before = {key[2]: key[0] for key in read if key[1] == RT}

    def nodes(self) -> Iterator[DsrNode]:
        """Yield the nodes: those that were read in their order, and then the others in theirs."""
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
            elif key not in self._start.taken and self._still_holds(key):
                yield edge
        for key, mine in present.items():
            if key not in self._edges_before:
                yield self._edge(mine, None)

    def _numbered(self, names: Mapping[int, str]) -> dict[str, int]:
        """Return the number of each node that is there; those that are new get numbers of their own."""
        numbers = {
            name: number for number, name in names.items() if name in self._seen or (name,) not in self._start.taken
        }
        free = (number for number in range(1, 2**64) if number not in names)
        for node in self._seen.nodes():
            if node.name not in numbers:
                numbers[node.name] = next(free)
        return numbers

    def _still_holds(self, key: Subject) -> bool:
        """Return whether an edge that the graph does not hold has its nodes, and no step of a task has undone it."""
        origin, label, target = key
        is_of_task = target in self._words.tasks and label in set(Stage)
        if is_of_task and self._seen.handover(target).stage is not None:
            return False
        return origin in self._numbers and target in self._numbers

    def _node(self, node: Node, before: DsrNode | None) -> DsrNode:
        kept = {} if before is None else self._kept(before.attributes, (node.name,))
        readings = _known(node.attributes, self._seen)
        attributes = {**kept, **self._derived(node.name), **_coded(readings, before)}
        if before is not None:
            return replace(before, type=str(node.type), attributes=attributes)
        return DsrNode(number=self._numbers[node.name], name=str(node.name), type=str(node.type), attributes=attributes)

    def _edge(self, edge: Edge, before: DsrEdge | None) -> DsrEdge:
        kept = {} if before is None else self._kept(before.attributes, edge.key)
        attributes = {**kept, **self._choice(edge), **_coded(_known(edge.attributes, self._seen), before)}
        if edge.label == RT:
            attributes = self._posed(edge, attributes)
        if before is not None:
            return replace(before, attributes=attributes)
        origin, label, target = edge.key
        return DsrEdge(
            origin=self._numbers[origin], label=str(label), target=self._numbers[target], attributes=attributes
        )

    def _kept(self, attributes: Mapping[str, DsrValue], owner: Subject) -> dict[str, DsrValue]:
        """Return what was read of something and is not in the graph."""
        return {name: value for name, value in attributes.items() if (*owner, name) not in self._start.taken}

    def _posed(self, edge: Edge, attributes: dict[str, DsrValue]) -> dict[str, DsrValue]:
        pose = self._seen.transform(edge.origin, edge.target).pose
        if pose == pose_of(attributes, self._start.unit_m):
            return attributes
        others = {name: value for name, value in attributes.items() if name not in OF_RING}
        return {**others, **attributes_of(pose, self._start.unit_m)}

    def _choice(self, edge: Edge) -> dict[str, DsrValue]:
        """Return the attribute that tells the type of an edge, if nothing else does."""
        ends = self._seen.node(edge.origin), self._seen.node(edge.target)
        fitting = [each for each in self._words.labelled(edge.label) if each.fits(*ends)]
        return {EDGE_TYPE: coded(str(edge.type))} if len(fitting) > 1 else {}

    def _derived(self, name: str) -> dict[str, DsrValue]:
        """Return in which node a node stands and how deep, as DSR repeats it, if that is not as it was read."""
        chain = _chain(name, self._parents)
        is_placed = len(chain) > 1 or name in self._parents.values()
        if name in self._before and chain == _chain(name, self._parents_before):
            return {}
        if not is_placed:
            return {}
        parent = self._numbers[chain[1]] if len(chain) > 1 else 0
        told = (DsrValue(code=ValueCode.UINT64, value=parent), DsrValue(code=ValueCode.INT32, value=len(chain) - 1))
        return dict(zip(DERIVED, told, strict=True))


def _known(readings: Mapping[str, Reading[Any]], seen: Snapshot) -> dict[str, object]:
    present = {name: reading.at(seen.instant_s) for name, reading in readings.items()}
    return {name: reading.value for name, reading in present.items() if reading.known}


def _coded(values: Mapping[str, object], before: DsrNode | DsrEdge | None) -> dict[str, DsrValue]:
    """Return values with the codes that they were read with, or with their own."""
    was = {} if before is None else before.attributes
    return dict(_each_coded(values.items(), was))


def _each_coded(values: Iterable[tuple[str, object]], was: Mapping[str, DsrValue]) -> Iterator[tuple[str, DsrValue]]:
    for name, value in values:
        known = was.get(name)
        if known is None:
            yield name, coded(value)
        elif known.value == value:
            yield name, known
        else:
            yield name, coded(value, known.code, known.extra)


def _chain(name: str, parents: Mapping[str, str]) -> tuple[str, ...]:
    """Return a node, what it stands in, and so on."""
    chain = [name]
    while chain[-1] in parents and parents[chain[-1]] not in chain:
        chain.append(parents[chain[-1]])
    return tuple(chain)
