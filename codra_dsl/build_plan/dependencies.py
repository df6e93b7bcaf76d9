"""The dependency graph of a plan: which element identifies, requires, runs or decides on which."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import chain

from codra_dsl.build_plan.values import Edge, EdgeKind, Node, NodeKind, Tree
from codra_dsl.check.checked import CheckedAlgorithm, CheckedSpec
from codra_dsl.model import Skill


def dependencies(checked: CheckedSpec, forest: Iterable[Tree]) -> tuple[Edge, ...]:
    """Return the dependency graph of a forest and of the skills that decide on what it identifies.

    Edges are sorted by kind and name of their source, by their own kind, and by kind and name of their target; so they
    are made in that order, each once.
    """
    trees = sorted(forest, key=lambda tree: tree.name)
    algorithms = sorted((branch.algorithm for tree in trees for branch in tree.branches), key=lambda each: each.name)
    skills = sorted(checked.spec.skills, key=lambda skill: skill.name)
    parts = chain(map(_runs, trees), map(_perceives, algorithms), map(_decides, skills))
    return tuple(chain.from_iterable(parts))


def _runs(tree: Tree) -> list[Edge]:
    source = Node(NodeKind.OBSERVER, tree.name)
    return _edges(source, EdgeKind.RUNS, NodeKind.PERCEPTION, [branch.name for branch in tree.branches])


def _perceives(algorithm: CheckedAlgorithm) -> list[Edge]:
    source = Node(NodeKind.PERCEPTION, algorithm.name)
    identified = [variable for variable, _ in algorithm.identifies]
    return [
        *_edges(source, EdgeKind.FEEDBACK, NodeKind.CONTEXT, algorithm.feedback),
        *_edges(source, EdgeKind.IDENTIFIES, NodeKind.CONTEXT, identified),
        *_edges(source, EdgeKind.REQUIRES, NodeKind.CONTEXT, algorithm.waits_for),
    ]


def _decides(skill: Skill) -> list[Edge]:
    watched = (expectation.variable for expectation in skill.monitor)
    names = [reference.name for reference in (*skill.preview, *watched)]
    return _edges(Node(NodeKind.SKILL, skill.name), EdgeKind.DECIDES_ON, NodeKind.CONTEXT, names)


def _edges(source: Node, kind: EdgeKind, target: NodeKind, names: Collection[str]) -> list[Edge]:
    several = sorted(set(names)) if len(names) > 1 else names
    return [Edge(source, Node(target, name), kind) for name in several]
