"""Phase 4 for tasks: no two loops wait for each other (P2, section 3.3)."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl import graph
from codra_dsl.check.conditions import Role
from codra_dsl.check.knowledge.mentions import patterns_of, steps
from codra_dsl.check.knowledge.owners import is_whole
from codra_dsl.check.knowledge.world import World
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.model import Agent, Task, TaskState


def waiting_loops(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """No task waits for another that waits for it: who executes one does not ask for what in turn asks for it."""
    if not is_whole(scope, faults):
        return
    world = scope.world
    needs = {
        task.name: tuple(other.name for other in scope.spec.tasks if _waits(world, task, other))
        for task in scope.spec.tasks
    }
    for names in graph.strong_components(needs):
        within = {name: tuple(each for each in needs[name] if each in names) for name in names}
        yield _loop(world, graph.shortest_cycle(within))


def _waits(world: World, task: Task, other: Task) -> bool:
    """Return whether who executes a task may ask for another meanwhile.

    That is so of every task that it may ask for, unless its rules tell: then it is so of what the rules ask for that
    take the task up.
    """
    if task.by.name not in (each.name for each in other.requesters):
        return False
    agent = world.agents.get(task.by.name)
    if agent is None:
        return True
    asked = _rules_about(world, agent, other, (Role.DURING, Role.AFTER), (TaskState.WANTS,))
    taken = _rules_about(world, agent, task, (Role.BEFORE, Role.DURING), (TaskState.WANTS, TaskState.IS))
    return not asked or not taken or bool(asked & taken)


def _rules_about(
    world: World, agent: Agent, task: Task, roles: tuple[Role, ...], states: tuple[TaskState, ...]
) -> frozenset[str]:
    """Return the names of an agent's rules that name a task in some states at some moments."""
    found = set()
    for pattern in patterns_of(agent):
        for step in steps(pattern) if pattern.role in roles else ():
            named = world.task_of(step.origin, step.link.edge, step.target)
            if pattern.rule is not None and named is task and step.link.edge in states:
                found.add(pattern.rule.name)
    return frozenset(found)


def _loop(world: World, cycle: tuple[str, ...]) -> Diagnostic:
    tasks = [world.tasks[name] for name in cycle]
    first = tasks[0]
    shown = " -> ".join((*cycle, cycle[0]))
    if len(tasks) == 1:
        message = f"agent '{first.by.name}' executes task '{first.name}' and may ask for it: it would wait for itself"
    else:
        message = f"tasks may wait for each other for ever: {shown}"
    following = (*tasks[1:], first)
    return finding(
        "waiting-loops",
        message,
        first.place,
        path=f"knowledge.tasks.{first.name}",
        way_out="let an agent ask that executes none of them, or say in rules when it asks",
        related=tuple(
            Related(f"agent '{task.by.name}' executes '{task.name}' and asks for '{other.name}'", task.place)
            for task, other in zip(tasks, following, strict=True)
        ),
    )


HANDOVERS = (waiting_loops,)
"""The rules of this subject."""
