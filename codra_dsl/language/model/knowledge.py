"""Knowledge and agents as a spec declares them: P2's Deep State Representation (P2, sections 3.1 to 3.3)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from enum import StrEnum

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model.elements import FOREVER_S, Condition, Literal, Reference, ValueType

CONTEXT_NODE = "context"
"""The node of the context-variables that do not state `of`."""

POSES = "the knowledge graph"
"""The source of the results of comparisons with poses; no agent can have this name."""

DERIVED = "other context-variables"
"""The source of derived variables; no agent can have this name."""

TASK_TYPE = "task"
"""The type of the nodes that tasks declare implicitly."""

RT = "RT"
"""The label of edges with rigid motions."""

RESULT = "result"
"""The attribute of a task that contains the result with which it finished."""

TASK_ATTRIBUTES = ("request", "requester", RESULT, "reason")
"""The attributes of every task. Only requests, acknowledgements and ends of the task write them."""


class TaskState(StrEnum):
    """The label of the edge of a task (P2, section 3.2). In P2, the label `wants` is called `starts`."""

    WANTS = "wants"
    IS = "is"
    FINISHED = "finished"
    ABORTED = "aborted"


class Phase(StrEnum):
    """The role of an agent in a loop (P2, Figure 4)."""

    MONITOR = "monitor"
    ANALYSE = "analyse"
    PLAN = "plan"
    EXECUTE = "execute"


@dataclass(frozen=True, slots=True, kw_only=True)
class Writer:
    """An agent that may write something.

    Attributes:
        priority: the value of the writer with the higher priority wins while this value is valid; None if the spec
            states no priority.
    """

    name: str
    place: Place
    priority: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribute:
    """A property of the nodes or of the edges of a type.

    Attributes:
        sources: who may write the attribute; empty if the attribute states no `source` of its own.
    """

    name: str
    type: ValueType
    place: Place
    label: str = ""
    sources: tuple[Writer, ...] = ()
    valid_for_s: float = FOREVER_S
    history: int = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The field of view of a camera: a pyramid about its optical axis."""

    horizontal_rad: float
    vertical_rad: float
    nearest_m: float = 0.0
    farthest_m: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeType:
    """A type of nodes.

    Attributes:
        sources: who may insert and delete nodes of the type.
        places: the places of the entries, by key; `name` is the place of the type's name.
    """

    name: str
    place: Place
    label: str = ""
    sources: tuple[Writer, ...] = ()
    attributes: tuple[Attribute, ...] = ()
    view: View | None = None
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class StartingValue:
    """The initial value of an attribute; a number with a unit keeps the unit.

    Attributes:
        unit: the unit as written, or None.
        place: the place of the value.
        key: the place of the attribute's name.
    """

    name: str
    value: Literal
    unit: str | None
    place: Place
    key: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeElement:
    """A node that exists from the start.

    Attributes:
        values: the initial values of attributes, in file order.
    """

    name: str
    place: Place
    type: Reference
    label: str = ""
    values: tuple[StartingValue, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The declared properties of an edge with rigid motions; None selects the runtime's default."""

    history_s: float | None = None
    extrapolate_s: float | None = None
    valid_for_s: float | None = None
    is_static: bool = False

    @property
    def valid_s(self) -> float:
        """Return how long the newest pose is valid; the pose of a static edge is valid forever."""
        return math.inf if self.is_static or self.valid_for_s is None else self.valid_for_s


@dataclass(frozen=True, slots=True, kw_only=True)
class StartingPose:
    """The initial pose of an edge's target relative to its origin: rotated by roll, pitch, yaw, then translated.

    Attributes:
        translation_m: the translation along x, y and z.
        rotation_rad: the angles of roll about x, then pitch about y, then yaw about z, about fixed axes.
    """

    translation_m: tuple[float, float, float]
    rotation_rad: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeType:
    """A type of edges. If its label is `RT`, the edges are rigid motions, otherwise symbols.

    Attributes:
        origins: types of nodes, or single nodes, at which an edge may begin.
        targets: types of nodes, or single nodes, at which an edge may end.
        sources: who may insert, change and delete edges of this type.
        motion: the properties of the rigid motions; None for symbols.
        pose: the initial pose.
        places: the places of the entries, by key; `name` is the place of the type's name.
    """

    name: str
    place: Place
    label: str
    origins: tuple[Reference, ...]
    targets: tuple[Reference, ...]
    sources: tuple[Writer, ...] = ()
    attributes: tuple[Attribute, ...] = ()
    motion: Motion | None = None
    pose: StartingPose | None = None
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A task: its node and the edge on which it is handed over (P2, section 3.2).

    Attributes:
        origin: the node that does the task; the edge begins at this node.
        by: the agent that executes the task.
        requesters: the agents that may request the task.
        acknowledge_s: how long a request may stay unacknowledged.
        finish_s: how long an acknowledged request may take.
        results: the results with which the task can finish.
        places: the places of the entries, by key; `name` is the place of the task's name.
    """

    name: str
    place: Place
    label: str = ""
    origin: Reference
    by: Reference
    requesters: tuple[Reference, ...]
    results: tuple[Reference, ...]
    acknowledge_s: float = FOREVER_S
    finish_s: float = FOREVER_S
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentRule:
    """P2's triplet: the graph before, during and after an agent's action.

    Attributes:
        is_whole: whether all conditions of the rule could be read; otherwise some have no tree or are missing.
    """

    name: str
    place: Place
    before: tuple[Condition, ...] = ()
    during: tuple[Condition, ...] = ()
    after: tuple[Condition, ...] = ()
    is_whole: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Conduct:
    """How an agent participates in knowledge.

    Attributes:
        wakes: patterns; each of them alone wakes the agent. Without patterns, the agent is always active.
        owns: further elements that the agent may write, besides the elements that name the agent under `source`.
        reads: further elements that the agent reads, besides the elements in its rules and under `wakes`.
        places: the places of the entries, by key; `name` is the place of the agent's name.
    """

    label: str = ""
    phase: Phase | None = None
    wakes: tuple[Condition, ...] = ()
    owns: tuple[Reference, ...] = ()
    reads: tuple[Reference, ...] = ()
    rules: tuple[AgentRule, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)

    @property
    def is_bare(self) -> bool:
        """Whether nothing is declared here: then the agent is only an outside writer."""
        return not (self.label or self.phase or self.wakes or self.owns or self.reads or self.rules)


BARE = Conduct()
"""The conduct of an agent that is only an outside writer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agent:
    """An outside writer, by name, and how it participates in knowledge.

    Attributes:
        period_s: the time between two writes of each context-variable of which the agent is a source; None if the spec
            does not state it.
    """

    name: str
    place: Place
    conduct: Conduct = BARE
    period_s: float | None = None
