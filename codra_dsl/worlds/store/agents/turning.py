"""Turning by 180 degrees on the spot, so that the fork comes to where the front was (P2, section 3.2)."""

from __future__ import annotations

from math import pi

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_dsl.worlds.store.agents.working import Executor
from codra_dsl.worlds.store.body import Body, Outcome

_RESULTS = {Outcome.DONE: "turned", Outcome.BLOCKED: "blocked", Outcome.BUMPED: "bumped"}


class Turning:
    """Turns the robot round."""

    def __init__(self, knowledge: Knowledge, body: Body, _: Clock) -> None:
        """Wait until somebody wants it."""
        self._body = body
        self._task = Executor(knowledge, knowledge.as_agent("turning"), "rotating", self._begin, body.stop)

    def _begin(self, _: Snapshot) -> None:
        self._body.turn(pi, self._done)

    def _done(self, outcome: Outcome) -> None:
        if outcome in _RESULTS:
            self._task.finish(_RESULTS[outcome])
