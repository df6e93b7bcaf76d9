"""Slots of shared resources: how many jobs may use a resource at a time, and in which order jobs get slots."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.values.model import ResourceModel

Precedence = Callable[[], tuple[float, int]]
"""Returns the present priority and urgency of a request; the request with the larger pair goes first."""

MAIN_EXECUTION = math.inf
"""The priority of the main execution, which goes before every observer (P1, section 3.2)."""

_TOLERANCE_S = 1e-9


class Ticket:
    """A request for slots, which waits in the queue and then holds the slots.

    Attributes:
        lasts_s: the longest time for which it uses the slots.
        age_s: how long it has waited, without the time in which the main execution held all slots.
        held: whether it holds the slots.
    """

    __slots__ = ("_precedence", "age_s", "grant", "held", "lasts_s", "number", "slots")

    def __init__(
        self, slots: tuple[str, ...], precedence: Precedence, number: int, lasts_s: float, grant: Callable[[], None]
    ) -> None:
        self.slots = slots
        self.number = number
        self.lasts_s = lasts_s
        self.grant = grant
        self.age_s = 0.0
        self.held = False
        self._precedence = precedence

    @property
    def is_of_main_execution(self) -> bool:
        """Return whether the request is made by the main execution."""
        return self._precedence()[0] == MAIN_EXECUTION

    def rank(self) -> tuple[float, int, int]:
        """Return the sort key among waiting tickets; the smallest goes first."""
        priority, urgency = self._precedence()
        return (-priority, -urgency, self.number)


class Slots:
    """Grants slots by priority, then urgency, then waiting time, with a bound on the waiting time.

    The age of a waiting request grows while observers could use the slot. If n algorithms use a resource, each with one
    job at a time, and T is their longest timeout, no request waits until it is older than n T. A request passes older
    requests only if each of them can still begin in time when all requests that are older still take their longest
    time. So the oldest request can always be granted, and a new request, with n - 1 others before it, has T to spare.

    Several slots are granted together or not at all, so that no job holds one slot while it waits for another. A
    request for several slots is not passed by requests of lower rank that need only one of them.
    """

    def __init__(self, clock: Clock, resources: Mapping[str, ResourceModel]) -> None:
        """Start with all slots free; a resource without a number of slots can be used by any number of jobs."""
        self._clock = clock
        self._free = {name: math.inf if model.slots is None else model.slots for name, model in resources.items()}
        self._all = dict(self._free)
        self._main: Counter[str] = Counter()
        self._users: Counter[str] = Counter()
        self._longest_s: dict[str, float] = {}
        self._queue: dict[int, Ticket] = {}
        self._requests = 0
        self._counted_s = clock.now_s()
        self._is_due = False

    @property
    def resources(self) -> Mapping[str, float]:
        """Return how many slots of each resource are free."""
        return self._free

    def expect(self, slots: Iterable[str], timeout_s: float) -> None:
        """Register an algorithm whose jobs use some slots for at most `timeout_s`."""
        for slot in slots:
            self._users[slot] += 1
            self._longest_s[slot] = max(timeout_s, self._longest_s.get(slot, 0.0))

    def request(
        self, slots: tuple[str, ...], precedence: Precedence, grant: Callable[[], None], lasts_s: float = 0.0
    ) -> Ticket:
        """Add a request to the queue; when all its slots are free, `grant` is called in a separate event."""
        self._grow_older()
        self._requests += 1
        ticket = Ticket(tuple(dict.fromkeys(slots)), precedence, self._requests, lasts_s, grant)
        self._queue[ticket.number] = ticket
        self._grant_soon()
        return ticket

    def release(self, ticket: Ticket) -> None:
        """Release the slots of a ticket, or remove it from the queue; a second call does nothing."""
        self._grow_older()
        if ticket.held:
            ticket.held = False
            self._move(ticket, 1)
        else:
            self._queue.pop(ticket.number, None)
        self._grant_soon()

    def _grant_soon(self) -> None:
        if self._queue and not self._is_due:
            self._is_due = True
            self._clock.call_at(self._clock.now_s(), self._grant_all)

    def _grant_all(self) -> None:
        self._is_due = False
        self._grow_older()
        waiting = sorted(self._candidates(), key=Ticket.rank)
        while self._grant_next(waiting):
            waiting = [ticket for ticket in waiting if ticket.number in self._queue]

    def _candidates(self) -> Iterable[Ticket]:
        """Return the queue. If no request for slots can be granted, return only the requests that need no slot."""
        free = [ticket for ticket in self._queue.values() if all(self._free[slot] > 0 for slot in ticket.slots)]
        return self._queue.values() if any(ticket.slots for ticket in free) else free

    def _grant_next(self, waiting: Sequence[Ticket]) -> bool:
        """Grant the first request whose slots are free and all requests before it that need no slot.

        The slots that earlier requests wait for count as taken. Return whether a request for slots was granted.
        """
        wanted: Counter[str] = Counter()
        spare_s = self._spare_s() if any(ticket.slots for ticket in waiting) else {}
        for ticket in waiting:
            if ticket.lasts_s > spare_s.get(ticket.number, math.inf) + _TOLERANCE_S:
                continue
            if any(self._free[slot] <= wanted[slot] for slot in ticket.slots):
                wanted.update(ticket.slots)
            elif self._queue.pop(ticket.number, None) is not None:
                ticket.held = True
                self._move(ticket, -1)
                ticket.grant()
                if ticket.slots:
                    return True
        return False

    def _spare_s(self) -> dict[int, float]:
        """Return, by the number of each request, for how long it can still delay the older requests."""
        spare_s: dict[int, float] = {}
        for slot, longest_s in self._longest_s.items():
            bound_s, least_s, before_s = self._users[slot] * longest_s, math.inf, 0.0
            for ticket in self._queue.values():
                if slot in ticket.slots and not ticket.is_of_main_execution:
                    spare_s[ticket.number] = min(least_s, spare_s.get(ticket.number, math.inf))
                    least_s = min(least_s, bound_s - ticket.age_s - before_s)
                    before_s += ticket.lasts_s
        return spare_s

    def _move(self, ticket: Ticket, count: int) -> None:
        """Add `count` to the free slots that a ticket uses: 1 to release them, -1 to take them."""
        for slot in ticket.slots:
            self._free[slot] += count
            if ticket.is_of_main_execution:
                self._main[slot] -= count

    def _grow_older(self) -> None:
        """Add the elapsed time to the age of each waiting ticket.

        Time does not count for a ticket while the main execution holds all slots of a resource that the ticket needs.
        """
        now_s = self._clock.now_s()
        passed_s, self._counted_s = now_s - self._counted_s, now_s
        if passed_s <= 0 or not self._queue:
            return
        of_main = {slot for slot, count in self._all.items() if self._main[slot] >= count}
        for ticket in self._queue.values():
            if of_main.isdisjoint(ticket.slots):
                ticket.age_s += passed_s
