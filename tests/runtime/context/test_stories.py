"""Mistakes in published code of other projects, each as a test of this runtime."""

from __future__ import annotations

import threading

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from codra_dsl.logic import known, value
from codra_dsl.runtime import ContextManager, EventLog, Reason, SimClock, UnknownValueError, WallClock
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.values.model import real
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, seen, started, takes, variable

YES = {"seen": True}
PATIENCE_S = 20.0


def test_a_missing_message_about_the_battery_does_not_mean_that_it_is_fine() -> None:
    """Nav2's IsBatteryLow starts as false and never ages."""
    model = forest(
        [given("battery_is_low", valid_for_s=10.0), variable("path_free")],
        observer("o", seen("look_far", "path_free", when=[~value("battery_is_low")])),
    )
    world, clock = World({"look_far": YES}), SimClock()
    with started(model, world, clock) as manager:
        manager.declare("path_free")
        clock.sleep(100)
        assert manager.get("battery_is_low").reason is Reason.NEVER_OBSERVED
        with pytest.raises(UnknownValueError):
            _ = manager.get("battery_is_low").value
        with pytest.raises(TypeError, match="no truth value"):
            bool(manager.get("battery_is_low"))
        assert world.calls == []
        assert manager.decide("battery_is_low", lambda: True) is True
        manager.set("battery_is_low", False)
        clock.sleep(10)
        assert manager.get("battery_is_low").reason is Reason.STALE
        look_count = len(world.calls)
        assert look_count > 0
        clock.sleep(100)
        assert len(world.calls) == look_count


def test_an_absent_value_satisfies_neither_a_condition_nor_its_negation() -> None:
    """SkiROS2's ConditionProperty takes an absent property for a negated condition that holds."""
    model = forest(
        [given("occupied"), variable("a"), variable("b")],
        observer("o", seen("see_a", "a", when=[value("occupied")])),
        observer("p", seen("see_b", "b", when=[~value("occupied")])),
    )
    world, clock = World({"see_a": YES, "see_b": YES}), SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        manager.declare("b")
        clock.sleep(10)
        assert world.calls == []
        manager.set("occupied", False)
        clock.sleep(0)
        assert [name for name, _ in world.calls] == ["see_b"]


@pytest.mark.parametrize("last", ["x", "y", "phi"])
def test_one_unknown_coordinate_is_not_hidden_by_a_known_one(last: str) -> None:
    """RAFCON's move_to_position asks `(my_x or my_y or my_phi) is None`."""
    pose = {"x": 0.0, "y": 2.0, "phi": 0.0}
    where = Look(
        algorithm("measure", {"error": real(optional=True)}, given=tuple(pose)), {"arrived": value("error") < 0.1}
    )
    model = forest([*(given(name, type=real()) for name in pose), variable("arrived")], observer("o", where))
    world, clock = World({"measure": {"error": 0.0}}), SimClock()
    with started(model, world, clock) as manager:
        manager.declare("arrived")
        for name in pose.keys() - {last}:
            manager.set(name, pose[name])
        clock.sleep(5)
        assert world.calls == []
        assert manager.wait_for(known("x") & known("y") & known("phi"), 0.0) is False
        assert manager.wait_for((value("x") + value("y") + value("phi")).is_in(2.0), 0.0) is False
        manager.set(last, pose[last])
        clock.sleep(0)
        assert world.given == [pose]


def test_a_history_is_a_ring_that_goes_on() -> None:
    """py_trees' ActivityStream stops recording when it is full."""
    clock = SimClock()
    with started(forest([given("x", type=real(), history=5)]), World(), clock) as manager:
        for step in range(50):
            manager.set("x", step)
            clock.sleep(1)
        assert [reading.value for reading in manager.history("x")] == [45, 46, 47, 48, 49]


def test_a_full_event_log_continues_with_the_newest_events() -> None:
    """Subscribers continue as well; py_trees' stream stops at the content that it shows."""
    clock, record, contents = SimClock(), EventLog(limit=20), []
    model = forest([given("x", type=real())])
    with ContextManager[str, str](model, clock=clock, resources={"world": World()}, record=record) as manager:
        manager.subscribe("x", lambda reading: contents.append(reading.content))
        for step in range(500):
            manager.set("x", step)
            clock.sleep(1)
    assert list(record)[-1].details["value"] == 499
    assert 20 <= len(record) < 40
    assert contents == [None, *range(500)]


def test_one_function_that_raises_or_takes_too_long_does_not_stop_others() -> None:
    """An exception in a py_trees behaviour ends the tick of the whole tree, and its Timeout does not pre-empt."""

    def raises(_: object) -> object:
        raise ValueError("no picture")

    model = forest(
        [variable("a"), variable("b"), variable("c")],
        observer("o", seen("see_a", "a")),
        observer("p", seen("see_b", "b", timeout_s=2.0)),
        observer("q", seen("see_c", "c")),
    )
    world, clock = World({"see_a": raises, "see_b": takes(60.0, YES), "see_c": YES}), SimClock()
    with started(model, world, clock) as manager:
        for name in "abc":
            manager.declare(name)
        clock.sleep(10)
        assert manager.get("a").reason is Reason.FAILED
        assert manager.get("b").reason is Reason.TIMED_OUT
        assert manager.get("c").evidence_s == 10
    assert len(world.asked_s("see_c")) == 11


def test_in_real_time_a_function_that_hangs_or_a_broken_tree_does_not_stop_others() -> None:
    """One function hangs forever, one ends its thread, one tree is broken, and one subscriber raises."""
    release = threading.Event()

    def leaves(_: object) -> object:
        raise SystemExit

    def broken(_: object) -> object:
        raise ValueError("this tree is broken")

    model = forest(
        [variable("a"), variable("b"), variable("c"), variable("d")],
        observer("o", seen("hangs", "a", timeout_s=0.2)),
        observer("p", seen("leaves", "b"), period_s=0.05),
        ObserverModel(name="q", identifies=("c",), build=broken_tree, period_s=0.05),
        observer("r", seen("see_d", "d"), period_s=0.05),
    )
    world = World({"hangs": lambda _: release.wait(PATIENCE_S), "leaves": leaves, "see_d": YES})
    with WallClock() as clock, started(model, world, clock) as manager:
        manager.subscribe(list("abcd"), broken)
        for name in "abcd":
            manager.declare(name)
        for name in "abc":
            reason = Reason.TIMED_OUT if name == "a" else Reason.FAILED
            assert clock.wait_until(lambda name=name, reason=reason: manager.get(name).reason is reason, PATIENCE_S)
        since_s = clock.now_s()
        assert clock.wait_until(lambda: manager.get("d").start_s > since_s, PATIENCE_S)
        assert "this tree is broken" in manager.get("c").detail
        release.set()


class _BrokenBehaviour(Behaviour):
    def update(self) -> Status:
        raise RuntimeError("this tree is broken")


def broken_tree(observer: Observer) -> Behaviour:
    observer.branch(algorithm("never_asked")).identifies.append("c")
    return _BrokenBehaviour("broken")


def test_no_decision_is_answered_before_the_first_observation() -> None:
    """Nav2 #4802: a condition node answers wrongly at its first tick."""
    model = forest([variable("a")], observer("o", seen("eye", "a")))
    clock = SimClock()
    with started(model, World({"eye": takes(0.5, YES)}), clock) as manager:
        manager.declare("a")
        for _ in range(5):
            assert manager.decide("a", lambda: None) is None
            clock.sleep(0.0625)
        assert manager.decide("a", lambda: "looked", wait_up_to_s=1.0) is True
        assert clock.now_s() == 0.5
