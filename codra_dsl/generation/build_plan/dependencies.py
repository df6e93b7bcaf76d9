"""The dependency graph of a plan: which element identifies, requires, runs or decides on which other element."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import chain

from codra_dsl.generation.build_plan.loops import loop_edges
from codra_dsl.generation.build_plan.values import Edge, EdgeKind, Node, NodeKind, Tree
from codra_dsl.language import graph
from codra_dsl.language.check.checked.knowledge import CheckedAgent, CheckedKnowledge
from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedSpec
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.expression import Count, names_in, reads_of
from codra_dsl.language.model import Skill


def dependencies(checked: CheckedSpec, in_force: Iterable[str], forest: Iterable[Tree]) -> tuple[Edge, ...]:
    """Return the dependency graph of a forest and of the skills that decide on its variables, without duplicate edges.

    `in_force` is C_M: the graph shows how its derived variables follow from other variables.

    Edges are sorted by kind and name of their source, then by their own kind, then by kind and name of their target.
    """
    trees = sorted(forest, key=lambda tree: tree.name)
    algorithms = sorted(
        (branch.algorithm for tree in trees for branch in tree.branches), key=lambda algorithm: algorithm.name
    )
    skills = sorted(checked.spec.skills, key=lambda skill: skill.name)
    edge_groups = chain(map(_run_edges, trees), map(_perception_edges, algorithms), map(_decision_edges, skills))
    metrics = frozenset(metric.name for metric in checked.spec.metrics)
    knowledge_edges = [] if checked.knowledge is None else list(_knowledge_edges(checked.knowledge, metrics))
    edges = (*knowledge_edges, *chain.from_iterable(edge_groups))
    edges = edges if checked.mape is None else (*edges, *loop_edges(checked.mape))
    edges = (*edges, *_derivation_edges(checked, in_force, edges))
    nodes = (node for edge in edges for node in (edge.source, edge.target)) if checked.poses else ()
    variables = {node.name for node in nodes if node.kind is NodeKind.CONTEXT}
    pose_edges = [edge for name in checked.poses if name in variables for edge in _pose_edges(checked, name)]
    if checked.mape is None and not pose_edges and not checked.derived:
        return edges
    return tuple(sorted({*edges, *pose_edges}, key=lambda edge: (edge.source, edge.kind, edge.target)))


def _run_edges(tree: Tree) -> list[Edge]:
    source = Node(NodeKind.OBSERVER, tree.name)
    return _edges(source, EdgeKind.RUNS, NodeKind.PERCEPTION, [branch.name for branch in tree.branches])


def _perception_edges(algorithm: CheckedAlgorithm) -> list[Edge]:
    source = Node(NodeKind.PERCEPTION, algorithm.name)
    identified_variables = [variable for variable, _ in algorithm.identifies]
    return [
        *_edges(source, EdgeKind.FEEDBACK, NodeKind.CONTEXT, algorithm.feedback),
        *_edges(source, EdgeKind.IDENTIFIES, NodeKind.CONTEXT, identified_variables),
        *_edges(source, EdgeKind.REQUIRES, NodeKind.CONTEXT, algorithm.waits_for),
    ]


def _decision_edges(skill: Skill) -> list[Edge]:
    monitored_variables = (expectation.variable for expectation in skill.monitor)
    names = [reference.name for reference in (*skill.preview, *monitored_variables)]
    return _edges(Node(NodeKind.SKILL, skill.name), EdgeKind.DECIDES_ON, NodeKind.CONTEXT, names)


def _derivation_edges(checked: CheckedSpec, in_force: Iterable[str], edges: Iterable[Edge]) -> Iterator[Edge]:
    """Yield the edges from the inputs of derived variables to these variables, for variables in force or in `edges`."""
    inputs = {name: condition.variables for name, condition in checked.derived.items()}
    targets = (edge.target.name for edge in edges if edge.target.kind is NodeKind.CONTEXT)
    for name in graph.closure(inputs, (*in_force, *targets)) if inputs else ():
        for need in inputs.get(name, ()):
            yield Edge(Node(NodeKind.CONTEXT, need), Node(NodeKind.CONTEXT, name), EdgeKind.DERIVES)


def _pose_edges(checked: CheckedSpec, variable: str) -> list[Edge]:
    """Return edges from a variable to the edges of the knowledge graph with poses on which its value may depend."""
    pose_condition, knowledge = checked.variables[variable].pose_condition, checked.knowledge
    tree = None if pose_condition is None else pose_condition.tree
    if isinstance(tree, Count) and knowledge is not None:
        words = [link.edge for link in tree.path.links]
        edge_names = [edge.name for word in words for edge in knowledge.world.edges_of_word(word)]
        type_names = [term.type for term in tree.path.terms if term.type]
        source = Node(NodeKind.CONTEXT, variable)
        return [
            *_edges(source, EdgeKind.READS, NodeKind.EDGE, edge_names),
            *_edges(source, EdgeKind.READS, NodeKind.TYPE, type_names),
        ]
    pose_terms = () if tree is None else names_in(tree)
    nodes = [node for pose_term in pose_terms for node in reads_of(pose_term.name)[1:]]
    names = [] if knowledge is None else [edge for node in nodes for edge in knowledge.world.climb(node)[1]]
    return _edges(Node(NodeKind.CONTEXT, variable), EdgeKind.READS, NodeKind.EDGE, names)


def _edges(source: Node, kind: EdgeKind, target: NodeKind, names: Collection[str]) -> list[Edge]:
    sorted_names = sorted(set(names)) if len(names) > 1 else names
    return [Edge(source, Node(target, name), kind) for name in sorted_names]


def _knowledge_edges(knowledge: CheckedKnowledge, metrics: Collection[str]) -> Iterator[Edge]:
    """Yield the edges of knowledge, sorted like all other edges.

    They connect each agent with the elements that the agent owns or reads, and with the tasks that the agent requests
    or executes. They also connect each type of edges with the types of nodes at its ends.
    """
    world = knowledge.world
    types = frozenset(node_type_names(world))
    tasks_by_executor, tasks_by_requester = _tasks_of_agents(world)
    agents = {agent.name: agent for agent in knowledge.agents}
    for name in sorted(agents):
        source, agent = Node(NodeKind.AGENT, name), agents[name]
        executed_tasks, requested_tasks = tasks_by_executor.get(name, ()), tasks_by_requester.get(name, ())
        yield from _edges(source, EdgeKind.EXECUTES, NodeKind.TASK, executed_tasks)
        yield from _element_edges(source, EdgeKind.OWNS, agent.owns, types, metrics)
        read_elements = _elements_read_by_agent(agent, {*executed_tasks, *requested_tasks})
        yield from _element_edges(source, EdgeKind.READS, read_elements, types, metrics)
        yield from _edges(source, EdgeKind.REQUESTS, NodeKind.TASK, requested_tasks)
    for name in sorted(world.edges):
        source, edge = Node(NodeKind.EDGE, name), world.edges[name]
        for kind, ends in ((EdgeKind.LEADS_FROM, edge.origins), (EdgeKind.LEADS_TO, edge.targets)):
            type_names = (world.type_of(end.name) for end in ends)
            yield from _edges(
                source, kind, NodeKind.TYPE, [type_name for type_name in type_names if type_name in types]
            )


def node_type_names(world: DeclaredGraph) -> tuple[str, ...]:
    """Return the node types of a spec: the declared types, then undeclared types of its nodes."""
    return tuple(dict.fromkeys((*world.types, *(node.type.name for node in world.nodes.values()))))


def _tasks_of_agents(world: DeclaredGraph) -> tuple[Mapping[str, list[str]], Mapping[str, list[str]]]:
    """Return two mappings from agents' names: to the tasks that an agent executes, and to those that it may request."""
    tasks_by_executor: dict[str, list[str]] = {}
    tasks_by_requester: dict[str, list[str]] = {}
    for task in world.tasks.values():
        tasks_by_executor.setdefault(task.by.name, []).append(task.name)
        for requester in task.requesters:
            tasks_by_requester.setdefault(requester.name, []).append(task.name)
    return tasks_by_executor, tasks_by_requester


def _elements_read_by_agent(agent: CheckedAgent, tasks: Collection[str]) -> list[KnowledgeElement]:
    """Return the elements that an agent reads, except those that it knows in any case: its own elements and tasks."""
    known_elements = {(element.section, element.name) for element in agent.owns} | {("tasks", name) for name in tasks}
    return [element for element in agent.reads if (element.section, element.name) not in known_elements]


_KINDS = {"context": NodeKind.CONTEXT, "types": NodeKind.TYPE, "edges": NodeKind.EDGE, "tasks": NodeKind.TASK}


def _element_edges(
    source: Node,
    kind: EdgeKind,
    elements: Iterable[KnowledgeElement],
    types: Collection[str],
    metrics: Collection[str],
) -> list[Edge]:
    """Return the edges from an agent to some elements.

    The edge of an attribute leads to its element, and the edge of the variable of a metric leads to the metric.
    """
    elements_with_node = (element for element in elements if element.section != "types" or element.name in types)
    targets = {
        Node(NodeKind.METRIC, element.name)
        if element.section == "context" and element.name in metrics
        else Node(_KINDS[element.section], element.name)
        for element in elements_with_node
    }
    return [Edge(source, target, kind) for target in sorted(targets)]
