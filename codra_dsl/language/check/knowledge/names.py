"""Checks of names in knowledge (phase 1): every type, node, edge and attribute that something refers to is declared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from codra_dsl.language.check.index.fixes import renaming_fix
from codra_dsl.language.check.index.graph_schema import STATES
from codra_dsl.language.check.index.mentions import Mention, mention_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import KNOWLEDGE_SECTIONS, OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.index.words import declaration_help
from codra_dsl.language.check.knowledge.mentions import (
    edge_mentions,
    end_mentions,
    mention_in_pattern,
    names_in_pattern,
    node_mentions,
    node_mentions_in_paths,
    patterns,
    type_mentions,
)
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, is_slip, suggest
from codra_dsl.language.expression import Node, is_identifier, reads_of
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import RT, TASK_ATTRIBUTES, TASK_TYPE, Kind

_STATE_SYNONYMS: Mapping[str, str] = {
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


def unknown_types(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every type in a pattern is declared or has a node. The type of a node is not a misspelt declared type."""
    if not spec_index.spec.knows and not spec_index.spec.pose_conditions:
        return
    type_names = list(spec_index.declared_graph.types)  # without the type of tasks, which no node can have
    reported_names = set()
    for node in spec_index.spec.nodes:
        name = node.type.name
        nearest_name = (
            None
            if name in (*type_names, TASK_TYPE) or spec_index.declares("types", name)
            else suggest(name, type_names)
        )
        if (
            nearest_name is not None
            and is_slip(name, nearest_name)
            and spec_index.is_readable("nodes", node.name, "type")
        ):
            reported_names.add(name)
            mentions = (mention_of(node.type, "nodes", node.name, "type"),)
            yield _unknown_name_finding(
                spec_index, "unknown-node-type", "type", _UnknownName(mentions, nearest_name, type_names)
            )
    known_names = spec_index.declared_graph.type_names - reported_names
    undeclared_mentions = (
        mention for mention in type_mentions(spec_index) if not spec_index.declares("types", mention.name)
    )
    for name_mentions in _group_by_name(
        mention
        for mention in undeclared_mentions
        if mention.name not in known_names and mention.name not in reported_names
    ):
        nearest_name = spec_index.nearest_name(name_mentions[0].name, "types", known_names)
        help = (
            f"'{name_mentions[0].name}' is a node: remove 'some'"
            if name_mentions[0].name in spec_index.declared_graph.node_names
            else _variable_in_path_help(spec_index, name_mentions[0].name)
        )
        yield _unknown_name_finding(
            spec_index, "unknown-node-type", "type", _UnknownName(name_mentions, nearest_name, known_names), help=help
        )


