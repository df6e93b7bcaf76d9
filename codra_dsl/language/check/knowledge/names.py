"""Checks of names in knowledge (phase 1): every type, node, edge and attribute that something refers to is declared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from codra_dsl.language.check.index.fixes import renaming
from codra_dsl.language.check.index.graph_schema import STATES
from codra_dsl.language.check.index.mentions import Mention, mention_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import OBSERVER, UNDER_KNOWLEDGE, Silenced, SpecIndex
from codra_dsl.language.check.knowledge.mentions import (
    edge_mentions,
    end_mentions,
    mention_in,
    names_read,
    node_mentions,
    patterns,
    type_mentions,
)
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, is_slip, suggest
from codra_dsl.language.expression import Node, reads_of
from codra_dsl.language.load.yaml.names import is_identifier
from codra_dsl.language.model import RT, TASK_ATTRIBUTES, TASK_TYPE

_OTHER_STATES: Mapping[str, str] = {
    "want": "wants",
    "wants_to": "wants",
    "starts": "wants",
    "start": "wants",
    "requests": "wants",
    "running": "is",
    "executes": "is",
    "finishes": "finished",
    "finish": "finished",
    "done": "finished",
    "abort": "aborted",
    "aborts": "aborted",
    "cancel": "aborted",
    "cancelled": "aborted",
}
"""Other names for the states of a task, including those in P2."""


def unknown_types(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every type in a pattern is declared or has a node. The type of a node is not a misspelt declared type."""
    if not scope.spec.knows:
        return
    type_names = list(scope.world.types)  # without the type of tasks, which no node can have
    reported_names = set()
    for node in scope.spec.nodes:
        name = node.type.name
        near = None if name in (*type_names, TASK_TYPE) or scope.declares("types", name) else suggest(name, type_names)
        if near is not None and is_slip(name, near) and scope.readable("nodes", node.name, "type"):
            reported_names.add(name)
            mentions = (mention_of(node.type, "nodes", node.name, "type"),)
            yield _unknown_finding(scope, "unknown-node-type", "type", _UnknownName(mentions, near, type_names))
    known_names = scope.world.type_names - reported_names
    undeclared_mentions = (mention for mention in type_mentions(scope) if not scope.declares("types", mention.name))
    for group in _groups(
        mention
        for mention in undeclared_mentions
        if mention.name not in known_names and mention.name not in reported_names
    ):
        near = scope.nearest(group[0].name, "types", known_names)
        help = f"'{group[0].name}' is a node: remove 'some'" if group[0].name in scope.world.node_names else ""
        yield _unknown_finding(scope, "unknown-node-type", "type", _UnknownName(group, near, known_names), help=help)


