"""Turning by 180 degrees on the spot, so that the fork is where the front was (P2, section 3.2)."""

from __future__ import annotations

from math import pi

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_papers.store.agents.working import Executor
from codra_papers.store.body import Body, Outcome, StopFunction
from codra_papers.store.geometry import wrapped

_RESULTS = {Outcome.DONE: "turned", Outcome.BLOCKED: "blocked", Outcome.BUMPED: "bumped"}


MAX_TRIES = 3
"""Number of tries before the result is `blocked`. In each try the motion layer waits for free room."""


class Turning:
    """Turns the robot by 180 degrees."""

    def __init__(self, knowledge: Knowledge, body: Body, _: Clock) -> None:
        """Wait for requests."""
        self._body = body
        self._goal_rad, self._try_count = 0.0, 0
        self._stop_command: StopFunction | None = None
        self._task = Executor(knowledge, knowledge.as_agent("turning"), "rotating", self._begin, self._stop)

    def _begin(self, _: Snapshot) -> None:
        self._goal_rad = self._body.believed_pose().heading_rad + pi
        self._try_count = 0
        self._turn(pi)

    def _turn(self, angle_rad: float) -> None:
        self._try_count += 1
        self._stop_command = self._body.turn(angle_rad, self._on_end)

    def _stop(self) -> None:
        if self._stop_command is not None:
            self._stop_command()

    def _on_end(self, outcome: Outcome) -> None:
        """After a blocked turn, try again to turn to the goal, in the direction that is now shorter."""
        if outcome is Outcome.BLOCKED and self._try_count < MAX_TRIES:
            self._turn(wrapped(self._goal_rad - self._body.believed_pose().heading_rad))
        elif outcome in _RESULTS:
            self._task.finish(_RESULTS[outcome])
