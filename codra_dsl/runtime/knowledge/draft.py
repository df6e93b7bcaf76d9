"""Changes of a graph, made on a draft that nobody sees until it is whole. Each is checked against the declarations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from codra_dsl.logic import Value
from codra_dsl.runtime.agents import NotASourceError
from codra_dsl.runtime.cell import Reading, Reason, known_reading
from codra_dsl.runtime.geometry import Outcome, Pose
from codra_dsl.runtime.knowledge.declarations import RT, EdgeModel
from codra_dsl.runtime.knowledge.elements import NO_HISTORIES, Edge, EdgeKey, History, Node, made
from codra_dsl.runtime.knowledge.state import Handover, State
from codra_dsl.runtime.knowledge.words import Attribute, EdgeType, Words
from codra_dsl.runtime.model import NotOfTypeError, text

_convert_name = text().converter()
"""Takes a name if it can be written down."""

_GONE_S = 10.0
"""How long the poses of a deleted node are told, if its edge did not declare how far back they are."""

Touched = tuple[str, str]
"""What a change touched: `node`, `edge` or `frame` and a type or a name; or the name of a node and its attribute."""


class Note(NamedTuple):
    """What a change did, for a journal."""

    name: str
    what: str
    details: Mapping[str, object]


class AbsentError(LookupError):
    """There is no such node or edge in the graph."""


class PresentError(ValueError):
    """There is such a node in the graph already."""


class Draft:
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
        "_directory",
        "_edges",
        "_frames",
        "_gone",
        "_handovers",
        "_new_edges",
        "_new_nodes",
        "_next_number",
        "_nodes",
        "_version",
        "agent",
        "deadlines",
        "notes",
        "now_s",
        "operation",
        "shared",
        "touched",
        "words",
    )

    def __init__(self, words: Words, state: State, now_s: float, agent: str, notes: list[Note] | None = None) -> None:
        self.words = words
        (
            _,
            self._version,
            self._next_number,
            self._nodes,
            self._edges,
            self._directory,
            self._frames,
            self._handovers,
            self._gone,
        ) = state
        self._new_nodes: dict[str, Node | None] = {}
        self._new_edges: dict[EdgeKey, Edge | None] = {}
        self.agent = agent
        self.now_s = now_s
        self.touched: list[Touched] = []
        self.deadlines: tuple[tuple[float, Handover], ...] = ()
        self.shared: tuple[Reading[Value], ...] = ()
        self.notes = notes
        self.operation: Any = None

    def state(self) -> State:
        """Return the state that the changes make; once, and only of a draft that began as the present state."""
        nodes, edges, directory = self._nodes, self._edges, self._directory
        if self._new_nodes:
            nodes = nodes.with_changes(self._new_nodes)
        if self._new_edges:
            edges = edges.with_changes(self._new_edges)
        if directory.added > directory.most:
            directory = directory.renewed(nodes, edges)
        return made(
            State,
            (
                self.now_s,
                self._version + 1,
                self._next_number,
                nodes,
                edges,
                directory,
                self._frames,
                self._handovers,
                self._gone,
            ),
        )

    def is_of(self, state: State) -> bool:
        """Return whether the draft began as a state."""
        return self._version == state.version

    def take(self, other: Draft) -> None:
        """Take over what another draft, which began as the same state, has become."""
        for name in Draft.__slots__:
            if name != "now_s":  # it becomes the present state now, not when the other draft was begun
                setattr(self, name, getattr(other, name))

    # Nodes

    def insert_node(self, name: str, type_name: str, values: Mapping[str, object]) -> None:
        """Insert a node."""
        node_type = self.words.node_type(type_name)
        if self.agent not in node_type.rights.writers:
            node_type.rights.refuse(self.agent, f"nodes of type {type_name}")
        if not isinstance(name, str) or not name:
            raise ValueError(f"a node has a name, not {name!r}")
        _convert_name(name)
        if self.has_node(name):
            raise PresentError(f"there is a node {name!r} already")
        number = self._next_number
        self._next_number = number + 1
        self._new_nodes[name] = made(Node, (name, type_name, number, NO_HISTORIES, self.agent, self.now_s))
        self._directory.add_node(name, type_name)
        self.touched.append(("node", type_name))
        if self.notes is not None:
            self._note(name, "node_inserted", type=type_name)
        for attribute, value in values.items():
            self.set(name, attribute, value, None)

    def delete_node(self, name: str) -> None:
        """Delete a node and all edges to and from it; its poses are told as far back as they are kept."""
        node = self.node(name)
        rights = self.words.node_type(node.type).rights
        rights.check(self.agent, f"nodes of type {node.type}")
        if name in self.words.nodes_of_context:
            raise NotASourceError(f"{name!r} stays: context-variables are attributes of it")
        if rights.is_ranked:
            rights.check_rank(self.agent, node.writer, name)
        for key in sorted({*self._directory.out(name), *self._directory.into(name)}):
            self.remove(key)
        self._new_nodes[name] = None
        if name in self._frames:
            self._end_frame(name)
        self.touched.append(("node", node.type))
        self.touched.extend((name, attribute) for attribute in node.histories)
        if self.notes is not None:
            self._note(name, "node_deleted", type=node.type)

    def has_node(self, name: str) -> bool:
        """Return whether there is a node in the draft."""
        return (self._new_nodes[name] if name in self._new_nodes else self._nodes.get(name)) is not None

    def node(self, name: str) -> Node:
        """Return a node as it is in the draft."""
        found = self._new_nodes[name] if name in self._new_nodes else self._nodes.get(name)
        if found is None:
            raise AbsentError(f"there is no node {name!r}")
        return found

    def set(self, name: str, attribute: str, value: object, evidence_s: float | None) -> None:
        """Write an attribute of a node."""
        node = self.node(name)
        declared = self.words.attribute(node, attribute)
        if self.agent not in declared.rights.writers:
            declared.rights.refuse(self.agent, f"{name}.{attribute}")
        self.write(node, declared, value, evidence_s)

    def write(self, node: Node, declared: Attribute, value: object, evidence_s: float | None) -> None:
        """Write an attribute of a node, whoever may."""
        reading = self._reading(node.histories.get(declared.model.name), declared, node.name, value, evidence_s)
        self.take_in(node, declared, reading)
        if declared.variable:
            self.shared += (reading,)
        elif self.notes is not None:
            self._note_reading(declared, reading)

    def take_in(self, node: Node, declared: Attribute, reading: Reading[Value]) -> None:
        """Add a reading to what is known of an attribute of a node."""
        name, type_name, number, histories, writer, since_s = node
        attribute, most = declared.model.name, declared.model.history
        history = histories.get(attribute)
        longer = (History() if history is None else history).with_reading(reading, most)
        self._new_nodes[name] = made(Node, (name, type_name, number, {**histories, attribute: longer}, writer, since_s))
        self.touched.append((name, attribute))

    # Edges

    def insert_edge(self, origin: str, type_name: str, target: str, values: Mapping[str, object]) -> None:
        """Insert an edge that is a symbol, or write attributes of the one that is there."""
        edge_type = self.words.edge_type(type_name)
        if self.agent not in edge_type.rights.writers:
            edge_type.rights.refuse(self.agent, f"edges of type {type_name}")
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
                if edge_type.rights.is_ranked:
                    edge_type.rights.check_rank(self.agent, known.writer, str(known))
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
        number = self._next_number
        self._next_number = number + 1
        told = (origin, label, target, type_name, number, NO_HISTORIES, self.agent, self.now_s)
        self._new_edges[key] = edge = made(Edge, told)
        self._directory.add_edge(key)
        self.touched.append(("edge", type_name))
        if self.notes is not None:
            self._note_edge(edge, "edge_inserted")

    def delete_edge(self, origin: str, type_name: str, target: str) -> None:
        """Delete an edge; a node that had a pose by it stands nowhere from now on."""
        edge_type = self.words.edge_type(type_name)
        edge_type.rights.check(self.agent, f"edges of type {type_name}")
        edge = self.edge(origin, type_name, target)
        if edge_type.rights.is_ranked:
            edge_type.rights.check_rank(self.agent, edge.writer, str(edge))
        self._remove_edge(edge)

    def edge(self, origin: str, type_name: str, target: str) -> Edge:
        """Return an edge as it is in the draft."""
        found = self._edge_at((origin, self.words.edge_type(type_name).label, target))
        if found is None or found.type != type_name:
            raise AbsentError(f"there is no edge {origin} -{type_name}-> {target}")
        return found

    def set_of_edge(  # noqa: PLR0917 - the three that name an edge, and what `set` takes
        self, origin: str, type_name: str, target: str, attribute: str, value: object, evidence_s: float | None
    ) -> None:
        """Write an attribute of an edge."""
        edge = self.edge(origin, type_name, target)
        declared = self.words.attribute_of_edge(edge, attribute)
        subject = str(edge)
        declared.rights.check(self.agent, f"{subject}.{attribute}")
        history = edge.histories.get(attribute)
        reading = self._reading(history, declared, subject, value, evidence_s)
        longer = (History() if history is None else history).with_reading(reading, declared.model.history)
        self._new_edges[edge.key] = edge._replace(histories={**edge.histories, attribute: longer})
        self.touched.append(("edge", type_name))
        if self.notes is not None:
            self._note_reading(declared, reading, f"{origin} -{type_name}-> {target}.{attribute}")

    def _edge_at(self, key: EdgeKey) -> Edge | None:
        changed = self._new_edges
        return changed[key] if changed and key in changed else self._edges.get(key)

    def remove(self, key: EdgeKey) -> None:
        """Remove an edge, if it is there, whoever may."""
        edge = self._edge_at(key)
        if edge is not None:
            self._remove_edge(edge)

    def begin_edge(self, model: EdgeModel) -> None:
        """Insert an edge that is there from the start; a pose holds from then on."""
        if self.words.edge_type(model.type).model.motion is None:
            self.insert_edge(model.origin, model.type, model.target, model.values)
            return
        self.place(model.origin, model.type, model.target, model.pose, None)
        for attribute, value in model.values.items():
            self.set_of_edge(model.origin, model.type, model.target, attribute, value, None)

    # Geometry

    def place(self, origin: str, type_name: str, target: str, pose: Pose, stamp_s: float | None) -> None:
        """Say where a node stands in another, from an instant on."""
        edge_type = self.words.edge_type(type_name)
        edge_type.rights.check(self.agent, f"edges of type {type_name}")
        motion = edge_type.model.motion
        if motion is None:
            raise ValueError(f"an edge of type {type_name!r} is a symbol and has no pose")
        stamp_s = self.now_s if stamp_s is None else float(stamp_s)
        if not stamp_s <= self.now_s:
            raise ValueError(f"a pose of {target!r} was measured at {self.now_s} at the latest, not at {stamp_s}")
        before = self._parent_edge(target)
        if before is not None and before.writer != self.agent and edge_type.rights.is_ranked:
            self._check_rank_of_pose(edge_type, before)
        if before is None or before.origin != origin or before.type != type_name or before.writer != self.agent:
            self._place_anew(edge_type, origin, target, pose, stamp_s, before)
        else:
            self._frames = self._frames.with_pose(target, origin, pose, stamp_s, motion)
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
        self._frames = self._frames.with_pose(target, origin, pose, stamp_s, motion)
        if self._frames.track(target).newest_s > stamp_s:
            return
        if before is not None and (before.origin != origin or before.type != edge_type.model.name):
            self._detach(before)
        self.draw(edge_type, origin, target)

    def _check_rank_of_pose(self, edge_type: EdgeType, before: Edge) -> None:
        standing = self._frames.track(before.target).at(self.now_s)
        if standing is not None and standing.outcome is not Outcome.STALE:
            edge_type.rights.check_rank(self.agent, before.writer, str(before))

    def _parent_edge(self, target: str) -> Edge | None:
        """Return the edge on which a node stands now."""
        if target not in self._frames:
            return None
        parent = self._frames.track(target).parent
        return None if parent is None else self._edge_at((parent, RT, target))

    def _end_frame(self, name: str) -> None:
        """Let a node that is deleted stand nowhere from now on."""
        track = self._frames.track(name)
        if not len(track):
            self._frames = self._frames.without(name)
            return
        self._frames = self._frames.without_parent(name, max(self.now_s, track.newest_s))
        self._gone = {**self._still_told(), name: self.now_s}

    def _still_told(self) -> Mapping[str, float]:
        """Forget the poses of nodes that were deleted too long ago; return the others and when they were."""
        told: dict[str, float] = {}
        for name, gone_s in self._gone.items():
            if self.has_node(name):
                continue
            history_s = self._frames.track(name).motion.history_s
            if gone_s < self.now_s - (history_s if history_s < math.inf else _GONE_S):
                self._frames = self._frames.without(name)
            else:
                told[name] = gone_s
        return told

    # Within

    def _reading(
        self, history: History | None, declared: Attribute, subject: str, value: object, evidence_s: float | None
    ) -> Reading[Value]:
        """Return what is written now, if it may be after what was; None and NaN are unknown."""
        now_s, agent = self.now_s, self.agent
        try:
            content = None if value is None else declared.convert(value)
        except NotOfTypeError as error:
            raise NotOfTypeError(f"{subject}.{declared.model.name}: {error}") from None
        if evidence_s is None:
            evidence_s = now_s
        elif not evidence_s <= now_s:
            told = f"{subject}.{declared.model.name}"
            raise ValueError(f"evidence for {told} was taken at {now_s} at the latest, not at {evidence_s}")
        else:
            evidence_s = float(evidence_s)
        if history is None:
            name = declared.variable or f"{subject}.{declared.model.name}"
        else:
            before = history.present
            name = before.name
            if before.source != agent and declared.rights.is_ranked and before.at(now_s).known:
                declared.rights.check_rank(agent, before.source, f"{subject}.{declared.model.name}")
        if content is None:
            return Reading(
                name=name,
                reason=Reason.REJECTED,
                evidence_s=evidence_s,
                start_s=evidence_s,
                identified_s=now_s,
                source=agent,
            )
        return known_reading(
            name, content, evidence_s, evidence_s, now_s, evidence_s + declared.model.valid_for_s, agent
        )

    def _remove_edge(self, edge: Edge) -> None:
        if self.words.edge_type(edge.type).model.motion is not None and self._parent_edge(edge.target) == edge:
            newest_s = self._frames.track(edge.target).newest_s
            self._frames = self._frames.without_parent(edge.target, max(self.now_s, newest_s))
            self.touched.append(("frame", edge.target))
        self._detach(edge)

    def _detach(self, edge: Edge) -> None:
        """Take an edge out of the graph; where its target stood it did stand."""
        self._new_edges[edge.key] = None
        self.touched.append(("edge", edge.type))
        if self.notes is not None:
            self._note_edge(edge, "edge_deleted")

    # Tasks

    def handover(self, name: str) -> Handover:
        """Return how far a task is in the draft."""
        return self._handovers.get(name) or Handover(name)

    def hand_over(self, handover: Handover) -> None:
        """Say how far a task is."""
        self._handovers = {**self._handovers, handover.task: handover}
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
            self.notes.append(Note(name, what, {"agent": self.agent, **details}))

    def _note_edge(self, edge: Edge, what: str) -> None:
        self._note(f"{edge.origin} -{edge.type}-> {edge.target}", what, type=edge.type, label=edge.label)

    def _note_reading(self, declared: Attribute, reading: Reading[Value], subject: str = "") -> None:
        until_s = reading.expires_s if reading.expires_s < math.inf else None
        told = {"value": reading.content, "unit": declared.model.type.unit, "reason": reading.reason}
        self._note(subject or reading.name, "written", evidence_s=reading.evidence_s, expires_s=until_s, **told)
