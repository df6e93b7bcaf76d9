"""Permissions to write, and the audit of refused writes.

P2 fixes at design time which agent writes what; these permissions enforce that mapping at run time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from codra_dsl.runtime.errors import NotASourceError
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.knowledge.declarations import Writer

MAX_REFUSALS = 10_000
"""The maximum number of refusals in the audit."""

GRAPH_WRITER = ""
"""The writer of the initial graph, and of changes by the graph itself."""


class OutrankedError(PermissionError):
    """An agent tried to overwrite something that is still valid and that an agent with a higher priority wrote."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """A write that was refused.

    Attributes:
        instant_s: the instant of the attempt.
        agent: the agent that tried to write.
        why: the message of the error, with the subject and the permitted writers.
    """

    instant_s: float
    agent: str
    why: str


class Permissions:
    """The permissions to write one subject.

    Attributes:
        writers: all permitted agents, and the graph itself.
        is_ranked: whether the writers have different priorities.
    """

    __slots__ = ("_priorities", "is_ranked", "writers")

    def __init__(self, writers: Sequence[Writer]) -> None:
        self._priorities = {writer.agent: writer.priority for writer in writers}
        self.writers = frozenset((*self._priorities, GRAPH_WRITER))
        self.is_ranked = len(set(self._priorities.values())) > 1

    def check(self, agent: str, subject: str) -> None:
        """Check that an agent may write a subject.

        Raises:
            NotASourceError: if the agent may not write the subject.
        """
        if agent not in self.writers:
            self.refuse(agent, subject)

    def refuse(self, agent: str, subject: str) -> NoReturn:
        """Raise the error for an agent without permission.

        Raises:
            NotASourceError: always.
        """
        writers_text = " or ".join(self._priorities) or "no agent"
        raise NotASourceError(f"{subject!r} may be written by {writers_text}, not by {agent!r}")

    def priority(self, agent: str) -> int:
        """Return the priority of an agent among the permitted writers; 0 for the graph itself."""
        return self._priorities.get(agent, 0)

    def check_rank(self, agent: str, previous_writer: str, subject: str) -> None:
        """Check that an agent may overwrite the valid value of another agent.

        Raises:
            OutrankedError: if the other agent has a higher priority.
        """
        if agent == GRAPH_WRITER or self._priorities.get(previous_writer, 0) <= self._priorities[agent]:
            return
        raise OutrankedError(
            f"{agent!r} cannot overwrite {subject!r}: "
            f"{previous_writer!r} wrote it with a higher priority, and it is still valid"
        )


class Audit:
    """The latest refusals; threads may share it.

    Attributes:
        total_count: the number of all refusals so far.
    """

    def __init__(self) -> None:
        self.total_count = 0
        self._refusals: deque[Refusal] = deque(maxlen=MAX_REFUSALS)
        self._lock = new_lock()

    def add(self, refusal: Refusal) -> None:
        """Add a refusal."""
        with self._lock:
            self.total_count += 1
            self._refusals.append(refusal)

    def refusals(self) -> tuple[Refusal, ...]:
        """Return the refusals, the oldest first."""
        with self._lock:
            return tuple(self._refusals)
