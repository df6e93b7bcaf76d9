"""Who may write what, and what was refused: the mapping that P2 fixes at design time, kept at run time."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from codra_dsl.runtime.errors import NotASourceError
from codra_dsl.runtime.knowledge.declarations import Writer

MOST_REFUSALS = 10_000
"""Refusals that the audit tells at most."""

START = ""
"""Who wrote what is there from the start, and what the graph does by itself."""


class OutrankedError(PermissionError):
    """An agent wrote what another, which goes before it, has written and what still stands."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """A write that was refused.

    Attributes:
        instant_s: when.
        agent: who tried.
        why: what it would have written, and who may, as the error told it.
    """

    instant_s: float
    agent: str
    why: str


class Permissions:
    """Who may write one thing.

    Attributes:
        writers: all who may, and the graph itself.
        is_ranked: whether some of them go before others.
    """

    __slots__ = ("_priorities", "is_ranked", "writers")

    def __init__(self, writers: Sequence[Writer]) -> None:
        self._priorities = {writer.agent: writer.priority for writer in writers}
        self.writers = frozenset((*self._priorities, START))
        self.is_ranked = len(set(self._priorities.values())) > 1

    def check(self, agent: str, subject: str) -> None:
        """Do nothing if an agent may write something.

        Raises:
            NotASourceError: if it may not.
        """
        if agent not in self.writers:
            self.refuse(agent, subject)

    def refuse(self, agent: str, subject: str) -> NoReturn:
        """Tell an agent that it is none of the writers.

        Raises:
            NotASourceError: always.
        """
        may = " or ".join(self._priorities) or "nobody"
        raise NotASourceError(f"{subject!r} is for {may} to write, not for {agent!r}")

    def check_rank(self, agent: str, other: str, subject: str) -> None:
        """Do nothing if what another agent has written does not stand against an agent.

        Raises:
            OutrankedError: if it does.
        """
        if agent == START or self._priorities.get(other, 0) <= self._priorities[agent]:
            return
        raise OutrankedError(f"what {other!r} has written of {subject!r} still stands: it goes before {agent!r}")


class Audit:
    """The refusals, from all threads; the oldest go when there are too many.

    Attributes:
        count: of all refusals that there ever were.
    """

    def __init__(self) -> None:
        self.count = 0
        self._refusals: deque[Refusal] = deque(maxlen=MOST_REFUSALS)
        self._lock = threading.Lock()

    def refuse(self, refusal: Refusal) -> None:
        """Take down a refusal."""
        with self._lock:
            self.count += 1
            self._refusals.append(refusal)

    def refusals(self) -> tuple[Refusal, ...]:
        """Return the refusals, the oldest first."""
        with self._lock:
            return tuple(self._refusals)
