"""One version of the graph as a value that later writes do not change."""

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


class OvertakenError(Exception):
    """During a write, the same thread has made another write, for example in a signal handler.

    This inner write is complete. The interrupted write is repeated on the result of the inner write.
    """


class Request(NamedTuple):
    """A request of a task, with its number among all requests of this task."""

    task: str
    number: int


class Handover(NamedTuple):
    """The progress of a task (P2, section 3.2).

    Attributes:
        task: the name of the task.
        stage: the stage of the task; None before the first request.
        number: the number of the latest request, from 1.
        requester: the agent of the latest request.
        since_s: when this stage began.
        deadline_s: when the task is aborted if it is still at this stage; infinite without a deadline.
        result: the result, if the task has finished.
        reason: why the task was aborted: `requester`, `unacknowledged`, `overdue` or `executor_lost`.
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
        """Return the latest request."""
        return Request(self.task, self.number)

    @property
    def is_open(self) -> bool:
        """Return whether the task was requested and has not ended."""
        return self.stage is Stage.WANTS or self.stage is Stage.IS


@dataclass(slots=True)
class State:
    """One version of the graph. A change set changes a copy; a state that is or was the present one never changes.

    Attributes:
        since_s: when the state became the present one.
        version: the number of changes so far.
        next_number: the number of the next node or edge.
        nodes: the nodes, by name.
        edges: the edges, by origin, label and target.
        index: the index of nodes and edges.
        frames: the poses of nodes.
        handovers: the handovers of tasks, by the name of the task.
        deletion_times_s: when each deleted node was deleted, by the name of the node, while its past poses are kept.
    """

    since_s: float
    version: int
    next_number: int
    nodes: PersistentMap[str, Node]
    edges: PersistentMap[EdgeKey, Edge]
    index: GraphIndex
    frames: Frames
    handovers: Mapping[str, Handover]
    deletion_times_s: Mapping[str, float]

    @classmethod
    def empty(cls, since_s: float) -> State:
        """Return the state of an empty graph."""
        return cls(since_s, 0, 0, PersistentMap(), PersistentMap(), GraphIndex(), Frames(), {}, {})

    def next(self, since_s: float) -> State:
        """Return a copy as the next version, for a change set."""
        state = _allocate_state(State)  # a call of the class with nine arguments takes 1.5 times as long
        state.since_s = since_s
        state.version = self.version + 1
        state.next_number = self.next_number
        state.nodes = self.nodes
        state.edges = self.edges
        state.index = self.index
        state.frames = self.frames
        state.handovers = self.handovers
        state.deletion_times_s = self.deletion_times_s
        return state


_allocate_state: Callable[[type[State]], State] = object.__new__
