"""Slots of shared resources: how many jobs may use them at a time, and who goes first."""

from __future__ import annotations

import math
from bisect import insort
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
        self._limited = tuple(name for name, free in self._free.items() if free < math.inf)
        self._queue: list[Ticket] = []
        self._unbound = 0
        self._requests = 0
        self._is_due = False

    @property
    def resources(self) -> Mapping[str, float]:
        """Return how many slots of each resource are free."""
        return self._free

    def request(self, slots: tuple[str, ...], priority: float, grant: Callable[[], None]) -> Ticket:
        """Queue for slots; `grant` is called once all are free, in an event of its own."""
        self._requests += 1
        limited = (slot for slot in slots if self._free[slot] < math.inf)
        ticket = Ticket(tuple(dict.fromkeys(limited)), (-priority, self._requests), grant)
        insort(self._queue, ticket, key=_rank)
        self._unbound += not ticket.slots
        self._grant_soon()
        return ticket

    def release(self, ticket: Ticket) -> None:
        """Give slots back, or leave the queue; harmless when done twice."""
        if ticket.held:
            ticket.held = False
            for slot in ticket.slots:
                self._free[slot] += 1
        elif ticket in self._queue:
            self._leave_queue(ticket)
        self._grant_soon()

    def _leave_queue(self, ticket: Ticket) -> None:
        self._queue.remove(ticket)
        self._unbound -= not ticket.slots

    def _grant_soon(self) -> None:
        if self._queue and not self._is_due:
            self._is_due = True
            self._clock.call_at(self._clock.now_s(), self._grant_all)

    def _grant_all(self) -> None:
        self._is_due = False
        chosen = self._choose()
        for ticket in chosen:
            self._leave_queue(ticket)
            ticket.held = True
        for ticket in chosen:
            ticket.grant()

    def _choose(self) -> list[Ticket]:
        """Take what is free, in the order of the queue, less what the ones before wait for; return who gets it.

        Once nothing is left, it looks no further, however long the queue is.
        """
        wanted: Counter[str] = Counter()
        chosen: list[Ticket] = []
        unbound = self._unbound
        for ticket in self._queue:
            unbound -= not ticket.slots
            if all(self._free[slot] > wanted[slot] for slot in ticket.slots):
                chosen.append(ticket)
                for slot in ticket.slots:
                    self._free[slot] -= 1
            else:
                wanted.update(ticket.slots)
            if not unbound and all(self._free[slot] <= wanted[slot] for slot in self._limited):
                break
        return chosen


def _rank(ticket: Ticket) -> tuple[float, int]:
    return ticket.rank
