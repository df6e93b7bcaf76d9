"""Requests for slots are granted in the order that a plain implementation of the rules gives."""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.perception.requests import MAIN_EXECUTION_PRIORITY, Ticket
from codra_dsl.runtime.perception.slots import Slots
from codra_dsl.runtime.values.model import ResourceModel

SLOT_SETS: list[tuple[str, ...]] = [
    ("eye",), ("arm",), ("eye", "arm"), ("arm", "eye"), ("free",), ("eye", "free"), (),
]  # fmt: skip


@dataclass
class Request:
    """A request, as the plain implementation sees it."""

    number: int
    slots: tuple[str, ...]
    precedence: Callable[[], tuple[float, int]]
    max_duration_s: float
    age_s: float = 0.0
    is_holding: bool = False

    @property
    def is_of_main_execution(self) -> bool:
        return self.precedence()[0] == MAIN_EXECUTION_PRIORITY

    def rank(self) -> tuple[float, int, int]:
        priority, urgency = self.precedence()
        return -priority, -urgency, self.number


@dataclass
class PlainSlots:
    """The rules of docs/reference/runtime.md#slots, applied to all waiting requests at each grant."""

    counts: Mapping[str, float]
    users: list[tuple[tuple[str, ...], float]]
    queue: list[Request] = field(default_factory=list)
    holders: list[Request] = field(default_factory=list)

    def free(self, slot: str) -> float:
        return self.counts[slot] - sum(slot in holder.slots for holder in self.holders)

    def sleep(self, duration_s: float) -> None:
        main_execution_holds = Counter(
            slot for holder in self.holders if holder.is_of_main_execution for slot in holder.slots
        )
        for request in self.queue:
            if all(main_execution_holds[slot] < self.counts[slot] for slot in request.slots):
                request.age_s += duration_s

    def spare_time_s(self, request: Request) -> float:
        spare_s = math.inf
        for slot in () if request.is_of_main_execution else request.slots:
            timeouts_s = [timeout_s for slots, timeout_s in self.users if slot in slots]
            rivals = [other for other in self.queue if slot in other.slots and not other.is_of_main_execution]
            earlier_s = 0.0
            for other in rivals[: rivals.index(request)] if timeouts_s else ():
                spare_s = min(spare_s, len(timeouts_s) * max(timeouts_s) - other.age_s - earlier_s)
                earlier_s += other.max_duration_s
        return spare_s

    def grant_all(self) -> list[int]:
        granted_numbers: list[int] = []
        while (request := self.next_request()) is not None:
            self.queue.remove(request)
            self.holders.append(request)
            granted_numbers.append(request.number)
        return granted_numbers

    def next_request(self) -> Request | None:
        reserved_slots: Counter[str] = Counter()
        for request in sorted(self.queue, key=Request.rank):
            if request.max_duration_s > self.spare_time_s(request) + 1e-9:
                continue
            if all(self.free(slot) > reserved_slots[slot] for slot in request.slots):
                return request
            reserved_slots.update(request.slots)
        return None

    def release(self, request: Request) -> None:
        for requests in (self.queue, self.holders):
            if request in requests:
                requests.remove(request)


class Competition:
    """The same random requests and releases, made to `Slots` and to the plain rules."""

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)
        counts = {"eye": self._draw.choice([1, 1, 2]), "arm": self._draw.choice([1, 2, 3]), "free": None}
        self._users = [
            (self._draw.choice(SLOT_SETS), self._draw.choice([0.5, 1.0, 2.0, 3 * self._draw.random()]))
            for _ in range(self._draw.randint(2, 6))
        ]
        self._clock, self._version = SimClock(), 0
        resources = {name: ResourceModel(name=name, slots=count) for name, count in counts.items()}
        self._slots = Slots(self._clock, resources, order_version=lambda: self._version)
        for slots, timeout_s in self._users:
            self._slots.register_user(slots, timeout_s)
        self._plain = PlainSlots(
            {name: math.inf if count is None else count for name, count in counts.items()}, self._users
        )
        self._granted_numbers: list[int] = []
        self._requests: list[tuple[Ticket, Request]] = []
        self._precedences: list[tuple[float, int]] = []

    def step(self) -> tuple[list[int], list[int]]:
        """Make a random change, and return the numbers of the requests that are granted then, by both."""
        kind, earlier_count = self._draw.random(), len(self._granted_numbers)
        if kind < 0.5:
            self._request()
        elif kind < 0.85 and self._requests:
            ticket, request = self._draw.choice(self._requests)
            self._slots.release(ticket)
            self._plain.release(request)
        elif self._requests:
            number = self._draw.randrange(len(self._requests))
            self._precedences[number] = (self._precedences[number][0], self._draw.randint(0, 3))
            self._version += 1
            self._slots.release(self._slots.request((), lambda: (0.0, 0), lambda: None))  # for a new event
        self._clock.sleep(0.0)
        return self._granted_numbers[earlier_count:], self._plain.grant_all()

    def sleep(self) -> None:
        duration_s = self._draw.choice([0.0, 0.1, 0.5, 1.0, self._draw.random()])
        self._clock.sleep(duration_s)
        self._plain.sleep(duration_s)

    def _request(self) -> None:
        number, is_of_main_execution = len(self._requests), self._draw.random() < 0.1
        slots, duration_s = (
            (self._draw.choice(SLOT_SETS), 0.0) if is_of_main_execution else self._draw.choice(self._users)
        )
        priority = MAIN_EXECUTION_PRIORITY if is_of_main_execution else self._draw.choice([-1.0, 0.0, 0.0, 5.0])
        self._precedences.append((priority, self._draw.randint(0, 3)))
        precedence = partial(self._precedences.__getitem__, number)
        ticket = self._slots.request(slots, precedence, partial(self._granted_numbers.append, number), duration_s)
        request = Request(number, slots, precedence, duration_s)
        self._plain.queue.append(request)
        self._requests.append((ticket, request))


@pytest.mark.parametrize("seed", range(150))
def test_the_order_is_that_of_the_plain_rules(seed: int) -> None:
    competition = Competition(seed)
    for _ in range(60):
        granted_numbers, expected_numbers = competition.step()
        assert granted_numbers == expected_numbers
        competition.sleep()
