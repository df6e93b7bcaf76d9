"""Orders served strictly one after the other, without a reaction to other events.

This is P2's nominal course (section 5.1: pick up, deliver, back to the start) without its loops. The course is
aborted only by a deadline of a task.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge
from codra_papers.store.layout import DELIVERY
from codra_papers.store.mission.trip import AbortedError, Trip, TripError


class SequentialMission:
    """The agent `mission`: it serves the orders in the graph in the order of arrival."""

    def __init__(self, knowledge: Knowledge, clock: Clock) -> None:
        """Open the handles of the agents `mission` and `picking`. `serve` starts the work."""
        self._knowledge = knowledge
        self._clock = clock
        self._handle = knowledge.as_agent("mission")
        self._trip = Trip(knowledge, clock)

    def serve(self) -> None:
        """Serve orders until the clock ends the run."""
        while True:
            self._clock.wait_until(lambda: self._next_order() is not None, inf)
            while (order := self._next_order()) is not None:
                self._handle.set(order, "state", "open")
                self._handle.set("base", "base_notice", "none")
                self._handle.set(order, "state", self._serve_order(order))
            self._attempt(lambda: self._trip.go_to("start"))

    def _next_order(self) -> str | None:
        """Return the oldest order that has no state yet."""
        snapshot = self._knowledge.snapshot()
        waiting_nodes = (node for node in snapshot.nodes("order") if not snapshot.get(node.name, "state").known)
        return next((node.name for node in waiting_nodes), None)

    def _serve_order(self, order: str) -> str:
        snapshot = self._knowledge.snapshot()
        (origin,) = snapshot.edges("of_area", origin=order)
        (target,) = snapshot.edges("to_area", origin=order)
        try:
            if not self._trip.pick_up(origin.target):
                return "failed"
            self._trip.deliver(target.target)
        except (TripError, AbortedError):
            self._handle.set("base", "base_notice", "mission_aborted")
            self._put_down()
            return "failed"
        return "done"

    def _put_down(self) -> None:
        """Bring a container that is on the fork to the general delivery pose, as in P2 when a mission ends early."""
        loaded_reading = self._knowledge.get("robot", "loaded")
        if loaded_reading.known and loaded_reading.value:
            self._attempt(lambda: self._trip.deliver(DELIVERY.name))

    def _attempt(self, step: Callable[[], None]) -> None:
        try:
            step()
        except (TripError, AbortedError):
            self._handle.set("base", "base_notice", "mission_aborted")
