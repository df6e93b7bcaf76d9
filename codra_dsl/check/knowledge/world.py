"""The knowledge graph as declared, in tables: what there can be, what is there from the start, and who may write it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from codra_dsl.check.types import BOOL, Type, declared_type
from codra_dsl.diagnostics import Place
from codra_dsl.expression import NodeTerm, Path, reads_of
from codra_dsl.model import (
    CONTEXT_NODE,
    RESULT,
    RT,
    TASK_TYPE,
    Agent,
    Attribute,
    EdgeType,
    Kind,
    NodeElement,
    NodeType,
    Reference,
    Spec,
    Task,
    TaskState,
    ValueType,
    Variable,
    Writer,
)
from codra_dsl.units import UNITS

_METRES = Type(Kind.FLOAT, UNITS["m"], range=(0.0, math.inf))

STATES = frozenset(state.value for state in TaskState)
"""What the edge of a task can say: no edge that a spec declares has such a name."""


@dataclass(frozen=True, slots=True, order=True)
class Thing:
    """Something that has writers and readers.

    Attributes:
        section: `context`, `types`, `edges` or `tasks`.
        attribute: of a type or an edge; empty for the type or edge itself.
    """

    section: str
    name: str
    attribute: str = ""

    def __str__(self) -> str:
        """Return it as messages name it."""
        noun = {"context": "context-variable", "types": "type", "edges": "edge", "tasks": "task"}[self.section]
        return f"{noun} '{self.name}'" if not self.attribute else f"attribute '{self.name}.{self.attribute}'"


@dataclass(frozen=True, slots=True)
class End:
    """What a name at an end of an edge means: a single node, or every node of a type."""

    name: str
    is_node: bool


@dataclass(frozen=True)
class World:
    """The knowledge of a spec in tables. A name that stands twice, which `load` reports, means the first."""

    spec: Spec

    @cached_property
    def types(self) -> Mapping[str, NodeType]:
        """The declared types of nodes, by name."""
        return _by_name(self.spec.types)

    @cached_property
    def nodes(self) -> Mapping[str, NodeElement]:
        """The nodes that are there from the start, by name."""
        return _by_name(self.spec.nodes)

    @cached_property
    def edges(self) -> Mapping[str, EdgeType]:
        """The types of edges, by name."""
        return _by_name(self.spec.edges)

    @cached_property
    def tasks(self) -> Mapping[str, Task]:
        """The tasks, by name."""
        return _by_name(self.spec.tasks)

    @cached_property
    def agents(self) -> Mapping[str, Agent]:
        """The agents, by name."""
        return _by_name(self.spec.agents)

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The context-variables that are attributes of nodes, by name: all but those that follow from poses."""
        return _by_name(each for each in self.spec.context if each.posed is None)

    @cached_property
    def type_names(self) -> frozenset[str]:
        """The names of all types: declared ones, those that only nodes name, and that of tasks."""
        return frozenset((*self.types, *(node.type.name for node in self.spec.nodes), TASK_TYPE))

    @cached_property
    def node_names(self) -> frozenset[str]:
        """The names of all nodes that are there from the start, tasks among them."""
        return frozenset((*self.nodes, *self.tasks, CONTEXT_NODE))

    @cached_property
    def edge_words(self) -> frozenset[str]:
        """What may stand as an edge in a pattern: names and labels of edges, and the states of tasks."""
        labels = (edge.label for edge in self.spec.edges)
        return frozenset((*self.edges, *labels, *(STATES if self.tasks else ())))

    @property
    def sections(self) -> Mapping[str, frozenset[str]]:
        """The names of what is declared, by section."""
        tables = (("types", self.types), ("nodes", self.nodes), ("edges", self.edges), ("tasks", self.tasks))
        return {section: frozenset(table) for section, table in tables}

    def type_of(self, node: str) -> str:
        """Return the name of a node's type."""
        if node in self.nodes:
            return self.nodes[node].type.name
        return TASK_TYPE if node in self.tasks else node

    def end(self, name: str) -> End:
        """Return what a name at an end of an edge means: a node goes before a type."""
        return End(name, name in self.node_names)

    def fits(self, term: NodeTerm, end: End) -> bool:
        """Return whether a node that a term means can be one that an end of an edge means."""
        if term.name:
            return term.name == end.name if end.is_node else self.type_of(term.name) == end.name
        if term.type:
            return term.type == (self.type_of(end.name) if end.is_node else end.name)
        return True

    def may_be(self, one: NodeTerm, other: NodeTerm) -> bool:
        """Return whether two terms may mean the same node."""
        if one.name and other.name:
            return one.name == other.name
        kinds = {self.type_of(each.name) if each.name else each.type for each in (one, other)} - {""}
        return len(kinds) < 2

    def meant_by(self, word: str) -> tuple[EdgeType, ...]:
        """Return the edges that a word in a pattern names: the one of that name, else all of that label."""
        if word in self.edges:
            return (self.edges[word],)
        return tuple(edge for edge in self.edges.values() if edge.label == word)

    def edges_between(self, origin: NodeTerm, word: str, target: NodeTerm) -> tuple[EdgeType, ...]:
        """Return the edges that a word names and that can lead from one term to another."""
        return tuple(edge for edge in self.meant_by(word) if self.leads(edge, origin, target))

    def leads(self, edge: EdgeType, origin: NodeTerm, target: NodeTerm) -> bool:
        """Return whether an edge can lead from one term to another."""
        return any(self.fits(origin, self.end(each.name)) for each in edge.origins) and any(
            self.fits(target, self.end(each.name)) for each in edge.targets
        )

    def climb(self, name: str, until: frozenset[NodeTerm] = frozenset()) -> tuple[frozenset[NodeTerm], frozenset[str]]:
        """Return all in which a node may come to stand, itself among it, and the edges with poses by which it may.

        Nothing is said of what is above `until`.
        """
        pending = [NodeTerm(start=0, end=0, name=name)]
        found, edges = set(pending), set[str]()
        while pending:
            term = pending.pop()
            for edge in self._above(term) if term not in until else ():
                edges.add(edge.name)
                more = {self._term(each.name) for each in edge.origins} - found
                found |= more
                pending.extend(more)
        return frozenset(found), frozenset(edges)

    def _above(self, term: NodeTerm) -> tuple[EdgeType, ...]:
        """Return the edges with poses that may say where something stands."""
        rigid = (edge for edge in self.edges.values() if is_rigid(edge))
        return tuple(edge for edge in rigid if any(self.fits(term, self.end(each.name)) for each in edge.targets))

    def may_meet(self, one: str, other: str) -> bool:
        """Return whether poses may tell where two nodes stand to each other: whether both may stand in one frame."""
        first, second = self.climb(one)[0], self.climb(other)[0]
        return any(self.may_be(each, another) for each in first for another in second)

    def between(self, one: str, other: str) -> tuple[str, ...]:
        """Return the edges with poses that may tell where two nodes stand to each other, in file order.

        Those above a node in which both stand, however they stand, are left out: they move both together.
        """
        edges = self.climb(one, self._always_in(other))[1] | self.climb(other, self._always_in(one))[1]
        return tuple(name for name in self.edges if name in edges)

    def _always_in(self, name: str) -> frozenset[NodeTerm]:
        """Return the single nodes, itself among them, that no way up from a node goes past."""
        frames = self.climb(name)[0]
        tops = {frame for frame in frames if not self._above(frame)}
        singles = (frame for frame in frames if frame.name)
        return frozenset(each for each in singles if not tops & (self.climb(name, frozenset({each}))[0] - {each}))

    def _term(self, name: str) -> NodeTerm:
        """Return what a name at an end of an edge means, as patterns say it."""
        is_node = self.end(name).is_node
        return NodeTerm(start=0, end=0, name=name if is_node else "", type="" if is_node else name)

    def task_of(self, origin: NodeTerm, word: str, target: NodeTerm) -> Task | None:
        """Return the task whose edge a step of a path is about, if it is one."""
        task = self.tasks.get(target.name)
        is_step = task is not None and word in STATES
        return task if is_step and task is not None and origin.name in (task.origin.name, "") else None

    def starts_with(self, edge: EdgeType) -> bool:
        """Return whether an edge is there from the start: between single nodes, with a pose, or with no writer."""
        single = all(self.end(each.name).is_node for each in (*edge.origins, *edge.targets))
        alone = len(edge.origins) == len(edge.targets) == 1
        return single and alone and (edge.pose is not None or not self.writers(Thing("edges", edge.name)))

    def attributes_of(self, node: str) -> Mapping[str, tuple[Thing, ValueType]]:
        """Return the attributes of a node that is there from the start, by name."""
        found: dict[str, tuple[Thing, ValueType]] = {}
        kind = self.types.get(self.type_of(node))
        for attribute in kind.attributes if kind is not None else ():
            found[attribute.name] = (Thing("types", kind.name, attribute.name), attribute.type)  # type: ignore[union-attr]
        for variable in self.variables.values():
            if variable.node == node:
                found[variable.name] = (Thing("context", variable.name), variable.type)
        task = self.tasks.get(node)
        if task is not None:
            results = tuple(each.name for each in task.results)
            found[RESULT] = (Thing("tasks", node), ValueType(kind=Kind.ENUM, values=results))
        return found

    def read(self, name: str) -> Thing | None:
        """Return what a name in a condition reads; None where it is unknown, or is worked out from poses."""
        function, first, second = reads_of(name)
        if function:
            return None
        if not first:
            return Thing("context", second) if second in self.variables else None
        found = self.attributes_of(first).get(second) if first in self.node_names else None
        return None if found is None else found[0]

    @cached_property
    def _types_read(self) -> dict[str, Type | None]:
        return {}

    def read_type(self, name: str) -> Type | None:
        """Return the type of what a name in a condition reads; None where that is unknown."""
        if name not in self._types_read:
            self._types_read[name] = self._read_type(name)
        return self._types_read[name]

    def _read_type(self, name: str) -> Type | None:
        function, first, second = reads_of(name)
        if function:
            return _METRES if function == "distance" else BOOL
        if not first:
            variable = self.variables.get(second)
            return None if variable is None else declared_type(variable.type, variable.valid_for_s)
        found = self.attributes_of(first).get(second) if first in self.node_names else None
        return None if found is None else declared_type(found[1])

    def named(self, name: str) -> Thing | None:
        """Return what a name under `owns` or `reads` means: a variable, a type, an edge or a task, or an attribute."""
        first, dot, second = name.partition(".")
        if dot:
            return self._attribute_named(first, second)
        tables = (("context", self.variables), ("types", self.type_names), ("edges", self.edges), ("tasks", self.tasks))
        return next((Thing(section, name) for section, table in tables if name in table), None)

    def _attribute_named(self, holder: str, attribute: str) -> Thing | None:
        kind, edge = self.types.get(holder), self.edges.get(holder)
        for section, element in (("types", kind), ("edges", edge)):
            if element is not None and any(each.name == attribute for each in element.attributes):
                return Thing(section, holder, attribute)
        found = self.attributes_of(holder).get(attribute) if holder in self.node_names else None
        return None if found is None else found[0]

    def things(self) -> Iterator[Thing]:
        """Yield all that can have writers, in file order."""
        yield from (Thing("context", name) for name in self.variables)
        for kind in self.spec.types:
            yield Thing("types", kind.name)
            yield from (Thing("types", kind.name, each.name) for each in kind.attributes)
        for edge in self.spec.edges:
            yield Thing("edges", edge.name)
            yield from (Thing("edges", edge.name, each.name) for each in edge.attributes)

    @cached_property
    def _claims(self) -> Mapping[Thing, tuple[Writer, ...]]:
        """Who says under `owns` that it writes something."""
        found: dict[Thing, tuple[Writer, ...]] = {}
        for agent in self.spec.agents:
            for reference in agent.conduct.owns:
                thing = self.named(reference.name)
                if thing is not None:
                    found[thing] = (*found.get(thing, ()), Writer(name=agent.name, place=reference.place))
        return found

    def writers(self, thing: Thing) -> tuple[Writer, ...]:
        """Return who may write something, each once, those first that it names itself."""
        claimed = self._claims.get(thing, ())
        stated = self._stated(thing)
        names = {writer.name for writer in stated}
        return (*stated, *(writer for writer in claimed if writer.name not in names))

    def _stated(self, thing: Thing) -> tuple[Writer, ...]:
        if thing.section == "context":
            return tuple(_writer(each) for each in self.variables[thing.name].sources)
        if thing.section == "tasks":
            return (_writer(self.tasks[thing.name].by),)
        element = self.types.get(thing.name) if thing.section == "types" else self.edges.get(thing.name)
        if element is None:
            return ()
        if not thing.attribute:
            return element.sources
        attribute = next(each for each in element.attributes if each.name == thing.attribute)
        return attribute.sources or self.writers(Thing(thing.section, thing.name))

    def attribute(self, thing: Thing) -> Attribute:
        """Return an attribute of a type or an edge."""
        element: NodeType | EdgeType = self.types[thing.name] if thing.section == "types" else self.edges[thing.name]
        return next(each for each in element.attributes if each.name == thing.attribute)

    @cached_property
    def owned(self) -> Mapping[str, tuple[Thing, ...]]:
        """What each agent may write that may write anything, in file order."""
        found: dict[str, dict[Thing, None]] = {}
        for thing in self.things():
            for writer in self.writers(thing):
                found.setdefault(writer.name, {})[thing] = None
        return {name: tuple(things) for name, things in found.items()}

    def owns(self, agent: str, thing: Thing) -> bool:
        """Return whether an agent may write something."""
        return any(writer.name == agent for writer in self.writers(thing))

    def place_of(self, thing: Thing) -> Place:
        """Return where something is declared."""
        if thing.attribute:
            return self.attribute(thing).place
        tables: Mapping[str, Mapping[str, Variable | NodeType | EdgeType | Task]] = {
            "context": self.variables,
            "types": self.types,
            "edges": self.edges,
            "tasks": self.tasks,
        }
        element = tables[thing.section].get(thing.name)
        return element.place if element is not None else self._first_node(thing.name).place

    def _first_node(self, kind: str) -> NodeElement:
        return next(node for node in self.spec.nodes if node.type.name == kind)

    def is_there(self, path: Path) -> bool:
        """Return whether every edge of a path is there from the start, and nobody may take it away."""
        return all(
            any(
                self.starts_with(edge) and not self.writers(Thing("edges", edge.name))
                for edge in self.edges_between(origin, link.edge, target)
            )
            for origin, link, target in path.steps()
        )


def is_rigid(edge: EdgeType) -> bool:
    """Return whether an edge holds rigid motions."""
    return edge.label == RT


_Named = TypeVar("_Named", NodeType, NodeElement, EdgeType, Task, Agent, Variable)


def _by_name(elements: Iterable[_Named]) -> Mapping[str, _Named]:
    found: dict[str, _Named] = {}
    for element in elements:
        found.setdefault(element.name, element)
    return found


def _writer(reference: Reference) -> Writer:
    return Writer(name=reference.name, place=reference.place)
