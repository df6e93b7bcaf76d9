"""Steps: time does not pass within a step, and all its events have the same instant."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import SimClock, WallClock
from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S
from codra_dsl.runtime.locked_clock import LockedClock
from tests.runtime.forests import World, forest, given, observer, seen, started, variable

PATIENCE_S = 60.0


@pytest.fixture
def wall() -> Iterator[WallClock]:
    with WallClock() as clock:
        yield clock


def test_time_does_not_pass_within_a_step_but_does_for_other_threads(wall: WallClock) -> None:
    clock = LockedClock(wall, threading.RLock())
    seen_by_others: list[float] = []
    with clock:
        first = clock.now_s()
        thread = threading.Thread(target=lambda: seen_by_others.append(clock.now_s()))
        wall.sleep(0.01)
        thread.start()
        thread.join(PATIENCE_S)
        with clock:
            assert clock.now_s() == first
        assert clock.now_s() == first
    assert seen_by_others[0] > first
    assert clock.now_s() > first


def test_instants_of_steps_never_decrease(wall: WallClock) -> None:
    clock, instants_s = LockedClock(wall, threading.RLock()), list[float]()

    def record_instant() -> None:
        instants_s.append(clock.now_s())
        clock.notify()

    def run_steps() -> None:
        for _ in range(200):
            with clock:
                record_instant()
                clock.call_at(clock.now_s() + 0.001, record_instant)

    threads = [threading.Thread(target=run_steps) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert clock.wait_until(lambda: len(instants_s) == 1600, PATIENCE_S)
    assert instants_s == sorted(instants_s)
    assert clock.step_count == 800


def test_an_event_on_time_happens_at_its_time_and_a_late_one_when_it_happens(wall: WallClock) -> None:
    clock, names_and_instants = LockedClock(wall, threading.RLock()), list[tuple[str, float]]()
    late_instants_s: list[float] = []
    clock.on_late_event = lambda: late_instants_s.append(clock.now_s())

    def record_event(name: str) -> None:
        names_and_instants.append((name, clock.now_s()))
        clock.notify()

    start_s = wall.now_s()
    with clock:
        clock.call_at(start_s + 0.2, lambda: record_event("punctual"))
    assert clock.wait_until(lambda: len(names_and_instants) == 1, PATIENCE_S)
    release_event = threading.Event()
    wall.call_at(wall.now_s(), lambda: release_event.wait(PATIENCE_S))  # no other event happens meanwhile
    with clock:
        due_s = clock.now_s() + 0.01
        clock.call_at(due_s, lambda: record_event("late"))
    wall.sleep(0.1)
    release_event.set()
    assert clock.wait_until(lambda: len(names_and_instants) == 2, PATIENCE_S)

    assert names_and_instants[1][1] > due_s + PUNCTUALITY_TOLERANCE_S
    assert late_instants_s[-1] == names_and_instants[1][1]
    assert names_and_instants[0][1] == start_s + 0.2 or late_instants_s[0] == names_and_instants[0][1]


def test_events_of_one_instant_happen_in_the_order_in_which_they_were_scheduled() -> None:
    sim = SimClock()
    clock, fired_names = LockedClock(sim, threading.RLock()), list[str]()
    for name, instant_s in (("b", 2.0), ("past", -1.0), ("a", 1.0), ("b again", 2.0)):
        clock.call_at(instant_s, lambda name=name: fired_names.append(name))  # type: ignore[misc]
    clock.call_at(1.5, lambda: fired_names.append("never")).cancel()
    sim.sleep(3.0)

    assert (fired_names, clock.step_count) == (["past", "a", "b", "b again"], 4)


def test_a_cancelled_event_is_no_step_unless_it_is_due_already(wall: WallClock) -> None:
    clock, counts = LockedClock(wall, threading.RLock()), list[int]()
    with clock:
        due, early = clock.call_at(clock.now_s(), lambda: None), clock.call_at(clock.now_s() + 0.02, lambda: None)
        clock.call_at(clock.now_s() + 0.1, lambda: (counts.append(clock.step_count), clock.notify()))
        wall.sleep(0.05)  # the dispatcher waits for the lock
        due.cancel()
        early.cancel()
    assert clock.wait_until(lambda: bool(counts), PATIENCE_S)
    assert counts == [2]


def test_all_consequences_of_a_call_have_its_instant(wall: WallClock) -> None:
    model = forest([given("near"), variable("a")], observer("o", seen("eye", "a", when=[value("near")])))
    with started(model, World({"eye": {"seen": True}}), wall) as manager:
        manager.declare("near", True)
        manager.declare("a", False)
        instants: dict[str, set[float]] = {}
        for event in tuple(manager.record)[:4]:
            instants.setdefault(event.name, set()).add(event.instant_s)

        assert {name: len(instants_s) for name, instants_s in instants.items()} == {"near": 1, "a": 1, "o": 1}
        assert instants["a"] == instants["o"]
