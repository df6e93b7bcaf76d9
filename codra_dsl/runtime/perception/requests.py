"""The requests that wait for slots: their order, and how long each may still delay older requests."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable

Precedence = Callable[[], tuple[float, int]]
"""Returns the present priority and urgency of a request; the request with the larger pair goes first."""

MAIN_EXECUTION_PRIORITY = math.inf
"""The priority of the main execution: its requests go before those of all observers (P1, section 3.2)."""

_TOLERANCE_S = 1e-9
_SPARE_ENTRY_COUNT = 16

Rank = tuple[float, int, int]
"""The key by which waiting requests are sorted: priority and urgency, both negated, and the number of the request."""


class Ticket:
    """A request for slots, which waits in the queue and then holds the slots.

    Attributes:
        lane: the waiting requests for the same slots.
        number: the number of the request; an older request has a smaller number.
        max_duration_s: the longest time for which the job uses the slots.
        grant: called when the request is granted.
        is_of_main_execution: whether the request is made by the main execution.
        is_waiting: whether the request was neither granted nor removed.
        is_holding: whether the request was granted and its slots were not released yet.
        deadlines_s: for each resource, see `SpareTimes`.
    """

    __slots__ = (
        "_precedence",
        "_start_s",
        "deadlines_s",
        "grant",
        "is_holding",
        "is_of_main_execution",
        "is_waiting",
        "lane",
        "max_duration_s",
        "number",
    )

    def __init__(
        self, lane: Lane, precedence: Precedence, number: int, max_duration_s: float, grant: Callable[[], None]
    ) -> None:
        self.lane = lane
        self.number = number
        self.max_duration_s = max_duration_s
        self.grant = grant
        self.is_of_main_execution = precedence()[0] == MAIN_EXECUTION_PRIORITY
        self.is_waiting = True
        self.is_holding = False
        self.deadlines_s: dict[str, float] = {}
        self._precedence = precedence
        self._start_s = lane.elapsed_s

    @property
    def slots(self) -> tuple[str, ...]:
        """Return the resources of which the request needs one slot each."""
        return self.lane.slots

    @property
    def age_s(self) -> float:
        """Return how long the request has waited.

        The time in which the main execution held all slots of a resource that the request needs does not count.
        """
        return self.lane.elapsed_s - self._start_s

    def rank(self) -> Rank:
        """Return the key by which waiting tickets are sorted; the ticket with the smallest key goes first."""
        priority, urgency = self._precedence()
        return (-priority, -urgency, self.number)


class Lane:
    """The waiting requests for the same slots, sorted by rank.

    Attributes:
        slots: the resources of which each request needs one slot.
        limited_slots: those of these resources that have a number of slots.
        elapsed_s: the time that counts for the age of these requests.
        waiting_count: the number of tickets that are waiting.
    """

    __slots__ = ("_heap", "elapsed_s", "limited_slots", "slots", "waiting_count")

    def __init__(self, slots: tuple[str, ...], limited_slots: tuple[str, ...]) -> None:
        self.slots = slots
        self.limited_slots = limited_slots
        self.elapsed_s = 0.0
        self.waiting_count = 0
        self._heap: list[tuple[Rank, Ticket]] = []  # may contain tickets that no longer wait

    def push(self, rank: Rank, ticket: Ticket) -> None:
        """Add a waiting ticket."""
        if len(self._heap) > 2 * self.waiting_count + _SPARE_ENTRY_COUNT:
            self.sort_again()
        heapq.heappush(self._heap, (rank, ticket))

    def first_rank(self) -> Rank | None:
        """Return the rank of the first ticket; None if no ticket waits."""
        while self._heap and not self._heap[0][1].is_waiting:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def pop(self) -> tuple[Rank, Ticket]:
        """Remove and return the first ticket and its rank; `first_rank` must have returned this rank."""
        return heapq.heappop(self._heap)

    def sort_again(self) -> None:
        """Sort the tickets by their present ranks, because priorities or urgencies have changed."""
        self._heap = [(ticket.rank(), ticket) for _, ticket in self._heap if ticket.is_waiting]
        heapq.heapify(self._heap)


class SpareTimes:
    """How long each request for slots of one resource may still delay the older requests for slots of this resource.

    If n algorithms use the resource and T is their longest timeout, no request may become older than n T. The spare
    time of a request is the time for which it could delay the older requests: after this time, one of them would be too
    late if all requests before it take their longest time. Spare times of older requests are never shorter.

    Computing all spare times visits all waiting requests. Therefore each request gets a deadline when it is added: its
    spare time lasts at least until `elapsed_s` reaches this deadline. Later additions do not change it, and removals
    only postpone it. All spare times are computed only if the deadline of a request is too early to grant the request.

    Requests of the main execution are never added.
    """

    def __init__(self, resource: str) -> None:
        """Start without users."""
        self.elapsed_s = 0.0
        self._resource = resource
        self._user_count = 0
        self._longest_timeout_s = 0.0
        self._tickets: dict[int, Ticket] = {}
        self._durations_s = 0.0
        self._next_deadline_s = math.inf
        self._is_exact = True

    def register_user(self, timeout_s: float) -> None:
        """Register an algorithm whose jobs use a slot for at most `timeout_s`, before its first request."""
        self._user_count += 1
        self._longest_timeout_s = max(timeout_s, self._longest_timeout_s)

    def advance(self, elapsed_s: float) -> None:
        """Let time pass in which observers could use the resource."""
        self.elapsed_s += elapsed_s
        self._is_exact = False

    def add(self, ticket: Ticket) -> None:
        """Add the newest request."""
        ticket.deadlines_s[self._resource] = self._next_deadline_s
        self._limit_next(self.elapsed_s + self._bound_s - self._durations_s)
        self._durations_s += ticket.max_duration_s
        self._tickets[ticket.number] = ticket

    def remove(self, ticket: Ticket) -> None:
        """Remove a request that does not wait any more."""
        if self._tickets.pop(ticket.number, None) is not None:
            self._durations_s -= ticket.max_duration_s
            self._is_exact = False
        if not self._tickets:
            self._durations_s, self._next_deadline_s = 0.0, math.inf

    def admits(self, ticket: Ticket) -> bool:
        """Return whether a request may be granted before all older requests."""
        if not self._lasts(ticket) and not self._is_exact:
            self._compute_deadlines()
        return self._lasts(ticket)

    @property
    def _bound_s(self) -> float:
        return self._user_count * self._longest_timeout_s if self._user_count else math.inf

    def _lasts(self, ticket: Ticket) -> bool:
        return ticket.max_duration_s <= ticket.deadlines_s[self._resource] - self.elapsed_s + _TOLERANCE_S

    def _limit_next(self, deadline_s: float) -> None:
        self._next_deadline_s = min(self._next_deadline_s, deadline_s)

    def _compute_deadlines(self) -> None:
        self._next_deadline_s, self._durations_s = math.inf, 0.0
        for ticket in self._tickets.values():
            ticket.deadlines_s[self._resource] = self._next_deadline_s
            self._limit_next(self.elapsed_s + (self._bound_s - ticket.age_s - self._durations_s))
            self._durations_s += ticket.max_duration_s
        self._is_exact = True
