"""Commits: the writes of transactions, as values that replicas exchange and store.

A transaction of an agent becomes one commit. Each of its operations becomes writes to registers: whether a node or an
edge exists, the value of an attribute, and the pose of a node. A node has one register for its pose and its parent, so
it never has two parents.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple, cast

from codra_dsl.runtime.geometry import Pose, Quaternion, Vector
from codra_dsl.runtime.replication.hybrid_time import HybridTime, Stamp


class RegisterKind(StrEnum):
    """The kind of content of a register."""

    NODE = "node"
    EDGE = "edge"
    POSE = "pose"
    NODE_ATTRIBUTE = "node_attribute"
    EDGE_ATTRIBUTE = "edge_attribute"


_PATH_LENGTHS: Mapping[RegisterKind, int] = {
    RegisterKind.NODE: 1,
    RegisterKind.EDGE: 3,
    RegisterKind.POSE: 1,
    RegisterKind.NODE_ATTRIBUTE: 2,
    RegisterKind.EDGE_ATTRIBUTE: 4,
}

POSE_LENGTH = 8
"""The length of the content of a pose: the parent, the translation in metres, and the quaternion."""


class Register(NamedTuple):
    """The name of a register.

    Attributes:
        kind: the kind of content.
        path: the node, or the origin, label and target of the edge; then the attribute, if there is one.
    """

    kind: RegisterKind
    path: tuple[str, ...]


class Write(NamedTuple):
    """A write to a register.

    Attributes:
        register: the register.
        type: the type of the node or edge; for a pose, the type of the edge that holds it.
        content: True for a node or edge, a value for an attribute, the parent and seven numbers for a pose. None
            deletes a node or edge, makes an attribute unknown, or ends a pose.
        evidence_s: when the evidence was taken.
    """

    register: Register
    type: str
    content: Any
    evidence_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Commit:
    """The writes of one transaction.

    Attributes:
        replica: the replica on which the transaction was made.
        number: the number of the commit among all commits of this replica, from 1.
        time: the instant of the commit.
        author: the agent that made the transaction.
        writes: the writes, in the order of the operations.
    """

    replica: str
    number: int
    time: HybridTime
    author: str
    writes: tuple[Write, ...]

    def stamp(self, position: int) -> Stamp:
        """Return the stamp of the write at a position."""
        return Stamp(*self.time, self.author, self.replica, position)

    def plain_data(self) -> list[Any]:
        """Return the commit as data for JSON."""
        writes = [_plain_write(write) for write in self.writes]
        return [self.replica, self.number, *self.time, self.author, writes]


def commit_of(plain_data: Any) -> Commit:
    """Return the commit that plain data describe.

    Raises:
        ValueError: if the data describe no commit.
    """
    match plain_data:
        case [str(replica), int(number), physical_s, counter, str(author), list(writes)] if number > 0:
            time = time_of([physical_s, counter])
            decoded_writes = tuple(_write_of(write) for write in writes)
            return Commit(replica=replica, number=number, time=time, author=author, writes=decoded_writes)
    raise ValueError(f"this is not a commit: {plain_data!r:.100}")


def time_of(plain_data: Any) -> HybridTime:
    """Return the instant that plain data describe; raise `ValueError` if they describe none."""
    match plain_data:
        case [int() | float() as physical_s, int(counter)] if physical_s < math.inf and counter >= 0:
            return HybridTime(float(physical_s), counter)
    raise ValueError(f"this is not the time of a replica: {plain_data!r:.100}")


def pose_of(content: tuple[Any, ...]) -> Pose:
    """Return the pose in the content of a write."""
    return Pose(cast("Vector", content[1:4]), cast("Quaternion", content[4:]))


def plain_stamped_write(write: Write, stamp: Stamp) -> list[Any]:
    """Return a write and its stamp as data for JSON."""
    return [_plain_write(write), list(stamp)]


def stamped_write_of(plain_data: Any) -> tuple[Write, Stamp]:
    """Return the write and the stamp that plain data describe; raise `ValueError` if they describe none."""
    match plain_data:
        case [write, [physical_s, counter, str(author), str(replica), int(position)]]:
            return _write_of(write), Stamp(*time_of([physical_s, counter]), author, replica, position)
    raise ValueError(f"this is not a write with a stamp: {plain_data!r:.100}")


def _plain_write(write: Write) -> list[Any]:
    content = list(write.content) if isinstance(write.content, tuple) else write.content
    return [write.register.kind, list(write.register.path), write.type, content, write.evidence_s]


def _write_of(plain_data: Any) -> Write:
    match plain_data:
        case [str(kind), list(path), str(type_name), content, int() | float() as evidence_s]:
            register = Register(RegisterKind(kind), tuple(path))
            if len(path) == _PATH_LENGTHS[register.kind] and _are_names(path):
                content = tuple(content) if isinstance(content, list) else content
                return Write(register, type_name, content, float(evidence_s))
    raise ValueError(f"this is not a write: {plain_data!r:.100}")


def _are_names(path: Iterable[Any]) -> bool:
    return all(isinstance(name, str) and name for name in path)
