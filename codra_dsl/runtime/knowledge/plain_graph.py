"""Graphs and their changes as plain data, from which another program makes an equal copy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.geometry import Frames, Motion, Pose
from codra_dsl.runtime.geometry.motion import Track, TrackEntry
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Attribute, Edge, EdgeKey, History, Node
from codra_dsl.runtime.knowledge.graph_index import GraphIndex
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema, Stage
from codra_dsl.runtime.knowledge.operations import operations_of
from codra_dsl.runtime.knowledge.shared_graph import GraphChange
from codra_dsl.runtime.knowledge.state import Handover, State
from codra_dsl.runtime.values.cell import Override, Reading, Reason
from codra_dsl.runtime.values.persistent import PersistentMap

PlainGraph = Mapping[str, Any]
"""A state, or a change, of a graph: texts, numbers, truth values, None, and lists of these."""


def plain_state(state: State) -> dict[str, Any]:
    """Return a state as plain data."""
    return {
        "since_s": state.since_s,
        "version": state.version,
        "next_number": state.next_number,
        "nodes": [_plain_element(node[:3], node, state.version) for node in state.nodes.values()],
        "edges": [_plain_element(edge[:5], edge, state.version) for edge in state.edges.values()],
        "tracks": [
            [name, list(map(_plain_entry, state.frames.track(name).entries()))] for name in state.frames.names()
        ],
        "handovers": [list(handover) for handover in state.handovers.values()],
        "deletions": [list(deletion) for deletion in state.deletion_times_s.items()],
    }


def state_of(plain: PlainGraph, schema: GraphSchema) -> State:
    """Return the state that plain data describes.

    Raises:
        ValueError: if the data does not describe a state of a graph with this schema; LookupError and TypeError
            likewise.
    """
    nodes = {node.name: node for node in (_node(schema, *fields) for fields in plain["nodes"])}
    edges = {edge.key: edge for edge in (_edge(schema, *fields) for fields in plain["edges"])}
    index = GraphIndex()
    for node in nodes.values():
        index.add_node(node.name, node.type)
    for key in edges:
        index.add_edge(key)
    return State(
        since_s=plain["since_s"],
        version=plain["version"],
        next_number=plain["next_number"],
        nodes=PersistentMap[str, Node]().with_changes(nodes),
        edges=PersistentMap[EdgeKey, Edge]().with_changes(edges),
        index=index,
        frames=Frames.of({name: Track.of(_entry(*fields) for fields in entries) for name, entries in plain["tracks"]}),
        handovers={fields[0]: _handover(*fields) for fields in plain["handovers"]},
        deletion_times_s=dict(plain["deletions"]),
    )


def plain_change(change: GraphChange) -> dict[str, Any]:
    """Return a change as plain data."""
    return {
        "version": change.version,
        "instant_s": change.instant_s,
        "agent": change.agent,
        "operations": [operation.plain_data() for operation in change.operations],
        "variable": change.variable,
        "reading": None if change.reading is None else _plain_reading(change.reading),
    }


def change_of(plain: PlainGraph) -> GraphChange:
    """Return the change that plain data describes.

    Raises:
        ValueError: if the data does not describe a change; LookupError and TypeError likewise.
    """
    reading = plain["reading"]
    return GraphChange(
        version=plain["version"],
        instant_s=plain["instant_s"],
        agent=plain["agent"],
        operations=operations_of(plain["operations"]),
        variable=plain["variable"],
        reading=None if reading is None else _reading(*reading),
    )


def _plain_element(identity: Sequence[Any], element: Node | Edge, version: int) -> list[Any]:
    histories = [
        [
            name,
            list(map(_plain_reading, history.readings_of_sources_at(version))),
            None if history.override is None else _plain_reading(history.override),
        ]
        for name, history in element.histories.items()
    ]
    return [*identity, element.writer, element.since_s, histories]


def _node(schema: GraphSchema, *fields: Any) -> Node:
    name, type_name, number, writer, since_s, histories = fields
    node = Node(name, type_name, number, NO_HISTORIES, writer, since_s)
    return node._replace(histories=_histories(lambda name: schema.attribute(node, name), node.name, histories))


def _edge(schema: GraphSchema, *fields: Any) -> Edge:
    origin, label, target, type_name, number, writer, since_s, histories = fields
    edge = Edge(origin, label, target, type_name, number, NO_HISTORIES, writer, since_s)
    return edge._replace(histories=_histories(lambda name: schema.attribute_of_edge(edge, name), str(edge), histories))


def _histories(attribute: Any, element: str, plain_histories: Iterable[Sequence[Any]]) -> Mapping[str, History]:
    return {
        name: _history(attribute(name), f"{element}.{name}", readings, override)
        for name, readings, override in plain_histories
    }


def _history(attribute: Attribute, subject: str, readings: Iterable[Any], plain_override: Any) -> History:
    override = None if plain_override is None else _reading(*plain_override)
    assert override is None or isinstance(override, Override)
    return History.of(attribute, subject, (_reading(*fields) for fields in readings), override)


_INSTANTS = ("evidence_s", "start_s", "identified_s", "expires_s")
_READING_FIELDS = ("name", "content", "reason", "detail", *_INSTANTS, "source")


def _plain_reading(reading: Reading[Value]) -> list[Any]:
    """Return the fields of a reading; of an override, the fields of the reading beneath it follow."""
    fields = [getattr(reading, name) for name in _READING_FIELDS]
    return [*fields, _plain_reading(reading.beneath)] if isinstance(reading, Override) else fields


def _reading(*fields: Any) -> Reading[Value]:
    content = dict(zip(_READING_FIELDS, fields, strict=False))
    content["reason"] = None if content["reason"] is None else Reason(content["reason"])
    if len(fields) == len(_READING_FIELDS):
        return Reading(**content)
    return Override(**content, beneath=_reading(*fields[-1]))


def _plain_entry(entry: TrackEntry) -> list[Any]:
    pose = [float(number) for number in (*entry.pose.translation_m, *entry.pose.rotation)]
    return [entry.stamp_s, entry.parent, pose, list(astuple(entry.motion))]


def _entry(stamp_s: float, parent: str | None, pose: Sequence[float], motion: Sequence[Any]) -> TrackEntry:
    history_s, extrapolate_s, valid_for_s, is_static = motion
    return TrackEntry(
        stamp_s,
        parent,
        Pose(tuple(pose[:3]), tuple(pose[3:])),  # type: ignore[arg-type]
        Motion(history_s=history_s, extrapolate_s=extrapolate_s, valid_for_s=valid_for_s, is_static=is_static),
    )


def _handover(task: str, stage: str | None, *rest: Any) -> Handover:
    return Handover(task, None if stage is None else Stage(stage), *rest)
