"""Agents: each writes through a handle with its name, and only variables that name it as source."""

from __future__ import annotations

import threading

import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import (
    Kind,
    NotASourceError,
    NotDeclaredError,
    NotOfTypeError,
    Reason,
    SimClock,
    UnknownNameError,
    WallClock,
)
from codra_dsl.runtime.values.model import SkillModel, real
from tests.runtime.forests import World, forest, given, observer, seen, started, variable

PATIENCE_S = 60.0
LIGHT = variable("light", type=real(0, 2000, unit="lux"), sources=("house",), valid_for_s=10.0)


def test_an_agent_writes_a_variable_that_names_it_and_the_reading_has_its_name() -> None:
    with started(forest([LIGHT]), World()) as manager:
        manager.agent("house").set("light", 300)
        reading = manager.get("light")
    assert (reading.value, reading.source) == (300.0, "house")


def test_an_agent_writes_without_a_declaration_and_the_main_execution_does_not() -> None:
    with started(forest([LIGHT]), World()) as manager:
        with pytest.raises(NotDeclaredError, match=r"and an agent writes with agent\('house'\)\.set$"):
            manager.set("light", 300)
        manager.declare("light")
        manager.set("light", 300)
        assert manager.get("light").source == "main_execution"


def test_a_forbidden_write_of_an_agent_is_refused_and_recorded() -> None:
    model = forest([LIGHT, variable("open"), variable("rain", sources=("roof",))])
    with started(model, World()) as manager:
        with pytest.raises(NotASourceError, match=r"'open' may be written by observer, not by 'house'"):
            manager.agent("house").set("open", True)
        assert manager.get("open").reason is Reason.NEVER_OBSERVED
        (event,) = manager.record.of(Kind.VARIABLE)
    assert (event.name, event.what, event.details["source"]) == ("open", "refused", "house")


def test_an_agent_that_no_variable_names_is_reported_with_a_suggestion() -> None:
    with started(forest([LIGHT, given("here")]), World()) as manager:
        with pytest.raises(UnknownNameError, match=r"no variable whose source is 'huose': did you mean 'house'\?"):
            manager.agent("huose")
        for name in ("main_execution", "observer"):
            with pytest.raises(UnknownNameError):
                manager.agent(name)


def test_values_of_an_agent_are_checked() -> None:
    with started(forest([LIGHT]), World()) as manager:
        house = manager.agent("house")
        with pytest.raises(NotOfTypeError, match=r"lies outside \[0, 2000\]"):
            house.set("light", 3000)
        with pytest.raises(UnknownNameError, match=r"did you mean 'light'"):
            house.set("ligth", 300)


def test_a_report_counts_from_the_instant_of_its_evidence() -> None:
    clock = SimClock(100.0)
    with started(forest([LIGHT]), World(), clock) as manager:
        house = manager.agent("house")
        house.set("light", 300, evidence_s=96.0)
        reading = manager.get("light")
        assert (reading.evidence_s, reading.start_s, reading.identified_s) == (96.0, 96.0, 100.0)
        house.set("light", 50, evidence_s=95.0)
        assert manager.get("light").value == 300.0
        assert [reading.value for reading in manager.history("light")] == [50.0, 300.0]
        clock.sleep(6.0)
        assert manager.get("light").reason is Reason.STALE


def test_evidence_from_the_future_or_without_an_instant_is_refused() -> None:
    with started(forest([LIGHT, given("here")]), World()) as manager:
        for instant_s in (0.1, float("nan")):
            with pytest.raises(ValueError, match=r"cannot be from .*: the present instant is 0\.0"):
                manager.set("here", True, evidence_s=instant_s)
        assert manager.history("here") == ()


def test_a_report_from_before_a_skill_acted_does_not_undo_the_invalidation() -> None:
    skill = SkillModel(name="switch", changes=("light",))
    clock = SimClock()
    with started(forest([LIGHT], skills=[skill]), World(), clock) as manager, manager.skill("switch") as switch:
        clock.sleep(5.0)
        with switch.acting():
            clock.sleep(1.0)
            manager.agent("house").set("light", 300, evidence_s=4.0)
            assert manager.get("light").reason is Reason.INVALIDATED
            manager.agent("house").set("light", 0, evidence_s=6.0)
            assert manager.get("light").value == 0.0


def test_a_value_of_an_agent_wakes_the_observers_that_wait_for_it() -> None:
    eye = seen("eye", "open", when=[value("light") > 100])
    clock, world = SimClock(), World({"eye": {"seen": True}})
    with started(forest([LIGHT, variable("open")], observer("o", eye)), world, clock) as manager:
        manager.declare("open")
        clock.sleep(3.0)
        manager.agent("house").set("light", 300)
        clock.sleep(0.0)
        assert manager.get("open").evidence_s == 3.0


def test_an_agent_may_write_from_a_separate_thread_in_real_time() -> None:
    with WallClock() as clock, started(forest([LIGHT]), World(), clock) as manager:
        house = manager.agent("house")
        thread = threading.Thread(target=lambda: [house.set("light", level) for level in range(100)])
        thread.start()
        assert clock.wait_until(lambda: manager.get("light").known and manager.get("light").value == 99.0, PATIENCE_S)
        thread.join(PATIENCE_S)
        assert len(manager.history("light")) == 100
