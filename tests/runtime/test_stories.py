"""What shipped code of others gets wrong, each as a story about ours."""

from __future__ import annotations

from codra_dsl.logic import value
from codra_dsl.runtime import Reason, SimClock
from codra_dsl.runtime.model import real
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, seen, started, takes, variable

YES = {"seen": True}


def test_no_message_about_the_battery_is_not_a_battery_that_is_fine() -> None:
    """Nav2's IsBatteryLow starts as false and never ages."""
    model = forest([given("battery_is_low", valid_for_s=10.0)])
    clock = SimClock()
    with started(model, World(), clock) as manager:
        clock.sleep(100)
        assert manager.get("battery_is_low").reason is Reason.NEVER_OBSERVED
        assert manager.decide("battery_is_low", lambda: True) is True
        manager.set("battery_is_low", False)
        clock.sleep(10)
        assert manager.get("battery_is_low").reason is Reason.STALE


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


def test_one_unknown_coordinate_is_not_hidden_by_a_known_one() -> None:
    """RAFCON's move_to_position asks `(my_x or my_y or my_phi) is None`."""
    where = Look(
        algorithm("measure", {"error": real(optional=True)}, given=("x", "y")), {"arrived": value("error") < 0.1}
    )
    model = forest([given("x", type=real()), given("y", type=real()), variable("arrived")], observer("o", where))
    world, clock = World({"measure": {"error": 0.0}}), SimClock()
    with started(model, world, clock) as manager:
        manager.declare("arrived")
        manager.set("y", 2.0)
        clock.sleep(5)
        assert world.calls == []
        manager.set("x", 0.0)
        clock.sleep(0)
        assert world.given == [{"x": 0.0, "y": 2.0}]


def test_a_history_is_a_ring_that_goes_on() -> None:
    """py_trees' ActivityStream stops recording when it is full."""
    clock = SimClock()
    with started(forest([given("x", type=real(), history=5)]), World(), clock) as manager:
        for step in range(50):
            manager.set("x", step)
            clock.sleep(1)
        assert [reading.value for reading in manager.history("x")] == [45, 46, 47, 48, 49]


def test_one_function_that_raises_or_overstays_stops_no_other() -> None:
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
