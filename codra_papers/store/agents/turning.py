"""Turning by 180 degrees on the spot, so that the fork is where the front was (P2, section 3.2)."""

from __future__ import annotations

from math import pi

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_papers.store.agents.working import Executor
from codra_papers.store.body import Body, Outcome, Stop
from codra_papers.store.geometry import wrapped

_RESULTS = {Outcome.DONE: "turned", Outcome.BLOCKED: "blocked", Outcome.BUMPED: "bumped"}


TRIES = 3
"""Number of tries before the result is `blocked`. In each try the motion layer waits for free room."""


class Turning:
    """Turns the robot by 180 degrees."""

    def __init__(self, knowledge: Knowledge, body: Body, _: Clock) -> None:
        """Wait for requests."""
        self._body = body
        self._goal_rad, self._tries = 0.0, 0
        self._halt: Stop | None = None
        self._task = Executor(knowledge, knowledge.as_agent("turning"), "rotating", self._begin, self._stop)

    def _begin(self, _: Snapshot) -> None:
        self._goal_rad = self._body.believed().heading_rad + pi
        self._tries = 0
        self._turn(pi)

    def _turn(self, angle_rad: float) -> None:
        self._tries += 1
        self._halt = self._body.turn(angle_rad, self._on_end)

    def _stop(self) -> None:
        if self._halt is not None:
            self._halt()

    def _on_end(self, outcome: Outcome) -> None:
        """After a blocked turn, try again by the remaining angle, or by the other side if that is shorter."""
        if outcome is Outcome.BLOCKED and self._tries < TRIES:
            self._turn(wrapped(self._goal_rad - self._body.believed().heading_rad))
        elif outcome in _RESULTS:
            self._task.finish(_RESULTS[outcome])
