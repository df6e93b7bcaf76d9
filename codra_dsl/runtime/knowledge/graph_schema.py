"""The schema of one graph: its declared types, attributes, tasks and permissions, in tables with names as keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from codra_dsl.runtime.errors import unknown_name_error
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
    """The stage of a task: the label of the edge that leads to the task (P2, section 3.2)."""

    WANTS = "wants"
    IS = "is"
    FINISHED = "finished"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class NodeType:
    """The declaration of a type of nodes, with the permissions to insert and delete them."""

    model: NodeTypeModel
    permissions: Permissions
    attributes: Mapping[str, Attribute]


@dataclass(frozen=True, slots=True)
class EdgeType:
    """The declaration of a type of edges, with the permissions to insert and delete them."""

    model: EdgeTypeModel
    label: str
    permissions: Permissions
    attributes: Mapping[str, Attribute]
    origins: frozenset[str]
    targets: frozenset[str]

    def fits(self, origin: Node, target: Node) -> bool:
        """Return whether an edge of this type may go from one node to another."""
        return (origin.type in self.origins or origin.name in self.origins) and (
            target.type in self.targets or target.name in self.targets
        )


class GraphSchema:
    """The declarations of a graph, by name.

    Attributes:
        model: the declarations, with the node `context` if a context-variable needs it.
        tasks: the tasks, by name.
        agents: the names of all agents that are declared or may write something. The main execution is one of them if
            it may write something.
        nodes_by_variable: for each context-variable, the name of the node that has it as an attribute.
        nodes_of_context: the names of all nodes that have a context-variable as an attribute.
    """

    def __init__(self, model: KnowledgeModel, variables: Sequence[VariableModel] = ()) -> None:
        """Build the schema of a spec's graph.

        Args:
            model: the declarations.
            variables: the context-variables. Each is an attribute of the node that declares an attribute of the same
                name, or else of the node `context`.

        Raises:
            ValueError: if a name is declared twice, or is reserved for tasks.
        """
        # Variables with a pose condition are computed from poses, so they are not attributes.
        variables = [variable for variable in variables if variable.pose_condition is None]
        self.nodes_by_variable: Mapping[str, str] = nodes_of_variables(model, variables)
        self.nodes_of_context = frozenset(self.nodes_by_variable.values())
        self.model = model = _with_context_node(model, self.nodes_by_variable)
        self.tasks: Mapping[str, TaskModel] = {task.name: task for task in model.tasks}
        node_types, edge_types = list(model.node_types), list(model.edge_types)
        if model.tasks:
            node_types.append(NodeTypeModel(name=TASK))
            origins = tuple({task.origin: None for task in model.tasks})
            edge_types += [EdgeTypeModel(name=stage, origins=origins, targets=(TASK,)) for stage in Stage]
        _check_unique("type of nodes", [node_type.name for node_type in node_types])
        _check_unique("type of edges", [edge_type.name for edge_type in edge_types])
        self._node_types = {node_type.name: _make_node_type(node_type) for node_type in node_types}
        self._edge_types = {edge_type.name: _make_edge_type(edge_type) for edge_type in edge_types}
        variable_attributes = _variable_attributes(self.nodes_by_variable, variables)
        task_types_and_attributes = {
            task.name: (TASK, {**_task_attributes(task), **variable_attributes.get(task.name, {})})
            for task in model.tasks
        }
        self._types_and_attributes_by_node: Mapping[str, tuple[str, Mapping[str, Attribute]]] = {
            **{
                node.name: (node.type, self._node_attributes(node, variable_attributes.get(node.name, {})))
                for node in model.nodes
            },
            **task_types_and_attributes,
        }
        writers = (source for variable in variables if variable.derived is None for source in variable.sources)
        self.agents = agents_of(model) | frozenset(writers) - {OBSERVER}

    def node_type(self, name: str) -> NodeType:
        """Return a type of nodes; raise `UnknownNameError` if it is not declared."""
        try:
            return self._node_types[name]
        except KeyError:
            raise unknown_name_error("type of nodes", name, self._node_types) from None

    def edge_type(self, name: str) -> EdgeType:
        """Return a type of edges; raise `UnknownNameError` if it is not declared."""
        try:
            return self._edge_types[name]
        except KeyError:
            raise unknown_name_error("type of edges", name, self._edge_types) from None

    def types_of_edges(self, name: str) -> frozenset[str]:
        """Return the names of the types of edges that a name in a path means.

        If a type has this name, the result is only this type; otherwise the result is all types with this label.

        Raises:
            UnknownNameError: if no type of edges has this name or label.
        """
        if name in self._edge_types:
            return frozenset((name,))
        names = frozenset(edge_type.model.name for edge_type in self._edge_types.values() if edge_type.label == name)
        if not names:
            raise unknown_name_error("type of edges", name, self._edge_types)
        return names

    def edge_types_with_label(self, label: str) -> tuple[EdgeType, ...]:
        """Return the types of edges with a label."""
        return tuple(edge_type for edge_type in self._edge_types.values() if edge_type.label == label)

    def attributes_of_node(self, node: Node) -> Mapping[str, Attribute]:
        """Return the attributes that a node may have."""
        entry = self._types_and_attributes_by_node.get(node.name)
        return entry[1] if entry is not None and entry[0] == node.type else self._node_types[node.type].attributes

    def attribute(self, node: Node, name: str) -> Attribute:
        """Return an attribute of a node; raise `UnknownNameError` if it is not declared for the node."""
        entry = self._types_and_attributes_by_node.get(node.name)
        attributes = entry[1] if entry is not None and entry[0] == node.type else self._node_types[node.type].attributes
        attribute = attributes.get(name)
        if attribute is None:
            raise unknown_name_error(f"attribute of {node.type!r}", name, attributes)
        return attribute

    def attribute_of_edge(self, edge: Edge, name: str) -> Attribute:
        """Return an attribute of an edge; raise `UnknownNameError` if it is not declared for the edge."""
        attribute = self._edge_types[edge.type].attributes.get(name)
        if attribute is None:
            raise unknown_name_error(f"attribute of {edge.type!r}", name, self._edge_types[edge.type].attributes)
        return attribute

    def _node_attributes(
        self, node: NodeModel, variable_attributes: Mapping[str, Attribute]
    ) -> Mapping[str, Attribute]:
        return {**self.node_type(node.type).attributes, **_make_attributes(node.attributes), **variable_attributes}


def _with_context_node(model: KnowledgeModel, variables: Mapping[str, str]) -> KnowledgeModel:
    """Return the model, with the node `context` added if a context-variable belongs to this node."""
    if CONTEXT not in variables.values() or any(node.name == CONTEXT for node in model.nodes):
        return model
    types = model.node_types
    if all(node_type.name != CONTEXT for node_type in types):
        types = (*types, NodeTypeModel(name=CONTEXT))
    return replace(model, node_types=types, nodes=(NodeModel(name=CONTEXT, type=CONTEXT), *model.nodes))


def nodes_of_variables(model: KnowledgeModel, variables: Sequence[VariableModel]) -> Mapping[str, str]:
    """Return for each context-variable the name of the node that declares it as an attribute, or else `context`.

    Variables that are computed from poses are left out: they are not attributes of a node.
    """
    owners: tuple[NodeModel | TaskModel, ...] = (*model.nodes, *model.tasks)
    owners_by_attribute = {attribute.name: owner.name for owner in owners for attribute in owner.attributes}
    return {
        variable.name: owners_by_attribute.get(variable.name, CONTEXT)
        for variable in variables
        if variable.pose_condition is None
    }


def _variable_attributes(
    nodes: Mapping[str, str], variables: Sequence[VariableModel]
) -> Mapping[str, Mapping[str, Attribute]]:
    """Return for each node those of its attributes that are context-variables, with their names as keys."""
    attributes: dict[str, dict[str, Attribute]] = {}
    for variable in variables:
        model = AttributeModel(
            name=variable.name,
            type=variable.type,
            sources=by(*variable.sources),
            valid_for_s=variable.valid_for_s,
            history=variable.history,
        )
        attributes.setdefault(nodes[variable.name], {})[variable.name] = _make_attribute(
            model, model.sources, variable.name
        )
    return attributes


def _make_node_type(model: NodeTypeModel) -> NodeType:
    return NodeType(model, Permissions(model.sources), _make_attributes(model.attributes))


def _make_edge_type(model: EdgeTypeModel) -> EdgeType:
    label = model.label or (RT if model.motion is not None else str(model.name))
    if (label == RT) != (model.motion is not None):
        raise ValueError(f"edges of type {model.name!r} must either have a motion and the label {RT}, or neither")
    return EdgeType(
        model,
        label,
        Permissions(model.sources),
        {
            attribute.name: _make_attribute(attribute, attribute.sources or model.sources)
            for attribute in model.attributes
        },
        frozenset(model.origins),
        frozenset(model.targets),
    )


def _make_attribute(model: AttributeModel, sources: Sequence[Writer], variable: str = "") -> Attribute:
    return Attribute(model, Permissions(sources), model.type.converter(), variable)


def _make_attributes(models: Iterable[AttributeModel]) -> Mapping[str, Attribute]:
    return {model.name: _make_attribute(model, model.sources) for model in models}


def _task_attributes(task: TaskModel) -> Mapping[str, Attribute]:
    """Return the attributes of a task's node: the declared attributes, and the attributes of the handshake.

    The requesters write each declared attribute that has no sources of its own. Only the steps of the handshake write
    the attributes of the handshake.
    """
    handshake_attribute_models = (
        AttributeModel(name="request", type=integer(low=0)),
        AttributeModel(name="requester", type=text()),
        AttributeModel(name="result", type=member(*task.results)),
        AttributeModel(name="reason", type=text()),
    )
    declared_attributes = {
        attribute.name: _make_attribute(attribute, attribute.sources or by(*task.requesters))
        for attribute in task.attributes
    }
    return {**declared_attributes, **_make_attributes(handshake_attribute_models)}


def agents_of(model: KnowledgeModel) -> frozenset[str]:
    """Return the agents that are declared, or that write or execute something in a graph."""
    return frozenset(_agent_names(model)) - {OBSERVER}


def _agent_names(model: KnowledgeModel) -> Iterable[str]:
    yield from (agent.name for agent in model.agents)
    for task in model.tasks:
        yield from (task.by, *task.requesters)
    types: list[NodeTypeModel | EdgeTypeModel] = [*model.node_types, *model.edge_types]
    owners: list[NodeTypeModel | EdgeTypeModel | NodeModel | TaskModel] = [*types, *model.nodes, *model.tasks]
    declarations = [*types, *(attribute for owner in owners for attribute in owner.attributes)]
    yield from (writer.agent for declaration in declarations for writer in declaration.sources)


def _check_unique(kind: str, names: Sequence[str]) -> None:
    duplicate_names = [name for position, name in enumerate(names) if name in names[:position]]
    if duplicate_names:
        raise ValueError(f"the {kind} {str(duplicate_names[0])!r} is declared twice, or is reserved for tasks")
