"""Validity, invalidation and the order of evidence, as visible to readers of the context manager."""

from __future__ import annotations

import math

import pytest

from codra_dsl.logic import known, value
from codra_dsl.runtime import Reason, SimClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.values.model import SkillModel
from tests.runtime.forests import World, events, forest, given, observer, seen, started, takes, variable

YES = {"seen": True}


def test_a_value_is_stale_at_the_exact_end_of_its_validity() -> None:
    clock = SimClock(1000.0)
    with started(forest([given("x", valid_for_s=2.5)]), World(), clock) as manager:
        manager.set("x", True)
        clock.sleep(math.nextafter(2.5, 0.0) - 1e-9)
        assert manager.get("x").known
        clock.sleep(1002.5 - clock.now_s())
        reading = manager.get("x")
        (_, stale) = manager.record.of(Kind.VARIABLE)
    assert (reading.reason, reading.evidence_s, reading.identified_s) == (Reason.STALE, 1000.0, 1002.5)
    assert (stale.instant_s, stale.what) == (1002.5, "unknown")


def test_newer_evidence_moves_the_end_of_validity() -> None:
    clock = SimClock()
    with started(forest([given("x", valid_for_s=2.0)]), World(), clock) as manager:
        for _ in range(5):
            manager.set("x", True)
            clock.sleep(1.5)
            assert manager.get("x").known
        clock.sleep(0.5)
        assert manager.get("x").reason is Reason.STALE
        assert events(manager, Kind.VARIABLE) == ["identified"] * 5 + ["unknown"]


def test_the_end_of_validity_is_recorded_at_its_instant_after_one_renewal() -> None:
    clock = SimClock()
    with started(forest([given("x", valid_for_s=2.0)]), World(), clock) as manager:
        manager.set("x", True)
        clock.sleep(1.5)
        manager.set("x", True)
        clock.sleep(10)
        changes = [(event.instant_s, event.what) for event in manager.record.of(Kind.VARIABLE)]
    assert changes == [(0.0, "identified"), (1.5, "identified"), (3.5, "unknown")]


def test_validity_counts_from_the_evidence_not_from_its_arrival() -> None:
    eye = seen("eye", "x")
    model = forest([variable("x", valid_for_s=3.0)], observer("o", eye, period_s=100.0))
    clock = SimClock()
    with started(model, World({"eye": takes(2.0, YES, snapshot=True)}), clock) as manager:
        manager.declare("x")
        clock.sleep(2.9)
        assert manager.get("x").known
        clock.sleep(0.1)
        assert manager.get("x").reason is Reason.STALE


def test_a_value_that_arrives_after_its_validity_is_never_known() -> None:
    model = forest([variable("x", valid_for_s=1.0)], observer("o", seen("eye", "x")))
    clock = SimClock()
    with started(model, World({"eye": takes(2.0, YES, snapshot=True)}), clock) as manager:
        manager.declare("x")
        for _ in range(40):
            clock.sleep(0.125)
            assert not manager.get("x").known
        assert manager.get("x").reason is Reason.STALE
        assert manager.history("x")[0].value is True


def test_an_observer_stops_looking_when_its_precondition_becomes_stale() -> None:
    model = forest(
        [given("near", valid_for_s=2.5), variable("x")], observer("o", seen("eye", "x", when=[value("near")]))
    )
    world, clock = World({"eye": YES}), SimClock()
    with started(model, world, clock) as manager:
        manager.set("near", True)
        manager.declare("x")
        clock.sleep(10)
        assert world.asked_s("eye") == [0, 1, 2]
        manager.set("near", True)
        clock.sleep(0)
        assert world.asked_s("eye") == [0, 1, 2, 10]


def test_an_observer_that_waits_for_a_value_to_become_stale_looks_at_that_instant() -> None:
    model = forest([variable("x", valid_for_s=4.25)], observer("o", seen("eye", "x", when=[~known("x")])))
    world, clock = World({"eye": YES}), SimClock()
    with started(model, world, clock) as manager:
        manager.declare("x")
        clock.sleep(10)
        assert world.asked_s("eye") == [0, 4.25, 8.5]


def test_the_history_drops_the_oldest_readings_and_keeps_the_newest() -> None:
    clock = SimClock()
    with started(forest([given("x", history=3)]), World(), clock) as manager:
        for step in range(1000):
            manager.set("x", step % 2 == 0)
            clock.sleep(0.1)
        history = manager.history("x")
    assert [reading.value for reading in history] == [False, True, False]
    assert history[-1].evidence_s == pytest.approx(99.9)


def test_evidence_is_judged_although_its_precondition_is_written_hundreds_of_times_meanwhile() -> None:
    """A localisation reports at 100 Hz, and a history of 100 values covers only one second."""
    model = forest([given("near"), variable("x")], observer("o", seen("eye", "x", when=[value("near")])))
    clock = SimClock()
    with started(model, World({"eye": takes(4.0, YES)}), clock) as manager:
        manager.set("near", True)
        manager.declare("x")
        for _ in range(450):
            clock.sleep(0.01)
            manager.set("near", True)
        assert manager.get("x").value is True


def test_an_invalidation_names_the_skill() -> None:
    skills = [SkillModel(name="turn", changes=("x", "y"))]
    with started(forest([given("x"), given("y")], skills=skills), World()) as manager:
        manager.set("x", True)
        with manager.skill("turn") as skill, skill.acting():
            readings = [manager.get(name) for name in ("x", "y")]
    assert [(reading.reason, reading.detail) for reading in readings] == [(Reason.INVALIDATED, "turn")] * 2


def test_a_reading_from_before_a_value_went_stale_is_reported_to_readers() -> None:
    clock = SimClock()
    look = seen("look", "a", timeout_s=5.0)
    watch = seen("watch", "c", when=[known("a") | known("b")])
    model = forest(
        [variable("a", valid_for_s=4.0), given("b"), variable("c", when_unobservable="forget")],
        observer("o_a", look, period_s=2.0),
        observer("o_c", watch, period_s=100.0),
    )
    world = World(
        {"look": lambda job: {"seen": True} if job.now_s() < 1.0 else job.sleep(9.0), "watch": {"seen": True}}
    )
    with started(model, world, clock) as manager:
        manager.declare("a")
        manager.declare("c")
        clock.sleep(3.0)
        manager.set("b", value=True)
        clock.sleep(2.0)
        assert (manager.get("a").reason, manager.get("c").value) == (Reason.STALE, True)
        clock.sleep(2.0)  # now the look that began at 2 s has timed out: from then on the value was unknown
        assert (manager.get("a").reason, manager.get("c").reason) == (Reason.TIMED_OUT, Reason.FORGOTTEN)
        assert manager.get("c").evidence_s == 2.0
