"""Checks of tasks (phase 4): no two loops wait for each other (P2, section 3.3)."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language import graph
from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import Silenced, SpecIndex
from codra_dsl.language.check.knowledge.mentions import patterns_of, steps
from codra_dsl.language.check.knowledge.owners import is_knowledge_complete
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.model import Agent, Task, TaskState


def waiting_loops(scope: SpecIndex, faults: Silenced) -> Iterator[Diagnostic]:
    """Tasks do not wait for each other: their executors do not request each other's tasks in a cycle."""
    if not is_knowledge_complete(scope, faults):
        return
    world = scope.world
    needs = {
        task.name: tuple(other.name for other in scope.spec.tasks if _waits(world, task, other))
        for task in scope.spec.tasks
    }
    for names in graph.strong_components(needs):
        component_needs = {name: tuple(need for need in needs[name] if need in names) for name in names}
        yield _loop_finding(world, graph.shortest_cycle(component_needs))


def _waits(world: DeclaredGraph, task: Task, other: Task) -> bool:
    """Return whether the executor of a task may request another task while it executes the first.

    This is true of every task that the executor may request, with one exception: the executor has rules that request
    the other task, and rules that take up the first. Then it is true only if the same rule does both.
    """
    if task.by.name not in (requester.name for requester in other.requesters):
        return False
    agent = world.agents.get(task.by.name)
    if agent is None:
        return True
    requesting_rules = _rules_about(world, agent, other, (Role.DURING, Role.AFTER), (TaskState.WANTS,))
    accepting_rules = _rules_about(world, agent, task, (Role.BEFORE, Role.DURING), (TaskState.WANTS, TaskState.IS))
    return not requesting_rules or not accepting_rules or bool(requesting_rules & accepting_rules)


def _rules_about(
    world: DeclaredGraph, agent: Agent, task: Task, roles: tuple[Role, ...], states: tuple[TaskState, ...]
) -> frozenset[str]:
    """Return the names of an agent's rules with a task in one of these states in a pattern with one of these roles."""
    rule_names = set()
    for pattern in patterns_of(agent):
        for step in steps(pattern) if pattern.role in roles else ():
            named_task = world.task_of(step.origin, step.link.edge, step.target)
            if pattern.rule is not None and named_task is task and step.link.edge in states:
                rule_names.add(pattern.rule.name)
    return frozenset(rule_names)


def _loop_finding(world: DeclaredGraph, cycle: tuple[str, ...]) -> Diagnostic:
    tasks = [world.tasks[name] for name in cycle]
    first = tasks[0]
    cycle_text = " -> ".join((*cycle, cycle[0]))
    if len(tasks) == 1:
        message = (
            f"agent '{first.by.name}' executes task '{first.name}' and may request it: the agent would wait for itself"
        )
    else:
        message = f"tasks may wait for each other forever: {cycle_text}"
    next_tasks = (*tasks[1:], first)
    return finding(
        "waiting-loops",
        message,
        first.place,
        path=f"knowledge.tasks.{first.name}",
        help="let an agent that executes none of these tasks request them, or write rules that request them",
        related=tuple(
            Related(f"agent '{task.by.name}' executes '{task.name}' and requests '{other.name}'", task.place)
            for task, other in zip(tasks, next_tasks, strict=True)
        ),
    )


HANDOVERS = (waiting_loops,)
"""The checks of this module."""
