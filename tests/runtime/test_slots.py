"""Who gets the slots of shared resources, and when."""

from __future__ import annotations

from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime import CallError, SimClock
from codra_dsl.runtime.model import ResourceModel
from codra_dsl.runtime.slots import MAIN_EXECUTION, Slots, Ticket
from tests.runtime.forests import World, forest, observer, seen, started, takes, variable


class Desk:
    """Slots and who was granted some, in order."""

    def __init__(self, counts: Mapping[str, int | None]) -> None:
        self.clock = SimClock()
        self.slots = Slots(self.clock, {name: ResourceModel(name=name, slots=count) for name, count in counts.items()})
        self.granted: list[str] = []
        self.tickets: dict[str, Ticket] = {}

    def ask(self, who: str, *slots: str, priority: float = 0.0, urgency: int = 0) -> None:
        self.tickets[who] = self.slots.request(slots, lambda: (priority, urgency), lambda: self.granted.append(who))

    def give_back(self, *names: str) -> list[str]:
        for name in names:
            self.slots.release(self.tickets[name])
        self.clock.sleep(0)
        return self.granted


def test_priority_goes_first_then_who_has_waited_longest_and_the_main_execution_before_all() -> None:
    desk = Desk({"eye": 1})
    desk.ask("holder", "eye")
    desk.clock.sleep(0)
    for who, priority in [("a", 0.0), ("b", 5.0), ("c", 0.0), ("d", 5.0), ("main", MAIN_EXECUTION)]:
        desk.ask(who, "eye", priority=priority)
    for who in ("holder", "main", "b", "d", "a", "c"):
        assert desk.give_back()[-1] == who
        desk.give_back(who)


def test_requests_of_one_instant_are_weighed_together() -> None:
    desk = Desk({"eye": 1})
    desk.ask("early", "eye", priority=1)
    desk.ask("urgent", "eye", priority=2)
    assert desk.give_back() == ["urgent"]


def test_several_slots_are_granted_together_or_not_at_all() -> None:
    """So two that need the same two never wait for each other."""
    desk = Desk({"eye": 1, "arm": 1})
    desk.ask("a", "eye", "arm")
    desk.ask("b", "arm", "eye")
    assert desk.give_back() == ["a"]
    assert desk.give_back("a") == ["a", "b"]


def test_who_waits_for_two_is_not_passed_for_ever_by_those_who_need_one() -> None:
    desk = Desk({"eye": 1, "arm": 1})
    desk.ask("e0", "eye")
    desk.ask("a0", "arm")
    desk.clock.sleep(0)
    desk.ask("both", "eye", "arm")
    desk.ask("e1", "eye")
    desk.ask("a1", "arm")
    assert desk.give_back("e0") == ["e0", "a0"]
    assert desk.give_back("a0") == ["e0", "a0", "both"]
    assert desk.give_back("both") == ["e0", "a0", "both", "e1", "a1"]


def test_who_needs_something_else_is_not_held_up() -> None:
    desk = Desk({"eye": 1, "arm": 1, "free": None})
    desk.ask("holder", "eye")
    desk.clock.sleep(0)
    desk.ask("waits", "eye", priority=9)
    for who in ("x", "y"):
        desk.ask(who, "free")
    desk.ask("arm", "arm")
    assert desk.give_back() == ["holder", "x", "y", "arm"]


def test_a_resource_can_have_several_slots_and_one_job_needs_one_of_them() -> None:
    desk = Desk({"eye": 2})
    for who in "abc":
        desk.ask(who, "eye", "eye")
    assert desk.give_back() == ["a", "b"]
    assert desk.give_back("a", "a") == ["a", "b", "c"]


def test_who_leaves_the_queue_is_not_granted() -> None:
    desk = Desk({"eye": 1})
    desk.ask("a", "eye")
    desk.clock.sleep(0)
    desk.ask("b", "eye")
    desk.ask("c", "eye")
    assert desk.give_back("b", "a") == ["a", "c"]


@given(st.lists(st.tuples(st.sampled_from(["eye", "arm", "both"]), st.integers(0, 3), st.booleans()), max_size=40))
def test_slots_never_run_out_or_multiply(requests: list[tuple[str, int, bool]]) -> None:
    desk = Desk({"eye": 1, "arm": 2})
    for number, (what, priority, gives_back) in enumerate(requests):
        desk.ask(str(number), *(["eye", "arm"] if what == "both" else [what]), priority=priority)
        if gives_back and desk.give_back():
            desk.give_back(desk.granted[number % len(desk.granted)])
        free = desk.slots.resources
        assert 0 <= free["eye"] <= 1
        assert 0 <= free["arm"] <= 2
    desk.give_back(*desk.tickets)
    assert desk.slots.resources == {"eye": 1, "arm": 2}


def test_a_job_needs_slots_of_a_resource_that_there_is() -> None:
    model = forest([variable("a")], observer("o", seen("eye", "a", slots=("visoin",))), slots={"vision": 1})
    with pytest.raises(CallError, match=r"perception 'eye' needs a slot of 'visoin', which is no resource"):
        started(model, World()).__enter__()


@pytest.mark.parametrize("how", ["returns", "raises", "times out", "is cancelled", "is voided", "is closed"])
def test_the_slot_of_a_job_is_free_again_however_the_job_ends(how: str) -> None:
    def raises(_: object) -> object:
        raise ValueError

    finds = {"raises": raises, "times out": takes(99, None)}
    world = World({"eye": finds.get(how, takes(2.0, {"seen": True}))})
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
