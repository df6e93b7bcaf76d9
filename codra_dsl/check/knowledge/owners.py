"""Phase 2 for knowledge: everything has a writer, one goes before the other, and nobody writes what others own."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.conditions import Role
from codra_dsl.check.knowledge.mentions import Pattern, Step, names_read, patterns, patterns_of, steps
from codra_dsl.check.knowledge.world import Thing, World
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import NodeTerm, Path, reads_of
from codra_dsl.model import Agent, Task, TaskState, Writer

_SECTIONS = ("context", "types", "nodes", "edges", "tasks", "agents")


def is_whole(scope: Scope, faults: Faults) -> bool:
    """Return whether knowledge is declared, all of it could be read, and no name in it is wrong."""
    if not scope.spec.knows or any(scope.spec.damaged.get(section) for section in _SECTIONS):
        return False
    return not any(section in _SECTIONS for section, _ in faults.elements)


def two_owners(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """Of several who may write the same, priorities say who goes first; of a variable, the newest evidence counts."""
    if not is_whole(scope, faults):
        return
    told: set[Place] = set()
    for thing in scope.world.things():
        writers = scope.world.writers(thing)
        unranked = [writer for writer in writers if writer.priority is None]
        if thing.section == "context" or len(writers) < 2 or not unranked or unranked[-1].place in told:
            continue
        told.add(unranked[-1].place)  # attributes without a source of their own have those of their holder
        yield _unranked(scope.world, thing, writers, unranked[-1])


def _unranked(world: World, thing: Thing, writers: tuple[Writer, ...], offender: Writer) -> Diagnostic:
    ranked = ", ".join(f"{each.name}: {rank}" for rank, each in zip(range(len(writers), 0, -1), writers, strict=True))
    others = " and ".join(f"'{each.name}'" for each in writers if each is not offender)
    message = f"{thing} is written by '{offender.name}' and by {others}, and nothing says who goes first"
    key = f".attributes.{thing.attribute}" if thing.attribute else ""
    return finding(
        "two-owners",
        message,
        offender.place,
        path=f"knowledge.{thing.section}.{thing.name}{key}.source",
        way_out=f"write 'source: {{{ranked}}}' where it is declared: the larger number goes first",
        related=(Related("declared here", world.place_of(thing)),),
    )


def unwritten(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What an agent reads is there from the start, or somebody writes it; so is every edge that is declared."""
    if not is_whole(scope, faults):
        return
    world = scope.world
    told: set[Thing] = set()
    for edge in scope.spec.edges:
        thing = Thing("edges", edge.name)
        if not world.writers(thing) and not world.starts_with(edge):
            told.add(thing)
            message = f"nobody writes edge '{edge.name}', and it is not there from the start"
            way_out = "say who does with 'source', or lead it from one single node to another"
            path = f"knowledge.edges.{edge.name}"
            yield finding("unwritten-knowledge", message, edge.place, path=path, way_out=way_out)
    for agent in scope.spec.agents:
        for thing, place, path in _readings(world, agent):
            if thing not in told and not _is_written(world, thing):
                told.add(thing)
                message = f"agent '{agent.name}' reads {thing}, which nobody writes"
                related = (Related("declared here", world.place_of(thing)),)
                way_out = "say who does with 'source'"
                yield finding("unwritten-knowledge", message, place, path=path, way_out=way_out, related=related)


def _readings(world: World, agent: Agent) -> Iterator[tuple[Thing, Place, str]]:
    """Yield what an agent reads, each with its place and its path."""
    for reference in agent.conduct.reads:
        thing = world.named(reference.name)
        if thing is not None:
            yield thing, reference.place, f"agents.{agent.name}.reads"
    for pattern in patterns_of(agent):
        for name in names_read(pattern) if pattern.role is not Role.AFTER else ():
            thing = world.read(name.name)
            if thing is not None:
                yield thing, pattern.said.place_of(name), pattern.path
        for term in _terms_sought(pattern):
            if term.type:
                yield Thing("types", term.type), pattern.said.place_of(term), pattern.path


