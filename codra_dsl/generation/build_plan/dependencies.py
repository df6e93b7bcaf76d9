"""The dependency graph of a plan: which element identifies, requires, runs or decides on which other element."""

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
    """Return the dependency graph of a forest and of the skills that decide on its variables.

    Edges are sorted by kind and name of their source, by their own kind, and by kind and name of their target. They are
    generated in that order, without duplicates.
    """
    trees = sorted(forest, key=lambda tree: tree.name)
    algorithms = sorted(
        (branch.algorithm for tree in trees for branch in tree.branches), key=lambda algorithm: algorithm.name
    )
    skills = sorted(checked.spec.skills, key=lambda skill: skill.name)
    parts = chain(map(_runs, trees), map(_perceives, algorithms), map(_decides, skills))
    knowledge_edges = [] if checked.knowledge is None else list(_knowledge_edges(checked.knowledge))
    edges = (*knowledge_edges, *chain.from_iterable(parts))
    edges = edges if checked.mape is None else (*edges, *loop_edges(checked.mape))
    needed = {edge.target.name for edge in edges if edge.target.kind is NodeKind.CONTEXT} if checked.poses else ()
    pose_edges = [edge for name in checked.poses if name in needed for edge in _pose_edges(checked, name)]
    return edges if checked.mape is None and not pose_edges else tuple(sorted({*edges, *pose_edges}, key=_in_order))


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


def _pose_edges(checked: CheckedSpec, variable: str) -> list[Edge]:
    """Return the edges to the poses from which a variable may be derived."""
    pose_condition, knowledge = checked.variables[variable].pose_condition, checked.knowledge
    readings = () if pose_condition is None else names_in(pose_condition.tree)
    nodes = [node for reading in readings for node in reads_of(reading.name)[1:]]
    names = [] if knowledge is None else [edge for node in nodes for edge in knowledge.world.climb(node)[1]]
    return _edges(Node(NodeKind.CONTEXT, variable), EdgeKind.READS, NodeKind.EDGE, names)


def _edges(source: Node, kind: EdgeKind, target: NodeKind, names: Collection[str]) -> list[Edge]:
    several = sorted(set(names)) if len(names) > 1 else names
    return [Edge(source, Node(target, name), kind) for name in several]


def _knowledge_edges(knowledge: CheckedKnowledge) -> Iterator[Edge]:
    """Yield the edges of knowledge, sorted like the others.

    They connect agents with the elements that they own and read and with the tasks that they request and execute, and
    types of edges with the types of nodes at their ends.
    """
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
            type_names = (world.type_of(end.name) for end in ends)
            yield from _edges(
                source, kind, NodeKind.TYPE, [type_name for type_name in type_names if type_name in types]
            )


def types_shown(world: DeclaredGraph) -> tuple[str, ...]:
    """Return the types of nodes that a spec declares or uses for its nodes."""
    return tuple(dict.fromkeys((*world.types, *(node.type.name for node in world.nodes.values()))))


def _handed(world: DeclaredGraph) -> tuple[Mapping[str, list[str]], Mapping[str, list[str]]]:
    """Return the tasks that each agent executes, and those that it may request."""
    executed: dict[str, list[str]] = {}
    asked: dict[str, list[str]] = {}
    for task in world.tasks.values():
        executed.setdefault(task.by.name, []).append(task.name)
        for requester in task.requesters:
            asked.setdefault(requester.name, []).append(task.name)
    return executed, asked


def _read(agent: CheckedAgent, handed: Collection[str]) -> list[KnowledgeElement]:
    """Return the elements that an agent reads, without its own elements and its tasks: those it knows in any case."""
    known = {(element.section, element.name) for element in agent.owns} | {("tasks", name) for name in handed}
    return [element for element in agent.reads if (element.section, element.name) not in known]


_KINDS = {"context": NodeKind.CONTEXT, "types": NodeKind.TYPE, "edges": NodeKind.EDGE, "tasks": NodeKind.TASK}


def _touched(source: Node, kind: EdgeKind, elements: Iterable[KnowledgeElement], types: Collection[str]) -> list[Edge]:
    """Return the edges from an agent to some elements; an attribute is represented by the element that has it."""
    shown = (element for element in elements if element.section != "types" or element.name in types)
    targets = {Node(_KINDS[element.section], element.name) for element in shown}
    return [Edge(source, target, kind) for target in sorted(targets)]
