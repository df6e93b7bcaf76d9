"""Slots of shared resources: how many jobs may use them at a time, and who goes first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.model import ResourceModel

MAIN_EXECUTION = math.inf
"""The priority of the main execution: it goes before every observer (P1, section 3.2)."""


class Ticket:
    """A place in the queue for slots, then the slots themselves."""

    __slots__ = ("grant", "held", "rank", "slots")

    def __init__(self, slots: tuple[str, ...], rank: tuple[float, int], grant: Callable[[], None]) -> None:
        self.slots = slots
        self.rank = rank
        self.grant = grant
        self.held = False


class Slots:
    """Grants slots by priority, then by waiting time.

    Several slots are granted together or not at all, so that nobody holds one while waiting for another; and whoever
    waits for several is not passed by those who need only one of them and rank lower.
    """

    def __init__(self, clock: Clock, resources: Mapping[str, ResourceModel]) -> None:
        """Make all slots free; a resource without a number of slots takes any number of jobs."""
        self._clock = clock
        self._free = {name: math.inf if model.slots is None else model.slots for name, model in resources.items()}
        self._queue: list[Ticket] = []
        self._requests = 0

    @property
    def resources(self) -> Mapping[str, float]:
        """Return how many slots of each resource are free."""
        return self._free

    def request(self, slots: tuple[str, ...], priority: float, grant: Callable[[], None]) -> Ticket:
        """Queue for slots; `grant` is called once all are free, in an event of its own."""
        self._requests += 1
        ticket = Ticket(tuple(dict.fromkeys(slots)), (-priority, self._requests), grant)
        self._queue.append(ticket)
        self._grant_soon()
        return ticket

    def release(self, ticket: Ticket) -> None:
        """Give slots back, or leave the queue; harmless when done twice."""
        if ticket.held:
            ticket.held = False
            for slot in ticket.slots:
                self._free[slot] += 1
        elif ticket in self._queue:
            self._queue.remove(ticket)
        self._grant_soon()

    def _grant_soon(self) -> None:
        if self._queue:
            self._clock.call_at(self._clock.now_s(), self._grant_all)

    def _grant_all(self) -> None:
        while (ticket := self._next()) is not None:
            self._queue.remove(ticket)
            ticket.held = True
            for slot in ticket.slots:
                self._free[slot] -= 1
            ticket.grant()

    def _next(self) -> Ticket | None:
        """Return the first in the queue whose slots are free, counting those that the ones before it wait for."""
        wanted: Counter[str] = Counter()
        for ticket in sorted(self._queue, key=lambda one: one.rank):
            if all(self._free[slot] > wanted[slot] for slot in ticket.slots):
                return ticket
            wanted.update(ticket.slots)
        return None
