"""The dependency graph of a plan: which element identifies, requires, runs or decides on which."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import chain

from codra_dsl.generation.build_plan.loops import loop_edges
from codra_dsl.generation.build_plan.values import Edge, EdgeKind, Node, NodeKind, Tree
from codra_dsl.language.check.checked.knowledge import CheckedAgent, CheckedKnowledge
from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedSpec
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.expression import names_in, reads_of
from codra_dsl.language.model import Skill


def dependencies(checked: CheckedSpec, forest: Iterable[Tree]) -> tuple[Edge, ...]:
    """Return the dependency graph of a forest and of the skills that decide on what it identifies.

    Edges are sorted by kind and name of their source, by their own kind, and by kind and name of their target; so they
    are made in that order, each once.
    """
    trees = sorted(forest, key=lambda tree: tree.name)
    algorithms = sorted((branch.algorithm for tree in trees for branch in tree.branches), key=lambda each: each.name)
    skills = sorted(checked.spec.skills, key=lambda skill: skill.name)
    parts = chain(map(_runs, trees), map(_perceives, algorithms), map(_decides, skills))
    known = [] if checked.knowledge is None else list(_known(checked.knowledge))
    found = (*known, *chain.from_iterable(parts))
    found = found if checked.mape is None else (*found, *loop_edges(checked.mape))
    needed = {edge.target.name for edge in found if edge.target.kind is NodeKind.CONTEXT} if checked.poses else ()
    posed = [edge for name in checked.poses if name in needed for edge in _rests_on(checked, name)]
    return found if checked.mape is None and not posed else tuple(sorted({*found, *posed}, key=_in_order))


def _in_order(edge: Edge) -> tuple[Node, EdgeKind, Node]:
    return edge.source, edge.kind, edge.target


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


def _rests_on(checked: CheckedSpec, variable: str) -> list[Edge]:
    """Return the edges with poses from which it may follow what a variable is."""
    posed, knowledge = checked.variables[variable].posed, checked.knowledge
    asked = () if posed is None else names_in(posed.tree)
    nodes = [node for name in asked for node in reads_of(name.name)[1:]]
    names = [] if knowledge is None else [edge for node in nodes for edge in knowledge.world.climb(node)[1]]
    return _edges(Node(NodeKind.CONTEXT, variable), EdgeKind.READS, NodeKind.EDGE, names)


def _edges(source: Node, kind: EdgeKind, target: NodeKind, names: Collection[str]) -> list[Edge]:
    several = sorted(set(names)) if len(names) > 1 else names
    return [Edge(source, Node(target, name), kind) for name in several]


def _known(knowledge: CheckedKnowledge) -> Iterator[Edge]:
    """Yield who owns and reads what, who asks for and does which task, and where edges lead; sorted like the rest."""
    world = knowledge.world
    types = frozenset(types_shown(world))
    executed, asked = _handed(world)
    by_name = {agent.name: agent for agent in knowledge.agents}
    for name in sorted(by_name):
        source, agent = Node(NodeKind.AGENT, name), by_name[name]
        does, asks = executed.get(name, ()), asked.get(name, ())
        yield from _edges(source, EdgeKind.EXECUTES, NodeKind.TASK, does)
        yield from _touched(source, EdgeKind.OWNS, agent.owns, types)
        yield from _touched(source, EdgeKind.READS, _read(agent, {*does, *asks}), types)
        yield from _edges(source, EdgeKind.REQUESTS, NodeKind.TASK, asks)
    for name in sorted(world.edges):
        source, edge = Node(NodeKind.EDGE, name), world.edges[name]
        for kind, ends in ((EdgeKind.LEADS_FROM, edge.origins), (EdgeKind.LEADS_TO, edge.targets)):
            names = (world.type_of(each.name) for each in ends)
            yield from _edges(source, kind, NodeKind.TYPE, [each for each in names if each in types])


def types_shown(world: DeclaredGraph) -> tuple[str, ...]:
    """Return the types of nodes that a spec declares or that its nodes name."""
    return tuple(dict.fromkeys((*world.types, *(node.type.name for node in world.nodes.values()))))


def _handed(world: DeclaredGraph) -> tuple[Mapping[str, list[str]], Mapping[str, list[str]]]:
    """Return the tasks that each agent executes, and those that it may ask for."""
    executed: dict[str, list[str]] = {}
    asked: dict[str, list[str]] = {}
    for task in world.tasks.values():
        executed.setdefault(task.by.name, []).append(task.name)
        for requester in task.requesters:
            asked.setdefault(requester.name, []).append(task.name)
    return executed, asked


def _read(agent: CheckedAgent, handed: Collection[str]) -> list[KnowledgeElement]:
    """Return what an agent reads and neither owns nor hands over: that it knows that goes without saying."""
    known = {(thing.section, thing.name) for thing in agent.owns} | {("tasks", name) for name in handed}
    return [thing for thing in agent.reads if (thing.section, thing.name) not in known]


_KINDS = {"context": NodeKind.CONTEXT, "types": NodeKind.TYPE, "edges": NodeKind.EDGE, "tasks": NodeKind.TASK}


def _touched(source: Node, kind: EdgeKind, things: Iterable[KnowledgeElement], types: Collection[str]) -> list[Edge]:
    """Return the edges from an agent to some things, attributes told with what has them."""
    told = (thing for thing in things if thing.section != "types" or thing.name in types)
    return [Edge(source, target, kind) for target in sorted({Node(_KINDS[each.section], each.name) for each in told})]
