"""The words of one graph, looked up from its declarations: types, attributes, tasks, and who may write them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from codra_dsl.runtime.errors import unknown
from codra_dsl.runtime.knowledge.declarations import (
    CONTEXT,
    RT,
    TASK,
    AttributeModel,
    EdgeTypeModel,
    KnowledgeModel,
    NodeModel,
    NodeTypeModel,
    TaskModel,
    Writer,
    by,
)
from codra_dsl.runtime.knowledge.elements import Attribute, Edge, Node
from codra_dsl.runtime.knowledge.permissions import Permissions
from codra_dsl.runtime.values.declarations import OBSERVER
from codra_dsl.runtime.values.model import VariableModel, integer, member, text


class Stage(StrEnum):
    """How far a task is: the label of the edge that leads to it (P2, section 3.2)."""

    WANTS = "wants"
    IS = "is"
    FINISHED = "finished"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class NodeType:
    """A type of nodes as it is declared, and who may insert and delete them."""

    model: NodeTypeModel
    permissions: Permissions
    attributes: Mapping[str, Attribute]


@dataclass(frozen=True, slots=True)
class EdgeType:
    """A type of edges as it is declared, and who may insert and delete them."""

    model: EdgeTypeModel
    label: str
    permissions: Permissions
    attributes: Mapping[str, Attribute]
    origins: frozenset[str]
    targets: frozenset[str]

    def fits(self, origin: Node, target: Node) -> bool:
        """Return whether there may be such an edge from one node to another."""
        return (origin.type in self.origins or origin.name in self.origins) and (
            target.type in self.targets or target.name in self.targets
        )


class GraphSchema:
    """What the declarations say, by name.

    Attributes:
        model: what is declared, with the node of the context-variables that say no other.
        tasks: by name.
        agents: the names of all that are declared or that may write something; the main execution is one where it may.
        variables: by name, the node of which a context-variable is an attribute.
        nodes_of_context: these nodes.
    """

    def __init__(self, model: KnowledgeModel, variables: Sequence[VariableModel] = ()) -> None:
        """Look up all that a spec says of its graph.

        Args:
            model: what is declared of it.
            variables: those of the context. Each is an attribute of the node that declares one of the same name as its
                own, or else of the node `context`.

        Raises:
            ValueError: if a name is declared twice, or is one that tasks bring along.
        """
        variables = [each for each in variables if each.posed is None]  # the others follow from the graph
        self.variables: Mapping[str, str] = nodes_of_variables(model, variables)
        self.nodes_of_context = frozenset(self.variables.values())
        self.model = model = _with_context_node(model, self.variables)
        self.tasks: Mapping[str, TaskModel] = {task.name: task for task in model.tasks}
        node_types, edge_types = list(model.node_types), list(model.edge_types)
        if model.tasks:
            node_types.append(NodeTypeModel(name=TASK))
            origins = tuple({task.origin: None for task in model.tasks})
            edge_types += [EdgeTypeModel(name=stage, origins=origins, targets=(TASK,)) for stage in Stage]
        _check_unique("type of nodes", [each.name for each in node_types])
        _check_unique("type of edges", [each.name for each in edge_types])
        self._node_types = {each.name: _node_type(each) for each in node_types}
        self._edge_types = {each.name: _edge_type(each) for each in edge_types}
        shared = _shared(self.variables, variables)
        of_tasks = {task.name: (TASK, {**_attributes_of(task), **shared.get(task.name, {})}) for task in model.tasks}
        self._of_nodes: Mapping[str, tuple[str, Mapping[str, Attribute]]] = {
            **{node.name: (node.type, self._of_node(node, shared.get(node.name, {}))) for node in model.nodes},
            **of_tasks,
        }
        writers = (source for variable in variables for source in variable.sources)
        self.agents = frozenset((*_agents(model), *writers)) - {OBSERVER}

    def node_type(self, name: str) -> NodeType:
        """Return a type of nodes; raise `UnknownNameError` if there is none."""
        try:
            return self._node_types[name]
        except KeyError:
            raise unknown("type of nodes", name, self._node_types) from None

    def edge_type(self, name: str) -> EdgeType:
        """Return a type of edges; raise `UnknownNameError` if there is none."""
        try:
            return self._edge_types[name]
        except KeyError:
            raise unknown("type of edges", name, self._edge_types) from None

    def types_of_edges(self, name: str) -> frozenset[str]:
        """Return the types of edges that a path names, by their own name or by their label.

        Raises:
            UnknownNameError: if there is none.
        """
        if name in self._edge_types:
            return frozenset((name,))
        found = frozenset(each.model.name for each in self._edge_types.values() if each.label == name)
        if not found:
            raise unknown("type of edges", name, self._edge_types)
        return found

    def labelled(self, label: str) -> tuple[EdgeType, ...]:
        """Return the types of the edges that carry a label."""
        return tuple(each for each in self._edge_types.values() if each.label == label)

    def of_node(self, node: Node) -> Mapping[str, Attribute]:
        """Return the attributes that a node may have."""
        own = self._of_nodes.get(node.name)
        return own[1] if own is not None and own[0] == node.type else self._node_types[node.type].attributes

    def attribute(self, node: Node, name: str) -> Attribute:
        """Return an attribute of a node; raise `UnknownNameError` if it cannot have it."""
        own = self._of_nodes.get(node.name)
        declared = own[1] if own is not None and own[0] == node.type else self._node_types[node.type].attributes
        found = declared.get(name)
        if found is None:
            raise unknown(f"attribute of {node.type!r}", name, declared)
        return found

    def attribute_of_edge(self, edge: Edge, name: str) -> Attribute:
        """Return an attribute of an edge; raise `UnknownNameError` if it cannot have it."""
        found = self._edge_types[edge.type].attributes.get(name)
        if found is None:
            raise unknown(f"attribute of {edge.type!r}", name, self._edge_types[edge.type].attributes)
        return found

    def _of_node(self, node: NodeModel, shared: Mapping[str, Attribute]) -> Mapping[str, Attribute]:
        return {**self.node_type(node.type).attributes, **_attributes(node.attributes), **shared}


def _with_context_node(model: KnowledgeModel, variables: Mapping[str, str]) -> KnowledgeModel:
    """Return a model with the node of the context-variables that say no other, if there are any."""
    if CONTEXT not in variables.values() or any(node.name == CONTEXT for node in model.nodes):
        return model
    types = model.node_types
    if all(each.name != CONTEXT for each in types):
        types = (*types, NodeTypeModel(name=CONTEXT))
    return replace(model, node_types=types, nodes=(NodeModel(name=CONTEXT, type=CONTEXT), *model.nodes))


def nodes_of_variables(model: KnowledgeModel, variables: Sequence[VariableModel]) -> Mapping[str, str]:
    """Return, by context-variable, its node: the one that declares it as an attribute of its own, or `context`.

    Those that follow from poses are attributes of none.
    """
    owners: tuple[NodeModel | TaskModel, ...] = (*model.nodes, *model.tasks)
    declared = {attribute.name: owner.name for owner in owners for attribute in owner.attributes}
    return {each.name: declared.get(each.name, CONTEXT) for each in variables if each.posed is None}


def _shared(nodes: Mapping[str, str], variables: Sequence[VariableModel]) -> Mapping[str, Mapping[str, Attribute]]:
    """Return the attributes of nodes that are context-variables, by node and name."""
    found: dict[str, dict[str, Attribute]] = {}
    for each in variables:
        model = AttributeModel(
            name=each.name,
            type=each.type,
            sources=by(*each.sources),
            valid_for_s=each.valid_for_s,
            history=each.history,
        )
        found.setdefault(nodes[each.name], {})[each.name] = _attribute(model, model.sources, each.name)
    return found


def _node_type(model: NodeTypeModel) -> NodeType:
    return NodeType(model, Permissions(model.sources), _attributes(model.attributes))


def _edge_type(model: EdgeTypeModel) -> EdgeType:
    label = model.label or (RT if model.motion is not None else str(model.name))
    if (label == RT) != (model.motion is not None):
        raise ValueError(f"edges of type {model.name!r} have a motion if, and only if, their label is {RT}")
    return EdgeType(
        model,
        label,
        Permissions(model.sources),
        {each.name: _attribute(each, each.sources or model.sources) for each in model.attributes},
        frozenset(model.origins),
        frozenset(model.targets),
    )


def _attribute(model: AttributeModel, sources: Sequence[Writer], variable: str = "") -> Attribute:
    return Attribute(model, Permissions(sources), model.type.converter(), variable)


def _attributes(models: Iterable[AttributeModel]) -> Mapping[str, Attribute]:
    return {model.name: _attribute(model, model.sources) for model in models}


def _attributes_of(task: TaskModel) -> Mapping[str, Attribute]:
    """Return what the node of a task tells: what only the steps of its handshake write, and what its requesters do."""
    steps = (
        AttributeModel(name="request", type=integer(low=0)),
        AttributeModel(name="requester", type=text()),
        AttributeModel(name="result", type=member(*task.results)),
        AttributeModel(name="reason", type=text()),
    )
    asked = {each.name: _attribute(each, each.sources or by(*task.requesters)) for each in task.attributes}
    return {**asked, **_attributes(steps)}


def _agents(model: KnowledgeModel) -> Iterable[str]:
    yield from (agent.name for agent in model.agents)
    for task in model.tasks:
        yield from (task.by, *task.requesters)
    types: list[NodeTypeModel | EdgeTypeModel] = [*model.node_types, *model.edge_types]
    owners: list[NodeTypeModel | EdgeTypeModel | NodeModel | TaskModel] = [*types, *model.nodes, *model.tasks]
    owned = [*types, *(attribute for owner in owners for attribute in owner.attributes)]
    yield from (writer.agent for each in owned for writer in each.sources)


def _check_unique(kind: str, names: Sequence[str]) -> None:
    twice = [name for position, name in enumerate(names) if name in names[:position]]
    if twice:
        raise ValueError(f"there are two of the {kind} {str(twice[0])!r}, or it is one that tasks bring along")
