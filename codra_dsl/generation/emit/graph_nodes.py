"""The nodes of knowledge in the dependency graph, and the places of knowledge, for the files beside the code."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.generation.build_plan import BuildPlan, Node, NodeKind
from codra_dsl.generation.build_plan.dependencies import node_type_names
from codra_dsl.language.check.checked.knowledge import CheckedAgent, CheckedKnowledge, CheckedPattern
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.model import Variable


def node_id(plan: BuildPlan, node: Node) -> str:
    """Return the name of a node in files and pictures, e.g. `lab/context/centrifuge_open`."""
    return f"{plan.name}/{node.kind}/{node.name}"


def variable_entry(variable: Variable) -> dict[str, object]:
    """Return the entry of a context-variable in the dependency graph."""
    return {"label": variable.label, "type": variable.type.kind.value}


def knowledge_nodes(plan: BuildPlan, knowledge: CheckedKnowledge) -> Iterator[tuple[Node, dict[str, object]]]:
    """Yield the nodes of knowledge in the dependency graph with their entries, kind by kind in file order.

    The first nodes are context-variables that no decision needs, but that agents own or read.
    """
    world = knowledge.world
    edge_nodes = (node for edge in plan.edges for node in (edge.source, edge.target))
    shown_names = {node.name for node in edge_nodes if node.kind is NodeKind.CONTEXT}
    for variable in plan.checked.variables.values():
        if variable.name in shown_names and variable.name not in plan.in_force:
            yield Node(NodeKind.CONTEXT, variable.name), variable_entry(variable)
    for agent in knowledge.agents:
        yield Node(NodeKind.AGENT, agent.name), _agent_entry(agent)
    for name in node_type_names(world):
        declared_type = world.types.get(name)
        attributes = [attribute.name for attribute in declared_type.attributes] if declared_type is not None else []
        label = declared_type.label if declared_type is not None else ""
        yield Node(NodeKind.TYPE, name), {"label": label or name, "attributes": attributes}
    for edge in world.edges.values():
        yield Node(NodeKind.EDGE, edge.name), {"label": edge.name, "carries": edge.label}
    for task in world.tasks.values():
        results = [result.name for result in task.results]
        yield Node(NodeKind.TASK, task.name), {"label": task.label or task.name, "results": results}


def _agent_entry(agent: CheckedAgent) -> dict[str, object]:
    conduct = agent.agent.conduct
    phase = {} if conduct.phase is None else {"phase": conduct.phase.value}
    wakes = [pattern.text for pattern in agent.wakes]
    return {"label": conduct.label or agent.name, **phase, **({"wakes": wakes} if wakes else {})}


def knowledge_places(plan: BuildPlan, knowledge: CheckedKnowledge) -> Iterator[tuple[str, Place]]:
    """Yield, for each element of knowledge and each rule and pattern of an agent, its name in files and its place."""
    world, name = knowledge.world, plan.name
    for kind in node_type_names(world):
        declared_type = world.types.get(kind)
        yield f"{name}/type/{kind}", declared_type.place if declared_type is not None else _first_node(knowledge, kind)
    yield from ((f"{name}/node/{node.name}", node.place) for node in world.nodes.values())
    yield from ((f"{name}/edge/{edge.name}", edge.place) for edge in world.edges.values())
    yield from ((f"{name}/task/{task.name}", task.place) for task in world.tasks.values())
    for agent in knowledge.agents:
        agent_path = f"{name}/agent/{agent.name}"
        yield agent_path, agent.agent.place
        yield from _numbered_places(f"{agent_path}/wakes", agent.wakes)
        for rule in agent.rules:
            yield f"{agent_path}/rules/{rule.name}", rule.place
            for moment in ("before", "during", "after"):
                yield from _numbered_places(f"{agent_path}/rules/{rule.name}/{moment}", getattr(rule, moment))


def _numbered_places(name: str, patterns: tuple[CheckedPattern, ...]) -> Iterator[tuple[str, Place]]:
    return ((f"{name}/{number}", pattern.place) for number, pattern in enumerate(patterns))


def _first_node(knowledge: CheckedKnowledge, kind: str) -> Place:
    return next(node.type.place for node in knowledge.world.nodes.values() if node.type.name == kind)
