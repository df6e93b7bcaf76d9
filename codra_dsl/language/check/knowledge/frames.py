"""Checks of frames (phase 4): rigid motions form a tree, in which each frame has one parent, without cycles."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from codra_dsl.language import graph
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, End, holds_poses
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.model import EdgeType, Reference


def two_parents(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A frame has one parent at a time, so at most one edge with poses leads to the frame."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    pose_edges = [edge for edge in spec_index.spec.edges if holds_poses(edge)]
    for first, second in combinations(pose_edges, 2):
        for target in second.targets:
            other = next(
                (end for end in first.targets if _may_be_same_frame(spec_index.declared_graph, end, target)), None
            )
            if other is not None:
                yield _two_parents_finding(first, second, target)
                break


def _may_be_same_frame(declared_graph: DeclaredGraph, one: Reference, other: Reference) -> bool:
    """Return whether two ends of edges may mean the same node."""
    first, second = declared_graph.end(one.name), declared_graph.end(other.name)
    if first.is_node == second.is_node:
        return first.name == second.name
    node, kind = (first, second) if first.is_node else (second, first)
    return declared_graph.type_of(node.name) == kind.name


def _two_parents_finding(first: EdgeType, second: EdgeType, target: Reference) -> Diagnostic:
    parents = [" or ".join(f"'{origin.name}'" for origin in edge.origins) for edge in (first, second)]
    origins = ", ".join(dict.fromkeys(origin.name for edge in (first, second) for origin in edge.origins))
    return finding(
        "two-parents",
        f"'{target.name}' has two parent frames: {parents[0]} by edge '{first.name}', "
        f"and {parents[1]} by edge '{second.name}'",
        target.place,
        path=f"knowledge.edges.{second.name}.to",
        help="remove one edge; if the node moves from one parent to the other, write one edge with "
        f"'from: [{origins}]'",
        related=(Related(f"edge '{first.name}'", first.place),),
    )


def frame_cycles(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No frame is its own ancestor."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    parents = dict(_parents(spec_index.declared_graph))
    parents_by_frame = {target: (parent,) for target, (parent, _) in parents.items()}
    for component in graph.strong_components(parents_by_frame):
        component_parents = {name: parents_by_frame[name] for name in component}
        cycle = graph.shortest_cycle(component_parents)
        edges = [parents[name][1] for name in cycle]
        cycle_text = " -> ".join((cycle[0], *reversed(cycle)))
        yield finding(
            "frame-cycle",
            f"the parents of frames form a cycle: {cycle_text}",
            edges[0].place,
            path=f"knowledge.edges.{edges[0].name}",
            help="give one of these frames a parent outside of the cycle, such as the world",
            related=tuple(
                Related(f"'{parents[name][0]}' is the parent of '{name}'", edge.place)
                for name, edge in zip(cycle, edges, strict=True)
            ),
        )


def _parents(declared_graph: DeclaredGraph) -> Iterator[tuple[str, tuple[str, EdgeType]]]:
    """Yield each single node whose parent is certain, with this parent and the edge between the two nodes."""
    for edge in declared_graph.edges.values():
        origins: list[End] = [declared_graph.end(origin.name) for origin in edge.origins]
        if holds_poses(edge) and len(origins) == 1 and origins[0].is_node:
            for target in edge.targets:
                if declared_graph.end(target.name).is_node:
                    yield target.name, (origins[0].name, edge)


FRAME_CHECKS = (two_parents, frame_cycles)
"""The checks of this module."""
