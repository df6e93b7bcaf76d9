"""The declared knowledge graph in tables: types, initial nodes and edges, and writers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import TypeVar

from codra_dsl.language.check.conditions.types import BOOL, Type, declared_type
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import NodeTerm, Path, reads_of
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import (
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
from codra_dsl.language.units import UNITS

_METRES = Type(Kind.FLOAT, UNITS["m"], range=(0.0, math.inf))

STATES = frozenset(state.value for state in TaskState)
"""The states of a task, which are the labels of the task's edge. No declared edge has the name of a state."""


@dataclass(frozen=True, slots=True, order=True)
class KnowledgeElement:
    """A declared element of knowledge that has writers and readers.

    Attributes:
        section: `context`, `types`, `edges` or `tasks`.
        attribute: the name of an attribute of a type or an edge; empty if the element is not an attribute.
    """

    section: str
    name: str
    attribute: str = ""

    def __str__(self) -> str:
        """Return the name of the element in messages."""
        noun = {"context": "context-variable", "types": "type", "edges": "edge", "tasks": "task"}[self.section]
        return f"{noun} '{self.name}'" if not self.attribute else f"attribute '{self.name}.{self.attribute}'"


@dataclass(frozen=True, slots=True)
class End:
    """The meaning of a name at an end of an edge: a single node, or every node of a type."""

    name: str
    is_node: bool


