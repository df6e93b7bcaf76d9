"""The check of commits of other replicas: types, and P2's mapping from agents to the elements that they write.

The check uses only the spec and the commit, never the present graph. So all replicas of a spec refuse the same commits.
"""

from __future__ import annotations

import math

from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Attribute, Node
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.permissions import GRAPH_WRITER, Permissions
from codra_dsl.runtime.replication.commits import POSE_LENGTH, Commit, Register, RegisterKind, Write, pose_of
from codra_dsl.runtime.replication.hybrid_time import Stamp
from codra_dsl.runtime.replication.merge import Entry
from codra_dsl.runtime.values.model import text

_convert_name = text().converter()
"""Checks that a name is text that can be written to a file."""


def entries_of(schema: GraphSchema, commit: Commit) -> tuple[tuple[Register, Entry], ...]:
    """Return the entries that a commit adds to registers.

    Raises:
        PermissionError: if the author may not make one of the writes; the whole commit counts as refused.
        LookupError: if the spec does not declare a type or an attribute.
        ValueError: if a value does not have its type, or the evidence is newer than the commit.
    """
    if commit.author == GRAPH_WRITER:
        raise PermissionError("a commit needs an author: only the initial graph has none")
    stamped_writes = ((write, commit.stamp(position)) for position, write in enumerate(commit.writes))
    return tuple((write.register, entry_of(schema, write, stamp)) for write, stamp in stamped_writes)


def entry_of(schema: GraphSchema, write: Write, stamp: Stamp) -> Entry:
    """Return the entry of one write; this raises the errors of `entries_of`. The initial graph has no author."""
    if not -math.inf < write.evidence_s <= stamp.physical_s:
        raise ValueError(f"the evidence for {write.register.path} is not finite, or newer than its commit")
    permissions = _permissions(schema, write)
    permissions.check(stamp.author, " ".join(write.register.path))
    return Entry(write.type, permissions.priority(stamp.author), write.content, write.evidence_s, stamp)


def _permissions(schema: GraphSchema, write: Write) -> Permissions:
    """Return the permissions for a write, after a check of its content."""
    (kind, path), content = write.register, write.content
    match kind:
        case RegisterKind.NODE_ATTRIBUTE:
            schema.node_type(write.type)
            attribute = schema.attribute(Node(path[0], write.type, 0, NO_HISTORIES, "", 0.0), path[1])
            return _permissions_of_value(attribute, content)
        case RegisterKind.EDGE_ATTRIBUTE:
            return _permissions_of_value(schema.edge_type(write.type).attributes[path[3]], content)
        case RegisterKind.POSE:
            edge_type = schema.edge_type(write.type)
            if edge_type.label != RT or (content is not None and not _is_pose(content)):
                raise ValueError(f"this is not a pose on an edge of type {write.type!r}: {content!r:.100}")
            return edge_type.permissions
    if content is not None and content is not True:
        raise ValueError(f"this is neither the insertion nor the deletion of a {kind}: {content!r:.100}")
    if kind is RegisterKind.NODE:
        _convert_name(path[0])
        return schema.node_type(write.type).permissions
    edge_type = schema.edge_type(write.type)
    if edge_type.label != path[1] or edge_type.label == RT:
        raise ValueError(f"edges of type {write.type!r} do not have the label {path[1]!r}, or have a pose")
    return edge_type.permissions


def _permissions_of_value(attribute: Attribute, content: object) -> Permissions:
    if content is not None and attribute.convert(content) != content:
        raise ValueError(f"{content!r:.100} is not a value of {attribute.model.name!r}")
    return attribute.permissions


def _is_pose(content: object) -> bool:
    if not isinstance(content, tuple) or len(content) != POSE_LENGTH or not isinstance(content[0], str):
        return False
    return all(type(number) is float for number in content[1:]) and pose_of(content).checked() == pose_of(content)
