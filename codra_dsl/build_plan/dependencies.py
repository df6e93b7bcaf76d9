"""The dependency graph of a plan: which element identifies, requires, runs or decides on which."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from codra_dsl.build_plan.values import Edge, EdgeKind, Node, NodeKind, Tree
from codra_dsl.check.checked import CheckedAlgorithm, CheckedSpec


def dependencies(checked: CheckedSpec, forest: Iterable[Tree]) -> tuple[Edge, ...]:
    """Return the dependency graph of a forest and of the skills that decide on what it identifies."""
    edges: set[Edge] = set()
    for tree in forest:
        for branch in tree.branches:
            perception = Node(NodeKind.PERCEPTION, branch.name)
            edges.add(Edge(Node(NodeKind.OBSERVER, tree.name), perception, EdgeKind.RUNS))
            edges.update(_perception_edges(perception, branch.algorithm))
    for skill in checked.spec.skills:
        decided = (*skill.preview, *(expectation.variable for expectation in skill.monitor))
        source = Node(NodeKind.SKILL, skill.name)
        edges.update(Edge(source, Node(NodeKind.CONTEXT, each.name), EdgeKind.DECIDES_ON) for each in decided)
    return tuple(sorted(edges, key=_sentence))


def _sentence(edge: Edge) -> tuple[str, ...]:
    return (edge.source.kind, edge.source.name, edge.kind, edge.target.kind, edge.target.name)


def _perception_edges(perception: Node, algorithm: CheckedAlgorithm) -> Iterator[Edge]:
    for variable, _ in algorithm.identifies:
        yield Edge(perception, Node(NodeKind.CONTEXT, variable), EdgeKind.IDENTIFIES)
    for variable in algorithm.needs:
        kind = EdgeKind.FEEDBACK if variable in algorithm.feedback else EdgeKind.REQUIRES
        yield Edge(perception, Node(NodeKind.CONTEXT, variable), kind)