def unknown_nodes(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every node that something refers to by name is declared. Patterns refer to other nodes by their type."""
    if not scope.spec.knows and not scope.spec.pose_conditions:
        return
    world, known_names = scope.world, scope.world.node_names
    undeclared_mentions = (
        mention
        for mention in node_mentions(scope)
        if mention.name not in known_names and not _may_be_lost(scope, mention.name)
    )
    for group in _groups(undeclared_mentions):
        name = group[0].name
        near = scope.nearest(name, "nodes", known_names)
        is_type = name in world.type_names
        help = _type_name_help(group[0], name) if is_type else ""
        yield _unknown_finding(
            scope, "unknown-node", "node", _UnknownName(group, None if is_type else near, known_names), help=help
        )
    end_names = known_names | world.type_names
    undeclared_ends = (
        mention
        for mention in end_mentions(scope)
        if mention.name not in end_names and not _may_be_lost(scope, mention.name)
    )
    for group in _groups(undeclared_ends):
        near = scope.nearest(group[0].name, "nodes and types", end_names)
        help = f"declare '{group[0].name}' under 'types' or 'nodes' of 'knowledge'"
        yield _unknown_finding(scope, "unknown-node", "node or type", _UnknownName(group, near, end_names), help=help)


def unknown_edges(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every edge in a pattern is declared, or is the state of a task."""
    if not scope.spec.knows:
        return
    known_words = scope.world.edge_words
    is_lost = scope.lost("edges", "label") or scope.lost("tasks")
    undeclared_mentions = (
        mention for mention in edge_mentions(scope) if mention.name not in known_words and not is_lost
    )
    for group in _groups(undeclared_mentions):
        name = group[0].name
        state = _OTHER_STATES.get(name) if scope.spec.tasks else None
        near = state or scope.nearest(name, "edges", known_words - {RT})
        help = "declare the task under 'tasks' of 'knowledge'" if name in STATES else ""
        help = help or f"declare '{name}' under 'edges' of 'knowledge'"
        yield _unknown_finding(scope, "unknown-edge", "edge", _UnknownName(group, near, known_words), help=help)


def unknown_attributes(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every attribute in a condition, and every attribute with an initial value, belongs to its node."""
    world = scope.world
    for pattern in patterns(scope):
        for name in names_read(pattern):
            function, node, attribute = reads_of(name.name)
            if function or not node or node not in world.node_names or _is_open(scope, node):
                continue
            attributes = world.attributes_of(node)
            if attribute not in attributes:
                start = name.start + len(node) + 1
                part = Node(start=start, end=start + len(attribute))
                yield _attribute_finding(scope, mention_in(pattern, attribute, part), node, attributes)
    for element in scope.spec.nodes:
        for value in element.values:
            attributes = world.attributes_of(element.name)
            if value.name not in attributes and not _is_open(scope, element.name):
                path = f"knowledge.nodes.{element.name}.with.{value.name}"
                yield _attribute_finding(scope, Mention(value.name, value.key, "", path), element.name, attributes)


def unknown_elements(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every name under `owns` and `reads` of an agent is the name of an element that can have writers."""
    world = scope.world
    is_lost = any(scope.lost(section) for section in ("context", "types", "edges", "tasks"))
    for agent in () if is_lost else scope.spec.agents:
        for key, references in (("owns", agent.conduct.owns), ("reads", agent.conduct.reads)):
            for reference in references:
                element = world.named(reference.name)
                if element is not None and not (key == "owns" and element.section == "tasks"):
                    continue
                known_names = [str(other.name) for other in world.elements()]
                known_names += [f"{other.name}.{other.attribute}" for other in world.elements() if other.attribute]
                near = None if element else scope.nearest(reference.name, "things", known_names)
                help = "write the name of a variable, a type or an edge, or TYPE.ATTRIBUTE"
                help = "write the agent's name under 'by' of the task" if element else help
                mentions = (mention_of(reference, "agents", agent.name, key),)
                subject = f"task '{reference.name}' under 'owns'" if element else ""
                unknown = _UnknownName(mentions, near, known_names)
                yield _unknown_finding(scope, "unknown-knowledge", "name", unknown, help=help, subject=subject)


def reserved_names(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """No edge has the name of a task state, no type has the name `task`, and no task has the name of a node.

    Observers are the source only of context-variables. The label of an edge is an identifier. A context-variable does
    not have the name of another attribute of its node.
    """
    for edge in scope.spec.edges:
        taken_name = edge.label if edge.label in STATES else edge.name if edge.name in STATES | {RT} else ""
        if taken_name:
            message = f"edge '{edge.name}' has the name '{taken_name}', which is the state of a task"
            if taken_name == RT:
                message = f"edge '{edge.name}' has a reserved name: it is the label of rigid motions"
            place = edge.places.get("label", edge.place) if edge.label == taken_name else edge.place
            yield _reserved_finding(f"edges.{edge.name}", message, place, "choose another name")
        elif not is_identifier(edge.label):
            message = f"the label '{edge.label}' of edge '{edge.name}' is not a name"
            help = "use only letters A to Z, digits and '_', and begin with a letter"
            yield _reserved_finding(f"edges.{edge.name}.label", message, edge.places.get("label", edge.place), help)
    for kind in scope.spec.types:
        if kind.name == TASK_TYPE:
            message = f"type '{TASK_TYPE}' is reserved for the nodes of tasks"
            yield _reserved_finding(f"types.{kind.name}", message, kind.place, "choose another name")
    for node_element in scope.spec.nodes:
        if node_element.type.name == TASK_TYPE:
            message = f"node '{node_element.name}' is of type '{TASK_TYPE}', which is reserved for the nodes of tasks"
            yield _reserved_finding(
                f"nodes.{node_element.name}.type", message, node_element.type.place, "choose another type"
            )
    nodes = {name.casefold(): node for name, node in scope.world.nodes.items()}
    for task in scope.spec.tasks:
        node = nodes.get(task.name.casefold())
        if node is not None:
            message = f"task '{task.name}' is itself a node, but another node '{node.name}' is declared already"
            related = (Related("the node", node.place),)
            yield _reserved_finding(f"tasks.{task.name}", message, task.place, "rename one of them", related)
    yield from _observers_as_writers(scope)
    yield from _taken_attributes(scope)


def _taken_attributes(scope: SpecIndex) -> Iterator[Diagnostic]:
    """Yield findings about context-variables with the name of another attribute of their node."""
    world = scope.world
    for variable in scope.spec.context if scope.spec.knows else ():
        kind = world.types.get(world.type_of(variable.node))
        own_attributes = {attribute.name: attribute for attribute in kind.attributes} if kind is not None else {}
        path, place = f"context.{variable.name}.of", variable.places.get("of", variable.place)
        if variable.node in world.tasks and variable.name in TASK_ATTRIBUTES:
            message = (
                f"context-variable '{variable.name}' of task '{variable.node}' is named like an attribute of tasks"
            )
            yield _taken_finding(path, message, place, "rename it")
        elif variable.name in own_attributes:
            message = f"the type of node '{variable.node}' already has an attribute '{variable.name}'"
            related = (Related("declared here", own_attributes[variable.name].place),)
            yield _taken_finding(path, message, place, "rename one of them, or remove one", related)


def _observers_as_writers(scope: SpecIndex) -> Iterator[Diagnostic]:
    sections = (("types", scope.spec.types), ("edges", scope.spec.edges))
    for section, element in ((section, element) for section, elements in sections for element in elements):
        writers = (*element.sources, *(writer for attribute in element.attributes for writer in attribute.sources))
        for writer in writers:
            if writer.name == OBSERVER:
                message = f"observers write only context-variables, not '{element.name}'"
                help = "write the name of an agent; for observers, declare a context-variable with 'of'"
                yield _reserved_finding(f"{section}.{element.name}.source", message, writer.place, help)


KNOWLEDGE_NAMES = (
    unknown_types,
    unknown_nodes,
    unknown_edges,
    unknown_attributes,
    unknown_elements,
    reserved_names,
)
"""The checks of this module."""


def _taken_finding(path: str, message: str, place: Place, help: str, related: tuple[Related, ...] = ()) -> Diagnostic:
    return finding("reserved-in-knowledge", message, place, path=path, help=help, related=related)


def _reserved_finding(
    path: str, message: str, place: Place, help: str, related: tuple[Related, ...] = ()
) -> Diagnostic:
    return finding(
        "reserved-in-knowledge",
        message,
        place,
        path=f"knowledge.{path}",
        help=help,
        related=related,
    )


def _groups(mentions: Iterable[Mention]) -> list[tuple[Mention, ...]]:
    """Return, for each name, its mentions in the order of their places."""
    groups: dict[str, list[Mention]] = {}
    for mention in mentions:
        groups.setdefault(mention.name, []).append(mention)
    return [
        tuple(sorted(mentions_of_name, key=lambda mention: mention.place.span)) for mentions_of_name in groups.values()
    ]


def _may_be_lost(scope: SpecIndex, name: str) -> bool:
    """Return whether a name may belong to a node, a task or a type that could not be read."""
    return any(name in scope.spec.damaged.get(section, ()) for section in ("types", "nodes", "tasks"))


def _is_open(scope: SpecIndex, node: str) -> bool:
    """Return whether a node may have attributes that could not be read."""
    kind = scope.world.type_of(node)
    lost = scope.spec.damaged.get("types", frozenset())
    return kind in lost or bool(scope.spec.damaged.get("context")) or node in scope.spec.damaged.get("nodes", ())


def _type_name_help(mention: Mention, name: str) -> str:
    if ".rules." in mention.path or mention.path.endswith("wakes"):
        return f"'{name}' is a type: write 'some {name}'"
    return f"'{name}' is a type; write the name of a node that is declared under 'nodes'"


@dataclass(frozen=True, slots=True)
class _UnknownName:
    """An undeclared name: its mentions, and its candidates.

    Attributes:
        near: the most likely candidate; None if there is none.
    """

    mentions: tuple[Mention, ...]
    near: str | None
    candidates: Iterable[str]

    @property
    def name(self) -> str:
        return self.mentions[0].name


def _unknown_finding(
    scope: SpecIndex, rule: str, noun: str, unknown: _UnknownName, *, help: str = "", subject: str = ""
) -> Diagnostic:
    """Return the finding about an undeclared name, with all its mentions."""
    first, *others = unknown.mentions
    near = unknown.near
    subject = subject or f"unknown {noun} '{first.name}'"
    message = f"{subject} in {first.user}"
    fix = None
    if near is not None:
        places = [mention.place for mention in unknown.mentions]
        fix = renaming(first.name, near, unknown.candidates, places, scope.mentioned)
    section = {"type": "types", "node": "nodes"}.get(noun, "")
    declare_help = f"declare '{first.name}' under '{section}' of 'knowledge'" if section in UNDER_KNOWLEDGE else help
    return finding(
        rule,
        message,
        first.place,
        path=first.path,
        help=f"did you mean '{near}'?" if near is not None else help or declare_help,
        related=tuple(Related(f"also in {mention.user}", mention.place) for mention in others),
        fix=fix,
    )


def _attribute_finding(scope: SpecIndex, mention: Mention, node: str, attributes: Mapping[str, object]) -> Diagnostic:
    near = scope.nearest(mention.name, f"attributes of {node}", attributes)
    attributes_text = f"the node has {', '.join(list(attributes)[:10])}" if attributes else "the node has none"
    help = f"did you mean '{near}'?" if near is not None else f"{attributes_text}; declare it in the type of the node"
    kind = scope.world.type_of(node)
    user = f" in {mention.user}" if mention.user else ""
    message = f"node '{node}', of type '{kind}', has no attribute '{mention.name}'{user}"
    fix = None
    if near is not None:
        fix = renaming(mention.name, near, attributes, [mention.place], scope.mentioned)
    return finding("unknown-attribute", message, mention.place, path=mention.path, help=help, fix=fix)
