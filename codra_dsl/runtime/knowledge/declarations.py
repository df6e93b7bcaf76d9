"""The declarations of knowledge and agents in generated code, as frozen values (P2, sections 3.1 to 3.3).

The values describe a graph: the types of its nodes and edges, the permitted writers, the initial nodes and edges, the
tasks that are handed over on edges, and the agents with their rules. Terms in rules read attributes as
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
"""The type of the nodes of tasks."""


CONTEXT = "context"
"""The name of the node whose attributes are all context-variables that no other node declares as an attribute."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Writer:
    """An agent that may write something.

    Attributes:
        agent: the name of the agent.
        priority: while a value of this writer is valid, no writer with a lower priority can replace the value.
    """

    agent: str
    priority: int = 0


def by(*agents: str) -> tuple[Writer, ...]:
    """Return writers of equal priority: among their values the one with the newest evidence wins."""
    return tuple(Writer(agent=agent) for agent in agents)


def ranked(*agents: str) -> tuple[Writer, ...]:
    """Return writers in descending priority."""
    return tuple(Writer(agent=agent, priority=len(agents) - rank) for rank, agent in enumerate(agents, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class AttributeModel:
    """A property of a node or an edge, such as the level of a battery.

    Attributes:
        type: the type of the attribute's values, with unit, range or members.
        sources: the agents that may write the attribute. If empty, only initial nodes and edges can have a value.
        valid_for_s: how long a value is valid after the instant of its evidence; afterwards the attribute is unknown.
        history: the number of readings that are kept.
    """

    name: str
    type: ValueType
    sources: tuple[Writer, ...] = ()
    valid_for_s: float = math.inf
    history: int = 100
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewModel:
    """The field of view of a camera: a pyramid around its optical axis z, with x to the right and y down.

    Attributes:
        horizontal_rad: the angle of view from left to right, below pi.
        vertical_rad: the angle of view from top to bottom, below pi.
        nearest_m: the minimum distance along the optical axis.
        farthest_m: the maximum distance along the optical axis.
    """

    horizontal_rad: float
    vertical_rad: float
    nearest_m: float = 0.0
    farthest_m: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeTypeModel:
    """A type of nodes.

    Attributes:
        sources: the agents that may insert and delete nodes of the type; empty if there are only initial nodes.
        attributes: the attributes of every node of the type.
        view: the field of view for `in_view`, if the nodes are cameras.
    """

    name: str
    sources: tuple[Writer, ...] = ()
    attributes: tuple[AttributeModel, ...] = ()
    view: ViewModel | None = None
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeTypeModel:
    """A type of edges. Two nodes have at most one edge per label and direction.

    Attributes:
        name: the name of the type.
        label: the label of the edges. If empty, the label is `RT` for edges with a motion, otherwise the type's name.
        origins: types of nodes, or single nodes, from which an edge may go.
        targets: types of nodes, or single nodes, to which an edge may go.
        sources: the agents that may insert, change and delete edges of the type.
        attributes: the attributes of every edge of the type.
        motion: how the target moves relative to the origin; None for edges without a pose. Motion belongs to the edge
            and not to the node, so an object can be static while it is carried and not static after it is put down.
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
    """An initial node.

    Attributes:
        type: the name of the node's type.
        attributes: attributes that this node has in addition to those of its type.
        values: initial values of attributes.
    """

    name: str
    type: str
    attributes: tuple[AttributeModel, ...] = ()
    values: Mapping[str, Value] = field(default_factory=dict)
    label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeModel:
    """An initial edge.

    Attributes:
        origin: the name of a node.
        type: the name of the type of the edge.
        target: the name of a node.
        values: initial values of attributes.
        pose: the pose of the target relative to the origin, if the edge holds a rigid motion.
    """

    origin: str
    type: str
    target: str
    values: Mapping[str, Value] = field(default_factory=dict)
    pose: Pose = IDENTITY


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskModel:
    """A task: its node, and the edge on which the task is handed over (P2, section 3.2).

    A requester inserts the edge `wants` (P2's `starts`). The executor acknowledges the request by turning this edge
    into `is`, and ends the task by turning the edge into `finished` with a result. The requester, or a deadline, may
    turn `wants` or `is` into `aborted`.

    Attributes:
        name: the name of the task and of its node; the type of this node is `task`.
        origin: the node that does the task; the edge goes from this node.
        by: the agent that executes the task.
        requesters: the agents that may request the task. A new request must wait until the task has ended.
        results: the possible results of a finished task.
        acknowledge_s: the maximum time until a request is acknowledged.
        finish_s: the maximum time that an acknowledged task may take.
        attributes: the attributes of the task's node, such as the goal of a drive. The requesters write each attribute
            that does not declare its own sources.
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
    """The direction of a link: along its edge, or against its edge."""

    FORWARD = "forward"
    BACKWARD = "backward"


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A node on a path: a named node, some node of a type, or any node.

    Attributes:
        name: the name of the node; any node if empty.
        type: the required type; any type if empty.
        called: the name of this place in matches. Places with the same name match the same node. Empty if the place
            needs no name.
    """

    name: str = ""
    type: str = ""
    called: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    """An edge on a path.

    Attributes:
        edge: the name of the edge's type, or the edge's label.
        direction: the direction in which the path follows the edge.
    """

    edge: str
    direction: Direction = Direction.FORWARD


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Nodes, each connected to the next one by an edge, such as `robot -wants-> detecting`.

    Attributes:
        places: the nodes, one more than links.
        links: the edges.
    """

    places: tuple[Place, ...]
    links: tuple[Link, ...]

    def __str__(self) -> str:
        element_texts = [_place_text(self.places[0])]
        for link, place in zip(self.links, self.places[1:], strict=True):
            is_forward = link.direction is Direction.FORWARD
            element_texts.append(f"-{link.edge}->" if is_forward else f"<-{link.edge}-")
            element_texts.append(_place_text(place))
        return " ".join(element_texts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Absence:
    """The condition that no part of the graph matches a path."""

    path: Path

    def __str__(self) -> str:
        return f"not {self.path}"


Pattern = Path | Absence | Term
"""A pattern of the graph: a path, its absence, or a condition over attributes and poses."""


def some(type: str, *, called: str = "") -> Place:
    """Return a place for some node of a type."""
    return Place(type=type, called=called)


def anything(*, called: str = "") -> Place:
    """Return a place for any node."""
    return Place(called=called)


def backward(edge: str) -> Link:
    """Return a link that follows an edge against its direction."""
    return Link(edge=edge, direction=Direction.BACKWARD)


def path(first: str | Place, *rest: str | Place | Link) -> Path:
    """Return a path of alternating nodes and edges; a text is the name of a node or edge.

    Raises:
        ValueError: if the path does not end with a node, or if nodes and edges do not alternate.
    """
    if len(rest) % 2:
        raise ValueError("a path must end with a node")
    links = tuple(_as_link(edge) for edge in rest[::2])
    return Path(places=(_as_place(first), *(_as_place(place) for place in rest[1::2])), links=links)


def absent(first: str | Place, *rest: str | Place | Link) -> Absence:
    """Return the absence of a path."""
    return Absence(path=path(first, *rest))


def distance(a: str, b: str) -> Term:
    """Return a term for the distance in metres between the origins of two nodes.

    The distance is unknown if one of the nodes has no pose, or if a pose is stale.
    """
    return value(f"distance({a}, {b})")


def in_view(node: str, camera: str) -> Term:
    """Return a term for whether a camera sees the origin of a node.

    The result is unknown if the node or the camera has no pose, or if a pose is stale.
    """
    return value(f"in_view({node}, {camera})")


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleModel:
    """P2's triplet: the graph before, during and after an agent's action (P2, section 3.1)."""

    name: str
    before: tuple[Pattern, ...] = ()
    during: tuple[Pattern, ...] = ()
    after: tuple[Pattern, ...] = ()


class Phase(StrEnum):
    """The role of an agent in a loop (P2, Figure 4)."""

    MONITOR = "monitor"
    ANALYSE = "analyse"
    PLAN = "plan"
    EXECUTE = "execute"


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentModel:
    """A declared agent.

    Attributes:
        phase: the agent's role in a loop, if any.
        wakes: the patterns that wake the agent, independently of each other. If empty, the agent is always active.
        owns: the subjects that the agent may write: `type`, `type.attribute`, `node.attribute`, or the name of a type
            of edges.
        reads: the subjects that the agent's rules and `wakes` patterns read, in the same notation.
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
    """All declarations of a spec about its graph.

    Attributes:
        counts: the paths whose matches derived variables count.
    """

    name: str
    node_types: tuple[NodeTypeModel, ...] = ()
    edge_types: tuple[EdgeTypeModel, ...] = ()
    nodes: tuple[NodeModel, ...] = ()
    edges: tuple[EdgeModel, ...] = ()
    tasks: tuple[TaskModel, ...] = ()
    agents: tuple[AgentModel, ...] = ()
    counts: tuple[Path, ...] = ()


def _as_place(place: str | Place | Link) -> Place:
    if isinstance(place, Link):
        raise ValueError(f"expected a node in a path, not the edge {place.edge!r}")
    return Place(name=place) if isinstance(place, str) else place


def _as_link(edge: str | Place | Link) -> Link:
    if isinstance(edge, Place):
        raise ValueError(f"expected an edge in a path, not the node {_place_text(edge)!r}")
    return Link(edge=edge) if isinstance(edge, str) else edge


def _place_text(place: Place) -> str:
    node_text = place.name or (f"some {place.type}" if place.type else "anything")
    return f"{node_text} as {place.called}" if place.called else node_text
