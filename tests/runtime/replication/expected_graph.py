"""The graph that follows from commits: a plain program that applies them one after another, in the order of stamps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from codra_dsl.runtime.knowledge import KnowledgeModel, Writer
from codra_dsl.runtime.replication import Commit
from codra_dsl.runtime.replication.commits import RegisterKind, Write


class Graph(NamedTuple):
    """A graph as plain values.

    Attributes:
        nodes: type, writer and attributes of each node.
        edges: type, writer and attributes of each edge, by origin, label and target.
        poses: the parent of each node, and the first number of its pose.
    """

    nodes: dict[str, tuple[str, str, dict[str, Any]]]
    edges: dict[tuple[str, str, str], tuple[str, str, dict[str, Any]]]
    poses: dict[str, tuple[str, float]]


@dataclass(eq=False)
class Thing:
    """A node or edge while it exists."""

    type: str
    author: str
    rank: int
    values: dict[str, list[Value]] = field(default_factory=dict)
    poses: list[tuple[Value, Thing | None]] = field(default_factory=list)


class Value(NamedTuple):
    """A value that was written, in the order of evidence."""

    evidence_s: float
    stamp: tuple[Any, ...]
    rank: int
    author: str
    type: str
    content: Any


def sources_of(model: KnowledgeModel, write: Write) -> tuple[Writer, ...]:
    """Return who may make a write, from the declarations alone."""
    types: Any = model.node_types if write.register.kind in (RegisterKind.NODE, RegisterKind.NODE_ATTRIBUTE) else ()
    (declaration,) = (one for one in types or model.edge_types if one.name == write.type)
    if write.register.kind not in (RegisterKind.NODE_ATTRIBUTE, RegisterKind.EDGE_ATTRIBUTE):
        return tuple(declaration.sources)
    (attribute,) = (one for one in declaration.attributes if one.name == write.register.path[-1])
    return tuple(attribute.sources)


def is_permitted(model: KnowledgeModel, commit: Commit) -> bool:
    """Return whether the spec allows the author all writes of a commit."""
    return all(commit.author in {source.agent for source in sources_of(model, write)} for write in commit.writes)


def expected_graph(model: KnowledgeModel, commits: Iterable[Commit], now_s: float) -> Graph:
    """Return the graph at an instant."""
    world = _World(model, now_s)
    writes = [(commit.stamp(position), write) for commit in commits for position, write in enumerate(commit.writes)]
    for stamp, write in sorted(writes, key=lambda item: item[0]):
        priorities = {source.agent: source.priority for source in sources_of(model, write)}
        world.apply(write, stamp, stamp.author, priorities[stamp.author])
    return world.graph()


class _World:
    """The present graph of the plain program."""

    def __init__(self, model: KnowledgeModel, now_s: float) -> None:
        self._model = model
        self._now_s = now_s
        self.nodes: dict[str, Thing] = {node.name: Thing(node.type, "", 0) for node in model.nodes}
        self.edges: dict[tuple[str, ...], Thing] = {}
        self.motions: dict[tuple[str, ...], Thing] = {}  # attributes of edges with poses outlast a change of the pose
        motions = {edge_type.name: edge_type.motion for edge_type in model.edge_types}
        for node in model.nodes:
            self._add_initial_values(self.nodes[node.name], node.values)
        for edge in model.edges:
            if motions[edge.type] is None:
                self.edges[edge.origin, "at", edge.target] = thing = Thing(edge.type, "", 0)
            else:
                value = Value(0.0, (), 0, "", edge.type, (edge.origin, *edge.pose.translation_m))
                self.nodes[edge.target].poses.append((value, self.nodes[edge.origin]))
                thing = self.motions[edge.origin, edge.target, edge.type] = Thing(edge.type, "", 0)
            self._add_initial_values(thing, edge.values)

    @staticmethod
    def _add_initial_values(thing: Thing, values: Any) -> None:
        for name, content in values.items():
            thing.values[name] = [Value(0.0, (), 0, "", thing.type, content)]

    def apply(self, write: Write, stamp: tuple[Any, ...], author: str, rank: int) -> None:
        kind, path = write.register
        value = Value(write.evidence_s, stamp, rank, author, write.type, write.content)
        if kind is RegisterKind.NODE:
            if self._change(self.nodes, path[0], value):
                self._detach(path[0])
            return
        ends = (path[0], path[2]) if kind in (RegisterKind.EDGE, RegisterKind.EDGE_ATTRIBUTE) else (path[0],)
        if any(end not in self.nodes for end in ends):
            return
        match kind:
            case RegisterKind.EDGE:
                self._change(self.edges, path, value)
            case RegisterKind.POSE:
                origin = self.nodes.get(write.content[0]) if write.content else None
                self.nodes[path[0]].poses.append((value, origin))
            case RegisterKind.NODE_ATTRIBUTE if self.nodes[path[0]].type == write.type:
                self.nodes[path[0]].values.setdefault(path[1], []).append(value)
            case RegisterKind.EDGE_ATTRIBUTE:
                edge = self.edges.get(path[:3])
                if path[1] == "RT":
                    key = (path[0], path[2], write.type)
                    edge = self.motions.setdefault(key, Thing(write.type, "", 0))
                if edge is not None and edge.type == write.type:
                    edge.values.setdefault(path[3], []).append(value)

    @staticmethod
    def _change(things: dict[Any, Thing], key: Any, value: Value) -> bool:
        """Insert or delete a thing; return whether another or no thing is there afterwards."""
        thing = things.get(key)
        if thing is not None and thing.type == value.type and thing.rank > value.rank:
            return False
        if value.content is None:
            if thing is None or thing.type != value.type:
                return False
            del things[key]
            return True
        if thing is None or thing.type != value.type:
            things[key] = Thing(value.type, value.author, value.rank)
            return True
        thing.author, thing.rank = value.author, value.rank
        return False

    def _detach(self, name: str) -> None:
        """Delete the edges of a node that was deleted or replaced; its own poses went with it."""
        for edges in (self.edges, self.motions):
            for key in [key for key in edges if name in (key[0], key[2] if edges is self.edges else key[1])]:
                del edges[key]

    def graph(self) -> Graph:
        poses = self._poses()
        edges = {key: thing for key, thing in self.edges.items() if self._fits(key[0], key[2], thing.type)}
        for name, value in poses.items():
            motion = self.motions.get((value.content[0], name, value.type))
            values = motion.values if motion else {}
            edges[value.content[0], "RT", name] = Thing(value.type, value.author, value.rank, values)
        return Graph(
            {name: (thing.type, thing.author, self._values(thing)) for name, thing in self.nodes.items()},
            {key: (thing.type, thing.author, self._values(thing)) for key, thing in edges.items()},  # type: ignore[misc]
            {name: (value.content[0], value.content[1]) for name, value in poses.items()},
        )

    def _poses(self) -> dict[str, Value]:
        motions = {one.name: one.motion.valid_for_s for one in self._model.edge_types if one.motion}
        poses: dict[str, Value] = {}
        candidates = []
        for name, thing in self.nodes.items():
            connected_values = {
                value
                for value, origin in thing.poses
                if origin is not None and self.nodes.get(value.content[0]) is origin
                if self._fits(value.content[0], name, value.type)
            }
            decided = self._decide([value for value, _ in thing.poses], motions, connected_values)
            if decided in connected_values:
                candidates.append((decided.stamp, name, decided))
        for _, name, value in sorted(candidates):
            ancestors = [value.content[0]]
            while ancestors[-1] in poses:
                ancestors.append(poses[ancestors[-1]].content[0])
            if name not in ancestors:
                poses[name] = value
        return poses

    def _fits(self, origin: str, target: str, type_name: str) -> bool:
        (edge_type,) = (one for one in self._model.edge_types if one.name == type_name)
        return self.nodes[origin].type in edge_type.origins and self.nodes[target].type in edge_type.targets

    def _values(self, thing: Thing) -> dict[str, Any]:
        decided = {name: self._decide(values, self._validity_s(name)) for name, values in thing.values.items()}
        return {name: (value.content, value.author, value.evidence_s) for name, value in decided.items() if value}

    def _validity_s(self, attribute: str) -> dict[str, float]:
        """Return how long values of an attribute are valid, by the type of the node or edge."""
        types: Any = (*self._model.node_types, *self._model.edge_types)
        return {one.name: other.valid_for_s for one in types for other in one.attributes if other.name == attribute}

    def _decide(
        self, values: list[Value], valid_for_s: dict[str, float], connected_values: set[Value] | None = None
    ) -> Value | None:
        """Return the value that stands after all values took effect in the order of their evidence."""
        decided: Value | None = None
        for value in sorted(values, key=lambda value: value[:2]):
            if decided is not None and decided.content is not None and decided.type == value.type:
                is_connected = connected_values is None or decided in connected_values
                is_valid = is_connected and self._now_s < decided.evidence_s + valid_for_s[decided.type]
                if is_valid and decided.rank > value.rank:
                    continue
            decided = value
        return decided
