"""The order in which slots of shared resources are granted."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.logic import value
from codra_dsl.runtime import CallError, Cost, Kind, SimClock
from codra_dsl.runtime.context.decisions import DecisionRequest
from codra_dsl.runtime.perception.requests import MAIN_EXECUTION_PRIORITY, Ticket
from codra_dsl.runtime.perception.slots import Slots
from codra_dsl.runtime.values.model import ResourceModel, SkillModel
from tests.runtime.forests import Manager, World, forest, observer, seen, started, takes, variable


class Desk:
    """Slots, and the names of the requests that were granted, in order."""

    def __init__(self, counts: Mapping[str, int | None]) -> None:
        self.clock = SimClock()
        self.slots = Slots(self.clock, {name: ResourceModel(name=name, slots=count) for name, count in counts.items()})
        self.granted_names: list[str] = []
        self.tickets: dict[str, Ticket] = {}

    def request(
        self, name: str, *slots: str, priority: float = 0.0, urgency: int = 0, max_duration_s: float = 0.0
    ) -> None:
        self.tickets[name] = self.slots.request(
            slots, lambda: (priority, urgency), lambda: self.granted_names.append(name), max_duration_s
        )

    def release(self, *names: str) -> list[str]:
        for name in names:
            self.slots.release(self.tickets[name])
        self.clock.sleep(0)
        return self.granted_names


def test_slots_are_granted_to_the_main_execution_then_by_priority_then_by_waiting_time() -> None:
    desk = Desk({"eye": 1})
    desk.request("holder", "eye")
    desk.clock.sleep(0)
    for name, priority in [("a", 0.0), ("b", 5.0), ("c", 0.0), ("d", 5.0), ("main", MAIN_EXECUTION_PRIORITY)]:
        desk.request(name, "eye", priority=priority)
    for name in ("holder", "main", "b", "d", "a", "c"):
        assert desk.release()[-1] == name
        desk.release(name)


def test_requests_at_the_same_instant_are_compared_with_each_other() -> None:
    desk = Desk({"eye": 1})
    desk.request("early", "eye", priority=1)
    desk.request("urgent", "eye", priority=2)
    assert desk.release() == ["urgent"]


def test_several_slots_are_granted_together_or_not_at_all() -> None:
    """So two requests for the same two slots never wait for each other."""
    desk = Desk({"eye": 1, "arm": 1})
    desk.request("a", "eye", "arm")
    desk.request("b", "arm", "eye")
    assert desk.release() == ["a"]
    assert desk.release("a") == ["a", "b"]


def test_a_request_for_two_slots_is_not_passed_forever_by_requests_for_one() -> None:
    desk = Desk({"eye": 1, "arm": 1})
    desk.request("e0", "eye")
    desk.request("a0", "arm")
    desk.clock.sleep(0)
    desk.request("both", "eye", "arm")
    desk.request("e1", "eye")
    desk.request("a1", "arm")
    assert desk.release("e0") == ["e0", "a0"]
    assert desk.release("a0") == ["e0", "a0", "both"]
    assert desk.release("both") == ["e0", "a0", "both", "e1", "a1"]


def test_a_request_for_other_slots_is_not_delayed() -> None:
    desk = Desk({"eye": 1, "arm": 1, "free": None})
    desk.request("holder", "eye")
    desk.clock.sleep(0)
    desk.request("waits", "eye", priority=9)
    for name in ("x", "y"):
        desk.request(name, "free")
    desk.request("arm", "arm")
    assert desk.release() == ["holder", "x", "y", "arm"]


def test_a_job_uses_one_of_several_slots_of_a_resource() -> None:
    desk = Desk({"eye": 2})
    for name in "abc":
        desk.request(name, "eye", "eye")
    assert desk.release() == ["a", "b"]
    assert desk.release("a", "a") == ["a", "b", "c"]


def test_a_request_that_left_the_queue_is_not_granted() -> None:
    desk = Desk({"eye": 1})
    desk.request("a", "eye")
    desk.clock.sleep(0)
    desk.request("b", "eye")
    desk.request("c", "eye")
    assert desk.release("b", "a") == ["a", "c"]


@given(st.lists(st.tuples(st.sampled_from(["eye", "arm", "both"]), st.integers(0, 3), st.booleans()), max_size=40))
def test_slots_never_run_out_or_multiply(requests: list[tuple[str, int, bool]]) -> None:
    desk = Desk({"eye": 1, "arm": 2})
    for number, (what, priority, must_release) in enumerate(requests):
        desk.request(str(number), *(["eye", "arm"] if what == "both" else [what]), priority=priority)
        if must_release and desk.release():
            desk.release(desk.granted_names[number % len(desk.granted_names)])
        free_slot_counts = desk.slots.free_slot_counts
        assert 0 <= free_slot_counts["eye"] <= 1
        assert 0 <= free_slot_counts["arm"] <= 2
    desk.release(*desk.tickets)
    assert desk.slots.free_slot_counts == {"eye": 1, "arm": 2}


def test_a_slot_of_an_undeclared_resource_is_an_error() -> None:
    model = forest([variable("a")], observer("o", seen("eye", "a", slots=("visoin",))), slots={"vision": 1})
    with pytest.raises(CallError, match=r"perception 'eye' needs a slot of 'visoin', which is not a resource"):
        started(model, World()).__enter__()


@pytest.mark.parametrize("how", ["returns", "raises", "times out", "is cancelled", "is voided", "is closed"])
def test_the_slot_is_released_whenever_a_job_ends(how: str) -> None:
    def raises(_: object) -> object:
        raise ValueError

    functions = {"raises": raises, "times out": takes(99, None)}
    world = World({"eye": functions.get(how, takes(2.0, {"seen": True}))})
    model = forest(
        [variable("a")],
        observer("o", seen("eye", "a", slots=("one",), timeout_s=2.5, min_interval_s=99)),
        slots={"one": 1},
    )
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(1.0)
        if how == "is cancelled":
            manager.withdraw("a")
        if how == "is voided":
            manager._forest.observers["o"].branches[0].void("a condition")
        if how == "is closed":
            manager.close()
        clock.sleep(2.0)
        with manager.slot("one"):
            assert clock.now_s() == 3.0


# The main execution


def test_a_thread_can_request_a_slot_that_it_already_holds() -> None:
    with started(forest([], slots={"eye": 1, "arm": 1}), World()) as manager:
        with manager.slot("eye"), manager.slot("eye"), manager.slot("eye", "eye"):
            assert manager._components.slots.free_slot_counts["eye"] == 0
        assert manager._components.slots.free_slot_counts["eye"] == 1
        with manager.slot("eye", "arm"), manager.slot("arm"):
            assert manager._components.slots.free_slot_counts == {"world": math.inf, "eye": 0, "arm": 0}
        assert manager._components.slots.free_slot_counts == {"world": math.inf, "eye": 1, "arm": 1}


def test_taking_slots_one_by_one_is_refused_and_the_message_shows_how_to_take_them_together() -> None:
    with (
        started(forest([], slots={"eye": 1, "arm": 1}), World()) as manager,
        manager.slot("eye"),
        pytest.raises(RuntimeError, match=r"request all slots in one call.*: slot\('eye', 'arm'\)"),
        manager.slot("arm"),
    ):
        pass
    assert manager._components.slots.free_slot_counts["eye"] == 1


# Urgency and age


def test_the_more_urgent_request_goes_first_among_equal_priorities() -> None:
    desk = Desk({"eye": 1})
    desk.request("holder", "eye")
    desk.clock.sleep(0)
    for name, priority, urgency in [("a", 0.0, 0), ("b", 0.0, 2), ("c", 1.0, 0), ("d", 0.0, 2)]:
        desk.request(name, "eye", priority=priority, urgency=urgency)
    for name in ("holder", "c", "b", "d"):
        desk.release(name)
    assert desk.granted_names == ["holder", "c", "b", "d", "a"]


def test_priority_decides_until_the_oldest_request_could_wait_too_long() -> None:
    """With two algorithms and timeouts of at most 3 s, a request waits for at most 6 s; others may pass it for 3 s."""
    desk = Desk({"eye": 1})
    desk.slots.register_user(("eye",), 3.0)
    desk.slots.register_user(("eye",), 2.0)
    desk.request("low", "eye", priority=-1, max_duration_s=2.0)
    desk.request("high 0", "eye", priority=9, max_duration_s=3.0)
    for number in range(6):
        desk.clock.sleep(1.0)
        desk.request(f"high {number + 1}", "eye", priority=9, max_duration_s=3.0)
        desk.release(desk.granted_names[-1])
    assert desk.granted_names == ["high 0", "high 1", "high 2", "high 3", "low", "high 4", "high 5"]


def test_requests_do_not_age_while_the_main_execution_holds_the_slot() -> None:
    desk = Desk({"eye": 1})
    for _ in range(2):
        desk.slots.register_user(("eye",), 3.0)
    desk.request("main", "eye", priority=MAIN_EXECUTION_PRIORITY)
    desk.clock.sleep(0)
    desk.request("low", "eye", priority=-1, max_duration_s=3.0)
    desk.clock.sleep(100.0)
    desk.request("high", "eye", priority=9, max_duration_s=3.0)
    assert desk.release("main")[-1] == "high"


NEEDS = ("waited for", "under way", "expected", "declared")


def need(manager: Manager, variable: str, how: str, expected: list[str]) -> None:
    """Let the main execution need a variable: sooner for a `how` that is earlier in `NEEDS`."""
    if how == "under way":
        manager.commands.begin(f"use_{variable}")
    elif how == "expected":
        expected.append(f"use_{variable}")
        manager.expect(*expected)
    else:
        manager.declare(variable)
    if how == "waited for":
        manager.commands.ask(DecisionRequest(variable=variable, wait_up_to_s=60.0))


@pytest.mark.parametrize("how_b", NEEDS)
@pytest.mark.parametrize("how_a", NEEDS)
def test_variables_that_are_needed_sooner_and_their_preconditions_are_observed_first(how_a: str, how_b: str) -> None:
    """`b` needs `c`; the observer of `c` competes with the observer of `a`, which requested the slot earlier."""
    once: dict[str, Any] = {"slots": ("one",), "min_interval_s": 99.0}
    model = forest(
        [variable(name) for name in "abcd"],
        observer("od", seen("see_d", "d", **once)),
        observer("oa", seen("see_a", "a", **once)),
        observer("ob", seen("see_b", "b", when=[value("c")])),
        observer("oc", seen("see_c", "c", **once)),
        skills=[SkillModel(name="use_a", preview=("a",)), SkillModel(name="use_b", preview=("b",))],
        slots={"one": 1},
    )
    world = World({f"see_{name}": takes(1.0, {"seen": True}) for name in "abcd"})
    clock, expected = SimClock(), list[str]()
    with started(model, world, clock) as manager:
        manager.declare("d")
        clock.sleep(0.1)
        need(manager, "a", how_a, expected)
        clock.sleep(0.1)
        need(manager, "b", how_b, expected)
        clock.sleep(9.0)
    order = sorted(("see_a", "see_c"), key=lambda name: world.asked_s(name)[0])
    assert order[0] == ("see_c" if NEEDS.index(how_b) < NEEDS.index(how_a) else "see_a")


# An hour of competition (a slot for six observers and the main execution)

LOADS = st.lists(
    st.tuples(
        st.integers(-3, 9),  # priority
        st.floats(0.05, 4.0),  # period
        st.floats(0.05, 3.0),  # how long a job takes
        st.floats(0.1, 2.0),  # timeout
    ),
    min_size=2,
    max_size=7,
)


@dataclass(frozen=True)
class Competition:
    """The results of observers that compete with the main execution for one slot.

    Attributes:
        waits_s: for each observer, how long each job waited; only the time that the main execution left free counts.
        bound_s: the number of observers times the longest timeout.
    """

    spent: Mapping[str, Cost]
    waits_s: Mapping[str, list[float]]
    main_s: float
    bound_s: float


def compete(
    loads: Sequence[tuple[int, float, float, float]], looks: Sequence[tuple[float, float]], for_s: float
) -> Competition:
    """Let observers compete while the main execution alternately pauses and looks."""
    names = [f"v{number}" for number in range(len(loads))]
    model = forest(
        [variable(name) for name in names],
        *(
            observer(
                name, seen(f"see_{name}", name, slots=("one",), timeout_s=timeout_s), priority=p, period_s=period_s
            )
            for name, (p, period_s, _, timeout_s) in zip(names, loads, strict=True)
        ),
        slots={"one": 1},
    )
    finds = {f"see_{name}": takes(load[2], {"seen": True}) for name, load in zip(names, loads, strict=True)}
    clock, free_clock, asked_s = SimClock(), FreeTime(), {}
    waits_s: dict[str, list[float]] = {name: [] for name in names}
    with started(model, World(finds), clock) as manager:
        request = manager._components.slots.request

        def record_request(
            slots: Any, precedence: Any, grant: Callable[[], None], max_duration_s: float = 0.0
        ) -> Ticket:
            free_time_s = free_clock.at(clock.now_s())
            return request(
                slots, precedence, lambda: (asked_s.update({clock.now_s(): free_time_s}), grant())[1], max_duration_s
            )

        manager._components.slots.request = record_request  # type: ignore[method-assign]
        for name in names:
            manager.declare(name)
        while clock.now_s() < for_s:
            pause_s, look_s = looks[int(clock.now_s()) % len(looks)]
            clock.sleep(pause_s)
            with manager.slot("one"):
                free_clock.stop(clock.now_s())
                clock.sleep(look_s)
                free_clock.go(clock.now_s())
        spent, events = manager.spent(), manager.record.of(Kind.JOB)
    for event in events:
        if event.what == "started":
            waits_s[event.name.removeprefix("see_")].append(free_clock.at(event.instant_s) - asked_s[event.instant_s])
    bound_s = len(loads) * max(timeout_s for *_, timeout_s in loads)
    return Competition(spent, waits_s, free_clock.taken_s, bound_s)


class FreeTime:
    """A clock of the time that the main execution leaves free."""

    def __init__(self) -> None:
        self.taken_s = 0.0
        self._spans: list[tuple[float, float]] = []
        self._since_s: float | None = None

    def stop(self, now_s: float) -> None:
        self._since_s = now_s

    def go(self, now_s: float) -> None:
        assert self._since_s is not None
        self._spans.append((self._since_s, now_s))
        self.taken_s += now_s - self._since_s
        self._since_s = None

    def at(self, now_s: float) -> float:
        open_s = 0.0 if self._since_s is None else now_s - self._since_s
        return now_s - open_s - sum(max(0.0, min(end_s, now_s) - start_s) for start_s, end_s in self._spans)


@settings(max_examples=15, deadline=None)
@given(LOADS, st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(0.0, 5.0)), min_size=1, max_size=4))
def test_no_job_waits_longer_than_observers_times_the_longest_timeout(
    loads: list[tuple[int, float, float, float]], looks: list[tuple[float, float]]
) -> None:
    """Only the slot time that the main execution leaves free counts; the bound holds for all priorities."""
    looks = [(pause_s + 0.1, look_s) for pause_s, look_s in looks]
    competition = compete(loads, looks, for_s=120.0)
    for waits_s in competition.waits_s.values():
        assert all(wait_s <= competition.bound_s + 1e-6 for wait_s in waits_s)


def test_no_observer_starves_when_six_share_a_slot_with_the_main_execution_for_an_hour() -> None:
    """The two observers of the highest priority could use all the slot time that the main execution leaves free."""
    loads = [(9, 0.1, 0.8, 2.0), (9, 0.1, 1.5, 2.0), (5, 0.5, 1.0, 2.0), (5, 2.0, 0.3, 2.0), (0, 1.0, 0.5, 2.0)]
    loads.append((0, 1.0, 9.0, 2.0))  # every job times out
    competition = compete(loads, [(4.0, 2.0)], for_s=3600.0)

    slot_s = sum(cost.slot_s for cost in competition.spent.values())
    assert 3590.0 <= slot_s + competition.main_s <= 3610.0, "the slot is never idle"
    assert competition.main_s == 1070.0
    for name, waits_s in competition.waits_s.items():
        assert max(waits_s) <= competition.bound_s, name
        assert competition.spent[name].jobs >= 3600 / (2 * competition.bound_s), name
    mean_waits_s = [sum(observer_waits_s) / len(observer_waits_s) for observer_waits_s in competition.waits_s.values()]
    assert max(mean_waits_s[:2]) < min(mean_waits_s[2:]) / 3
    assert competition.spent["v1"].slot_s > 2 * competition.spent["v5"].slot_s, "though its jobs are shorter"
    assert competition.spent["v5"].failed >= competition.spent["v5"].jobs - 1
    assert competition.spent["v0"].accepted >= competition.spent["v0"].jobs - 1
