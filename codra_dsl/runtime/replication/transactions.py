"""From the operations of an agent to the writes of a commit.

Operations are checked against the graph of the replica on which they are made, by the same rules as in one process.
Other replicas check only whether the author may write such elements at all, because their graphs can differ.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.declarations import RT, TASK, KnowledgeModel
from codra_dsl.runtime.knowledge.elements import Attribute
from codra_dsl.runtime.knowledge.operations import Operation, Verb
from codra_dsl.runtime.replication.commits import Register, RegisterKind, Write

_EDGE_VERBS = (Verb.INSERT_EDGE, Verb.DELETE_EDGE, Verb.SET_OF_EDGE, Verb.PLACE)
_TASK_VERBS = (Verb.REQUEST, Verb.ACKNOWLEDGE, Verb.FINISH, Verb.ABORT)


def apply_operations(change_set: ChangeSet, operations: Iterable[Operation]) -> tuple[Write, ...]:
    """Apply operations of an agent to a change set, and return their writes.

    Raises:
        ValueError: if an operation is a step of a task, or fails.
        LookupError: if an operation fails; TypeError, PermissionError and RuntimeError likewise.
    """
    return tuple(write for operation in operations for write in _apply(change_set, operation))


def nodes_of(operations: Iterable[Operation]) -> Iterator[str]:
    """Yield the names of the nodes that operations read or write."""
    for verb, arguments in operations:
        yield str(arguments[0])
        if verb in _EDGE_VERBS:
            yield str(arguments[2])


def initial_operations(model: KnowledgeModel) -> Iterator[Operation]:
    """Yield the operations that insert the nodes, tasks and edges that a spec declares."""
    for node in model.nodes:
        yield Operation(Verb.INSERT_NODE, (node.name, node.type, node.values))
    for task in model.tasks:
        yield Operation(Verb.INSERT_NODE, (task.name, TASK, {}))
    motions = {edge_type.name: edge_type.motion for edge_type in model.edge_types}
    for edge in model.edges:
        key = (edge.origin, edge.type, edge.target)
        if motions[edge.type] is None:
            yield Operation(Verb.INSERT_EDGE, (*key, edge.values))
        else:
            yield Operation(Verb.PLACE, (*key, edge.pose, None))
            for attribute, value in edge.values.items():
                yield Operation(Verb.SET_OF_EDGE, (*key, attribute, value, None))


def _apply(change_set: ChangeSet, operation: Operation) -> Iterable[Write]:
    """Apply an operation, and return its writes."""
    verb, (first, *rest) = operation
    if verb in _TASK_VERBS:
        raise ValueError(f"{operation.subject!r} is a task: tasks are handed over at one replica, and are never merged")
    deleted_type = change_set.node(first).type if verb is Verb.DELETE_NODE else ""
    change_count = len(change_set.changed_subjects)
    operation.apply(change_set)
    now_s = change_set.now_s
    match verb:
        case Verb.SET:
            return [_node_value(change_set, first, *rest)]
        case Verb.INSERT_NODE:
            type_name, values = rest
            attribute_writes = [_node_value(change_set, first, name, value, None) for name, value in values.items()]
            return [Write(Register(RegisterKind.NODE, (first,)), type_name, True, now_s), *attribute_writes]
        case Verb.DELETE_NODE:
            return [Write(Register(RegisterKind.NODE, (first,)), deleted_type, None, now_s)]
    type_name, target, *rest = rest
    key, label = (first, type_name, target), change_set.schema.edge_type(type_name).label
    edge_register = Register(RegisterKind.EDGE, (first, label, target))
    match verb:
        case Verb.INSERT_EDGE:
            (values,) = rest
            attribute_writes = [_edge_value(change_set, key, name, value, None) for name, value in values.items()]
            if len(change_set.changed_subjects) == change_count + len(values):
                return attribute_writes  # the agent has already inserted this edge
            return [Write(edge_register, type_name, True, now_s), *attribute_writes]
        case Verb.DELETE_EDGE:
            register = Register(RegisterKind.POSE, (target,)) if label == RT else edge_register
            return [Write(register, type_name, None, now_s)]
        case Verb.PLACE:
            return [_pose_write(change_set, *key, *rest)]
    return [_edge_value(change_set, key, *rest)]


def _pose_write(  # noqa: PLR0917 - the arguments of `place`
    change_set: ChangeSet, origin: str, type_name: str, target: str, pose: Pose, stamp_s: float | None
) -> Write:
    pose, evidence_s = pose.checked(), change_set.now_s if stamp_s is None else float(stamp_s)
    content = (origin, *map(float, (*pose.translation_m, *pose.rotation)))
    return Write(Register(RegisterKind.POSE, (target,)), type_name, content, evidence_s)


def _node_value(change_set: ChangeSet, name: str, attribute: str, value: object, evidence_s: float | None) -> Write:
    node = change_set.node(name)
    register = Register(RegisterKind.NODE_ATTRIBUTE, (name, attribute))
    return _value(change_set, register, node.type, change_set.schema.attribute(node, attribute), value, evidence_s)


def _edge_value(
    change_set: ChangeSet, key: tuple[str, str, str], attribute: str, value: object, evidence_s: float | None
) -> Write:
    edge = change_set.edge(*key)
    register = Register(RegisterKind.EDGE_ATTRIBUTE, (*edge.key, attribute))
    declaration = change_set.schema.attribute_of_edge(edge, attribute)
    return _value(change_set, register, edge.type, declaration, value, evidence_s)


def _value(  # noqa: PLR0917 - the fields of a write
    change_set: ChangeSet,
    register: Register,
    type_name: str,
    attribute: Attribute,
    value: Any,
    evidence_s: float | None,
) -> Write:
    content = None if value is None else attribute.convert(value)
    return Write(register, type_name, content, change_set.now_s if evidence_s is None else float(evidence_s))