def _terms_sought(pattern: Pattern) -> tuple[NodeTerm, ...]:
    """Return the nodes that an agent looks for in a pattern."""
    path = pattern.tree
    sought = isinstance(path, Path) and pattern.role is not Role.AFTER and not path.negated
    return path.terms if sought and isinstance(path, Path) else ()


def _is_written(world: World, thing: Thing) -> bool:
    """Return whether somebody writes something, or it is there from the start."""
    if thing.section in ("context", "tasks") or world.writers(thing):
        return True
    if thing.section == "edges":
        return world.starts_with(world.edges[thing.name])
    of_type = [node for node in world.spec.nodes if node.type.name == thing.name]
    if not thing.attribute:
        return bool(of_type) or thing.name not in world.types
    return any(value.name == thing.attribute for node in of_type for value in node.values)


def foreign_writes(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a rule brings about is owned by its agent."""
    if not is_whole(scope, faults):
        return
    for pattern in patterns(scope):
        if pattern.role is Role.AFTER:
            found = _written(scope.world, pattern)
            if found and not any(scope.world.owns(pattern.agent.name, thing) for thing, _ in found):
                yield _foreign(scope.world, pattern, *found[0])
            yield from _foreign_states(scope.world, pattern)


def _written(world: World, pattern: Pattern) -> list[tuple[Thing, Place]]:
    """Return what a pattern under `after` can be brought about by, each with its place; nothing where that is open."""
    found: list[tuple[Thing, Place]] = []
    for step in steps(pattern):
        if world.task_of(step.origin, step.link.edge, step.target) is not None:
            return []
        edges = world.edges_between(step.origin, step.link.edge, step.target)
        found += [(Thing("edges", edge.name), pattern.said.place_of(step.link)) for edge in edges]
    for name in names_read(pattern):
        thing = world.read(name.name)
        if thing is None or reads_of(name.name)[0]:
            return []
        found.append((thing, pattern.said.place_of(name)))
    if isinstance(pattern.tree, Path) and pattern.tree.negated:
        kinds = [term.type for term in pattern.tree.terms if term.type]
        found += [(Thing("types", kind), pattern.said.place) for kind in kinds if kind in world.types]
    return found


def _foreign(world: World, pattern: Pattern, thing: Thing, place: Place) -> Diagnostic:
    owners = [writer.name for writer in world.writers(thing)]
    who = " and ".join(f"'{owner}'" for owner in owners)
    assert pattern.rule is not None
    verb = "own" if len(owners) > 1 else "owns"
    own = f"name '{pattern.agent.name}' as its '{'by' if thing.section == 'tasks' else 'source'}'"
    way_out = f"{own}, or leave it to {who}: a rule brings about what its agent owns" if who else own
    return finding(
        "foreign-write",
        f"rule '{pattern.rule.name}' of {pattern.user} writes {thing}, which {who or 'nobody'} {verb}",
        place,
        path=pattern.path,
        way_out=way_out,
        related=(Related("declared here", world.place_of(thing)),),
    )


def _foreign_states(world: World, pattern: Pattern) -> Iterator[Diagnostic]:
    for step in steps(pattern):
        task = world.task_of(step.origin, step.link.edge, step.target)
        if task is None or pattern.agent.name in may_write(task, step.link.edge):
            continue
        assert pattern.rule is not None
        who = " and ".join(f"'{name}'" for name in may_write(task, step.link.edge))
        yield finding(
            "foreign-write",
            f"rule '{pattern.rule.name}' of {pattern.user} writes '{step.link.edge}' of task '{task.name}', "
            f"which {who} may",
            pattern.said.place_of(step.link),
            path=pattern.path,
            way_out=f"requesters write wants and aborted, the executor is and finished; leave it to {who}",
            related=(Related("declared here", task.place),),
        )


def may_write(task: Task, state: str) -> tuple[str, ...]:
    """Return who may write a state of a task: a requester wants and aborts, the executor does it and finishes."""
    if state in (TaskState.WANTS, TaskState.ABORTED):
        return tuple(each.name for each in task.requesters)
    return (task.by.name,)


def claimed_tasks(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """A task has one executor: no rule of another agent takes it up."""
    if not is_whole(scope, faults):
        return
    for agent in scope.spec.agents:
        for rule in agent.conduct.rules:
            wanted = {task.name for task, _ in _task_steps(scope.world, agent, rule.name, Role.BEFORE, TaskState.WANTS)}
            for task, step in _task_steps(scope.world, agent, rule.name, Role.DURING, TaskState.IS):
                if task.name in wanted and task.by.name != agent.name:
                    yield _claimed(agent, rule.name, task, step)


def _task_steps(world: World, agent: Agent, rule: str, role: Role, state: TaskState) -> Iterator[tuple[Task, Step]]:
    """Yield the tasks that the patterns of a rule name in a state."""
    for pattern in patterns_of(agent):
        if pattern.rule is None or pattern.rule.name != rule or pattern.role is not role:
            continue
        for step in steps(pattern):
            task = world.task_of(step.origin, step.link.edge, step.target)
            if task is not None and step.link.edge == state:
                yield task, step


def _claimed(agent: Agent, rule: str, task: Task, step: Step) -> Diagnostic:
    return finding(
        "claimed-task",
        f"rule '{rule}' of agent '{agent.name}' takes up task '{task.name}', which agent '{task.by.name}' executes",
        step.pattern.said.place_of(step.link),
        path=step.pattern.path,
        way_out=f"let one agent do it: change 'by' of the task, or leave it to '{task.by.name}'",
        related=(Related("declared here", task.places.get("by", task.place)),),
    )


def unattended_tasks(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """The executor of a task notices that it is asked: it is always active or woken by it, and has a rule for it."""
    if not is_whole(scope, faults):
        return
    for task in scope.spec.tasks:
        agent = scope.world.agents.get(task.by.name)
        if agent is None:
            continue
        asleep = agent.conduct.wakes and not _names_request(scope.world, agent, task, Role.WAKES)
        idle = agent.conduct.rules and not _names_request(scope.world, agent, task, Role.BEFORE)
        if asleep or idle:
            wants = f"{task.origin.name} -wants-> {task.name}"
            reason = "is not woken by it" if asleep else "has no rule for it"
            way_out = f"add '{wants}' to its 'wakes'" if asleep else f"add a rule with 'before: [{wants}]'"
            yield finding(
                "unattended-task",
                f"nobody takes up task '{task.name}': agent '{agent.name}', which executes it, {reason}",
                task.places.get("by", task.place),
                path=f"knowledge.tasks.{task.name}.by",
                way_out=way_out,
                related=(Related("the agent", agent.place),),
            )


def _names_request(world: World, agent: Agent, task: Task, role: Role) -> bool:
    """Return whether some pattern of an agent asks for the request of a task, or is a condition that may come of it."""
    for pattern in patterns_of(agent):
        if pattern.role is not role or (isinstance(pattern.tree, Path) and pattern.tree.negated):
            continue
        if not isinstance(pattern.tree, Path):
            if role is Role.WAKES:
                return True
            continue
        for step in steps(pattern):
            found = world.task_of(step.origin, step.link.edge, step.target)
            is_any = not step.target.name and step.link.edge == TaskState.WANTS
            if is_any or (found is not None and found.name == task.name and step.link.edge == TaskState.WANTS):
                return True
    return False


def owns(world: World, agent: str) -> tuple[Thing, ...]:
    """Return what an agent may write, in file order."""
    return world.owned.get(agent, ())


def reads(world: World, agent: Agent) -> tuple[Thing, ...]:
    """Return what an agent reads, each once: what it says and what its patterns name."""
    found = dict.fromkeys(thing for thing, *_ in _readings(world, agent))
    for pattern in patterns_of(agent):
        if pattern.role is Role.AFTER:
            continue
        for step in steps(pattern):
            task = world.task_of(step.origin, step.link.edge, step.target)
            if task is not None:
                found[Thing("tasks", task.name)] = None
            found |= dict.fromkeys(
                Thing("edges", edge.name) for edge in world.edges_between(step.origin, step.link.edge, step.target)
            )
    return tuple(found)


OWNERS = (two_owners, unwritten, foreign_writes, claimed_tasks, unattended_tasks)
"""The rules of this subject."""
