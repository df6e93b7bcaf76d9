"""Checks of writers of knowledge (phase 2).

Each element has a writer, several writers of one element have priorities, and agents own the elements that they write.
"""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.mentions import Pattern, Step, names_in_pattern, patterns, patterns_of, steps
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import NodeTerm, Path, reads_of
from codra_dsl.language.model import Agent, Task, TaskState, Writer

_SECTIONS = ("context", "types", "nodes", "edges", "tasks", "agents")


def is_knowledge_checkable(spec_index: SpecIndex, faults: FaultyElements) -> bool:
    """Return whether knowledge is declared, could be read completely, and has no wrong names."""
    if not spec_index.spec.knows or any(spec_index.spec.damaged.get(section) for section in _SECTIONS):
        return False
    return not any(section in _SECTIONS for section, _ in faults.elements)


def two_owners(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Several writers of the same element have priorities.

    Context-variables are not checked, because the value with the newest evidence is used.
    """
    if not is_knowledge_checkable(spec_index, faults):
        return
    reported_places: set[Place] = set()
    for element in spec_index.declared_graph.elements():
        writers = spec_index.declared_graph.writers(element)
        unranked_writers = [writer for writer in writers if writer.priority is None]
        if (
            element.section == "context"
            or len(writers) < 2
            or not unranked_writers
            or unranked_writers[-1].place in reported_places
        ):
            continue
        # attributes without a source of their own have the sources of their type or edge
        reported_places.add(unranked_writers[-1].place)
        yield _unranked_writer_finding(spec_index.declared_graph, element, writers, unranked_writers[-1])


def _unranked_writer_finding(
    declared_graph: DeclaredGraph, element: KnowledgeElement, writers: tuple[Writer, ...], offender: Writer
) -> Diagnostic:
    priorities_text = ", ".join(
        f"{writer.name}: {rank}" for rank, writer in zip(range(len(writers), 0, -1), writers, strict=True)
    )
    others = " and ".join(f"'{writer.name}'" for writer in writers if writer is not offender)
    message = f"{element} is written by '{offender.name}' and by {others}, without priorities"
    key = f".attributes.{element.attribute}" if element.attribute else ""
    return finding(
        "two-owners",
        message,
        offender.place,
        path=f"knowledge.{element.section}.{element.name}{key}.source",
        help=f"write 'source: {{{priorities_text}}}' in the declaration: the larger number has priority",
        related=(Related("declared here", declared_graph.place_of(element)),),
    )


def unwritten_knowledge(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Everything that an agent reads, and every declared edge, exists from the start or has a writer."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    declared_graph = spec_index.declared_graph
    reported_elements: set[KnowledgeElement] = set()
    for edge in spec_index.spec.edges:
        element = KnowledgeElement("edges", edge.name)
        if not declared_graph.writers(element) and not declared_graph.exists_initially(edge):
            reported_elements.add(element)
            message = f"no agent writes edge '{edge.name}', and it does not exist from the start"
            help = "name its writer under 'source', or declare it between two single nodes"
            path = f"knowledge.edges.{edge.name}"
            yield finding("unwritten-knowledge", message, edge.place, path=path, help=help)
    for agent in spec_index.spec.agents:
        for element, place, path in _element_mentions(declared_graph, agent):
            if element not in reported_elements and not _is_written(declared_graph, element):
                reported_elements.add(element)
                message = f"agent '{agent.name}' reads {element}, which no agent writes"
                related = (Related("declared here", declared_graph.place_of(element)),)
                help = "name its writer under 'source'"
                yield finding("unwritten-knowledge", message, place, path=path, help=help, related=related)


def _element_mentions(declared_graph: DeclaredGraph, agent: Agent) -> Iterator[tuple[KnowledgeElement, Place, str]]:
    """Yield the elements that an agent reads, each with the place and the path where it is read."""
    for reference in agent.conduct.reads:
        element = declared_graph.element_named(reference.name)
        if element is not None:
            yield element, reference.place, f"agents.{agent.name}.reads"
    for pattern in patterns_of(agent):
        for name in names_in_pattern(pattern) if pattern.role is not Role.AFTER else ():
            element = declared_graph.element_read_by(name.name)
            if element is not None:
                yield element, pattern.condition.place_of(name), pattern.path
        for term in _searched_terms(pattern):
            if term.type:
                yield KnowledgeElement("types", term.type), pattern.condition.place_of(term), pattern.path


def _searched_terms(pattern: Pattern) -> tuple[NodeTerm, ...]:
    """Return the nodes that an agent searches for with a pattern."""
    path = pattern.tree
    is_search_pattern = isinstance(path, Path) and pattern.role is not Role.AFTER and not path.negated
    return path.terms if is_search_pattern and isinstance(path, Path) else ()


def _is_written(declared_graph: DeclaredGraph, element: KnowledgeElement) -> bool:
    """Return whether an element has a writer, or exists from the start."""
    if element.section in ("context", "tasks") or declared_graph.writers(element):
        return True
    if element.section == "edges":
        return declared_graph.exists_initially(declared_graph.edges[element.name])
    nodes_of_type = [node for node in declared_graph.spec.nodes if node.type.name == element.name]
    if not element.attribute:
        return bool(nodes_of_type) or element.name not in declared_graph.types
    return any(value.name == element.attribute for node in nodes_of_type for value in node.values)


def foreign_writes(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """An agent owns the elements that its rules write.

    If a rule can write any one of several elements, the agent owns at least one of them.
    """
    if not is_knowledge_checkable(spec_index, faults):
        return
    for pattern in patterns(spec_index):
        if pattern.role is Role.AFTER:
            elements = _written_elements(spec_index.declared_graph, pattern)
            if elements and not any(
                spec_index.declared_graph.owns(pattern.agent.name, element) for element, _ in elements
            ):
                yield _foreign_write_finding(spec_index.declared_graph, pattern, *elements[0])
            yield from _foreign_state_write_findings(spec_index.declared_graph, pattern)


def _written_elements(declared_graph: DeclaredGraph, pattern: Pattern) -> list[tuple[KnowledgeElement, Place]]:
    """Return the elements that a rule can write to make a pattern under `after` true, each with its place.

    The rule writes at least one of these elements. If it cannot be decided which elements they are, the list is empty.
    """
    elements: list[tuple[KnowledgeElement, Place]] = []
    for step in steps(pattern):
        if declared_graph.task_of(step.origin, step.link.edge, step.target) is not None:
            return []
        edges = declared_graph.edges_between(step.origin, step.link.edge, step.target)
        elements += [(KnowledgeElement("edges", edge.name), pattern.condition.place_of(step.link)) for edge in edges]
    for name in names_in_pattern(pattern):
        element = declared_graph.element_read_by(name.name)
        if element is None or reads_of(name.name)[0]:
            return []
        elements.append((element, pattern.condition.place_of(name)))
    if isinstance(pattern.tree, Path) and pattern.tree.negated:
        kinds = [term.type for term in pattern.tree.terms if term.type]
        elements += [
            (KnowledgeElement("types", kind), pattern.condition.place) for kind in kinds if kind in declared_graph.types
        ]
    return elements


def _foreign_write_finding(
    declared_graph: DeclaredGraph, pattern: Pattern, element: KnowledgeElement, place: Place
) -> Diagnostic:
    owners = [writer.name for writer in declared_graph.writers(element)]
    writers_text = " and ".join(f"'{owner}'" for owner in owners)
    assert pattern.rule is not None
    verb = "own" if len(owners) > 1 else "owns"
    key = "by" if element.section == "tasks" else "source"
    ownership_help = f"write '{pattern.agent.name}' under '{key}' of {element}"
    help = (
        f"{ownership_help}, or leave this change to {writers_text}: a rule may write only what its agent owns"
        if writers_text
        else ownership_help
    )
    return finding(
        "foreign-write",
        f"rule '{pattern.rule.name}' of {pattern.user} writes {element}, which {writers_text or 'no agent'} {verb}",
        place,
        path=pattern.path,
        help=help,
        related=(Related("declared here", declared_graph.place_of(element)),),
    )


def _foreign_state_write_findings(declared_graph: DeclaredGraph, pattern: Pattern) -> Iterator[Diagnostic]:
    for step in steps(pattern):
        task = declared_graph.task_of(step.origin, step.link.edge, step.target)
        if task is None or pattern.agent.name in state_writers(task, step.link.edge):
            continue
        assert pattern.rule is not None
        writers_text = " and ".join(f"'{name}'" for name in state_writers(task, step.link.edge))
        yield finding(
            "foreign-write",
            f"rule '{pattern.rule.name}' of {pattern.user} writes '{step.link.edge}' of task '{task.name}', "
            f"which only {writers_text} may write",
            pattern.condition.place_of(step.link),
            path=pattern.path,
            help="requesters write 'wants' and 'aborted', the executor writes 'is' and 'finished'; "
            f"leave this change to {writers_text}",
            related=(Related("declared here", task.place),),
        )


def state_writers(task: Task, state: str) -> tuple[str, ...]:
    """Return the writers of a task state: requesters write `wants` and `aborted`, the executor `is` and `finished`."""
    if state in (TaskState.WANTS, TaskState.ABORTED):
        return tuple(requester.name for requester in task.requesters)
    return (task.by.name,)


def claimed_tasks(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No rule of an agent takes up a task that another agent executes, since a task has one executor."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    for agent in spec_index.spec.agents:
        for rule in agent.conduct.rules:
            wanted = {
                task.name
                for task, _ in _task_steps(spec_index.declared_graph, agent, rule.name, Role.BEFORE, TaskState.WANTS)
            }
            for task, step in _task_steps(spec_index.declared_graph, agent, rule.name, Role.DURING, TaskState.IS):
                if task.name in wanted and task.by.name != agent.name:
                    yield _claimed_task_finding(agent, rule.name, task, step)


def _task_steps(
    declared_graph: DeclaredGraph, agent: Agent, rule: str, role: Role, state: TaskState
) -> Iterator[tuple[Task, Step]]:
    """Yield each task that the patterns of a rule with this role mention in this state, with the step that does so."""
    for pattern in patterns_of(agent):
        if pattern.rule is None or pattern.rule.name != rule or pattern.role is not role:
            continue
        for step in steps(pattern):
            task = declared_graph.task_of(step.origin, step.link.edge, step.target)
            if task is not None and step.link.edge == state:
                yield task, step


def _claimed_task_finding(agent: Agent, rule: str, task: Task, step: Step) -> Diagnostic:
    return finding(
        "claimed-task",
        f"rule '{rule}' of agent '{agent.name}' takes up task '{task.name}', which agent '{task.by.name}' executes",
        step.pattern.condition.place_of(step.link),
        path=step.pattern.path,
        help=f"let one agent execute the task: change 'by' of the task, or leave the task to '{task.by.name}'",
        related=(Related("declared here", task.places.get("by", task.place)),),
    )


def unattended_tasks(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The executor of a task reacts to a request.

    The executor is always active, or the request wakes the executor. If the executor has rules, one of them begins with
    the request.
    """
    if not is_knowledge_checkable(spec_index, faults):
        return
    for task in spec_index.spec.tasks:
        agent = spec_index.declared_graph.agents.get(task.by.name)
        if agent is None:
            continue
        is_never_woken = agent.conduct.wakes and not _has_request_pattern(
            spec_index.declared_graph, agent, task, Role.WAKES
        )
        has_no_request_rule = agent.conduct.rules and not _has_request_pattern(
            spec_index.declared_graph, agent, task, Role.BEFORE
        )
        if is_never_woken or has_no_request_rule:
            request_text = f"{task.origin.name} -wants-> {task.name}"
            reason = "is not woken by a request" if is_never_woken else "has no rule for a request"
            help = (
                f"add '{request_text}' to 'wakes' of the agent"
                if is_never_woken
                else f"add a rule with 'before: [{request_text}]'"
            )
            yield finding(
                "unattended-task",
                f"no agent takes up task '{task.name}': agent '{agent.name}', which executes it, {reason}",
                task.places.get("by", task.place),
                path=f"knowledge.tasks.{task.name}.by",
                help=help,
                related=(Related("the agent", agent.place),),
            )


def _has_request_pattern(declared_graph: DeclaredGraph, agent: Agent, task: Task, role: Role) -> bool:
    """Return whether an agent has a pattern with this role that contains the request of a task.

    A condition under `wakes` may depend on the request. Therefore the result is also True for such a condition.
    """
    for pattern in patterns_of(agent):
        if pattern.role is not role or (isinstance(pattern.tree, Path) and pattern.tree.negated):
            continue
        if not isinstance(pattern.tree, Path):
            if role is Role.WAKES:
                return True
            continue
        for step in steps(pattern):
            other_task = declared_graph.task_of(step.origin, step.link.edge, step.target)
            is_any = not step.target.name and step.link.edge == TaskState.WANTS
            if is_any or (
                other_task is not None and other_task.name == task.name and step.link.edge == TaskState.WANTS
            ):
                return True
    return False


def writable_elements(declared_graph: DeclaredGraph, agent: str) -> tuple[KnowledgeElement, ...]:
    """Return the elements that an agent may write, in file order."""
    return declared_graph.elements_by_writer.get(agent, ())


def read_elements(declared_graph: DeclaredGraph, agent: Agent) -> tuple[KnowledgeElement, ...]:
    """Return the elements under `reads` of an agent, and the elements that its patterns read, without repetitions."""
    elements = dict.fromkeys(element for element, *_ in _element_mentions(declared_graph, agent))
    for pattern in patterns_of(agent):
        if pattern.role is Role.AFTER:
            continue
        for step in steps(pattern):
            task = declared_graph.task_of(step.origin, step.link.edge, step.target)
            if task is not None:
                elements[KnowledgeElement("tasks", task.name)] = None
            elements |= dict.fromkeys(
                KnowledgeElement("edges", edge.name)
                for edge in declared_graph.edges_between(step.origin, step.link.edge, step.target)
            )
    return tuple(elements)


OWNER_CHECKS = (two_owners, unwritten_knowledge, foreign_writes, claimed_tasks, unattended_tasks)
"""The checks of this module."""
