"""Phase 1 for knowledge: every type, node, edge and attribute that something refers to is declared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from codra_dsl.check.fixes import renaming
from codra_dsl.check.knowledge.mentions import (
    edge_mentions,
    end_mentions,
    mention,
    names_read,
    node_mentions,
    patterns,
    type_mentions,
)
from codra_dsl.check.knowledge.world import STATES
from codra_dsl.check.mentions import Mention, mention_of
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import OBSERVER, UNDER_KNOWLEDGE, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related, is_slip, suggest
from codra_dsl.expression import Node, reads_of
from codra_dsl.load.names import is_identifier
from codra_dsl.model import RT, TASK_TYPE, TOLD_BY_TASKS

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
"""What others call the states of a task, P2 among them."""


def unknown_types(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every type that a pattern names is declared or has a node; what nodes name is a type, if it is no slip."""
    if not scope.spec.knows:
        return
    declared = list(scope.world.types)  # that of tasks is none that a node could have been meant to be of
    told = set()
    for node in scope.spec.nodes:
        name = node.type.name
        near = None if name in (*declared, TASK_TYPE) or scope.declares("types", name) else suggest(name, declared)
        if near is not None and is_slip(name, near) and scope.readable("nodes", node.name, "type"):
            told.add(name)
            mentioned = (mention_of(node.type, "nodes", node.name, "type"),)
            yield _unknown(scope, "unknown-node-type", "type", _Unknown(mentioned, near, declared))
    known = scope.world.type_names - told
    found = (each for each in type_mentions(scope) if not scope.declares("types", each.name))
    for group in _groups(each for each in found if each.name not in known and each.name not in told):
        near = scope.nearest(group[0].name, "types", known)
        help_ = f"'{group[0].name}' is a node: leave 'some' away" if group[0].name in scope.world.node_names else ""
        yield _unknown(scope, "unknown-node-type", "type", _Unknown(group, near, known), way_out=help_)


