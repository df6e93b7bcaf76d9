"""The cost of starting, stopping and changes depends on the affected observers, not on the size of the forest.

The tests count function calls.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator

import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.observers.forest import Forest
from codra_dsl.runtime.observers.observer import Observer
from codra_dsl.runtime.perception.job_run import JobRun
from tests.runtime.forests import Manager, World, forest, given, observer, seen, started, takes, variable

CHAINS, LINKS = 1_000, 10
OBSERVERS = CHAINS * LINKS
LAST = LINKS - 1
YES = {"seen": True}


def chains(number: int) -> ContextModel:
    """Return chains of ten observers: each needs the one before it, and the first a variable of the main execution."""
    names = [f"c{chain}_{link}" for chain in range(number) for link in range(LINKS)]
    roots = [f"c{chain}" for chain in range(number)]
    needs = [f"c{chain}" if not link else f"c{chain}_{link - 1}" for chain in range(number) for link in range(LINKS)]
    looks = [seen("see_" + name, name, when=[value(need)]) for name, need in zip(names, needs, strict=True)]
    observers = [observer(f"o_{name}", look) for name, look in zip(names, looks, strict=True)]
    return forest([*map(given, roots), *map(variable, names)], *observers)


def count_calls(action: Callable[[], object]) -> int:
    """Return the number of calls of Python functions, counted by the interpreter."""
    call_count = 0

    def count_event(_frame: object, what: str, _argument: object) -> None:
        nonlocal call_count
        call_count += what == "call"

    before = sys.getprofile()
    sys.setprofile(count_event)
    try:
        action()
    finally:
        sys.setprofile(before)
    return call_count


@pytest.fixture(scope="module")
def clock() -> SimClock:
    return SimClock()


@pytest.fixture(scope="module")
def large_manager(clock: SimClock) -> Iterator[Manager]:
    model = chains(CHAINS)
    with started(
        model,
        World({f"see_{observer_model.identifies[0]}": {"seen": True} for observer_model in model.observers}),
        clock,
    ) as manager:
        yield manager


def names_of_ticked_observers(action: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return the observers that are ticked during a call."""
    names: set[str] = set()
    tick = Forest._tick

    def record_tick(self: Forest, ticked_observer: Observer, now_s: float) -> list:
        names.add(ticked_observer.name)
        return tick(self, ticked_observer, now_s)

    with monkeypatch.context() as patch:
        patch.setattr(Forest, "_tick", record_tick)
        action()
    return names


def test_declaring_one_variable_of_ten_thousand_starts_and_ticks_what_it_needs(
    large_manager: Manager, clock: SimClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    chain = {f"o_c0_{link}" for link in range(LINKS)}
    large_manager.set("c0", True)

    ticked_names = names_of_ticked_observers(
        lambda: (large_manager.declare(f"c0_{LAST}"), clock.sleep(0.5)), monkeypatch
    )

    assert len(large_manager._forest.observers) == OBSERVERS
    assert ticked_names == large_manager.running() == chain
    assert names_of_ticked_observers(lambda: large_manager.withdraw(f"c0_{LAST}"), monkeypatch) == chain
    assert large_manager.running() == set()


def test_starting_and_stopping_take_no_more_steps_in_a_larger_forest_or_when_more_runs(
    large_manager: Manager, clock: SimClock
) -> None:
    def there_and_back(manager: Manager) -> int:
        again = [count_calls(lambda: (manager.declare(f"c1_{LAST}"), manager.withdraw(f"c1_{LAST}"))) for _ in range(2)]
        return again[1]

    with started(chains(2), World(), SimClock()) as small:
        in_small = there_and_back(small)
    alone = there_and_back(large_manager)
    for chain in range(10, 300):
        large_manager.declare(f"c{chain}_{LAST}")
    clock.sleep(0.5)
    beside_others = there_and_back(large_manager)
    large_manager.declare(f"c2_{LAST}")

    assert len(large_manager.running()) == 291 * LINKS
    assert in_small == alone == beside_others
    assert in_small < 200 * LINKS


def test_a_change_ticks_the_observers_that_read_it_and_a_confirmation_ticks_none(
    large_manager: Manager, clock: SimClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    large_manager.declare(f"c3_{LAST}")
    clock.sleep(0.1)

    assert names_of_ticked_observers(lambda: (large_manager.set("c3", True), clock.sleep(0.0)), monkeypatch) == {
        f"o_c3_{link}" for link in range(LINKS)
    }
    assert names_of_ticked_observers(lambda: (large_manager.set("c3", True), clock.sleep(0.0)), monkeypatch) == set()
    assert names_of_ticked_observers(lambda: (large_manager.set("c3", False), clock.sleep(0.0)), monkeypatch) == {
        "o_c3_0"
    }


def test_no_work_is_done_while_no_event_is_due_and_no_value_changes(large_manager: Manager, clock: SimClock) -> None:
    clock.sleep(3.0)
    large_manager.set("c3", False)
    clock.sleep(0.1)

    assert count_calls(lambda: clock.sleep(0.2)) < 10


def test_jobs_that_have_ended_leave_no_garbage_for_the_cyclic_collector() -> None:
    """Every way in which a job can end: accepted, rejected, failed, timed out."""
    ways = {
        "accepted": takes(0.1, YES),
        "rejected": takes(0.1, {}),
        "failed": takes(0.1, None),
        "late": takes(9.0, YES),
    }
    model = forest([variable(name) for name in ways], *(observer(f"o_{n}", seen(n, n, timeout_s=1.0)) for n in ways))
    clock = SimClock()
    with started(model, World(ways), clock) as manager:
        for name in ways:
            manager.declare(name)
        clock.sleep(1.0)
        gc.collect()
        gc.disable()
        try:
            clock.sleep(200.0)
            jobs = manager.spent()["o_accepted"].jobs
            job_run_count = sum(isinstance(tracked_object, JobRun) for tracked_object in gc.get_objects())
        finally:
            gc.enable()
    assert jobs > 100
    assert job_run_count <= 4 * len(ways), "some are running, some were stuck"
