"""The operations of agents on the graph, as values.

A transaction can apply an `Operation` again if another write has changed the graph meanwhile, a journal can record the
`Operation`, and a replay can repeat it. Where none of these is needed, a change is applied without an `Operation`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple

from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.knowledge import handshake
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.state import Request
from codra_dsl.runtime.values.model import unbox

_POSE_NUMBER_COUNT = 7


class Verb(StrEnum):
    """The kinds of operations, named after the methods of `Writer`; the last two are those of the graph itself."""

    INSERT_NODE = "insert_node"
    DELETE_NODE = "delete_node"
    SET = "set"
    INSERT_EDGE = "insert_edge"
    DELETE_EDGE = "delete_edge"
    SET_OF_EDGE = "set_of_edge"
    PLACE = "place"
    REQUEST = "request"
    ACKNOWLEDGE = "acknowledge"
    FINISH = "finish"
    ABORT = "abort"
    ABANDON = "abandon"
    EXPIRE = "expire"


SET, INSERT_NODE, INSERT_EDGE = Verb.SET, Verb.INSERT_NODE, Verb.INSERT_EDGE
"""The most frequent verbs as constants, because Python 3.11 is slow at looking up a member of an enum."""


class Operation(NamedTuple):
    """One operation on the graph: its verb and its arguments."""

    verb: Verb
    arguments: tuple[Any, ...]

    def apply(self, change_set: ChangeSet) -> Any:
        """Apply the operation to a change set; return its result."""
        change_set.operation = self
        return HANDLERS[self.verb](change_set, *self.arguments)

    @property
    def subject(self) -> str:
        """Return the subject: a node, `node.attribute`, an edge, an edge's attribute, or a task."""
        first, *rest = self.arguments
        match self.verb:
            case Verb.SET:
                return f"{first}.{rest[0]}"
            case Verb.INSERT_EDGE | Verb.DELETE_EDGE | Verb.PLACE:
                return edge_name(first, *rest[:2])
            case Verb.SET_OF_EDGE:
                return f"{edge_name(first, *rest[:2])}.{rest[2]}"
            case _:
                return str(first.task if isinstance(first, Request) else first)

    def plain_data(self) -> list[Any]:
        """Return the operation as data for JSON: the verb, then the arguments."""
        return [self.verb, *map(_to_plain_data, self.arguments)]


def edge_name(origin: str, type_name: str, target: str) -> str:
    """Return the name of an edge in events."""
    return f"{origin} -{type_name}-> {target}"


def operations_text(operations: Iterable[Operation]) -> str:
    """Return operations as JSON."""
    return json_text([operation.plain_data() for operation in operations])


def operations_of(plain_data: Iterable[list[Any]]) -> tuple[Operation, ...]:
    """Return the operations that plain data describes.

    Raises:
        ValueError: if the data is not a list of operations; IndexError and TypeError likewise.
    """
    return tuple(_operation_of(Verb(verb), *arguments) for verb, *arguments in plain_data)


def _operation_of(verb: Verb, *arguments: Any) -> Operation:
    if verb is Verb.PLACE:
        *edge, pose, stamp_s = arguments
        return Operation(verb, (*edge, Pose(tuple(pose[:3]), tuple(pose[3:_POSE_NUMBER_COUNT])), stamp_s))
    if verb in (Verb.ACKNOWLEDGE, Verb.FINISH, Verb.ABORT):
        return Operation(verb, (Request(*arguments[0]), *arguments[1:]))
    return Operation(verb, arguments)


def _to_plain_data(argument: Any) -> Any:
    if isinstance(argument, Pose):
        return [float(number) for number in (*argument.translation_m, *argument.rotation)]
    if isinstance(argument, Mapping):
        return {str(name): _to_plain_data(nested_value) for name, nested_value in argument.items()}
    return list(argument) if isinstance(argument, tuple) else unbox(argument)


HANDLERS: Mapping[Verb, Callable[..., Any]] = {
    Verb.INSERT_NODE: ChangeSet.insert_node,
    Verb.DELETE_NODE: ChangeSet.delete_node,
    Verb.SET: ChangeSet.set,
    Verb.INSERT_EDGE: ChangeSet.insert_edge,
    Verb.DELETE_EDGE: ChangeSet.delete_edge,
    Verb.SET_OF_EDGE: ChangeSet.set_of_edge,
    Verb.PLACE: ChangeSet.place,
    Verb.REQUEST: handshake.request,
    Verb.ACKNOWLEDGE: handshake.acknowledge,
    Verb.FINISH: handshake.finish,
    Verb.ABORT: handshake.abort,
    Verb.ABANDON: handshake.abandon,
    Verb.EXPIRE: handshake.expire,
}
"""For each verb, the function that applies the operation with its arguments to a change set and returns the result."""
