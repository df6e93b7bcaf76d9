"""Slots of shared resources. They determine how many jobs may use a resource at a time, and which job is next."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.values.model import ResourceModel

Precedence = Callable[[], tuple[float, int]]
"""Returns the present priority and urgency of a request; the request with the larger pair goes first."""

MAIN_EXECUTION_PRIORITY = math.inf
"""The priority of the main execution: its requests go before those of all observers (P1, section 3.2)."""

_TOLERANCE_S = 1e-9


class Ticket:
    """A request for slots, which waits in the queue and then holds the slots.

    Attributes:
        max_duration_s: the longest time for which the job uses the slots.
        age_s: how long the request has waited, without the time in which the main execution held all slots of a
            resource that the request needs.
        is_holding: whether the request was granted and its slots were not released yet.
    """

    __slots__ = ("_precedence", "age_s", "grant", "is_holding", "max_duration_s", "number", "slots")

    def __init__(
        self,
        slots: tuple[str, ...],
        precedence: Precedence,
        number: int,
        max_duration_s: float,
        grant: Callable[[], None],
    ) -> None:
        self.slots = slots
        self.number = number
        self.max_duration_s = max_duration_s
        self.grant = grant
        self.age_s = 0.0
        self.is_holding = False
        self._precedence = precedence

    @property
    def is_of_main_execution(self) -> bool:
        """Return whether the request is made by the main execution."""
        return self._precedence()[0] == MAIN_EXECUTION_PRIORITY

    def rank(self) -> tuple[float, int, int]:
        """Return the key by which waiting tickets are sorted; the ticket with the smallest key goes first."""
        priority, urgency = self._precedence()
        return (-priority, -urgency, self.number)


class Slots:
    """Grants slots by priority, then urgency, then waiting time, with a bound on the waiting time.

    The age of a waiting request grows while observers could use the slot. If n algorithms use a resource, each with one
    job at a time, and T is their longest timeout, no request waits until it is older than n T.

    A request is granted before older requests only if each older request can still begin in time, even if all requests
    before this older request take their longest time. So the oldest request can always be granted, and a new request,
    with n - 1 others before it, can be delayed by T.

    Several slots are granted together or not at all, so that no job holds one slot while it waits for another. A
    waiting request for several slots reserves them. So no request of lower rank that needs only one of them is granted
    instead.
    """

    def __init__(self, clock: Clock, resources: Mapping[str, ResourceModel]) -> None:
        """Start with all slots free. If a resource has no number of slots, any number of jobs can use it."""
        self._clock = clock
        self._free_slot_counts = {
            name: math.inf if model.slots is None else model.slots for name, model in resources.items()
        }
        self._slot_counts = dict(self._free_slot_counts)
        self._main_execution_slot_counts: Counter[str] = Counter()
        self._user_counts: Counter[str] = Counter()
        self._longest_timeouts_s: dict[str, float] = {}
        self._queue: dict[int, Ticket] = {}
        self._request_count = 0
        self._last_update_s = clock.now_s()
        self._is_grant_scheduled = False

    @property
    def free_slot_counts(self) -> Mapping[str, float]:
        """Return how many slots of each resource are free."""
        return self._free_slot_counts

    def register_user(self, slots: Iterable[str], timeout_s: float) -> None:
        """Register an algorithm whose jobs use some slots for at most `timeout_s`."""
        for slot in slots:
            self._user_counts[slot] += 1
            self._longest_timeouts_s[slot] = max(timeout_s, self._longest_timeouts_s.get(slot, 0.0))

    def request(
        self, slots: tuple[str, ...], precedence: Precedence, grant: Callable[[], None], max_duration_s: float = 0.0
    ) -> Ticket:
        """Add a request to the queue. When all its slots are free, `grant` is called in a separate event."""
        self._update_ages()
        self._request_count += 1
        ticket = Ticket(tuple(dict.fromkeys(slots)), precedence, self._request_count, max_duration_s, grant)
        self._queue[ticket.number] = ticket
        self._schedule_grant()
        return ticket

    def release(self, ticket: Ticket) -> None:
        """Release the slots of a ticket, or remove a waiting ticket from the queue. A second call does nothing."""
        self._update_ages()
        if ticket.is_holding:
            ticket.is_holding = False
            self._change_free_slots(ticket, 1)
        else:
            self._queue.pop(ticket.number, None)
        self._schedule_grant()

    def _schedule_grant(self) -> None:
        if self._queue and not self._is_grant_scheduled:
            self._is_grant_scheduled = True
            self._clock.call_at(self._clock.now_s(), self._grant_all)

    def _grant_all(self) -> None:
        self._is_grant_scheduled = False
        self._update_ages()
        waiting_tickets = sorted(self._candidate_tickets(), key=Ticket.rank)
        while self._grant_next(waiting_tickets):
            waiting_tickets = [ticket for ticket in waiting_tickets if ticket.number in self._queue]

    def _candidate_tickets(self) -> Iterable[Ticket]:
        """Return the whole queue; if no request for slots can be granted, only the requests that need no slot."""
        queue = self._queue.values()
        grantable_tickets = [
            ticket for ticket in queue if all(self._free_slot_counts[slot] > 0 for slot in ticket.slots)
        ]
        return queue if any(ticket.slots for ticket in grantable_tickets) else grantable_tickets

    def _grant_next(self, waiting_tickets: Sequence[Ticket]) -> bool:
        """Grant the first request whose slots are free, and all requests before it that need no slot.

        A slot for which an earlier request waits does not count as free. Return whether a request for slots was
        granted.
        """
        reserved_slot_counts: Counter[str] = Counter()
        spare_times_s = self._spare_times_s() if any(ticket.slots for ticket in waiting_tickets) else {}
        for ticket in waiting_tickets:
            if ticket.max_duration_s > spare_times_s.get(ticket.number, math.inf) + _TOLERANCE_S:
                continue
            if any(self._free_slot_counts[slot] <= reserved_slot_counts[slot] for slot in ticket.slots):
                reserved_slot_counts.update(ticket.slots)
            elif self._queue.pop(ticket.number, None) is not None:
                ticket.is_holding = True
                self._change_free_slots(ticket, -1)
                ticket.grant()
                if ticket.slots:
                    return True
        return False

    def _spare_times_s(self) -> dict[int, float]:
        """Return a mapping from the number of each request to the time by which it may still delay older requests."""
        spare_times_s: dict[int, float] = {}
        for slot, longest_timeout_s in self._longest_timeouts_s.items():
            bound_s, least_spare_s, earlier_durations_s = self._user_counts[slot] * longest_timeout_s, math.inf, 0.0
            for ticket in self._queue.values():
                if slot in ticket.slots and not ticket.is_of_main_execution:
                    spare_times_s[ticket.number] = min(least_spare_s, spare_times_s.get(ticket.number, math.inf))
                    least_spare_s = min(least_spare_s, bound_s - ticket.age_s - earlier_durations_s)
                    earlier_durations_s += ticket.max_duration_s
        return spare_times_s

    def _change_free_slots(self, ticket: Ticket, change: int) -> None:
        """Add `change` to the number of free slots of each resource of a ticket: 1 to release, -1 to occupy a slot."""
        for slot in ticket.slots:
            self._free_slot_counts[slot] += change
            if ticket.is_of_main_execution:
                self._main_execution_slot_counts[slot] -= change

    def _update_ages(self) -> None:
        """Add the elapsed time to the age of each waiting ticket.

        For a ticket, time does not count while the main execution holds all slots of a resource that the ticket needs.
        """
        now_s = self._clock.now_s()
        elapsed_s, self._last_update_s = now_s - self._last_update_s, now_s
        if elapsed_s <= 0 or not self._queue:
            return
        fully_taken_slots = {
            slot for slot, count in self._slot_counts.items() if self._main_execution_slot_counts[slot] >= count
        }
        for ticket in self._queue.values():
            if fully_taken_slots.isdisjoint(ticket.slots):
                ticket.age_s += elapsed_s
