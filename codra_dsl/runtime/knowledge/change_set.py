"""Changes of a graph, made on a draft that nobody sees until it is whole. Each is checked against the declarations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import NotASourceError
from codra_dsl.runtime.geometry import Outcome, Pose
from codra_dsl.runtime.knowledge.declarations import RT, EdgeModel
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Attribute, Edge, EdgeKey, ElementT, History, Node, made
from codra_dsl.runtime.knowledge.graph_schema import EdgeType, GraphSchema
from codra_dsl.runtime.knowledge.state import Handover, State
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import NotOfTypeError, text
from codra_dsl.runtime.values.persistent import PersistentMap

_convert_name = text().converter()
"""Takes a name if it can be written down."""

_GONE_S = 10.0
"""How long the poses of a deleted node are told, if its edge did not declare how far back they are."""

Touched = tuple[str, str]
"""What a change touched: `node`, `edge` or `frame` and a type or a name; or the name of a node and its attribute."""


class ChangeRecord(NamedTuple):
    """What a change did, for a journal."""

    name: str
    what: str
    details: Mapping[str, object]


KeyT = TypeVar("KeyT")

_Written = list[tuple[History, Reading[Value]]]
"""What was written of a node or edge, each with the history that was found, which may be an empty one."""


class AbsentError(LookupError):
    """There is no such node or edge in the graph."""


class PresentError(ValueError):
    """There is such a node in the graph already."""


class ChangeSet:
    """A state that is being changed by one agent at one instant.

    Attributes:
        agent: who changes it.
        now_s: when.
        touched: what was changed.
        deadlines: of tasks, which the change set: when, and of what.
        shared: readings of attributes that are context-variables, in the order in which they were written.
        notes: what was done, for a journal; None if there is none.
        operation: what was done last.
    """

    __slots__ = (
        "_new_edges",
        "_new_nodes",
        "_state",
        "_written",
        "agent",
        "deadlines",
        "notes",
        "now_s",
        "operation",
        "schema",
        "shared",
        "touched",
    )

    def __init__(
        self, schema: GraphSchema, state: State, now_s: float, agent: str, notes: list[ChangeRecord] | None = None
    ) -> None:
        self.schema = schema
        self._state = state.next(now_s)
        self._new_nodes: dict[str, Node | None] = {}
        self._new_edges: dict[EdgeKey, Edge | None] = {}
        self._written: dict[str | EdgeKey, _Written] = {}
        self.agent = agent
        self.now_s = now_s
        self.touched: list[Touched] = []
        self.deadlines: tuple[tuple[float, Handover], ...] = ()
        self.shared: tuple[Reading[Value], ...] = ()
        self.notes = notes
        self.operation: Any = None

    def state(self) -> State:
        """Return the state that the changes make; once, and only of a draft that began as the present state."""
        state = self._state
        for key, written in self._written.items():
            if isinstance(key, str):
                self._grow(state.nodes, self._new_nodes, key, written)
            else:
                self._grow(state.edges, self._new_edges, key, written)
        if self._new_nodes:
            state.nodes = state.nodes.with_changes(self._new_nodes)
        if self._new_edges:
            state.edges = state.edges.with_changes(self._new_edges)
        index = state.index
        if index.added > index.most:
            state.index = index.renewed(state.nodes, state.edges)
        return state

    def _grow(
        self,
        before: PersistentMap[KeyT, ElementT],
        changed: dict[KeyT, ElementT | None],
        key: KeyT,
        written: _Written,
    ) -> None:
        """Add readings to the histories of attributes; if that makes others, the node or edge gets them."""
        element = changed.get(key) or before[key]
        for history, reading in written:
            known = element.histories.get(history.declared.model.name)
            longer = (known or history).with_reading(reading, self._state.version)
            if longer is not known:
                changed[key] = element = element.with_history(longer)

    def undo(self) -> None:
        """Take back what `state` has added to histories, because that state will never be the present one."""
        for written in self._written.values():
            for history, reading in written:
                history.cut(reading)

    def is_of(self, state: State) -> bool:
        """Return whether the draft began as a state."""
        return self._state.version == state.version + 1

    def take(self, other: ChangeSet) -> None:
        """Take over what another draft, which began as the same state, has become."""
        for name in ChangeSet.__slots__:
            if name != "now_s":  # it becomes the present state now, not when the other draft was begun
                setattr(self, name, getattr(other, name))
        self._state.since_s = self.now_s

    # Nodes

    def insert_node(self, name: str, type_name: str, values: Mapping[str, object]) -> None:
        """Insert a node."""
        node_type = self.schema.node_type(type_name)
        if self.agent not in node_type.permissions.writers:
            node_type.permissions.refuse(self.agent, f"nodes of type {type_name}")
        if not isinstance(name, str) or not name:
            raise ValueError(f"a node has a name, not {name!r}")
        _convert_name(name)
        if self.has_node(name):
            raise PresentError(f"there is a node {name!r} already")
        state = self._state
        number = state.next_number
        state.next_number = number + 1
        self._new_nodes[name] = made(Node, (name, type_name, number, NO_HISTORIES, self.agent, self.now_s, 0))
        state.index.add_node(name, type_name)
        self.touched.append(("node", type_name))
        if self.notes is not None:
            self._note(name, "node_inserted", type=type_name)
        for attribute, value in values.items():
            self.set(name, attribute, value, None)

    def delete_node(self, name: str) -> None:
        """Delete a node and all edges to and from it; its poses are told as far back as they are kept."""
        node = self.node(name)
        permissions = self.schema.node_type(node.type).permissions
        permissions.check(self.agent, f"nodes of type {node.type}")
        if name in self.schema.nodes_of_context:
            raise NotASourceError(f"{name!r} stays: context-variables are attributes of it")
        if permissions.is_ranked:
            permissions.check_rank(self.agent, node.writer, name)
        for key in sorted({*self._state.index.out(name), *self._state.index.into(name)}):
            self.remove(key)
        self._new_nodes[name] = None  # and what was written of it is not to be of another that comes by this name
        self._written.pop(name, None)
        if name in self._state.frames:
            self._end_frame(name)
        self.touched.append(("node", node.type))
        self.touched.extend((name, attribute) for attribute in node.histories)
        if self.notes is not None:
            self._note(name, "node_deleted", type=node.type)

    def has_node(self, name: str) -> bool:
        """Return whether there is a node in the draft."""
        return (self._new_nodes[name] if name in self._new_nodes else self._state.nodes.get(name)) is not None

    def node(self, name: str) -> Node:
        """Return a node as it is in the draft."""
        found = self._new_nodes[name] if name in self._new_nodes else self._state.nodes.get(name)
        if found is None:
            raise AbsentError(f"there is no node {name!r}")
        return found

    def set(self, name: str, attribute: str, value: object, evidence_s: float | None) -> None:
        """Write an attribute of a node."""
        history = self.history(name, attribute)
        if self.agent not in history.declared.permissions.writers:
            history.declared.permissions.refuse(self.agent, history.subject)
        self._write(name, history, value, evidence_s)

    def write(self, name: str, attribute: str, value: object) -> None:
        """Write an attribute of a node, whoever may."""
        self._write(name, self.history(name, attribute), value, None)

    def _write(self, name: str, history: History, value: object, evidence_s: float | None) -> None:
        reading = history.written(self.agent, self.now_s, value, evidence_s, self._state.version - 1)
        self.take_in(name, history, reading)
        if history.declared.variable:
            self.shared += (reading,)
        elif self.notes is not None:
            self._note_reading(history.declared, reading)

    def history(self, name: str, attribute: str) -> History:
        """Return what is known of an attribute of a node: nothing, if it was not written before this draft."""
        node = self.node(name)
        return node.histories.get(attribute) or History(self.schema.attribute(node, attribute), f"{name}.{attribute}")

    def take_in(self, name: str, history: History, reading: Reading[Value]) -> None:
        """Add a reading to what is known of an attribute of a node."""
        self._written.setdefault(name, []).append((history, reading))
        self.touched.append((name, history.declared.model.name))

    # Edges

    def insert_edge(self, origin: str, type_name: str, target: str, values: Mapping[str, object]) -> None:
        """Insert an edge that is a symbol, or write attributes of the one that is there."""
        edge_type = self.schema.edge_type(type_name)
        if self.agent not in edge_type.permissions.writers:
            edge_type.permissions.refuse(self.agent, f"edges of type {type_name}")
        if edge_type.model.motion is not None:
            raise ValueError(f"an edge of type {type_name!r} has a pose: place {target!r} in {origin!r}")
        self.draw(edge_type, origin, target)
        for attribute, value in values.items():
            self.set_of_edge(origin, type_name, target, attribute, value, None)

    def draw(self, edge_type: EdgeType, origin: str, target: str) -> None:
        """Insert an edge, whoever may, or say of the one that is there who wrote it last."""
        label, type_name = edge_type.label, edge_type.model.name
        key = (origin, label, target)
        known = self._edge_at(key)
        if known is not None and known.type == type_name:
            if known.writer != self.agent:
                if edge_type.permissions.is_ranked:
                    edge_type.permissions.check_rank(self.agent, known.writer, str(known))
                self._new_edges[key] = known._replace(writer=self.agent)
                self.touched.append(("edge", type_name))
                if self.notes is not None:
                    self._note_edge(known, "edge_inserted")
            return
        start, end = self.node(origin), self.node(target)
        if not edge_type.fits(start, end):
            raise NotOfTypeError(
                f"an edge of type {type_name!r} goes from {' or '.join(edge_type.model.origins)} to "
                f"{' or '.join(edge_type.model.targets)}, not from {start.type} {origin!r} to {end.type} {target!r}"
            )
        if known is not None:
            self._remove_edge(known)
        state = self._state
        number = state.next_number
        state.next_number = number + 1
        told = (origin, label, target, type_name, number, NO_HISTORIES, self.agent, self.now_s, 0)
        self._new_edges[key] = edge = made(Edge, told)
        state.index.add_edge(key)
        self.touched.append(("edge", type_name))
        if self.notes is not None:
            self._note_edge(edge, "edge_inserted")

    def delete_edge(self, origin: str, type_name: str, target: str) -> None:
        """Delete an edge; a node that had a pose by it stands nowhere from now on."""
        edge_type = self.schema.edge_type(type_name)
        edge_type.permissions.check(self.agent, f"edges of type {type_name}")
        edge = self.edge(origin, type_name, target)
        if edge_type.permissions.is_ranked:
            edge_type.permissions.check_rank(self.agent, edge.writer, str(edge))
        self._remove_edge(edge)

    def edge(self, origin: str, type_name: str, target: str) -> Edge:
        """Return an edge as it is in the draft."""
        found = self._edge_at((origin, self.schema.edge_type(type_name).label, target))
        if found is None or found.type != type_name:
            raise AbsentError(f"there is no edge {origin} -{type_name}-> {target}")
        return found

    def set_of_edge(  # noqa: PLR0917 - the three that name an edge, and what `set` takes
        self, origin: str, type_name: str, target: str, attribute: str, value: object, evidence_s: float | None
    ) -> None:
        """Write an attribute of an edge."""
        edge = self.edge(origin, type_name, target)
        declared = self.schema.attribute_of_edge(edge, attribute)
        history = edge.histories.get(attribute) or History(declared, f"{edge}.{attribute}")
        declared.permissions.check(self.agent, history.subject)
        reading = history.written(self.agent, self.now_s, value, evidence_s, self._state.version - 1)
        self._written.setdefault(edge.key, []).append((history, reading))
        self.touched.append(("edge", type_name))
        if self.notes is not None:
            self._note_reading(declared, reading, f"{origin} -{type_name}-> {target}.{attribute}")

    def _edge_at(self, key: EdgeKey) -> Edge | None:
        changed = self._new_edges
        return changed[key] if changed and key in changed else self._state.edges.get(key)

    def remove(self, key: EdgeKey) -> None:
        """Remove an edge, if it is there, whoever may."""
        edge = self._edge_at(key)
        if edge is not None:
            self._remove_edge(edge)

    def begin_edge(self, model: EdgeModel) -> None:
        """Insert an edge that is there from the start; a pose holds from then on."""
        if self.schema.edge_type(model.type).model.motion is None:
            self.insert_edge(model.origin, model.type, model.target, model.values)
            return
        self.place(model.origin, model.type, model.target, model.pose, None)
        for attribute, value in model.values.items():
            self.set_of_edge(model.origin, model.type, model.target, attribute, value, None)

    # Geometry

    def place(self, origin: str, type_name: str, target: str, pose: Pose, stamp_s: float | None) -> None:
        """Say where a node stands in another, from an instant on."""
        edge_type = self.schema.edge_type(type_name)
        edge_type.permissions.check(self.agent, f"edges of type {type_name}")
        motion = edge_type.model.motion
        if motion is None:
            raise ValueError(f"an edge of type {type_name!r} is a symbol and has no pose")
        stamp_s = self.now_s if stamp_s is None else float(stamp_s)
        if not stamp_s <= self.now_s:
            raise ValueError(f"a pose of {target!r} was measured at {self.now_s} at the latest, not at {stamp_s}")
        before = self._parent_edge(target)
        if before is not None and before.writer != self.agent and edge_type.permissions.is_ranked:
            self._check_rank_of_pose(edge_type, before)
        if before is None or before.origin != origin or before.type != type_name or before.writer != self.agent:
            self._place_anew(edge_type, origin, target, pose, stamp_s, before)
        else:
            self._state.frames = self._state.frames.with_pose(target, origin, pose, stamp_s, motion)
        self.touched.append(("frame", target))
        if self.notes is not None:
            told = {"translation_m": list(pose.translation_m), "rotation": list(pose.rotation)}
            self._note(f"{origin} -{type_name}-> {target}", "placed", label=RT, evidence_s=stamp_s, **told)

    def _place_anew(  # noqa: PLR0917 - what `place` was given
        self, edge_type: EdgeType, origin: str, target: str, pose: Pose, stamp_s: float, before: Edge | None
    ) -> None:
        """Say where a node stands, on another edge than before unless the pose is older than those of that edge."""
        motion = edge_type.model.motion
        if motion is None or not edge_type.fits(self.node(origin), self.node(target)):
            self.draw(edge_type, origin, target)  # which tells what does not fit
            return
        self._state.frames = self._state.frames.with_pose(target, origin, pose, stamp_s, motion)
        if self._state.frames.track(target).newest_s > stamp_s:
            return
        if before is not None and (before.origin != origin or before.type != edge_type.model.name):
            self._detach(before)
        self.draw(edge_type, origin, target)

    def _check_rank_of_pose(self, edge_type: EdgeType, before: Edge) -> None:
        standing = self._state.frames.track(before.target).at(self.now_s)
        if standing is not None and standing.outcome is not Outcome.STALE:
            edge_type.permissions.check_rank(self.agent, before.writer, str(before))

    def _parent_edge(self, target: str) -> Edge | None:
        """Return the edge on which a node stands now."""
        if target not in self._state.frames:
            return None
        parent = self._state.frames.track(target).parent
        return None if parent is None else self._edge_at((parent, RT, target))

    def _end_frame(self, name: str) -> None:
        """Let a node that is deleted stand nowhere from now on."""
        track = self._state.frames.track(name)
        if not len(track):
            self._state.frames = self._state.frames.without(name)
            return
        self._state.frames = self._state.frames.without_parent(name, max(self.now_s, track.newest_s))
        self._state.gone = {**self._still_told(), name: self.now_s}

    def _still_told(self) -> Mapping[str, float]:
        """Forget the poses of nodes that were deleted too long ago; return the others and when they were."""
        told: dict[str, float] = {}
        for name, gone_s in self._state.gone.items():
            if self.has_node(name):
                continue
            history_s = self._state.frames.track(name).motion.history_s
            if gone_s < self.now_s - (history_s if history_s < math.inf else _GONE_S):
                self._state.frames = self._state.frames.without(name)
            else:
                told[name] = gone_s
        return told

    # Within

    def _remove_edge(self, edge: Edge) -> None:
        if self.schema.edge_type(edge.type).model.motion is not None and self._parent_edge(edge.target) == edge:
            newest_s = self._state.frames.track(edge.target).newest_s
            self._state.frames = self._state.frames.without_parent(edge.target, max(self.now_s, newest_s))
            self.touched.append(("frame", edge.target))
        self._detach(edge)

    def _detach(self, edge: Edge) -> None:
        """Take an edge out of the graph; where its target stood it did stand."""
        self._new_edges[edge.key] = None
        self._written.pop(edge.key, None)
        self.touched.append(("edge", edge.type))
        if self.notes is not None:
            self._note_edge(edge, "edge_deleted")

    # Tasks

    def handover(self, name: str) -> Handover:
        """Return how far a task is in the draft."""
        return self._state.handovers.get(name) or Handover(name)

    def hand_over(self, handover: Handover) -> None:
        """Say how far a task is."""
        self._state.handovers = {**self._state.handovers, handover.task: handover}
        if handover.is_open and handover.deadline_s < math.inf:
            self.deadlines += ((handover.deadline_s, handover),)
        if self.notes is not None and handover.stage is not None:
            told = {"requester": handover.requester, "result": handover.result, "message": handover.reason or None}
            deadline_s = handover.deadline_s if handover.deadline_s < math.inf else None
            self._note(
                handover.task,
                str(handover.stage),
                request=handover.number,
                since_s=handover.since_s,
                deadline_s=deadline_s,
                **told,
            )

    # Notes for a journal

    def _note(self, name: str, what: str, **details: object) -> None:
        if self.notes is not None:
            self.notes.append(ChangeRecord(name, what, {"agent": self.agent, **details}))

    def _note_edge(self, edge: Edge, what: str) -> None:
        self._note(f"{edge.origin} -{edge.type}-> {edge.target}", what, type=edge.type, label=edge.label)

    def _note_reading(self, declared: Attribute, reading: Reading[Value], subject: str = "") -> None:
        until_s = reading.expires_s if reading.expires_s < math.inf else None
        told = {"value": reading.content, "unit": declared.model.type.unit, "reason": reading.reason}
        self._note(subject or reading.name, "written", evidence_s=reading.evidence_s, expires_s=until_s, **told)
