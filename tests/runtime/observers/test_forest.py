"""Ticking by change: rounds, feedback, broken trees, and one record for one seed."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given as given_
from hypothesis import settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence

from codra_dsl.logic import known, value
from codra_dsl.runtime import ContextManager, EventLog, Reason, SimClock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.observers.behaviours import ControlFlag, Precondition
from codra_dsl.runtime.observers.forest import MAX_ROUNDS
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.values.model import SkillModel
from tests.runtime.forests import (
    Look,
    World,
    algorithm,
    events,
    forest,
    given,
    observer,
    seen,
    started,
    takes,
    variable,
)
from tests.runtime.observers.test_activation import random_forest

YES, NO = {"seen": True}, {"seen": False}


def ticks(manager: ContextManager[str, str], name: str) -> list[float]:
    """Return a list that collects the ticks of an observer from now on, by the calls of its control flag."""
    tick_times_s: list[float] = []
    ticked_observer = manager._forest.observers[name]
    flag = ticked_observer.tree.children[0]
    update = flag.update

    def record_tick() -> Status:
        tick_times_s.append(ticked_observer.now_s)
        return update()

    flag.update = record_tick  # type: ignore[method-assign]
    return tick_times_s


# Ticking by change


def test_a_tree_is_ticked_when_something_changed_and_not_otherwise() -> None:
    model = forest(
        [given("near"), given("other"), variable("a")],
        observer("o", seen("eye", "a", when=[value("near")]), period_s=10.0),
    )
    clock = SimClock()
    with started(model, World({"eye": takes(2.0, YES)}), clock) as manager:
        tick_times_s = ticks(manager, "o")
        manager.set("near", False)
        manager.declare("a")
        clock.sleep(5)
        manager.set("near", True)
        clock.sleep(1)
        manager.set("other", True)
        clock.sleep(19)
    assert sorted(set(tick_times_s)) == [0.0, 5.0, 7.0, 15.0, 17.0, 25.0]


def test_a_value_written_in_a_round_is_visible_in_the_next_round_at_the_same_instant() -> None:
    """Four observers form a chain in which each needs the one before, and perception takes no time."""
    names = ["a", "b", "c", "d"]
    looks = [
        seen(f"see_{name}", name, when=[value(need)] if need else [])
        for name, need in zip(names, [None, *names], strict=False)
    ]
    model = forest([variable(name) for name in names], *(observer(f"o_{look.algorithm.name}", look) for look in looks))
    clock = SimClock()
    with started(model, World({look.algorithm.name: YES for look in looks}), clock) as manager:
        manager.declare("d")
        clock.sleep(0)
        assert [manager.get(name).value for name in names] == [True] * 4


@pytest.mark.parametrize("period_s", [0.0, 1.0])
def test_feedback_through_perception_that_takes_no_time_lets_time_pass(period_s: float) -> None:
    """`a` is observed while `b` is not true, and `b` while `a` is true: they never settle."""
    model = forest(
        [variable("a", when_unobservable="forget"), variable("b", when_unobservable="forget")],
        observer("o", seen("see_a", "a", when=[~known("b") | ~value("b")]), period_s=period_s),
        observer("p", seen("see_b", "b", when=[known("a") & value("a")]), period_s=period_s),
    )
    clock = SimClock()
    world = World({"see_a": YES, "see_b": YES})
    with started(model, world, clock) as manager:
        manager.declare("b")
        clock.sleep(5)
        assert clock.now_s() == 5
    assert 5 <= len(world.calls) <= 5 * 2 * 101


class Flip(Behaviour):
    """A node that writes the opposite of what it reads, at each tick."""

    def __init__(self, observer_: Observer) -> None:
        super().__init__("flip")
        self._observer = observer_

    def update(self) -> Status:
        now_s = self._observer.now_s
        self._observer.write("a", not self._observer.context_now().value("a"), "eye", now_s, now_s, now_s)
        return Status.SUCCESS


def by_hand(*nodes: Callable[[Observer], Behaviour]) -> Callable[[Observer], Behaviour]:
    def build(observer_: Observer) -> Behaviour:
        branch = observer_.branch(algorithm("eye"))
        branch.identifies.append("a")
        always = Precondition("always", known("a") | ~known("a"), branch)
        return Sequence("by hand", False, [ControlFlag(observer_), always, *(node(observer_) for node in nodes)])

    return build


def test_rounds_at_one_instant_are_bounded() -> None:
    """A tree that reads the variable that it writes and never settles has to wait; the others go on."""
    restless = ObserverModel(name="restless", identifies=("a",), build=by_hand(Flip))
    model = forest([variable("a"), variable("b")], restless, observer("calm", seen("ear", "b")))
    clock = SimClock()
    with started(model, World({"ear": YES, "eye": YES}), clock) as manager:
        manager.declare("a")
        manager.declare("b")
        clock.sleep(0)
        assert len(events(manager, Kind.VARIABLE, "a")) == MAX_ROUNDS
        clock.sleep(1)
        assert manager.get("b").value is True


def asleep(manager: ContextManager[str, str]) -> list[str]:
    """Return the observers that can look now or later, and that no timer will tick."""
    names = []
    for name in sorted(manager.running()):
        running_observer, timer = manager._forest.observers[name], manager._forest._timers.get(name)
        next_s = running_observer.next_tick_s()
        overdue = [
            branch for branch in running_observer.branches if running_observer.next_branch_in_turn(branch) is branch
        ]
        if overdue or (next_s is not None and (timer is None or timer.instant_s > next_s)):
            names.append(name)
    return names


@settings(max_examples=25)
@given_(st.integers(0, 10**6))
def test_no_observer_that_could_look_falls_asleep(seed: int) -> None:
    chance, clock = random.Random(seed), SimClock()
    model = random_forest(seed)
    world = World({f"look_{observer_.name[2:]}": chancy for observer_ in model.observers})
    with started(model, world, clock, seed) as manager:
        for _ in range(40):
            name = f"v{chance.randrange(60)}"
            action = chance.choice(["declare", "declare", "withdraw", "teach"])
            if action == "withdraw":
                manager.withdraw(name)
            else:
                manager.declare(name, value=chance.random() < 0.8 if action == "teach" else None)
            clock.sleep(chance.uniform(0.0, 2.0))
            assert asleep(manager) == []
    assert world.calls


# One broken tree


class Breaks(Behaviour):
    """A node that raises from its third tick on."""

    def __init__(self, _: Observer) -> None:
        super().__init__("breaks")
        self._ticks = 0

    def update(self) -> Status:
        self._ticks += 1
        if self._ticks >= 3:
            raise KeyError("broken")
        return Status.SUCCESS


def test_a_tree_that_raises_is_stopped_and_the_others_go_on() -> None:
    broken = ObserverModel(name="broken", identifies=("a",), build=by_hand(Flip, Breaks))
    model = forest([variable("a"), variable("b")], broken, observer("sound", seen("ear", "b")))
    clock = SimClock()
    world = World({"ear": YES, "eye": YES})
    with started(model, world, clock) as manager:
        manager.declare("a")
        manager.declare("b")
        clock.sleep(5)
        reading = manager.get("a")
        assert (reading.reason, reading.detail) == (Reason.FAILED, "KeyError: 'broken'")
        assert manager.get("b").age_s(clock.now_s()) == 0
        assert events(manager, Kind.OBSERVER, "broken") == ["started", "failed"]
        assert manager.obstacle("a") == "broken failed and is stopped: withdraw a and declare it again"
        assert "missing: withdraw a and declare it again: broken failed and is stopped" in str(manager.why("a"))
        manager.withdraw("a")
        manager.declare("a")
        clock.sleep(0)
        assert events(manager, Kind.OBSERVER, "broken") == ["started", "failed", "stopped", "started", "failed"]


def test_a_broken_tree_gives_its_slot_back() -> None:
    look = Look(algorithm("eye", slots=("one",)), {"a": value("seen")}, when=[value("x") < 3])
    model = forest(
        [given("x", type=variable("x").type), variable("a"), variable("b")],
        observer("broken", look, priority=1),
        observer("sound", seen("ear", "b", slots=("one",))),
        slots={"one": 1},
    )
    clock = SimClock()
    world = World({"eye": takes(4.0, YES), "ear": YES})
    with started(model, world, clock) as manager:
        manager.set("x", True)
        manager.declare("a")
        clock.sleep(1)
        manager._store.cells["x"].reading = manager._store.cells["x"].reading.at(0)
        broken = manager._forest.observers["broken"]
        broken.tree.children[0].update = lambda: 1 / 0  # type: ignore[method-assign,assign,return-value]
        broken.request_tick()
        manager.declare("b")
        clock.sleep(1)
        assert manager.get("a").reason is Reason.FAILED
        assert manager.get("b").value is True


# The same seed, the same event log


def lively(*extra_models: ObserverModel) -> ContextModel:
    """Return a model with a chain, a shared slot, feedback, alternatives, forgetting, validity, spread and failures."""
    added_names = [name for extra_model in extra_models for name in extra_model.identifies]
    return forest(
        [
            given("near"),
            variable("a", valid_for_s=1.7),
            variable("b", when_unobservable="forget"),
            variable("c", valid_for_s=3.0, when_unobservable="forget"),
            *(variable(name) for name in added_names),
        ],
        observer("o_a", seen("see_a", "a", when=[value("near")], slots=("one",))),
        observer("o_b", seen("see_b", "b", when=[value("a")], slots=("one",)), seen("feel_b", "b"), priority=3),
        observer("o_c", seen("see_c", "c", when=[~known("c") | value("b")], timeout_s=0.9)),
        *extra_models,
        skills=[SkillModel(name="act", preview=("b", "c", *added_names), monitor=("a",), changes=("b",))],
        slots={"one": 1},
    )


def chancy(job: Any) -> object:
    job.sleep(job.random.uniform(0.05, 1.0))
    if job.random.random() < 0.2:
        raise ValueError("no picture")
    return {"seen": job.random.choice([True, True, False, None])}


def story(model: ContextModel, seed: int) -> EventLog:
    """Return the event log of a main execution that decides randomly."""
    clock, chance = SimClock(), random.Random(seed)
    world = World(dict.fromkeys(("see_a", "see_b", "feel_b", "see_c", "see_d"), chancy))
    with started(model, world, clock, seed) as manager:

        def look() -> bool:
            clock.sleep(0.5)
            return True

        for _ in range(30):
            manager.expect(*chance.sample(["act"], chance.randint(0, 1)))
            manager.set("near", chance.random() < 0.7)
            clock.sleep(chance.uniform(0.0, 3.0))
            with manager.skill("act") as skill:
                manager.decide("b", look, wait_up_to_s=0.4)
                with skill.acting():
                    clock.sleep(0.5)
                    for near in chance.choice([[True], [False, True]]):
                        manager.set("near", near)
                    clock.sleep(0.5)
    return manager.record


OUTCOMES = {
    *("voided", "cancelled", "timed_out", "stale", "invalidated", "rejected", "failed", "withdrawn", "forgotten"),
    *("too_old", "fell_back", "answered"),
}


def test_the_same_seed_gives_the_same_event_log() -> None:
    first, again, other = (story(lively(), seed).text() for seed in (5, 5, 6))
    assert first == again
    assert first != other
    assert {word for word in OUTCOMES if f'"{word}"' not in first} == set()


@pytest.mark.parametrize("need", ["near", "b"])
def test_an_added_observer_does_not_affect_the_others(need: str) -> None:
    """Its name sorts before all others, it reads the variables that they read, and it shares no slot."""
    added_observer = observer("a_first", seen("see_d", "d", when=[value(need)]))
    events_without_observer, events_with_observer = (
        list(story(lively(*extra_models), 5)) for extra_models in ((), (added_observer,))
    )
    assert [
        event for event in events_with_observer if event.name not in ("a_first", "see_d", "d")
    ] == events_without_observer
    assert len(events_with_observer) > len(events_without_observer) + 50


def test_the_event_logs_of_two_processes_are_the_same() -> None:
    code = "from tests.runtime.observers.test_forest import lively, story; print(story(lively(), 5).text(), end='')"
    root = Path(__file__).parents[3]
    text = story(lively(), 5).text()
    for hash_seed, zone in [("1", "UTC"), ("77", "Asia/Tokyo")]:
        env = {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": str(root), "TZ": zone}
        run = subprocess.run(
            [sys.executable, "-c", code], cwd=root, env=env, capture_output=True, text=True, check=True
        )
        assert run.stdout == text
