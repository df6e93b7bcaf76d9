"""Slots of shared resources. They determine how many jobs may use a resource at a time, and which job is next."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.perception.requests import Lane, Precedence, Rank, SpareTimes, Ticket
from codra_dsl.runtime.values.model import ResourceModel


class Slots:
    """Grants slots by priority, then urgency, then waiting time, with a bound on the waiting time.

    The age of a waiting request grows while observers could use the slot. If n algorithms use a resource, each with one
    job at a time, and T is their longest timeout, no request gets older than n T.

    A request is granted before older requests only if each older request can still begin in time, even if all requests
    before this older request take their longest time. So the oldest request can always be granted, and a new request,
    with n - 1 others before it, can be delayed by T.

    Several slots are granted together or not at all, so that no job holds one slot while it waits for another. A
    waiting request for several slots reserves them. So no request of lower rank that needs only one of them is granted
    instead.
    """

    def __init__(
        self, clock: Clock, resources: Mapping[str, ResourceModel], order_version: Callable[[], object] = lambda: 0
    ) -> None:
        """Start with all slots free. If a resource has no number of slots, any number of jobs can use it.

        Args:
            clock: the clock on which requests are granted.
            resources: the resources by name.
            order_version: returns another value if the precedence of a waiting request may have changed.
        """
        self._clock = clock
        self._free_slot_counts = {
            name: math.inf if model.slots is None else model.slots for name, model in resources.items()
        }
        self._slot_counts = dict(self._free_slot_counts)
        self._main_execution_slot_counts: Counter[str] = Counter()
        self._spare_times = {name: SpareTimes(name) for name in resources}
        self._lanes: dict[tuple[str, ...], Lane] = {}
        self._new_tickets: list[Ticket] = []
        self._order_version = order_version
        self._sorted_version: object = None
        self._request_count = 0
        self._last_update_s = clock.now_s()
        self._is_grant_scheduled = False

    @property
    def free_slot_counts(self) -> Mapping[str, float]:
        """Return how many slots of each resource are free."""
        return self._free_slot_counts

    def register_user(self, slots: Iterable[str], timeout_s: float) -> None:
        """Register an algorithm whose jobs use some slots for at most `timeout_s`, before its first request."""
        for slot in slots:
            self._spare_times[slot].register_user(timeout_s)

    def request(
        self, slots: tuple[str, ...], precedence: Precedence, grant: Callable[[], None], max_duration_s: float = 0.0
    ) -> Ticket:
        """Add a request to the queue. When all its slots are free, `grant` is called in a separate event."""
        self._update_ages()
        self._request_count += 1
        lane = self._lane(tuple(dict.fromkeys(slots)))
        ticket = Ticket(lane, precedence, self._request_count, max_duration_s, grant)
        if not ticket.is_of_main_execution:
            for slot in ticket.slots:
                self._spare_times[slot].add(ticket)
        self._new_tickets.append(ticket)
        lane.waiting_count += 1
        self._schedule_grant()
        return ticket

    def release(self, ticket: Ticket) -> None:
        """Release the slots of a ticket, or remove a waiting ticket from the queue. A second call does nothing."""
        self._update_ages()
        if ticket.is_holding:
            ticket.is_holding = False
            self._change_free_slots(ticket, 1)
        elif ticket.is_waiting:
            self._remove(ticket)
        self._schedule_grant()

    def _lane(self, slots: tuple[str, ...]) -> Lane:
        if slots not in self._lanes:
            limited_slots = tuple(slot for slot in slots if self._slot_counts[slot] < math.inf)
            self._lanes[slots] = Lane(slots, limited_slots)
        return self._lanes[slots]

    def _remove(self, ticket: Ticket) -> None:
        """Remove a ticket from the waiting tickets."""
        ticket.is_waiting = False
        ticket.lane.waiting_count -= 1
        for slot in ticket.slots:
            self._spare_times[slot].remove(ticket)

    def _is_any_waiting(self) -> bool:
        return any(lane.waiting_count for lane in self._lanes.values())

    def _schedule_grant(self) -> None:
        if self._is_any_waiting() and not self._is_grant_scheduled:
            self._is_grant_scheduled = True
            self._clock.call_at(self._clock.now_s(), self._grant_all)

    def _grant_all(self) -> None:
        self._is_grant_scheduled = False
        self._update_ages()
        self._sort()
        while self._grant_next():
            pass

    def _sort(self) -> None:
        """Sort the waiting tickets, with those that were requested since the last time.

        The order then stays the same until the next event: tickets that are requested meanwhile wait for this event.
        """
        version = self._order_version()
        if version != self._sorted_version:
            self._sorted_version = version
            for lane in self._lanes.values():
                lane.sort_again()
        new_tickets, self._new_tickets = self._new_tickets, []
        for ticket in new_tickets:
            if ticket.is_waiting:
                ticket.lane.push(ticket.rank(), ticket)

    def _grant_next(self) -> bool:
        """Grant the first request whose slots are free, and all requests before it that need no slot.

        A slot for which an earlier request waits does not count as free. Return whether a request for slots was
        granted.
        """
        reserved_slot_counts: Counter[str] = Counter()
        passed_tickets: list[tuple[Rank, Ticket]] = []
        try:
            for rank, ticket in self._tickets_by_rank(reserved_slot_counts):
                if not all(self._admits(slot, ticket) for slot in ticket.slots):
                    passed_tickets.append((rank, ticket))
                elif any(self._free_slot_counts[slot] <= reserved_slot_counts[slot] for slot in ticket.slots):
                    passed_tickets.append((rank, ticket))
                    reserved_slot_counts.update(ticket.slots)
                else:
                    self._grant(ticket)
                    if ticket.slots:
                        return True
            return False
        finally:
            for rank, ticket in passed_tickets:
                ticket.lane.push(rank, ticket)

    def _tickets_by_rank(self, reserved_slot_counts: Mapping[str, int]) -> Iterator[tuple[Rank, Ticket]]:
        """Remove and yield the waiting tickets and their ranks, in the order of the ranks.

        The tickets of a lane are left out if all of their slots are taken or reserved. Such tickets cannot be granted,
        and cannot reserve a slot that another request could get.
        """
        while True:
            first_lanes = [
                (rank, lane)
                for lane in self._lanes.values()
                if self._can_matter(lane, reserved_slot_counts) and (rank := lane.first_rank()) is not None
            ]
            if not first_lanes:
                return
            yield min(first_lanes)[1].pop()

    def _can_matter(self, lane: Lane, reserved_slot_counts: Mapping[str, int]) -> bool:
        """Return whether a ticket of a lane could be granted, or could reserve a slot that is free."""
        return not lane.limited_slots or any(
            self._free_slot_counts[slot] > reserved_slot_counts[slot] for slot in lane.limited_slots
        )

    def _admits(self, slot: str, ticket: Ticket) -> bool:
        """Return whether the older requests for a slot can still begin in time after a ticket."""
        return ticket.is_of_main_execution or self._spare_times[slot].admits(ticket)

    def _grant(self, ticket: Ticket) -> None:
        self._remove(ticket)
        ticket.is_holding = True
        self._change_free_slots(ticket, -1)
        ticket.grant()

    def _change_free_slots(self, ticket: Ticket, change: int) -> None:
        """Add `change` to the number of free slots of each resource of a ticket: 1 to release, -1 to occupy a slot."""
        for slot in ticket.slots:
            self._free_slot_counts[slot] += change
            if ticket.is_of_main_execution:
                self._main_execution_slot_counts[slot] -= change

    def _update_ages(self) -> None:
        """Let all waiting tickets grow older by the elapsed time.

        For a ticket, time does not count while the main execution holds all slots of a resource that the ticket needs.
        """
        now_s = self._clock.now_s()
        elapsed_s, self._last_update_s = now_s - self._last_update_s, now_s
        if elapsed_s <= 0 or not self._is_any_waiting():
            return
        fully_taken_slots = {
            slot for slot, count in self._slot_counts.items() if self._main_execution_slot_counts[slot] >= count
        }
        for lane in self._lanes.values():
            if fully_taken_slots.isdisjoint(lane.slots):
                lane.elapsed_s += elapsed_s
        for slot, spare_times in self._spare_times.items():
            if slot not in fully_taken_slots:
                spare_times.advance(elapsed_s)