def unknown_nodes(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every node that something refers to by name is declared. Patterns refer to other nodes by their type."""
    if not spec_index.spec.knows and not spec_index.spec.pose_conditions:
        return
    declared_graph, known_names = spec_index.declared_graph, spec_index.declared_graph.node_names
    undeclared_mentions = (
        mention
        for mention in node_mentions(spec_index)
        if mention.name not in known_names and not _may_be_unreadable(spec_index, mention.name)
    )
    mentions_in_paths = frozenset(node_mentions_in_paths(spec_index))
    for name_mentions in _group_by_name(undeclared_mentions):
        name = name_mentions[0].name
        help = ""
        if name in declared_graph.type_names:
            help = f"'{name}' is a type; write the name of a node that is declared under 'nodes'"
        if name_mentions[0] in mentions_in_paths:
            help = _type_in_path_help(spec_index, name) or _variable_in_path_help(spec_index, name)
        nearest_name = None if help else spec_index.nearest_name(name, "nodes", known_names)
        unknown_name = _UnknownName(name_mentions, nearest_name, known_names)
        yield _unknown_name_finding(spec_index, "unknown-node", "node", unknown_name, help=help)
    end_names = known_names | declared_graph.type_names
    undeclared_end_mentions = (
        mention
        for mention in end_mentions(spec_index)
        if mention.name not in end_names and not _may_be_unreadable(spec_index, mention.name)
    )
    for name_mentions in _group_by_name(undeclared_end_mentions):
        nearest_name = spec_index.nearest_name(name_mentions[0].name, "nodes and types", end_names)
        help = f"declare '{name_mentions[0].name}' under 'types' or 'nodes' of 'knowledge'"
        type_name = name_mentions[0].name.removeprefix("some ")
        help = f"write '{type_name}': it stands for every node of this type" if type_name in end_names else help
        yield _unknown_name_finding(
            spec_index, "unknown-node", "node or type", _UnknownName(name_mentions, nearest_name, end_names), help=help
        )


def unknown_edges(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every edge in a path is declared, or is the state of a task."""
    if not spec_index.spec.knows and not spec_index.spec.pose_conditions:
        return
    known_words = spec_index.declared_graph.edge_words
    is_damaged = spec_index.has_damage("edges", "label") or spec_index.has_damage("tasks")
    undeclared_mentions = (
        mention for mention in edge_mentions(spec_index) if mention.name not in known_words and not is_damaged
    )
    for name_mentions in _group_by_name(undeclared_mentions):
        name = name_mentions[0].name
        state = _STATE_SYNONYMS.get(name) if spec_index.spec.tasks else None
        nearest_name = state or spec_index.nearest_name(name, "edges", known_words - {RT})
        help = "declare the task under 'tasks' of 'knowledge'" if name in STATES else ""
        help = help or declaration_help(name, "'edges' of 'knowledge'", spec_index.names("edges"))
        yield _unknown_name_finding(
            spec_index, "unknown-edge", "edge", _UnknownName(name_mentions, nearest_name, known_words), help=help
        )


def unknown_attributes(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every attribute in a condition, and every attribute with an initial value, is an attribute of its node."""
    declared_graph = spec_index.declared_graph
    for pattern in patterns(spec_index):
        for name in names_in_pattern(pattern):
            function, node, attribute = reads_of(name.name)
            if (
                function
                or not node
                or node not in declared_graph.node_names
                or _may_have_unreadable_attributes(spec_index, node)
            ):
                continue
            attributes = declared_graph.attributes_of(node)
            if attribute not in attributes:
                start = name.start + len(node) + 1
                part = Node(start=start, end=start + len(attribute))
                yield _unknown_attribute_finding(
                    spec_index, mention_in_pattern(pattern, attribute, part), node, attributes
                )
    for element in spec_index.spec.nodes:
        for value in element.values:
            attributes = declared_graph.attributes_of(element.name)
            if value.name not in attributes and not _may_have_unreadable_attributes(spec_index, element.name):
                path = f"knowledge.nodes.{element.name}.with.{value.name}"
                yield _unknown_attribute_finding(
                    spec_index, Mention(value.name, value.key, "", path), element.name, attributes
                )


def unknown_elements(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every name under `owns` and `reads` of an agent is the name of an element that can have writers."""
    declared_graph = spec_index.declared_graph
    is_damaged = any(spec_index.has_damage(section) for section in ("context", "types", "edges", "tasks"))
    for agent in () if is_damaged else spec_index.spec.agents:
        for key, references in (("owns", agent.conduct.owns), ("reads", agent.conduct.reads)):
            for reference in references:
                element = declared_graph.element_named(reference.name)
                if element is not None and not (key == "owns" and element.section == "tasks"):
                    continue
                known_names = [str(other.name) for other in declared_graph.elements()]
                known_names += [
                    f"{other.name}.{other.attribute}" for other in declared_graph.elements() if other.attribute
                ]
                nearest_name = None if element else spec_index.nearest_name(reference.name, "things", known_names)
                help = "write the name of a variable, a type or an edge, or TYPE.ATTRIBUTE"
                help = "write the agent's name under 'by' of the task" if element else help
                mentions = (mention_of(reference, "agents", agent.name, key),)
                subject = f"task '{reference.name}' under 'owns'" if element else ""
                unknown_name = _UnknownName(mentions, nearest_name, known_names)
                yield _unknown_name_finding(
                    spec_index, "unknown-knowledge", "name", unknown_name, help=help, subject=subject
                )


def reserved_names(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No edge has the name of a task state, no type has the name `task`, and no task has the name of a node.

    Observers are sources of nothing but context-variables. The label of an edge is an identifier. A context-variable
    does not have the name of another attribute of its node.
    """
    for edge in spec_index.spec.edges:
        taken_name = edge.label if edge.label in STATES else edge.name if edge.name in STATES | {RT} else ""
        if taken_name:
            message = f"edge '{edge.name}' has the name '{taken_name}', which is the state of a task"
            if taken_name == RT:
                message = f"edge '{edge.name}' has a reserved name: it is the label of rigid motions"
            place = edge.places.get("label", edge.place) if edge.label == taken_name else edge.place
            yield _reserved_name_finding(f"edges.{edge.name}", message, place, "choose another name")
        elif not is_identifier(edge.label):
            message = f"the label '{edge.label}' of edge '{edge.name}' is not a name"
            help = "use only letters A to Z, digits and '_', and begin with a letter"
            yield _reserved_name_finding(
                f"edges.{edge.name}.label", message, edge.places.get("label", edge.place), help
            )
    for node_type in spec_index.spec.types:
        if node_type.name == TASK_TYPE:
            message = f"type '{TASK_TYPE}' is reserved for the nodes of tasks"
            yield _reserved_name_finding(f"types.{node_type.name}", message, node_type.place, "choose another name")
    for node_element in spec_index.spec.nodes:
        if node_element.type.name == TASK_TYPE:
            message = f"node '{node_element.name}' is of type '{TASK_TYPE}', which is reserved for the nodes of tasks"
            yield _reserved_name_finding(
                f"nodes.{node_element.name}.type", message, node_element.type.place, "choose another type"
            )
    nodes_by_name = {name.casefold(): node for name, node in spec_index.declared_graph.nodes.items()}
    for task in spec_index.spec.tasks:
        node = nodes_by_name.get(task.name.casefold())
        if node is not None:
            message = f"task '{task.name}' is itself a node, but another node '{node.name}' is declared already"
            related = (Related("the node", node.place),)
            yield _reserved_name_finding(f"tasks.{task.name}", message, task.place, "rename one of them", related)
    yield from _observer_writer_findings(spec_index)
    yield from _taken_attribute_findings(spec_index)


def _taken_attribute_findings(spec_index: SpecIndex) -> Iterator[Diagnostic]:
    """Yield findings about context-variables with the name of another attribute of their node."""
    declared_graph = spec_index.declared_graph
    for variable in spec_index.spec.context if spec_index.spec.knows else ():
        node_type = declared_graph.types.get(declared_graph.type_of(variable.node))
        type_attributes = (
            {attribute.name: attribute for attribute in node_type.attributes} if node_type is not None else {}
        )
        path, place = f"context.{variable.name}.of", variable.places.get("of", variable.place)
        if variable.node in declared_graph.tasks and variable.name in TASK_ATTRIBUTES:
            message = (
                f"context-variable '{variable.name}' of task '{variable.node}' is named like an attribute of tasks"
            )
            yield _taken_attribute_finding(path, message, place, "rename it")
        elif variable.name in type_attributes:
            message = f"the type of node '{variable.node}' already has an attribute '{variable.name}'"
            related = (Related("declared here", type_attributes[variable.name].place),)
            yield _taken_attribute_finding(path, message, place, "rename or remove one of the two attributes", related)


def _observer_writer_findings(spec_index: SpecIndex) -> Iterator[Diagnostic]:
    sections = (("types", spec_index.spec.types), ("edges", spec_index.spec.edges))
    for section, element in ((section, element) for section, elements in sections for element in elements):
        writers = (*element.sources, *(writer for attribute in element.attributes for writer in attribute.sources))
        for writer in writers:
            if writer.name == OBSERVER:
                message = f"observers write only context-variables, not '{element.name}'"
                help = "write the name of an agent; for observers, declare a context-variable with 'of'"
                yield _reserved_name_finding(f"{section}.{element.name}.source", message, writer.place, help)


KNOWLEDGE_NAME_CHECKS = (
    unknown_types,
    unknown_nodes,
    unknown_edges,
    unknown_attributes,
    unknown_elements,
    reserved_names,
)
"""The checks of this module."""


def _taken_attribute_finding(
    path: str, message: str, place: Place, help: str, related: tuple[Related, ...] = ()
) -> Diagnostic:
    return finding("reserved-in-knowledge", message, place, path=path, help=help, related=related)


def _reserved_name_finding(
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


def _group_by_name(mentions: Iterable[Mention]) -> list[tuple[Mention, ...]]:
    """Return one tuple for each name, with the mentions of the name in the order of their places."""
    mentions_by_name: dict[str, list[Mention]] = {}
    for mention in mentions:
        mentions_by_name.setdefault(mention.name, []).append(mention)
    return [
        tuple(sorted(mentions_of_name, key=lambda mention: mention.place.span))
        for mentions_of_name in mentions_by_name.values()
    ]


def _may_be_unreadable(spec_index: SpecIndex, name: str) -> bool:
    """Return whether a name may belong to a node, a task or a type that could not be read."""
    return any(name in spec_index.spec.damaged.get(section, ()) for section in ("types", "nodes", "tasks"))


def _may_have_unreadable_attributes(spec_index: SpecIndex, node: str) -> bool:
    """Return whether a node may have attributes that could not be read."""
    type_name = spec_index.declared_graph.type_of(node)
    damaged_names = spec_index.spec.damaged.get("types", frozenset())
    return (
        type_name in damaged_names
        or bool(spec_index.spec.damaged.get("context"))
        or node in spec_index.spec.damaged.get("nodes", ())
    )


def _type_in_path_help(spec_index: SpecIndex, name: str) -> str:
    """Return the help for the name of a type, or for a similar name, at the place of a node in a path."""
    type_names = spec_index.declared_graph.type_names
    if name in type_names:
        return f"'{name}' is a type: write 'some {name}'"
    is_like_node = suggest(name, spec_index.declared_graph.node_names) is not None
    nearest_type = None if is_like_node or name in spec_index.variables else suggest(name, sorted(type_names))
    return f"did you mean 'some {nearest_type}'?" if nearest_type is not None else ""


def _variable_in_path_help(spec_index: SpecIndex, name: str) -> str:
    """Return the help for the name of a context-variable in a path; empty if no variable has this name."""
    variable = spec_index.variables.get(name)
    if variable is None:
        return ""
    share_text = f", or the share of time at which it is true with 'share_of: {name}'"
    return (
        f"'{name}' is a context-variable: read it as '{name}' or 'known({name})'"
        f"{share_text if variable.type.kind is Kind.BOOL else ''}; "
        f"a path is for example 'some {next(iter(spec_index.declared_graph.types), 'TYPE')}'"
    )


@dataclass(frozen=True, slots=True)
class _UnknownName:
    """An undeclared name: its mentions, and its candidates.

    Attributes:
        nearest_name: the most likely candidate; None if no candidate is likely.
    """

    mentions: tuple[Mention, ...]
    nearest_name: str | None
    candidates: Iterable[str]

    @property
    def name(self) -> str:
        return self.mentions[0].name


def _unknown_name_finding(
    spec_index: SpecIndex, rule: str, noun: str, unknown_name: _UnknownName, *, help: str = "", subject: str = ""
) -> Diagnostic:
    """Return the finding about an undeclared name, with all its mentions."""
    first, *others = unknown_name.mentions
    nearest_name = unknown_name.nearest_name
    subject = subject or f"unknown {noun} '{first.name}'"
    message = f"{subject} in {first.user}"
    fix = None
    if nearest_name is not None:
        places = [mention.place for mention in unknown_name.mentions]
        fix = renaming_fix(first.name, nearest_name, unknown_name.candidates, places, spec_index.mentioned_words)
    section = {"type": "types", "node": "nodes"}.get(noun, "")
    if not help and section in KNOWLEDGE_SECTIONS:
        help = declaration_help(first.name, f"'{section}' of 'knowledge'", spec_index.names(section))
    return finding(
        rule,
        message,
        first.place,
        path=first.path,
        help=f"did you mean '{nearest_name}'?" if nearest_name is not None else help,
        related=tuple(Related(f"also in {mention.user}", mention.place) for mention in others),
        fix=fix,
    )


def _unknown_attribute_finding(
    spec_index: SpecIndex, mention: Mention, node: str, attributes: Mapping[str, object]
) -> Diagnostic:
    nearest_name = spec_index.nearest_name(mention.name, f"attributes of {node}", attributes)
    attributes_text = f"the node has {', '.join(list(attributes)[:10])}" if attributes else "the node has no attributes"
    help = (
        f"did you mean '{nearest_name}'?"
        if nearest_name is not None
        else f"{attributes_text}; declare the attribute in the type of the node"
    )
    type_name = spec_index.declared_graph.type_of(node)
    user_text = f" in {mention.user}" if mention.user else ""
    message = f"node '{node}', of type '{type_name}', has no attribute '{mention.name}'{user_text}"
    fix = None
    if nearest_name is not None:
        fix = renaming_fix(mention.name, nearest_name, attributes, [mention.place], spec_index.mentioned_words)
    return finding("unknown-attribute", message, mention.place, path=mention.path, help=help, fix=fix)
