"""Checks of tasks (phase 4): tasks do not wait for each other in a cycle (P2, section 3.3)."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language import graph
from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.mentions import patterns_of, steps
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.model import Agent, Task, TaskState


def waiting_loops(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Executors do not request each other's tasks in a cycle, so tasks do not wait for each other forever."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    declared_graph = spec_index.declared_graph
    requested_names = {
        task.name: tuple(
            other_task.name for other_task in spec_index.spec.tasks if _may_wait_for(declared_graph, task, other_task)
        )
        for task in spec_index.spec.tasks
    }
    for component in graph.strong_components(requested_names):
        component_requests = {
            name: tuple(requested_name for requested_name in requested_names[name] if requested_name in component)
            for name in component
        }
        yield _waiting_loop_finding(declared_graph, graph.shortest_cycle(component_requests))


def _may_wait_for(declared_graph: DeclaredGraph, task: Task, other_task: Task) -> bool:
    """Return whether the executor of a task may request another task while it executes the first task.

    The result is True for every task that the executor may request, with one exception: if the executor has rules that
    request the other task, and rules that take up the first task, the result is True only if one rule does both.
    """
    if task.by.name not in (requester.name for requester in other_task.requesters):
        return False
    agent = declared_graph.agents.get(task.by.name)
    if agent is None:
        return True
    requesting_rule_names = _names_of_rules_about_task(
        declared_graph, agent, other_task, (Role.DURING, Role.AFTER), (TaskState.WANTS,)
    )
    accepting_rule_names = _names_of_rules_about_task(
        declared_graph, agent, task, (Role.BEFORE, Role.DURING), (TaskState.WANTS, TaskState.IS)
    )
    return not requesting_rule_names or not accepting_rule_names or bool(requesting_rule_names & accepting_rule_names)


def _names_of_rules_about_task(
    declared_graph: DeclaredGraph, agent: Agent, task: Task, roles: tuple[Role, ...], states: tuple[TaskState, ...]
) -> frozenset[str]:
    """Return the names of rules that mention the task, in one of these states, in a pattern with one of these roles."""
    rule_names = set()
    for pattern in patterns_of(agent):
        for step in steps(pattern) if pattern.role in roles else ():
            named_task = declared_graph.task_of(step.origin, step.link.edge, step.target)
            if pattern.rule is not None and named_task is task and step.link.edge in states:
                rule_names.add(pattern.rule.name)
    return frozenset(rule_names)


def _waiting_loop_finding(declared_graph: DeclaredGraph, cycle: tuple[str, ...]) -> Diagnostic:
    tasks = [declared_graph.tasks[name] for name in cycle]
    first_task = tasks[0]
    cycle_text = " -> ".join((*cycle, cycle[0]))
    if len(tasks) == 1:
        message = (
            f"agent '{first_task.by.name}' executes task '{first_task.name}' and may request it: "
            "the agent would wait for itself"
        )
    else:
        message = f"tasks may wait for each other forever: {cycle_text}"
    next_tasks = (*tasks[1:], first_task)
    return finding(
        "waiting-loops",
        message,
        first_task.place,
        path=f"knowledge.tasks.{first_task.name}",
        help="let an agent that executes none of these tasks request them, or write rules that request them",
        related=tuple(
            Related(f"agent '{task.by.name}' executes '{task.name}' and requests '{other_task.name}'", task.place)
            for task, other_task in zip(tasks, next_tasks, strict=True)
        ),
    )


HANDOVER_CHECKS = (waiting_loops,)
"""The checks of this module."""
