"""Changes of a graph, collected in a change set that is invisible until it is complete.

Until `state` is called, a change set keeps its changes outside the graph. If the changes are refused or abandoned
before this call, no map and no history of the graph has changed. After this call, `undo` removes their readings. The
index may keep names and keys that were never committed. Each change is checked against the declarations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import NotASourceError
from codra_dsl.runtime.geometry import Outcome, Pose
from codra_dsl.runtime.knowledge.declarations import RT, TASK, EdgeModel, KnowledgeModel
from codra_dsl.runtime.knowledge.elements import (
    NO_HISTORIES,
    Attribute,
    Edge,
    EdgeKey,
    ElementT,
    History,
    Node,
    make_tuple,
)
from codra_dsl.runtime.knowledge.graph_schema import EdgeType, GraphSchema
from codra_dsl.runtime.knowledge.state import Handover, State
from codra_dsl.runtime.values.cell import Override, Reading
from codra_dsl.runtime.values.model import NotOfTypeError, text
from codra_dsl.runtime.values.persistent import PersistentMap

_convert_name = text().converter()
"""Checks that a name is text that can be written to a file."""

_DELETED_NODE_HISTORY_S = 10.0
"""How long the poses of a deleted node are kept if the history of its edge has no limit."""

ChangeSubject = tuple[str, str]
"""The subject of a change, as a pair: `node` or `edge` and a type; `frame` and a node; or a node and an attribute."""


class ChangeRecord(NamedTuple):
    """The event of one change, for the event log."""

    name: str
    what: str
    details: Mapping[str, object]


KeyT = TypeVar("KeyT")

_NewReadings = list[tuple[History, Reading[Value]]]
"""The new readings of a node or edge, each with its attribute's earlier history, which can be empty."""


class AbsentError(LookupError):
    """The graph has no such node or edge."""


class PresentError(ValueError):
    """The graph already has a node of this name."""


