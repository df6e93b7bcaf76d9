"""What an agent does to the graph, as values: applied to a draft, told to a journal, and read back for a replay."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Any, NamedTuple

from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.knowledge import handshake
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.state import Request
from codra_dsl.runtime.values.model import unboxed

_POSE_NUMBERS = 7


class Verb(StrEnum):
    """What can be done, by the name of the method of `Writer` that does it."""

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


SET, INSERT_NODE, INSERT_EDGE = Verb.SET, Verb.INSERT_NODE, Verb.INSERT_EDGE
"""What is done most, by names of its own: Python 3.11 takes its time to find a member of an enum."""


class Operation(NamedTuple):
    """One thing that is done to the graph, and with what."""

    verb: Verb
    given: tuple[Any, ...]

    def apply(self, change_set: ChangeSet) -> Any:
        """Do it in a draft; return what the agent is told."""
        change_set.operation = self
        return HANDLERS[self.verb](change_set, *self.given)

    @property
    def subject(self) -> str:
        """Return what it is about: a node, `node.attribute`, an edge, its attribute, or a task."""
        first, *rest = self.given
        match self.verb:
            case Verb.SET:
                return f"{first}.{rest[0]}"
            case Verb.INSERT_EDGE | Verb.DELETE_EDGE | Verb.PLACE:
                return edge_name(first, *rest[:2])
            case Verb.SET_OF_EDGE:
                return f"{edge_name(first, *rest[:2])}.{rest[2]}"
            case _:
                return str(first.task if isinstance(first, Request) else first)

    def plain(self) -> list[Any]:
        """Return it as JSON can hold it: the verb, then what is given."""
        return [self.verb, *map(_plain, self.given)]


def edge_name(origin: str, type_name: str, target: str) -> str:
    """Return how events call an edge."""
    return f"{origin} -{type_name}-> {target}"


def operations_text(operations: Iterable[Operation]) -> str:
    """Return operations as JSON."""
    return json_text([operation.plain() for operation in operations])


def operations_of(plain: Iterable[list[Any]]) -> tuple[Operation, ...]:
    """Return the operations that plain data tells.

    Raises:
        ValueError: if it tells none; IndexError and TypeError likewise.
    """
    return tuple(_operation_of(Verb(verb), *given) for verb, *given in plain)


def _operation_of(verb: Verb, *given: Any) -> Operation:
    if verb is Verb.PLACE:
        *edge, pose, stamp_s = given
        return Operation(verb, (*edge, Pose(tuple(pose[:3]), tuple(pose[3:_POSE_NUMBERS])), stamp_s))
    if verb in (Verb.ACKNOWLEDGE, Verb.FINISH, Verb.ABORT):
        return Operation(verb, (Request(*given[0]), *given[1:]))
    return Operation(verb, given)


def _plain(given: Any) -> Any:
    if isinstance(given, Pose):
        return [float(number) for number in (*given.translation_m, *given.rotation)]
    if isinstance(given, Mapping):
        return {str(name): _plain(part) for name, part in given.items()}
    return list(given) if isinstance(given, tuple) else unboxed(given)


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
}
"""What each verb does in a draft, with what is given; it returns what the agent is told."""
