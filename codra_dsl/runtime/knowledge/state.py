"""The whole graph at one time, as one value: whoever holds it sees nothing of what is written later."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from codra_dsl.runtime.geometry import Frames
from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.knowledge.graph_index import GraphIndex
from codra_dsl.runtime.knowledge.graph_schema import Stage
from codra_dsl.runtime.values.persistent import PersistentMap


class Request(NamedTuple):
    """What a requester asked for: a task, and the number of the request among all of this task."""

    task: str
    number: int


class Handover(NamedTuple):
    """How far a task is (P2, section 3.2).

    Attributes:
        task: its name.
        stage: None while nobody has asked for it.
        number: of its last request, from 1.
        requester: the agent that asked.
        since_s: since when it is at this stage.
        deadline_s: when it ends as aborted unless it goes on before; infinite if never.
        result: of a task that has finished.
        reason: why it was aborted: `requester`, `unacknowledged` or `overdue`.
    """

    task: str
    stage: Stage | None = None
    number: int = 0
    requester: str = ""
    since_s: float = -math.inf
    deadline_s: float = math.inf
    result: str | None = None
    reason: str = ""

    @property
    def request(self) -> Request:
        """Return what names the last request."""
        return Request(self.task, self.number)

    @property
    def is_open(self) -> bool:
        """Return whether it was asked for and has not ended."""
        return self.stage is Stage.WANTS or self.stage is Stage.IS


@dataclass(slots=True)
class State:
    """The whole graph at one time. A draft changes a copy; one that is or was the present state never changes.

    Attributes:
        since_s: when it became the present one.
        version: how many changes were made.
        next_number: of the next node or edge.
        nodes: by name.
        edges: by origin, label and target.
        index: where both are found.
        frames: where nodes stand.
        handovers: how far tasks are, by name.
        gone: when nodes were deleted whose poses are still told, by name.
    """

    since_s: float
    version: int
    next_number: int
    nodes: PersistentMap[str, Node]
    edges: PersistentMap[EdgeKey, Edge]
    index: GraphIndex
    frames: Frames
    handovers: Mapping[str, Handover]
    gone: Mapping[str, float]

    @classmethod
    def empty(cls, since_s: float) -> State:
        """Return the state of a graph in which there is nothing yet."""
        return cls(since_s, 0, 0, PersistentMap(), PersistentMap(), GraphIndex(), Frames(), {}, {})

    def next(self, since_s: float) -> State:
        """Return what comes after it, with nothing changed yet."""
        made = _new(State)  # to give nine things to its class would take half as long again
        made.since_s = since_s
        made.version = self.version + 1
        made.next_number = self.next_number
        made.nodes = self.nodes
        made.edges = self.edges
        made.index = self.index
        made.frames = self.frames
        made.handovers = self.handovers
        made.gone = self.gone
        return made


_new: Callable[[type[State]], State] = object.__new__