class ChangeSet:
    """The changes that one agent makes to a state at one instant.

    Attributes:
        schema: the declarations of the graph.
        agent: the agent that makes the changes.
        now_s: the instant.
        changed_subjects: the subjects of the changes.
        deadlines: the new deadlines of tasks, each with the handover that is aborted at the deadline.
        context_readings: readings of attributes that are context-variables, in the order in which they were written.
        records: the changes as events for the event log; None if no events are recorded.
        operation: the latest operation.
    """

    __slots__ = (
        "_new_edges",
        "_new_nodes",
        "_new_readings",
        "_state",
        "agent",
        "changed_subjects",
        "context_readings",
        "deadlines",
        "now_s",
        "operation",
        "records",
        "schema",
    )

    def __init__(
        self, schema: GraphSchema, state: State, now_s: float, agent: str, records: list[ChangeRecord] | None = None
    ) -> None:
        self.schema = schema
        self._state = state.next(now_s)
        self._new_nodes: dict[str, Node | None] = {}
        self._new_edges: dict[EdgeKey, Edge | None] = {}
        self._new_readings: dict[str | EdgeKey, _NewReadings] = {}
        self.agent = agent
        self.now_s = now_s
        self.changed_subjects: list[ChangeSubject] = []
        self.deadlines: tuple[tuple[float, Handover], ...] = ()
        self.context_readings: tuple[Reading[Value], ...] = ()
        self.records = records
        self.operation: Any = None

    def state(self) -> State:
        """Return the state with all changes.

        Call this method once, and only if the change set starts from the present state.
        """
        state = self._state
        for key, histories_and_readings in self._new_readings.items():
            if isinstance(key, str):
                self._append_readings(state.nodes, self._new_nodes, key, histories_and_readings)
            else:
                self._append_readings(state.edges, self._new_edges, key, histories_and_readings)
        if self._new_nodes:
            state.nodes = state.nodes.with_changes(self._new_nodes)
        if self._new_edges:
            state.edges = state.edges.with_changes(self._new_edges)
        index = state.index
        if index.addition_count > index.compaction_threshold:
            state.index = index.compacted_index(state.nodes, state.edges)
        return state

    def _append_readings(
        self,
        elements: PersistentMap[KeyT, ElementT],
        changed_elements: dict[KeyT, ElementT | None],
        key: KeyT,
        histories_and_readings: _NewReadings,
    ) -> None:
        """Add readings to the histories of attributes; new histories are stored in the node or edge."""
        element = changed_elements.get(key) or elements[key]
        for history, reading in histories_and_readings:
            existing_history = element.histories.get(history.attribute.model.name)
            updated_history = (existing_history or history).with_reading(reading, self._state.version)
            if updated_history is not existing_history:
                changed_elements[key] = element = element.with_history(updated_history)

    def undo(self) -> None:
        """Remove the readings that `state` has added to histories; call this if the new state is not used."""
        for histories_and_readings in self._new_readings.values():
            for history, reading in histories_and_readings:
                history.remove(reading)

    def starts_from(self, state: State) -> bool:
        """Return whether the change set starts from a given state."""
        return self._state.version == state.version + 1

    def adopt(self, other: ChangeSet) -> None:
        """Take over the changes of another change set that starts from the same state."""
        for name in ChangeSet.__slots__:
            if name != "now_s":  # the state becomes the present one now, not when the other change set was begun
                setattr(self, name, getattr(other, name))
        self._state.since_s = self.now_s

    # Nodes

    def insert_node(self, name: str, type_name: str, values: Mapping[str, object]) -> None:
        """Insert a node."""
        node_type = self.schema.node_type(type_name)
        if self.agent not in node_type.permissions.writers:
            node_type.permissions.refuse(self.agent, f"nodes of type {type_name}")
        if not isinstance(name, str) or not name:
            raise ValueError(f"the name of a node must be a text that is not empty, not {name!r}")
        _convert_name(name)
        if self.has_node(name):
            raise PresentError(f"the node {name!r} already exists")
        state = self._state
        number = state.next_number
        state.next_number = number + 1
        self._new_nodes[name] = make_tuple(Node, (name, type_name, number, NO_HISTORIES, self.agent, self.now_s, 0))
        state.index.add_node(name, type_name)
        self.changed_subjects.append(("node", type_name))
        if self.records is not None:
            self._record(name, "node_inserted", type=type_name)
        for attribute, value in values.items():
            self.set(name, attribute, value, None)

    def delete_node(self, name: str) -> None:
        """Delete a node and all edges to and from it.

        The past poses of the node stay available for the length of their history, or for 10 s if there is no limit.
        """
        node = self.node(name)
        permissions = self.schema.node_type(node.type).permissions
        permissions.check(self.agent, f"nodes of type {node.type}")
        if name in self.schema.nodes_of_context:
            raise NotASourceError(f"the node {name!r} cannot be deleted: some of its attributes are context-variables")
        if permissions.is_ranked:
            permissions.check_rank(self.agent, node.writer, name)
        for key in sorted({*self._state.index.outgoing_keys(name), *self._state.index.incoming_keys(name)}):
            self.discard_edge(key)
        self._new_nodes[name] = None  # readings of the deleted node must not go to a new node of the same name
        self._new_readings.pop(name, None)
        if name in self._state.frames:
            self._end_frame(name)
        self.changed_subjects.append(("node", node.type))
        self.changed_subjects.extend((name, attribute) for attribute in node.histories)
        if self.records is not None:
            self._record(name, "node_deleted", type=node.type)

    def has_node(self, name: str) -> bool:
        """Return whether a node exists after the changes so far."""
        return (self._new_nodes[name] if name in self._new_nodes else self._state.nodes.get(name)) is not None

    def node(self, name: str) -> Node:
        """Return a node as it is after the changes so far."""
        node = self._new_nodes[name] if name in self._new_nodes else self._state.nodes.get(name)
        if node is None:
            raise AbsentError(f"the node {name!r} does not exist")
        return node

    def set(self, name: str, attribute: str, value: object, evidence_s: float | None) -> None:
        """Write an attribute of a node."""
        history = self.history(name, attribute)
        if self.agent not in history.attribute.permissions.writers:
            history.attribute.permissions.refuse(self.agent, history.subject)
        self._write(name, history, value, evidence_s)

    def write(self, name: str, attribute: str, value: object) -> None:
        """Write an attribute of a node without a permission check."""
        self._write(name, self.history(name, attribute), value, None)

    def _write(self, name: str, history: History, value: object, evidence_s: float | None) -> None:
        reading = history.make_reading(self.agent, self.now_s, value, evidence_s, self._state.version - 1)
        self.add_reading(name, history, reading)
        if history.attribute.variable:
            self.context_readings += (reading,)
        elif self.records is not None:
            self._record_reading(history.attribute, reading)

    def history(self, name: str, attribute: str) -> History:
        """Return the history that an attribute of a node had before this change set; empty if it was never written."""
        node = self.node(name)
        return node.histories.get(attribute) or History(self.schema.attribute(node, attribute), f"{name}.{attribute}")

    def add_reading(self, name: str, history: History, reading: Reading[Value]) -> None:
        """Add a reading of an attribute of a node."""
        self._new_readings.setdefault(name, []).append((history, reading))
        self.changed_subjects.append((name, history.attribute.model.name))

    def set_override(self, name: str, attribute: str, override: Override | None) -> None:
        """Let an override hide the readings of an attribute that is a context-variable; None ends the override."""
        node, history = self.node(name), self.history(name, attribute).with_override(override)
        self._new_nodes[name] = node.without_history(attribute) if history.is_empty else node.with_history(history)
        self.changed_subjects.append((name, attribute))

    # Edges

    def insert_edge(self, origin: str, type_name: str, target: str, values: Mapping[str, object]) -> None:
        """Insert an edge without a pose, or write attributes of an existing one."""
        edge_type = self.schema.edge_type(type_name)
        if self.agent not in edge_type.permissions.writers:
            edge_type.permissions.refuse(self.agent, f"edges of type {type_name}")
        if edge_type.model.motion is not None:
            raise ValueError(
                f"edges of type {type_name!r} have a pose: use place() for {target!r} relative to {origin!r}"
            )
        self.upsert_edge(edge_type, origin, target)
        for attribute, value in values.items():
            self.set_of_edge(origin, type_name, target, attribute, value, None)

    def upsert_edge(self, edge_type: EdgeType, origin: str, target: str) -> None:
        """Insert an edge without a permission check, or update the last writer of an existing one."""
        label, type_name = edge_type.label, edge_type.model.name
        key = (origin, label, target)
        present_edge = self._edge_at(key)
        if present_edge is not None and present_edge.type == type_name:
            if present_edge.writer != self.agent:
                if edge_type.permissions.is_ranked:
                    edge_type.permissions.check_rank(self.agent, present_edge.writer, str(present_edge))
                self._new_edges[key] = present_edge._replace(writer=self.agent)
                self.changed_subjects.append(("edge", type_name))
                if self.records is not None:
                    self._record_edge(present_edge, "edge_inserted")
            return
        origin_node, target_node = self.node(origin), self.node(target)
        if not edge_type.fits(origin_node, target_node):
            raise NotOfTypeError(
                f"edges of type {type_name!r} go from {' or '.join(edge_type.model.origins)} to "
                f"{' or '.join(edge_type.model.targets)}, "
                f"not from {origin_node.type} {origin!r} to {target_node.type} {target!r}"
            )
        if present_edge is not None:
            self._remove_edge(present_edge)
        state = self._state
        number = state.next_number
        state.next_number = number + 1
        fields = (origin, label, target, type_name, number, NO_HISTORIES, self.agent, self.now_s, 0)
        self._new_edges[key] = edge = make_tuple(Edge, fields)
        state.index.add_edge(key)
        self.changed_subjects.append(("edge", type_name))
        if self.records is not None:
            self._record_edge(edge, "edge_inserted")

    def delete_edge(self, origin: str, type_name: str, target: str) -> None:
        """Delete an edge. If the edge held the pose of its target, the target has no pose from now on."""
        edge_type = self.schema.edge_type(type_name)
        edge_type.permissions.check(self.agent, f"edges of type {type_name}")
        edge = self.edge(origin, type_name, target)
        if edge_type.permissions.is_ranked:
            edge_type.permissions.check_rank(self.agent, edge.writer, str(edge))
        self._remove_edge(edge)

    def edge(self, origin: str, type_name: str, target: str) -> Edge:
        """Return an edge as it is after the changes so far."""
        edge = self._edge_at((origin, self.schema.edge_type(type_name).label, target))
        if edge is None or edge.type != type_name:
            raise AbsentError(f"the edge {origin} -{type_name}-> {target} does not exist")
        return edge

    def set_of_edge(  # noqa: PLR0917 - three names identify an edge; the other arguments are those of `set`
        self, origin: str, type_name: str, target: str, attribute: str, value: object, evidence_s: float | None
    ) -> None:
        """Write an attribute of an edge."""
        edge = self.edge(origin, type_name, target)
        attribute_declaration = self.schema.attribute_of_edge(edge, attribute)
        history = edge.histories.get(attribute) or History(attribute_declaration, f"{edge}.{attribute}")
        attribute_declaration.permissions.check(self.agent, history.subject)
        reading = history.make_reading(self.agent, self.now_s, value, evidence_s, self._state.version - 1)
        self._new_readings.setdefault(edge.key, []).append((history, reading))
        self.changed_subjects.append(("edge", type_name))
        if self.records is not None:
            self._record_reading(attribute_declaration, reading, f"{origin} -{type_name}-> {target}.{attribute}")

    def _edge_at(self, key: EdgeKey) -> Edge | None:
        new_edges = self._new_edges
        return new_edges[key] if new_edges and key in new_edges else self._state.edges.get(key)

    def discard_edge(self, key: EdgeKey) -> None:
        """Remove an edge, if it exists, without a permission check."""
        edge = self._edge_at(key)
        if edge is not None:
            self._remove_edge(edge)

    def insert_initial_graph(self, model: KnowledgeModel) -> None:
        """Write the initial nodes, tasks and edges."""
        for node in model.nodes:
            self.insert_node(node.name, node.type, node.values)
        for task in model.tasks:
            self.insert_node(task.name, TASK, {})
        for edge in model.edges:
            self._insert_initial_edge(edge)

    def _insert_initial_edge(self, model: EdgeModel) -> None:
        """Insert a declared initial edge; its pose, if it has one, is valid from now on."""
        if self.schema.edge_type(model.type).model.motion is None:
            self.insert_edge(model.origin, model.type, model.target, model.values)
            return
        self.place(model.origin, model.type, model.target, model.pose, None)
        for attribute, value in model.values.items():
            self.set_of_edge(model.origin, model.type, model.target, attribute, value, None)

    # Geometry

    def place(self, origin: str, type_name: str, target: str, pose: Pose, stamp_s: float | None) -> None:
        """Set the pose of a node relative to another node. The pose holds from the instant `stamp_s`."""
        edge_type = self.schema.edge_type(type_name)
        edge_type.permissions.check(self.agent, f"edges of type {type_name}")
        motion = edge_type.model.motion
        if motion is None:
            raise ValueError(f"edges of type {type_name!r} have no pose: use insert_edge()")
        stamp_s = self.now_s if stamp_s is None else float(stamp_s)
        if not stamp_s <= self.now_s:
            raise ValueError(f"a pose of {target!r} cannot be from {stamp_s}: the present instant is {self.now_s}")
        present_edge = self._parent_edge(target)
        if present_edge is not None and present_edge.writer != self.agent and edge_type.permissions.is_ranked:
            self._check_rank_of_pose(edge_type, present_edge)
        if (
            present_edge is None
            or present_edge.origin != origin
            or present_edge.type != type_name
            or present_edge.writer != self.agent
        ):
            self._place_on_another_edge(edge_type, origin, target, pose, stamp_s, present_edge)
        else:
            self._state.frames = self._state.frames.with_pose(target, origin, pose, stamp_s, motion)
        self.changed_subjects.append(("frame", target))
        if self.records is not None:
            pose_details = {"translation_m": list(pose.translation_m), "rotation": list(pose.rotation)}
            self._record(f"{origin} -{type_name}-> {target}", "placed", label=RT, evidence_s=stamp_s, **pose_details)

    def _place_on_another_edge(  # noqa: PLR0917 - the arguments of `place`
        self, edge_type: EdgeType, origin: str, target: str, pose: Pose, stamp_s: float, present_edge: Edge | None
    ) -> None:
        """Set the pose of a node on another edge than its present edge, or on an edge that another agent wrote.

        If the node already has a pose with a newer stamp, the present edge stays.
        """
        motion = edge_type.model.motion
        if motion is None or not edge_type.fits(self.node(origin), self.node(target)):
            self.upsert_edge(edge_type, origin, target)  # raises the error about the types
            return
        self._state.frames = self._state.frames.with_pose(target, origin, pose, stamp_s, motion)
        if self._state.frames.track(target).newest_s > stamp_s:
            return
        if present_edge is not None and (present_edge.origin != origin or present_edge.type != edge_type.model.name):
            self._detach(present_edge)
        self.upsert_edge(edge_type, origin, target)

    def _check_rank_of_pose(self, edge_type: EdgeType, present_edge: Edge) -> None:
        placement = self._state.frames.track(present_edge.target).at(self.now_s)
        if placement is not None and placement.outcome is not Outcome.STALE:
            edge_type.permissions.check_rank(self.agent, present_edge.writer, str(present_edge))

    def _parent_edge(self, target: str) -> Edge | None:
        """Return the edge that holds the present pose of a node; None if no edge holds one."""
        if target not in self._state.frames:
            return None
        parent = self._state.frames.track(target).parent
        return None if parent is None else self._edge_at((parent, RT, target))

    def _end_frame(self, name: str) -> None:
        """End the present pose of a deleted node, but keep its past poses for some time."""
        track = self._state.frames.track(name)
        if not len(track):
            self._state.frames = self._state.frames.without(name)
            return
        self._state.frames = self._state.frames.without_parent(name, max(self.now_s, track.newest_s))
        self._state.deletion_times_s = {**self._prune_deleted_frames(), name: self.now_s}

    def _prune_deleted_frames(self) -> Mapping[str, float]:
        """Remove the poses of nodes that were deleted too long ago; return when the others were deleted."""
        kept_deletion_times_s: dict[str, float] = {}
        for name, deletion_time_s in self._state.deletion_times_s.items():
            if self.has_node(name):
                continue
            history_s = self._state.frames.track(name).motion.history_s
            if deletion_time_s < self.now_s - (history_s if history_s < math.inf else _DELETED_NODE_HISTORY_S):
                self._state.frames = self._state.frames.without(name)
            else:
                kept_deletion_times_s[name] = deletion_time_s
        return kept_deletion_times_s

    # Edges

    def _remove_edge(self, edge: Edge) -> None:
        if self.schema.edge_type(edge.type).model.motion is not None and self._parent_edge(edge.target) == edge:
            newest_s = self._state.frames.track(edge.target).newest_s
            self._state.frames = self._state.frames.without_parent(edge.target, max(self.now_s, newest_s))
            self.changed_subjects.append(("frame", edge.target))
        self._detach(edge)

    def _detach(self, edge: Edge) -> None:
        """Remove an edge from the graph, but keep the past poses of its target."""
        self._new_edges[edge.key] = None
        self._new_readings.pop(edge.key, None)
        self.changed_subjects.append(("edge", edge.type))
        if self.records is not None:
            self._record_edge(edge, "edge_deleted")

    # Tasks

    def handover(self, name: str) -> Handover:
        """Return the handover of a task after the changes so far."""
        return self._state.handovers.get(name) or Handover(name)

    def set_handover(self, handover: Handover) -> None:
        """Set the handover of a task."""
        self._state.handovers = {**self._state.handovers, handover.task: handover}
        if handover.is_open and handover.deadline_s < math.inf:
            self.deadlines += ((handover.deadline_s, handover),)
        if self.records is not None and handover.stage is not None:
            details = {"requester": handover.requester, "result": handover.result, "message": handover.reason or None}
            deadline_s = handover.deadline_s if handover.deadline_s < math.inf else None
            self._record(
                handover.task,
                str(handover.stage),
                request=handover.number,
                since_s=handover.since_s,
                deadline_s=deadline_s,
                **details,
            )

    # Records for a journal

    def _record(self, name: str, what: str, **details: object) -> None:
        if self.records is not None:
            self.records.append(ChangeRecord(name, what, {"agent": self.agent, **details}))

    def _record_edge(self, edge: Edge, what: str) -> None:
        self._record(f"{edge.origin} -{edge.type}-> {edge.target}", what, type=edge.type, label=edge.label)

    def _record_reading(self, attribute: Attribute, reading: Reading[Value], subject: str = "") -> None:
        until_s = reading.expires_s if reading.expires_s < math.inf else None
        details = {"value": reading.content, "unit": attribute.model.type.unit, "reason": reading.reason}
        self._record(subject or reading.name, "written", evidence_s=reading.evidence_s, expires_s=until_s, **details)
