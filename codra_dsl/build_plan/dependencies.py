"""The dependency graph of a plan: which element identifies, requires, runs or decides on which."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from itertools import chain

from codra_dsl.build_plan.values import Edge, EdgeKind, Node, NodeKind, Tree
from codra_dsl.check.checked import CheckedAlgorithm, CheckedSpec
from codra_dsl.check.knowledge.checked import CheckedAgent, CheckedKnowledge
from codra_dsl.check.knowledge.world import Thing, World
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
    known = [] if checked.knowledge is None else list(_known(checked.knowledge))
    return (*known, *chain.from_iterable(parts))


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


def _known(knowledge: CheckedKnowledge) -> Iterator[Edge]:
    """Yield who owns and reads what, who asks for and does which task, and where edges lead; sorted like the rest."""
    world = knowledge.world
    by_name = {agent.name: agent for agent in knowledge.agents}
    for name in sorted(by_name):
        source, agent = Node(NodeKind.AGENT, name), by_name[name]
        executed = [task.name for task in world.tasks.values() if task.by.name == name]
        asked = [task.name for task in world.tasks.values() if name in (each.name for each in task.requesters)]
        yield from _edges(source, EdgeKind.EXECUTES, NodeKind.TASK, executed)
        yield from _touched(source, EdgeKind.OWNS, agent.owns, world)
        yield from _touched(source, EdgeKind.READS, _read(agent, world), world)
        yield from _edges(source, EdgeKind.REQUESTS, NodeKind.TASK, asked)
    for name in sorted(world.edges):
        source, edge = Node(NodeKind.EDGE, name), world.edges[name]
        for kind, ends in ((EdgeKind.LEADS_FROM, edge.origins), (EdgeKind.LEADS_TO, edge.targets)):
            types = (world.type_of(each.name) for each in ends)
            yield from _edges(source, kind, NodeKind.TYPE, [each for each in types if each in types_shown(world)])


def types_shown(world: World) -> tuple[str, ...]:
    """Return the types of nodes that a spec declares or that its nodes name."""
    return tuple(dict.fromkeys((*world.types, *(node.type.name for node in world.nodes.values()))))


def _read(agent: CheckedAgent, world: World) -> list[Thing]:
    """Return what an agent reads and neither owns nor hands over: that it knows that goes without saying."""
    owned = {(thing.section, thing.name) for thing in agent.owns}
    handed = {
        ("tasks", task.name)
        for task in world.tasks.values()
        if agent.name in (task.by.name, *(each.name for each in task.requesters))
    }
    return [thing for thing in agent.reads if (thing.section, thing.name) not in owned | handed]


_KINDS = {"context": NodeKind.CONTEXT, "types": NodeKind.TYPE, "edges": NodeKind.EDGE, "tasks": NodeKind.TASK}


def _touched(source: Node, kind: EdgeKind, things: Iterable[Thing], world: World) -> list[Edge]:
    """Return the edges from an agent to some things, attributes told with what has them."""
    shown = types_shown(world)
    targets = {
        Node(_KINDS[thing.section], thing.name) for thing in things if thing.section != "types" or thing.name in shown
    }
    return [Edge(source, target, kind) for target in sorted(targets)]
