"""What generated code declares of knowledge and agents, as frozen values (P2, sections 3.1 to 3.3).

The graph's own words are here: what nodes and edges there can be, who may write what, what is there from the start,
which tasks are handed over on edges, and which agents there are with their rules. Terms in rules read attributes as
`node.attribute`, and poses through `distance` and `in_view`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.logic import Term, Value, value
from codra_dsl.runtime.geometry import IDENTITY, Motion, Pose
from codra_dsl.runtime.values.model import ValueType

RT = "RT"
"""The label of edges that hold rigid motions."""

TASK = "task"
"""The type of nodes that tasks bring along."""


CONTEXT = "context"
"""The node whose attributes context-variables are that say no other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Writer:
    """An agent that may write something.

    Attributes:
        agent: its name.
        priority: what a writer with a larger one has written stands, while it is valid, against one with a smaller one.
    """

    agent: str
    priority: int = 0


def by(*agents: str) -> tuple[Writer, ...]:
    """Return writers of equal priority: of what they write the newest evidence wins."""
    return tuple(Writer(agent=agent) for agent in agents)


def ranked(*agents: str) -> tuple[Writer, ...]:
    """Return writers of which each goes before those that follow it."""
    return tuple(Writer(agent=agent, priority=len(agents) - rank) for rank, agent in enumerate(agents, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class AttributeModel:
    """A property of a node or an edge, such as the level of a battery.

    Attributes:
        type: with unit, range or members.
        sources: who may write it; nobody if empty: then only what is there from the start has it.
        valid_for_s: how long evidence stands; then the attribute is unknown.
        history: how many readings are kept.
    """

    name: str
    type: ValueType
    sources: tuple[Writer, ...] = ()
    valid_for_s: float = math.inf
    history: int = 100
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewModel:
    """What a camera sees: a pyramid about its optical axis z, x to the right and y down.

    Attributes:
        horizontal_rad: the whole angle of view from left to right, below pi.
        vertical_rad: the whole angle of view from top to bottom, below pi.
        nearest_m: along the optical axis.
        farthest_m: along the optical axis.
    """

    horizontal_rad: float
    vertical_rad: float
    nearest_m: float = 0.0
    farthest_m: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeTypeModel:
    """A type of nodes.

    Attributes:
        sources: who may insert and delete nodes of the type; nobody if empty.
        attributes: of each node of the type.
        view: of a camera: what `in_view` asks.
    """

    name: str
    sources: tuple[Writer, ...] = ()
    attributes: tuple[AttributeModel, ...] = ()
    view: ViewModel | None = None
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeTypeModel:
    """A type of edges. Between two nodes there is at most one edge of each label.

    Attributes:
        name: of the type.
        label: that edges of the type carry; `RT` for rigid motions, by default the name of the type.
        origins: types of nodes, or single nodes, from which an edge may go.
        targets: types of nodes, or single nodes, to which an edge may go.
        sources: who may insert, change and delete edges of the type.
        attributes: of each edge of the type.
        motion: how the target moves in the origin; None for a symbol.
    """

    name: str
    origins: tuple[str, ...]
    targets: tuple[str, ...]
    label: str = ""
    sources: tuple[Writer, ...] = ()
    attributes: tuple[AttributeModel, ...] = ()
    motion: Motion | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeModel:
    """A node that is there from the start.

    Attributes:
        type: the name of its type.
        attributes: that this node alone has, beside those of its type.
        values: of attributes, known from the start.
    """

    name: str
    type: str
    attributes: tuple[AttributeModel, ...] = ()
    values: Mapping[str, Value] = field(default_factory=dict)
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeModel:
    """An edge that is there from the start.

    Attributes:
        origin: the name of a node.
        type: the name of the type of the edge.
        target: the name of a node.
        values: of attributes, known from the start.
        pose: of the target in the origin, if the edge holds a rigid motion.
    """

    origin: str
    type: str
    target: str
    values: Mapping[str, Value] = field(default_factory=dict)
    pose: Pose = IDENTITY


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskModel:
    """A node and the edge on which a task is handed over (P2, section 3.2).

    A requester draws `wants` (P2's `starts`), the executor acknowledges by turning it into `is`, and ends it with a
    result as `finished`; the requester may turn `wants` and `is` into `aborted`, and so do deadlines.

    Attributes:
        name: of the task, and of its node, whose type is `task`.
        origin: the node that does it, from which the edge goes.
        by: the agent that executes it.
        requesters: agents that may ask for it, of which the newest request must wait until the task has ended.
        acknowledge_s: how long a request may go unacknowledged.
        finish_s: how long an acknowledged task may take.
        results: with which it can finish.
        attributes: of its node, such as the goal of a drive; its requesters write them unless they name their sources.
    """

    name: str
    origin: str
    by: str
    requesters: tuple[str, ...]
    results: tuple[str, ...]
    acknowledge_s: float = math.inf
    finish_s: float = math.inf
    attributes: tuple[AttributeModel, ...] = ()
    label: str = ""


class Direction(StrEnum):
    """Along an edge, or against it."""

    FORWARD = "forward"
    BACKWARD = "backward"


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A node on a path: a certain one, some one of a type, or any.

    Attributes:
        name: of the certain node; any if empty.
        type: which it must have; any if empty.
        called: what a match calls it; places with one such name are one node. Without, a place has no name of its own.
    """

    name: str = ""
    type: str = ""
    called: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """An edge on a path.

    Attributes:
        edge: the name of its type, or its label.
        direction: in which the path follows it.
    """

    edge: str
    direction: Direction = Direction.FORWARD


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Nodes with an edge between each and the next, such as `robot -wants-> detecting`.

    Attributes:
        places: one more than there are links.
    """

    places: tuple[Place, ...]
    links: tuple[Link, ...]

    def __str__(self) -> str:
        schema = [_place_text(self.places[0])]
        for link, place in zip(self.links, self.places[1:], strict=True):
            is_forward = link.direction is Direction.FORWARD
            schema.append(f"-{link.edge}->" if is_forward else f"<-{link.edge}-")
            schema.append(_place_text(place))
        return " ".join(schema)


@dataclass(frozen=True, slots=True, kw_only=True)
class Absence:
    """That there is nothing that matches a path."""

    path: Path

    def __str__(self) -> str:
        return f"not {self.path}"


Pattern = Path | Absence | Term
"""What can be asked of the graph: a path, that there is none, or a condition over attributes and poses."""


def some(type: str, *, called: str = "") -> Place:
    """Return some node of a type."""
    return Place(type=type, called=called)


def anything(*, called: str = "") -> Place:
    """Return any node."""
    return Place(called=called)


def backward(edge: str) -> Link:
    """Return an edge that a path follows against its direction."""
    return Link(edge=edge, direction=Direction.BACKWARD)


def path(first: str | Place, *rest: str | Place | Link) -> Path:
    """Return a path: a node, an edge, a node, and so on; names of nodes and edges stand for them.

    Raises:
        ValueError: if it does not end with a node, or an edge stands where a node does, or the other way round.
    """
    if len(rest) % 2:
        raise ValueError("a path ends with a node")
    links = tuple(_link(edge) for edge in rest[::2])
    return Path(places=(_place(first), *(_place(place) for place in rest[1::2])), links=links)


def absent(first: str | Place, *rest: str | Place | Link) -> Absence:
    """Return that there is no such path."""
    return Absence(path=path(first, *rest))


def distance(a: str, b: str) -> Term:
    """Return how far apart the origins of two nodes are, in metres; unknown if one stands nowhere, or did too long."""
    return value(f"distance({a}, {b})")


def in_view(node: str, camera: str) -> Term:
    """Return whether a camera sees the origin of a node; unknown if one stands nowhere, or did too long."""
    return value(f"in_view({node}, {camera})")


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleModel:
    """P2's triplet: the graph before, during and after an agent's action (P2, section 3.1)."""

    name: str
    before: tuple[Pattern, ...] = ()
    during: tuple[Pattern, ...] = ()
    after: tuple[Pattern, ...] = ()


class Phase(StrEnum):
    """What an agent is in a loop (P2, Figure 4)."""

    MONITOR = "monitor"
    ANALYSE = "analyse"
    PLAN = "plan"
    EXECUTE = "execute"


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentModel:
    """A declared writer of knowledge.

    Attributes:
        phase: what it is in a loop; None if in none.
        wakes: what wakes it, each for itself; if empty it is always active.
        owns: what it may write, as `type`, `type.attribute`, `node.attribute`, or the name of a type of edges.
        reads: what its rules and wakes read, named in the same way.
    """

    name: str
    phase: Phase | None = None
    wakes: tuple[Pattern, ...] = ()
    owns: tuple[str, ...] = ()
    reads: tuple[str, ...] = ()
    rules: tuple[RuleModel, ...] = ()
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class KnowledgeModel:
    """All that a spec says of its graph."""

    name: str
    node_types: tuple[NodeTypeModel, ...] = ()
    edge_types: tuple[EdgeTypeModel, ...] = ()
    nodes: tuple[NodeModel, ...] = ()
    edges: tuple[EdgeModel, ...] = ()
    tasks: tuple[TaskModel, ...] = ()
    agents: tuple[AgentModel, ...] = ()


def _place(place: str | Place | Link) -> Place:
    if isinstance(place, Link):
        raise ValueError(f"the edge {place.edge!r} stands where a path has a node")
    return Place(name=place) if isinstance(place, str) else place


def _link(edge: str | Place | Link) -> Link:
    if isinstance(edge, Place):
        raise ValueError(f"{_place_text(edge)!r} stands where a path has an edge")
    return Link(edge=edge) if isinstance(edge, str) else edge


def _place_text(place: Place) -> str:
    kind = place.name or (f"some {place.type}" if place.type else "anything")
    return f"{kind} as {place.called}" if place.called else kind