@dataclass(frozen=True)
class DeclaredGraph:
    """The knowledge of a spec in tables.

    If a name is declared twice, which `load` reports, the tables contain the first element.
    """

    spec: Spec

    @cached_property
    def types(self) -> Mapping[str, NodeType]:
        """The declared types of nodes, by name."""
        return _by_name(self.spec.types)

    @cached_property
    def nodes(self) -> Mapping[str, NodeElement]:
        """The declared nodes, by name."""
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
        """The context-variables that are attributes of nodes, by name. Variables computed from poses are left out."""
        return _by_name(variable for variable in self.spec.context if variable.pose_condition is None)

    @cached_property
    def type_names(self) -> frozenset[str]:
        """The names of all types: declared types, undeclared types of nodes, and the type of tasks."""
        return frozenset((*self.types, *(node.type.name for node in self.spec.nodes), TASK_TYPE))

    @cached_property
    def node_names(self) -> frozenset[str]:
        """The names of all nodes that exist from the start, including tasks."""
        return frozenset((*self.nodes, *self.tasks, CONTEXT_NODE))

    @cached_property
    def edge_words(self) -> frozenset[str]:
        """The words allowed as an edge in a pattern: names and labels of edges, and the states of tasks."""
        labels = (edge.label for edge in self.spec.edges)
        return frozenset((*self.edges, *labels, *(STATES if self.tasks else ())))

    @property
    def sections(self) -> Mapping[str, frozenset[str]]:
        """The declared names, by section."""
        tables = (("types", self.types), ("nodes", self.nodes), ("edges", self.edges), ("tasks", self.tasks))
        return {section: frozenset(table) for section, table in tables}

    def type_of(self, node: str) -> str:
        """Return the name of a node's type."""
        if node in self.nodes:
            return self.nodes[node].type.name
        return TASK_TYPE if node in self.tasks else node

    def end(self, name: str) -> End:
        """Return the meaning of a name at an end of an edge: the node with this name or, if there is none, a type."""
        return End(name, name in self.node_names)

    def fits(self, term: NodeTerm, end: End) -> bool:
        """Return whether a term and an end of an edge can mean the same node."""
        if term.name:
            return term.name == end.name if end.is_node else self.type_of(term.name) == end.name
        if term.type:
            return term.type == (self.type_of(end.name) if end.is_node else end.name)
        return True

    def may_be_same_node(self, one: NodeTerm, other: NodeTerm) -> bool:
        """Return whether two terms may mean the same node."""
        if one.name and other.name:
            return one.name == other.name
        kinds = {self.type_of(term.name) if term.name else term.type for term in (one, other)} - {""}
        return len(kinds) < 2

    def edges_of_word(self, word: str) -> tuple[EdgeType, ...]:
        """Return the edges that a word in a pattern refers to.

        A word refers to the edge with this name or, if there is no such edge, to all edges with this label.
        """
        if word in self.edges:
            return (self.edges[word],)
        return tuple(edge for edge in self.edges.values() if edge.label == word)

    def edges_between(self, origin: NodeTerm, word: str, target: NodeTerm) -> tuple[EdgeType, ...]:
        """Return the edges that a word refers to and that can lead from `origin` to `target`."""
        return tuple(edge for edge in self.edges_of_word(word) if self.can_lead(edge, origin, target))

    def can_lead(self, edge: EdgeType, origin: NodeTerm, target: NodeTerm) -> bool:
        """Return whether an edge can lead from `origin` to `target`."""
        return any(self.fits(origin, self.end(end.name)) for end in edge.origins) and any(
            self.fits(target, self.end(end.name)) for end in edge.targets
        )

    def climb(self, name: str, until: frozenset[NodeTerm] = frozenset()) -> tuple[frozenset[NodeTerm], frozenset[str]]:
        """Return all possible ancestor frames of a node, and the names of the edges with poses above the node.

        The node itself is one of the frames. The search does not go beyond the frames in `until`.
        """
        pending_terms = [NodeTerm(start=0, end=0, name=name)]
        terms, edges = set(pending_terms), set[str]()
        while pending_terms:
            term = pending_terms.pop()
            for edge in self._parent_edges(term) if term not in until else ():
                edges.add(edge.name)
                origins = {self._term(origin.name) for origin in edge.origins} - terms
                terms |= origins
                pending_terms.extend(origins)
        return frozenset(terms), frozenset(edges)

    def _parent_edges(self, term: NodeTerm) -> tuple[EdgeType, ...]:
        """Return the edges with poses that may lead to a node that the term can mean."""
        pose_edges = (edge for edge in self.edges.values() if holds_poses(edge))
        return tuple(
            edge for edge in pose_edges if any(self.fits(term, self.end(target.name)) for target in edge.targets)
        )

    def may_have_relative_pose(self, one: str, other: str) -> bool:
        """Return whether the relative pose of two nodes may be known: the nodes may have a common ancestor frame."""
        frames, other_frames = self.climb(one)[0], self.climb(other)[0]
        return any(self.may_be_same_node(frame, other_frame) for frame in frames for other_frame in other_frames)

    def pose_edges_between(self, one: str, other: str) -> tuple[str, ...]:
        """Return the edges that may contribute to the relative pose of two nodes, in file order.

        If a frame contains both nodes in every case, the edges above this frame are left out, since they move both
        nodes together.
        """
        edges = self.climb(one, self._certain_ancestors(other))[1] | self.climb(other, self._certain_ancestors(one))[1]
        return tuple(name for name in self.edges if name in edges)

    def _certain_ancestors(self, name: str) -> frozenset[NodeTerm]:
        """Return the single nodes that are on every path from a node to a root frame, including the node itself."""
        frames = self.climb(name)[0]
        roots = {frame for frame in frames if not self._parent_edges(frame)}
        nodes = (frame for frame in frames if frame.name)
        return frozenset(frame for frame in nodes if not roots & (self.climb(name, frozenset({frame}))[0] - {frame}))

    def _term(self, name: str) -> NodeTerm:
        """Return the meaning of a name at an end of an edge as a term of a pattern."""
        is_node = self.end(name).is_node
        return NodeTerm(start=0, end=0, name=name if is_node else "", type="" if is_node else name)

    def task_of(self, origin: NodeTerm, word: str, target: NodeTerm) -> Task | None:
        """Return the task whose edge a step of a path refers to; None if the step refers to another edge."""
        task = self.tasks.get(target.name)
        is_step = task is not None and word in STATES
        return task if is_step and task is not None and origin.name in (task.origin.name, "") else None

    def exists_initially(self, edge: EdgeType) -> bool:
        """Return whether an edge exists from the start.

        An edge exists from the start if it leads from one single node to another, and has a pose or no writer.
        """
        has_node_ends = all(self.end(end.name).is_node for end in (*edge.origins, *edge.targets))
        has_one_end_each = len(edge.origins) == len(edge.targets) == 1
        return (
            has_node_ends
            and has_one_end_each
            and (edge.pose is not None or not self.writers(KnowledgeElement("edges", edge.name)))
        )

    def attributes_of(self, node: str) -> Mapping[str, tuple[KnowledgeElement, ValueType]]:
        """Return a mapping from the attribute names of an initial node to the elements and types of the attributes."""
        attributes: dict[str, tuple[KnowledgeElement, ValueType]] = {}
        kind = self.types.get(self.type_of(node))
        for attribute in kind.attributes if kind is not None else ():
            attributes[attribute.name] = (KnowledgeElement("types", kind.name, attribute.name), attribute.type)  # type: ignore[union-attr]
        for variable in self.variables.values():
            if variable.node == node:
                attributes[variable.name] = (KnowledgeElement("context", variable.name), variable.type)
        task = self.tasks.get(node)
        if task is not None:
            results = tuple(result.name for result in task.results)
            attributes[RESULT] = (KnowledgeElement("tasks", node), ValueType(kind=Kind.ENUM, values=results))
        return attributes

    def element_read_by(self, name: str) -> KnowledgeElement | None:
        """Return the element that a name in a condition reads; None if the name is unknown, or reads poses."""
        function, first, second = reads_of(name)
        if function:
            return None
        if not first:
            return KnowledgeElement("context", second) if second in self.variables else None
        attribute_entry = self.attributes_of(first).get(second) if first in self.node_names else None
        return None if attribute_entry is None else attribute_entry[0]

    @cached_property
    def _type_by_name(self) -> dict[str, Type | None]:
        return {}

    def name_type(self, name: str) -> Type | None:
        """Return the type of a name in a condition; None if the name is unknown."""
        if name not in self._type_by_name:
            self._type_by_name[name] = self._find_name_type(name)
        return self._type_by_name[name]

    def _find_name_type(self, name: str) -> Type | None:
        function, first, second = reads_of(name)
        if function:
            return _METRES if function == "distance" else BOOL
        if not first:
            variable = self.variables.get(second)
            return None if variable is None else declared_type(variable.type, variable.valid_for_s)
        attribute_entry = self.attributes_of(first).get(second) if first in self.node_names else None
        return None if attribute_entry is None else declared_type(attribute_entry[1])

    def element_named(self, name: str) -> KnowledgeElement | None:
        """Return the meaning of a name under `owns` or `reads`: a variable, type, edge, task or attribute."""
        first, dot, second = name.partition(".")
        if dot:
            return self._attribute_named(first, second)
        tables = (("context", self.variables), ("types", self.type_names), ("edges", self.edges), ("tasks", self.tasks))
        return next((KnowledgeElement(section, name) for section, table in tables if name in table), None)

    def _attribute_named(self, holder: str, attribute: str) -> KnowledgeElement | None:
        kind, edge = self.types.get(holder), self.edges.get(holder)
        for section, element in (("types", kind), ("edges", edge)):
            if element is not None and any(candidate.name == attribute for candidate in element.attributes):
                return KnowledgeElement(section, holder, attribute)
        attribute_entry = self.attributes_of(holder).get(attribute) if holder in self.node_names else None
        return None if attribute_entry is None else attribute_entry[0]

    def elements(self) -> Iterator[KnowledgeElement]:
        """Yield all variables, then all types and edges with their attributes, each section in file order."""
        yield from (KnowledgeElement("context", name) for name in self.variables)
        for kind in self.spec.types:
            yield KnowledgeElement("types", kind.name)
            yield from (KnowledgeElement("types", kind.name, attribute.name) for attribute in kind.attributes)
        for edge in self.spec.edges:
            yield KnowledgeElement("edges", edge.name)
            yield from (KnowledgeElement("edges", edge.name, attribute.name) for attribute in edge.attributes)

    @cached_property
    def _owners_by_element(self) -> Mapping[KnowledgeElement, tuple[Writer, ...]]:
        """For each element, the agents that list it under `owns`."""
        owners_by_element: dict[KnowledgeElement, tuple[Writer, ...]] = {}
        for agent in self.spec.agents:
            for reference in agent.conduct.owns:
                element = self.element_named(reference.name)
                if element is not None:
                    owners_by_element[element] = (
                        *owners_by_element.get(element, ()),
                        Writer(name=agent.name, place=reference.place),
                    )
        return owners_by_element

    def writers(self, element: KnowledgeElement) -> tuple[Writer, ...]:
        """Return the writers in the declaration of an element, then other agents that list the element under `owns`."""
        owners = self._owners_by_element.get(element, ())
        stated_writers = self._stated_writers(element)
        names = {writer.name for writer in stated_writers}
        return (*stated_writers, *(writer for writer in owners if writer.name not in names))

    def _stated_writers(self, element: KnowledgeElement) -> tuple[Writer, ...]:
        if element.section == "context":
            variable = self.variables[element.name]
            return tuple(_writer(source) for source in variable.sources) if variable.derived is None else ()
        if element.section == "tasks":
            return (_writer(self.tasks[element.name].by),)
        declaration = self.types.get(element.name) if element.section == "types" else self.edges.get(element.name)
        if declaration is None:
            return ()
        if not element.attribute:
            return declaration.sources
        attribute = next(candidate for candidate in declaration.attributes if candidate.name == element.attribute)
        return attribute.sources or self.writers(KnowledgeElement(element.section, element.name))

    def attribute(self, element: KnowledgeElement) -> Attribute:
        """Return an attribute of a type or an edge."""
        declaration: NodeType | EdgeType = (
            self.types[element.name] if element.section == "types" else self.edges[element.name]
        )
        return next(candidate for candidate in declaration.attributes if candidate.name == element.attribute)

    @cached_property
    def elements_by_writer(self) -> Mapping[str, tuple[KnowledgeElement, ...]]:
        """A mapping from the name of each writer to the elements that it may write, in the order of `elements`."""
        elements_by_writer: dict[str, dict[KnowledgeElement, None]] = {}
        for element in self.elements():
            for writer in self.writers(element):
                elements_by_writer.setdefault(writer.name, {})[element] = None
        return {name: tuple(elements) for name, elements in elements_by_writer.items()}

    def owns(self, agent: str, element: KnowledgeElement) -> bool:
        """Return whether an agent may write an element."""
        return any(writer.name == agent for writer in self.writers(element))

    def place_of(self, element: KnowledgeElement) -> Place:
        """Return the place of the declaration of an element."""
        if element.attribute:
            return self.attribute(element).place
        tables: Mapping[str, Mapping[str, Variable | NodeType | EdgeType | Task]] = {
            "context": self.variables,
            "types": self.types,
            "edges": self.edges,
            "tasks": self.tasks,
        }
        declaration = tables[element.section].get(element.name)
        if declaration is not None:
            return declaration.place
        # the type is not declared, but a node has it
        return next(node.place for node in self.spec.nodes if node.type.name == element.name)

    def always_exists(self, path: Path) -> bool:
        """Return whether every edge of a path exists from the start and has no writer that could remove it."""
        return all(
            any(
                self.exists_initially(edge) and not self.writers(KnowledgeElement("edges", edge.name))
                for edge in self.edges_between(origin, link.edge, target)
            )
            for origin, link, target in path.steps()
        )


def holds_poses(edge: EdgeType) -> bool:
    """Return whether an edge holds poses, which are rigid motions."""
    return edge.label == RT


_Named = TypeVar("_Named", NodeType, NodeElement, EdgeType, Task, Agent, Variable)


def _by_name(elements: Iterable[_Named]) -> Mapping[str, _Named]:
    elements_by_name: dict[str, _Named] = {}
    for element in elements:
        elements_by_name.setdefault(element.name, element)
    return elements_by_name


def _writer(reference: Reference) -> Writer:
    return Writer(name=reference.name, place=reference.place)
