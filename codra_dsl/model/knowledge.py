"""What a spec says of knowledge and agents: P2's Deep State Representation as declared (P2, sections 3.1 to 3.3)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.diagnostics import Place
from codra_dsl.model.elements import FOREVER_S, Condition, Literal, Reference, ValueType

CONTEXT_NODE = "context"
"""The node whose attributes context-variables are that do not say `of`."""

POSES = "the knowledge graph"
"""The source of what comparisons with poses come to; no agent can be called so."""

TASK_TYPE = "task"
"""The type of the nodes that tasks bring along."""

RT = "RT"
"""The label of edges that hold rigid motions."""

RESULT = "result"
"""The attribute of a task that says with which result it has finished."""

TOLD_BY_TASKS = ("request", "requester", RESULT, "reason")
"""The attributes of every task, which only the steps of its handshake write."""


class TaskState(StrEnum):
    """What the edge of a task says (P2, section 3.2); P2's `starts` is `wants`."""

    WANTS = "wants"
    IS = "is"
    FINISHED = "finished"
    ABORTED = "aborted"


class Phase(StrEnum):
    """What an agent is in a loop (P2, Figure 4)."""

    MONITOR = "monitor"
    ANALYSE = "analyse"
    PLAN = "plan"
    EXECUTE = "execute"


@dataclass(frozen=True, slots=True, kw_only=True)
class Writer:
    """Who may write something.

    Attributes:
        priority: what a writer with a larger one has written stands, while it is valid, against one with a smaller one;
            None where the spec states none.
    """

    name: str
    place: Place
    priority: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Attribute:
    """A property of nodes of a type or of edges.

    Attributes:
        sources: who may write it, where it says so itself.
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
    """What a camera sees: a pyramid about its optical axis."""

    horizontal_rad: float
    vertical_rad: float
    nearest_m: float = 0.0
    farthest_m: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeType:
    """A type of nodes.

    Attributes:
        sources: who may insert and delete nodes of the type.
        places: by key; also `name`.
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
    """The value of an attribute from the start; a number with a unit keeps that.

    Attributes:
        unit: as written; None where none is.
        place: of the value; `key` is that of the attribute's name.
    """

    name: str
    value: Literal
    unit: str | None
    place: Place
    key: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeElement:
    """A node that is there from the start.

    Attributes:
        values: of attributes, in file order.
    """

    name: str
    place: Place
    type: Reference
    label: str = ""
    values: tuple[StartingValue, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What is declared of an edge that holds rigid motions; None stands for what the runtime takes for granted."""

    history_s: float | None = None
    extrapolate_s: float | None = None
    valid_for_s: float | None = None
    is_static: bool = False

    @property
    def valid_s(self) -> float:
        """Return how long the newest pose counts; that of a static edge does so for good."""
        return math.inf if self.is_static or self.valid_for_s is None else self.valid_for_s


@dataclass(frozen=True, slots=True, kw_only=True)
class StartingPose:
    """Where the target of an edge stands in its origin from the start: turned by roll, pitch, yaw, then moved.

    Attributes:
        translation_m: x, y, z.
        rotation_rad: roll about x, then pitch about y, then yaw about z, of axes that stay.
    """

    translation_m: tuple[float, float, float]
    rotation_rad: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeType:
    """A type of edges: symbols, or rigid motions where its label is `RT`.

    Attributes:
        origins: types of nodes, or single nodes, from which an edge may go; also `targets`.
        sources: who may insert, change and delete such edges.
        motion: of rigid motions.
        pose: from the start.
        places: by key; also `name`.
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
    """A node and the edge on which a task is handed over (P2, section 3.2).

    Attributes:
        origin: the node that does it, from which the edge goes.
        by: the agent that executes it.
        requesters: agents that may ask for it.
        acknowledge_s: how long a request may go unacknowledged; also `finish_s`, once it is acknowledged.
        results: with which it can finish.
        places: by key; also `name`.
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
    """P2's triplet: the graph before, during and after an agent's action; what could not be read is left out.

    Attributes:
        is_whole: whether all of it could be read.
    """

    name: str
    place: Place
    before: tuple[Condition, ...] = ()
    during: tuple[Condition, ...] = ()
    after: tuple[Condition, ...] = ()
    is_whole: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Conduct:
    """How an agent takes part in knowledge.

    Attributes:
        wakes: what wakes it, each for itself; if empty it is always active.
        owns: what it may write beside what names it as `source`.
        reads: what it reads beside what its rules and wakes name.
        places: by key; also `name`.
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
        """Whether nothing is said of it: then it is an outside writer and no more."""
        return not (self.label or self.phase or self.wakes or self.owns or self.reads or self.rules)


BARE = Conduct()
"""Of an agent that is an outside writer and no more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agent:
    """An outside writer, by name, and how it takes part in knowledge."""

    name: str
    place: Place
    conduct: Conduct = BARE
