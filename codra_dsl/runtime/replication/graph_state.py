"""From the registers of a replica to its graph, which snapshots read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import cast

from codra_dsl.logic import Value
from codra_dsl.runtime.geometry.motion import ANY_MOTION, Motion
from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.knowledge.elements import Attribute, Edge, EdgeKey, History, Node
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.state import State
from codra_dsl.runtime.replication.commits import Register, RegisterKind, pose_of
from codra_dsl.runtime.replication.hybrid_time import Stamp
from codra_dsl.runtime.replication.merge import Entry, MergedState, Presence, presence, winner
from codra_dsl.runtime.values.cell import Reading, Reason, known_reading


def graph_state(
    merged: MergedState, schema: GraphSchema, now_s: float, registers: Iterable[Register] | None = None
) -> State:
    """Return the graph that a replica has at an instant; if `registers` are given, only the part that they determine.

    An edge exists only together with both of its nodes. An attribute or a pose counts only if it was written after the
    insertion of its node or edge. The graph has the newest value of each attribute and the newest pose of each node,
    without their histories.
    """
    return _GraphBuilder(merged, merged.registers if registers is None else registers, schema, now_s).build()


def without_cycles(poses: Mapping[str, Entry]) -> dict[str, Entry]:
    """Return poses by node, without those that close a cycle of parents.

    The poses take effect in the order of their stamps, so of the poses in a cycle the one that was written last is left
    out. Its author would have been refused if the replica had known the others. A pose that is left out still counts as
    the newest pose of its node, and takes effect when another pose opens the cycle.
    """
    kept_poses: dict[str, Entry] = {}
    for name, entry in sorted(poses.items(), key=lambda item: item[1].stamp):
        ancestor = entry.content[0]
        while ancestor != name and ancestor in kept_poses:
            ancestor = kept_poses[ancestor].content[0]
        if ancestor != name:
            kept_poses[name] = entry
    return kept_poses


class _GraphBuilder:
    """Derives the nodes, edges, poses and attributes of one instant."""

    def __init__(self, merged: MergedState, registers: Iterable[Register], schema: GraphSchema, now_s: float) -> None:
        self._schema = schema
        self._now_s = now_s
        self._registers: dict[RegisterKind, dict[tuple[str, ...], tuple[Entry, ...]]] = {
            kind: {} for kind in RegisterKind
        }
        for register in registers:
            entries = merged.registers.get(register)
            if entries is not None:
                self._registers[register.kind][register.path] = entries
        self._nodes: dict[str, Node] = {}
        self._edges: dict[EdgeKey, Edge] = {}
        self._begins: dict[str | EdgeKey, Stamp] = {}  # an attribute counts if it was written later

    def build(self) -> State:
        """Return the graph."""
        for (name,), entries in self._registers[RegisterKind.NODE].items():
            present = presence(entries)
            if present is not None:
                author, since_s = present.entry.stamp.author, present.begin.physical_s
                self._nodes[name] = Node(name, present.entry.type, 0, {}, author, since_s)
                self._begins[name] = present.begin
        for (origin, label, target), entries in self._registers[RegisterKind.EDGE].items():
            if origin in self._nodes and target in self._nodes:
                present = presence(entries, self._begin_of_ends(origin, target))
                if present is not None and self._fits(present.entry.type, origin, target):
                    self._add_edge((origin, label, target), present, present.begin)
        poses = without_cycles(self._poses())
        for name, entry in poses.items():
            origin = entry.content[0]
            self._add_edge((origin, RT, name), Presence(entry, entry), self._begin_of_ends(origin, name))
        self._add_attributes()
        return self._state(poses)

    def _add_edge(self, key: EdgeKey, present: Presence, begin: Stamp) -> None:
        author, since_s = present.entry.stamp.author, present.begin.physical_s
        self._edges[key] = Edge(*key, present.entry.type, 0, {}, author, since_s)
        self._begins[key] = begin

    def _begin_of_ends(self, origin: str, target: str) -> Stamp:
        return max(self._begins[origin], self._begins[target])

    def _fits(self, type_name: str, origin: str, target: str) -> bool:
        return self._schema.edge_type(type_name).fits(self._nodes[origin], self._nodes[target])

    def _poses(self) -> dict[str, Entry]:
        """Return the entries of the poses of all nodes that have one."""
        poses = {}
        for (name,), entries in self._registers[RegisterKind.POSE].items():
            entry = self._pose(name, entries) if name in self._nodes else None
            if entry is not None and entry.content is not None and self._connects(entry, name):
                poses[name] = entry
        return poses

    def _pose(self, name: str, entries: Iterable[Entry]) -> Entry | None:
        """Return the entry that determines the pose of a node; a pose without its parent is not valid."""
        counted_entries = [entry for entry in entries if entry.stamp > self._begins[name]]
        return winner(counted_entries, lambda entry: self._is_fresh(entry) and self._connects(entry, name))

    def _connects(self, entry: Entry, name: str) -> bool:
        origin = entry.content[0]
        return origin in self._nodes and entry.stamp > self._begins[origin] and self._fits(entry.type, origin, name)

    def _is_fresh(self, entry: Entry) -> bool:
        return self._now_s < entry.evidence_s + self._motion(entry).valid_for_s

    def _motion(self, entry: Entry) -> Motion:
        return self._schema.edge_type(entry.type).model.motion or ANY_MOTION

    def _add_attributes(self) -> None:
        """Add the attributes to the histories of nodes and edges."""
        for kind in (RegisterKind.NODE_ATTRIBUTE, RegisterKind.EDGE_ATTRIBUTE):
            for (*path, name), entries in self._registers[kind].items():
                element: Node | Edge | None
                if kind is RegisterKind.NODE_ATTRIBUTE:
                    element, begin = self._nodes.get(path[0]), self._begins.get(path[0])
                else:
                    key = cast("EdgeKey", tuple(path))
                    element, begin = self._edges.get(key), self._begins.get(key)
                if element is not None and begin is not None:
                    counted = [entry for entry in entries if entry.type == element.type and entry.stamp > begin]
                    if counted:
                        self._add_attribute(element, name, counted)

    def _add_attribute(self, element: Node | Edge, name: str, entries: Iterable[Entry]) -> None:
        if isinstance(element, Node):
            attribute, subject = self._schema.attribute(element, name), f"{element.name}.{name}"
        else:
            attribute, subject = self._schema.attribute_of_edge(element, name), f"{element}.{name}"
        history = History(attribute, subject)
        entry = winner(entries, lambda entry: _reading(entry, history.name, attribute).at(self._now_s).known)
        if entry is not None:
            histories = cast("dict[str, History]", element.histories)
            histories[name] = history.with_reading(_reading(entry, history.name, attribute), 0)

    def _state(self, poses: Mapping[str, Entry]) -> State:
        state = State.empty(self._now_s)
        for number, key in enumerate(sorted(self._begins, key=lambda key: (self._begins[key], str(key)))):
            if isinstance(key, str):
                self._nodes[key] = self._nodes[key]._replace(number=number)
                state.index.add_node(key, self._nodes[key].type)
            else:
                self._edges[key] = self._edges[key]._replace(number=number)
                state.index.add_edge(key)
        state.next_number = len(self._begins)
        state.nodes = state.nodes.with_changes(self._nodes)
        state.edges = state.edges.with_changes(self._edges)
        for name, entry in poses.items():
            pose = pose_of(entry.content)
            state.frames = state.frames.with_pose(name, entry.content[0], pose, entry.evidence_s, self._motion(entry))
        return state


def _reading(entry: Entry, name: str, attribute: Attribute) -> Reading[Value]:
    _, _, content, evidence_s, stamp = entry
    if content is None:
        return Reading(
            name=name,
            reason=Reason.REJECTED,
            evidence_s=evidence_s,
            start_s=evidence_s,
            identified_s=stamp.physical_s,
            source=stamp.author,
        )
    expires_s = evidence_s + attribute.model.valid_for_s
    return known_reading(name, content, evidence_s, evidence_s, stamp.physical_s, expires_s, stamp.author)