def unknown_nodes(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every node that something names is there from the start; what comes and goes is named by its type."""
    if not scope.spec.knows and all(each.posed is None for each in scope.spec.context):
        return
    world, known = scope.world, scope.world.node_names
    found = (each for each in node_mentions(scope) if each.name not in known and not _may_be_lost(scope, each.name))
    for group in _groups(found):
        name = group[0].name
        near = scope.nearest(name, "nodes", known)
        is_type = name in world.type_names
        way_out = _named_by_type(group[0], name) if is_type else ""
        yield _unknown(
            scope, "unknown-node", "node", _Unknown(group, None if is_type else near, known), way_out=way_out
        )
    both = known | world.type_names
    ends = (each for each in end_mentions(scope) if each.name not in both and not _may_be_lost(scope, each.name))
    for group in _groups(ends):
        near = scope.nearest(group[0].name, "nodes and types", both)
        way_out = f"declare '{group[0].name}' under 'types' or 'nodes' of 'knowledge'"
        yield _unknown(scope, "unknown-node", "node or type", _Unknown(group, near, both), way_out=way_out)


def unknown_edges(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every edge in a pattern is declared, or is what the edge of a task says."""
    if not scope.spec.knows:
        return
    known = scope.world.edge_words
    lost = scope.lost("edges", "label") or scope.lost("tasks")
    found = (each for each in edge_mentions(scope) if each.name not in known and not lost)
    for group in _groups(found):
        name = group[0].name
        meant = _OTHER_STATES.get(name) if scope.spec.tasks else None
        near = meant or scope.nearest(name, "edges", known - {RT})
        way_out = "declare the task under 'tasks' of 'knowledge'" if name in STATES else ""
        way_out = way_out or f"declare '{name}' under 'edges' of 'knowledge'"
        yield _unknown(scope, "unknown-edge", "edge", _Unknown(group, near, known), way_out=way_out)


def unknown_attributes(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every attribute in a condition, and every one with a value from the start, is one of its node."""
    world = scope.world
    for pattern in patterns(scope):
        for name in names_read(pattern):
            function, node, attribute = reads_of(name.name)
            if function or not node or node not in world.node_names or _is_open(scope, node):
                continue
            known = world.attributes_of(node)
            if attribute not in known:
                start = name.start + len(node) + 1
                part = Node(start=start, end=start + len(attribute))
                yield _unknown_attribute(scope, mention(pattern, attribute, part), node, known)
    for element in scope.spec.nodes:
        for value in element.values:
            known = world.attributes_of(element.name)
            if value.name not in known and not _is_open(scope, element.name):
                path = f"knowledge.nodes.{element.name}.with.{value.name}"
                yield _unknown_attribute(scope, Mention(value.name, value.key, "", path), element.name, known)


def unknown_things(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """What an agent says that it owns or reads is something that has writers."""
    world = scope.world
    lost = any(scope.lost(section) for section in ("context", "types", "edges", "tasks"))
    for agent in () if lost else scope.spec.agents:
        for key, named in (("owns", agent.conduct.owns), ("reads", agent.conduct.reads)):
            for each in named:
                thing = world.named(each.name)
                if thing is not None and not (key == "owns" and thing.section == "tasks"):
                    continue
                known = [str(other.name) for other in world.things()]
                known += [f"{other.name}.{other.attribute}" for other in world.things() if other.attribute]
                near = None if thing else scope.nearest(each.name, "things", known)
                way_out = "name a variable, a type, an edge or type.attribute"
                way_out = "name the agent as 'by' of the task" if thing else way_out
                mentioned = (mention_of(each, "agents", agent.name, key),)
                message = f"task '{each.name}' under 'owns'" if thing else ""
                unknown = _Unknown(mentioned, near, known)
                yield _unknown(scope, "unknown-knowledge", "name", unknown, way_out=way_out, what=message)


def reserved_names(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """No edge is called like the state of a task, no type `task`, no task like a node; observers write context only."""
    for edge in scope.spec.edges:
        taken = edge.label if edge.label in STATES else edge.name if edge.name in STATES | {RT} else ""
        if taken:
            message = f"edge '{edge.name}' is called '{taken}', as is what the edge of a task says"
            if taken == RT:
                message = f"edge '{edge.name}' is called like the label of rigid motions"
            place = edge.places.get("label", edge.place) if edge.label == taken else edge.place
            yield _reserved(f"edges.{edge.name}", message, place, "choose another name")
        elif not is_identifier(edge.label):
            message = f"the label '{edge.label}' of edge '{edge.name}' is no name"
            way_out = "names hold only letters A to Z, digits and '_', and begin with a letter"
            yield _reserved(f"edges.{edge.name}.label", message, edge.places.get("label", edge.place), way_out)
    for kind in scope.spec.types:
        if kind.name == TASK_TYPE:
            message = f"type '{TASK_TYPE}' is that of the nodes which tasks bring along"
            yield _reserved(f"types.{kind.name}", message, kind.place, "choose another name")
    for each in scope.spec.nodes:
        if each.type.name == TASK_TYPE:
            message = f"node '{each.name}' is of type '{TASK_TYPE}', which only the nodes are that tasks bring along"
            yield _reserved(f"nodes.{each.name}.type", message, each.type.place, "choose another type")
    nodes = {name.casefold(): node for name, node in scope.world.nodes.items()}
    for task in scope.spec.tasks:
        node = nodes.get(task.name.casefold())
        if node is not None:
            message = f"task '{task.name}' brings along a node of its name, and node '{node.name}' is there already"
            related = (Related("the node", node.place),)
            yield _reserved(f"tasks.{task.name}", message, task.place, "rename one of them", related)
    yield from _observers_as_writers(scope)
    yield from _taken_attributes(scope)


def _taken_attributes(scope: Scope) -> Iterator[Diagnostic]:
    """Yield the context-variables that are called like another attribute of their node."""
    world = scope.world
    for variable in scope.spec.context if scope.spec.knows else ():
        kind = world.types.get(world.type_of(variable.node))
        own = {each.name: each for each in kind.attributes} if kind is not None else {}
        path, place = f"context.{variable.name}.of", variable.places.get("of", variable.place)
        if variable.node in world.tasks and variable.name in TOLD_BY_TASKS:
            message = f"context-variable '{variable.name}' is called like what every task tells, '{variable.node}' too"
            yield _taken(path, message, place, "rename it")
        elif variable.name in own:
            message = f"node '{variable.node}' has an attribute '{variable.name}' by its type already"
            related = (Related("declared here", own[variable.name].place),)
            yield _taken(path, message, place, "rename one of them, or remove one", related)


def _observers_as_writers(scope: Scope) -> Iterator[Diagnostic]:
    elements = (("types", scope.spec.types), ("edges", scope.spec.edges))
    for section, each in ((section, each) for section, several in elements for each in several):
        writers = (*each.sources, *(writer for attribute in each.attributes for writer in attribute.sources))
        for writer in writers:
            if writer.name == OBSERVER:
                message = f"observers write context-variables, and nothing of '{each.name}'"
                way_out = "name an agent; what observers identify is a variable with 'of'"
                yield _reserved(f"{section}.{each.name}.source", message, writer.place, way_out)


KNOWLEDGE_NAMES = (
    unknown_types,
    unknown_nodes,
    unknown_edges,
    unknown_attributes,
    unknown_things,
    reserved_names,
)
"""The rules of this subject."""


def _taken(path: str, message: str, place: Place, way_out: str, related: tuple[Related, ...] = ()) -> Diagnostic:
    return finding("reserved-in-knowledge", message, place, path=path, way_out=way_out, related=related)


def _reserved(path: str, message: str, place: Place, way_out: str, related: tuple[Related, ...] = ()) -> Diagnostic:
    return finding(
        "reserved-in-knowledge",
        message,
        place,
        path=f"knowledge.{path}",
        way_out=way_out,
        related=related,
    )


def _groups(mentions: Iterable[Mention]) -> list[tuple[Mention, ...]]:
    """Return the mentions of each name, in the order of their places."""
    groups: dict[str, list[Mention]] = {}
    for each in mentions:
        groups.setdefault(each.name, []).append(each)
    return [tuple(sorted(found, key=lambda each: each.place.span)) for found in groups.values()]


def _may_be_lost(scope: Scope, name: str) -> bool:
    """Return whether a name may be that of a node, a task or a type that could not be read."""
    return any(name in scope.spec.damaged.get(section, ()) for section in ("types", "nodes", "tasks"))


def _is_open(scope: Scope, node: str) -> bool:
    """Return whether a node may have attributes that nobody could read."""
    kind = scope.world.type_of(node)
    lost = scope.spec.damaged.get("types", frozenset())
    return kind in lost or bool(scope.spec.damaged.get("context")) or node in scope.spec.damaged.get("nodes", ())


def _named_by_type(mentioned: Mention, name: str) -> str:
    if ".rules." in mentioned.path or mentioned.path.endswith("wakes"):
        return f"'{name}' is a type: write some {name}"
    return f"'{name}' is a type; name a node that is there from the start"


@dataclass(frozen=True, slots=True)
class _Unknown:
    """A name that is not declared: its mentions, and what it could mean.

    Attributes:
        near: what it most likely means.
    """

    mentions: tuple[Mention, ...]
    near: str | None
    candidates: Iterable[str]

    @property
    def name(self) -> str:
        return self.mentions[0].name


def _unknown(scope: Scope, rule: str, noun: str, unknown: _Unknown, *, way_out: str = "", what: str = "") -> Diagnostic:
    """Return the finding about a name that is not declared, with all its mentions."""
    first, *others = unknown.mentions
    near = unknown.near
    subject = what or f"unknown {noun} '{first.name}'"
    message = f"{subject} in {first.user}"
    fix = None
    if near is not None:
        places = [each.place for each in unknown.mentions]
        fix = renaming(first.name, near, unknown.candidates, places, scope.mentioned)
    section = {"type": "types", "node": "nodes"}.get(noun, "")
    declare = f"declare '{first.name}' under '{section}' of 'knowledge'" if section in UNDER_KNOWLEDGE else way_out
    return finding(
        rule,
        message,
        first.place,
        path=first.path,
        way_out=f"did you mean '{near}'?" if near is not None else way_out or declare,
        related=tuple(Related(f"also in {each.user}", each.place) for each in others),
        fix=fix,
    )


def _unknown_attribute(scope: Scope, mentioned: Mention, node: str, known: Mapping[str, object]) -> Diagnostic:
    near = scope.nearest(mentioned.name, f"attributes of {node}", known)
    listed = f"it has {', '.join(list(known)[:10])}" if known else "it has none"
    way_out = f"did you mean '{near}'?" if near is not None else f"{listed}; declare it with its type"
    kind = scope.world.type_of(node)
    user = f" in {mentioned.user}" if mentioned.user else ""
    message = f"node '{node}', of type '{kind}', has no attribute '{mentioned.name}'{user}"
    fix = None
    if near is not None:
        fix = renaming(mentioned.name, near, known, [mentioned.place], scope.mentioned)
    return finding("unknown-attribute", message, mentioned.place, path=mentioned.path, way_out=way_out, fix=fix)
