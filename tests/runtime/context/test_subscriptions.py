"""Callbacks on changes, and waiting for conditions: in simulated and in real time."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from codra_dsl.logic import age, known, value
from codra_dsl.runtime import Reading, Reason, SimClock, UnknownNameError, WallClock
from codra_dsl.runtime.callbacks import MAX_WAITING_CHANGES
from codra_dsl.runtime.values.model import integer
from tests.runtime.forests import Manager, World, forest, given, observer, seen, started, takes, variable
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error

PATIENCE_S = 20.0
MODEL = forest([given("a", valid_for_s=10.0), given("n", type=integer())])


@contextmanager
def in_real_time() -> Iterator[Manager]:
    with WallClock(0.0) as clock, started(MODEL, World(), clock) as manager:
        yield manager


def value_or_reason(reading: Reading[object]) -> object:
    return reading.value if reading.known else reading.reason


# Simulated time


def test_a_subscriber_gets_the_present_reading_and_then_each_change_at_its_instant() -> None:
    clock, notifications = SimClock(), []
    with started(MODEL, World(), clock) as manager:
        manager.subscribe("a", lambda reading: notifications.append((clock.now_s(), value_or_reason(reading))))
        clock.sleep(1.0)
        manager.set("a", True)
        clock.sleep(1.0)
        manager.set("a", True)
        clock.sleep(1.0)
        manager.set("a", False)
        clock.sleep(50.0)
    assert notifications == [(0.0, Reason.NEVER_OBSERVED), (1.0, True), (3.0, False), (13.0, Reason.STALE)]


def test_changes_of_several_variables_arrive_in_their_order() -> None:
    clock, notifications = SimClock(), []
    with started(MODEL, World(), clock) as manager:
        manager.subscribe(["n", "a"], lambda reading: notifications.append((reading.name, value_or_reason(reading))))
        clock.sleep(1.0)
        for number in range(3):
            manager.set("n", number)
            manager.set("a", number % 2 == 0)
        clock.sleep(0.0)
    assert notifications[2:] == [("n", 0), ("a", True), ("n", 1), ("a", False), ("n", 2), ("a", True)]


def test_changes_by_observers_are_reported() -> None:
    clock, notifications = SimClock(), []
    model = forest([variable("a")], observer("o", seen("look", "a")))
    with started(model, World({"look": takes(0.5, {"seen": True})}), clock) as manager:
        manager.subscribe("a", lambda reading: notifications.append((clock.now_s(), value_or_reason(reading))))
        manager.declare("a")
        clock.sleep(5.0)
    assert notifications == [(0.0, Reason.NEVER_OBSERVED), (0.5, True)]


def test_subscribing_does_not_declare_the_variable() -> None:
    model = forest([variable("a")], observer("o", seen("look", "a")))
    with started(model, World()) as manager:
        manager.subscribe("a", lambda _: None)
        assert (manager.declared(), manager.running()) == (frozenset(), frozenset())


def test_older_evidence_without_a_present_change_is_not_reported() -> None:
    clock, notifications = SimClock(100.0), []
    with started(MODEL, World(), clock) as manager:
        manager.set("n", 1)
        manager.subscribe("n", lambda reading: notifications.append(value_or_reason(reading)))
        manager.set("n", 2, evidence_s=50.0)
        clock.sleep(1.0)
    assert notifications == [1]


def test_after_unsubscribing_no_change_is_reported_not_even_a_waiting_one() -> None:
    clock, notifications = SimClock(), list[object]()
    with started(MODEL, World(), clock) as manager:
        subscription = manager.subscribe("n", lambda reading: notifications.append(value_or_reason(reading)))
        clock.sleep(0.0)
        manager.set("n", 1)
        subscription.unsubscribe()
        subscription.unsubscribe()
        manager.set("n", 2)
        clock.sleep(1.0)
        with manager.subscribe("n", lambda reading: notifications.append(value_or_reason(reading))):
            clock.sleep(0.0)
        manager.set("n", 3)
        clock.sleep(1.0)
    assert notifications == [Reason.NEVER_OBSERVED, 2]


def test_a_callback_may_end_its_own_subscription_and_write() -> None:
    clock, notifications = SimClock(), list[object]()
    with started(MODEL, World(), clock) as manager:

        def once(reading: Reading[object]) -> None:
            notifications.append(value_or_reason(reading))
            manager.set("n", 7)
            subscription.unsubscribe()

        subscription = manager.subscribe("n", once)
        clock.sleep(1.0)
        assert (notifications, manager.get("n").value) == ([Reason.NEVER_OBSERVED], 7)


def test_a_callback_that_raises_is_logged_and_gets_the_next_change(caplog: pytest.LogCaptureFixture) -> None:
    clock, notifications = SimClock(), list[object]()

    def raises(reading: Reading[object]) -> None:
        notifications.append(value_or_reason(reading))
        raise ValueError("no thanks")

    with started(MODEL, World(), clock) as manager, caplog.at_level(logging.ERROR):
        manager.subscribe("n", raises)
        manager.set("n", 1)
        clock.sleep(1.0)
        manager.set("n", 2)
        clock.sleep(1.0)
    assert notifications == [Reason.NEVER_OBSERVED, 1, 2]
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == ["no thanks"] * 3


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_a_callback_with_a_hostile_exception_is_logged_and_gets_the_next_change(
    kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    error, text = hostile_error(kind), HOSTILE_ERRORS[kind]
    clock, notifications = SimClock(), list[object]()

    class Callback:
        def __call__(self, reading: Reading[object]) -> None:
            notifications.append(value_or_reason(reading))
            raise error

        def __repr__(self) -> str:
            raise error

    with started(MODEL, World(), clock) as manager, caplog.at_level(logging.ERROR):
        manager.subscribe("n", Callback())
        clock.sleep(1.0)
        manager.set("n", 1)
        clock.sleep(1.0)
    assert notifications == [Reason.NEVER_OBSERVED, 1]
    assert caplog.messages == ["a callback raised: an object that cannot be shown"] * 2
    assert text in caplog.text


def test_a_callback_must_not_let_simulated_time_pass(caplog: pytest.LogCaptureFixture) -> None:
    clock = SimClock()
    with started(MODEL, World(), clock) as manager:
        manager.subscribe("n", lambda _: clock.sleep(1.0))
        clock.sleep(0.0)
    assert "must not wait on the clock" in caplog.text


def test_a_name_that_the_spec_lacks_cannot_be_subscribed_to() -> None:
    with started(MODEL, World()) as manager, pytest.raises(UnknownNameError):
        manager.subscribe(["n", "m"], lambda _: None)


# Real time


def test_a_callback_runs_in_a_thread_without_any_lock_and_in_order() -> None:
    notifications, done = list[object](), threading.Event()
    with in_real_time() as manager:

        def slowly(reading: Reading[object]) -> None:
            other = threading.Thread(target=lambda: manager.set("a", True))
            other.start()
            other.join(PATIENCE_S)
            assert not other.is_alive()
            notifications.append(value_or_reason(reading))
            if reading.content == 9:
                done.set()

        manager.subscribe("n", slowly)
        for number in range(10):
            manager.set("n", number)
        assert done.wait(PATIENCE_S)
    assert notifications == [Reason.NEVER_OBSERVED, *range(10)]


def test_a_callback_that_hangs_delays_neither_writers_nor_other_callbacks() -> None:
    release, notifications = threading.Event(), threading.Event()
    with in_real_time() as manager:
        slow = manager.subscribe("n", lambda _: release.wait(PATIENCE_S))
        manager.subscribe(
            "n", lambda reading: notifications.set() if reading.content == 2 * MAX_WAITING_CHANGES else None
        )
        for number in range(2 * MAX_WAITING_CHANGES + 1):
            manager.set("n", number)
        assert notifications.wait(PATIENCE_S)
        assert slow.dropped >= MAX_WAITING_CHANGES
        release.set()


def test_with_too_many_changes_the_newest_are_reported() -> None:
    release, done, notifications = threading.Event(), threading.Event(), list[object]()
    last = 2 * MAX_WAITING_CHANGES

    def slowly(reading: Reading[object]) -> None:
        release.wait(PATIENCE_S)
        notifications.append(reading.content)
        if reading.content == last:
            done.set()

    with in_real_time() as manager:
        subscription = manager.subscribe("n", slowly)
        for number in range(last + 1):
            manager.set("n", number)
        release.set()
        assert done.wait(PATIENCE_S)
    assert len(notifications) + subscription.dropped == last + 2
    assert notifications[-MAX_WAITING_CHANGES:] == list(range(last + 1 - MAX_WAITING_CHANGES, last + 1))


def test_a_callback_that_exits_its_thread_gets_the_next_change() -> None:
    done = threading.Event()

    def leaves(reading: Reading[object]) -> None:
        if reading.content == 1:
            done.set()
        raise SystemExit

    with in_real_time() as manager:
        manager.subscribe("n", leaves)
        manager.set("n", 1)
        assert done.wait(PATIENCE_S)


# Waiting


def test_waiting_for_a_variable_ends_when_it_is_known() -> None:
    clock = SimClock()
    model = forest([variable("a")], observer("o", seen("look", "a")))
    with started(model, World({"look": takes(1.5, {"seen": False})}), clock) as manager:
        manager.declare("a")
        assert manager.wait_for("a", 10.0) is True
        assert (clock.now_s(), manager.wait_for("a", 0.0)) == (1.5, True)


def test_waiting_for_a_condition_ends_when_it_holds_or_at_the_timeout() -> None:
    clock, world = SimClock(), World({"look": lambda job: {"seen": job.now_s() >= 3.0}})
    model = forest([variable("a"), given("b")], observer("o", seen("look", "a")))
    with started(model, world, clock) as manager:
        manager.declare("a")
        assert manager.wait_for(value("a") & ~known("b"), 10.0) is True
        assert clock.now_s() == 3.0
        assert manager.wait_for(~value("a"), 4.5) is False
        assert clock.now_s() == 7.5


def test_waiting_for_an_age_ends_without_another_event() -> None:
    clock = SimClock()
    with started(MODEL, World(), clock) as manager:
        manager.set("n", 1)
        assert manager.wait_for(age("n") > 5.0, 60.0) is True
        assert 5.0 < clock.now_s() < 5.1
    with in_real_time() as manager:
        manager.set("n", 1)
        assert manager.wait_for(age("n") > 0.2, PATIENCE_S) is True


def test_waiting_for_an_age_ends_if_the_variable_becomes_known_meanwhile() -> None:
    clock = SimClock()
    with started(MODEL, World(), clock) as manager:
        clock.call_at(5.0, lambda: manager.set("a", True))
        assert manager.wait_for(age("a") > 4.0, 60.0) is True
        assert 9.0 < clock.now_s() < 9.1


def test_waiting_for_an_undeclared_variable_is_an_error() -> None:
    with started(MODEL, World()) as manager:
        for condition in ("m", value("n") > known("m")):
            with pytest.raises(UnknownNameError, match="no variable 'm'"):
                manager.wait_for(condition, 1.0)


def test_another_thread_ends_the_waiting() -> None:
    with in_real_time() as manager:
        threading.Timer(0.05, lambda: manager.set("n", 5)).start()
        assert manager.wait_for(value("n") > 4, PATIENCE_S) is True


def test_waiting_ends_when_the_clock_is_closed() -> None:
    for condition in (value("n") > 4, age("n") > PATIENCE_S):
        clock = WallClock(0.0)
        with started(MODEL, World(), clock) as manager:
            manager.set("n", 1)
            threading.Timer(0.05, clock.close).start()
            assert manager.wait_for(condition, 10 * PATIENCE_S) is False


def test_waiting_with_a_negative_timeout_checks_once() -> None:
    with started(MODEL, World()) as manager:
        manager.set("n", 1)
        assert manager.wait_for("n", -1.0) is True
        assert manager.wait_for("a", -1.0) is False
        with pytest.raises(ValueError, match="a duration is zero or more"):
            manager.wait_for("a", float("nan"))
