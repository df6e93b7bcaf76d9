"""Phase 4 for knowledge: rigid motions make up a tree: each frame stands in one other, and none in itself."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from codra_dsl import graph
from codra_dsl.check.knowledge.owners import is_whole
from codra_dsl.check.knowledge.world import End, World, is_rigid
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.model import EdgeType, Reference


def two_parents(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """A frame stands in one other at a time: two edges that lead to it are too many."""
    if not is_whole(scope, faults):
        return
    rigid = [edge for edge in scope.spec.edges if is_rigid(edge)]
    for first, second in combinations(rigid, 2):
        for target in second.targets:
            other = next((each for each in first.targets if _same_frame(scope.world, each, target)), None)
            if other is not None:
                yield _two_parents(first, second, target)
                break


def _same_frame(world: World, one: Reference, other: Reference) -> bool:
    """Return whether two ends of edges may mean the same node."""
    first, second = world.end(one.name), world.end(other.name)
    if first.is_node == second.is_node:
        return first.name == second.name
    node, kind = (first, second) if first.is_node else (second, first)
    return world.type_of(node.name) == kind.name


def _two_parents(first: EdgeType, second: EdgeType, target: Reference) -> Diagnostic:
    parents = [" or ".join(f"'{each.name}'" for each in edge.origins) for edge in (first, second)]
    both = ", ".join(dict.fromkeys(each.name for edge in (first, second) for each in edge.origins))
    return finding(
        "two-parents",
        f"'{target.name}' stands in two frames at once: in {parents[0]} by edge '{first.name}', "
        f"and in {parents[1]} by edge '{second.name}'",
        target.place,
        path=f"knowledge.edges.{second.name}.to",
        way_out=f"remove one; if it is moved from one to the other, one edge has 'from: [{both}]'",
        related=(Related(f"edge '{first.name}'", first.place),),
    )


def frame_cycles(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """No frame stands in itself, directly or through others."""
    if not is_whole(scope, faults):
        return
    parents = dict(_parents(scope.world))
    needs = {target: (parent,) for target, (parent, _) in parents.items()}
    for names in graph.strong_components(needs):
        within = {name: needs[name] for name in names}
        cycle = graph.shortest_cycle(within)
        edges = [parents[name][1] for name in cycle]
        shown = " -> ".join((cycle[0], *reversed(cycle)))
        yield finding(
            "frame-cycle",
            f"frames stand in each other in a circle: {shown}",
            edges[0].place,
            path=f"knowledge.edges.{edges[0].name}",
            way_out="let one of them stand in something outside of the circle, such as the world",
            related=tuple(
                Related(f"'{name}' stands in '{parents[name][0]}'", edge.place)
                for name, edge in zip(cycle, edges, strict=True)
            ),
        )


def _parents(world: World) -> Iterator[tuple[str, tuple[str, EdgeType]]]:
    """Yield each single node that stands in one other for certain, with that and the edge that says so."""
    for edge in world.edges.values():
        origins: list[End] = [world.end(each.name) for each in edge.origins]
        if is_rigid(edge) and len(origins) == 1 and origins[0].is_node:
            for target in edge.targets:
                if world.end(target.name).is_node:
                    yield target.name, (origins[0].name, edge)


FRAMES = (two_parents, frame_cycles)
"""The rules of this subject."""
