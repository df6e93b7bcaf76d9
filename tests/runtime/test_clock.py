"""Simulated time and real time: events, waiting, work."""

from __future__ import annotations

import gc
import math
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from codra_dsl.runtime import Clock, SimClock, WallClock
from codra_dsl.runtime.clock import Cancelled, Timer, Work
from codra_dsl.runtime.locked_clock import LockedClock
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error

ROOT = Path(__file__).parents[2]


@pytest.fixture
def wall() -> Iterator[WallClock]:
    with WallClock() as clock:
        yield clock


# Simulated time


def test_time_passes_only_during_sleep() -> None:
    clock = SimClock(100.0)
    assert clock.now_s() == 100.0
    clock.sleep(2.5)
    assert clock.now_s() == 102.5


def test_events_happen_in_the_order_of_their_instants_then_of_their_scheduling() -> None:
    clock, happened = SimClock(), []
    for name, instant_s in [("b", 2.0), ("a", 1.0), ("c", 2.0), ("late", 9.0), ("past", -5.0)]:
        clock.call_at(instant_s, lambda name=name: happened.append((name, clock.now_s())))
    assert happened == []
    clock.sleep(2.0)
    assert happened == [("past", 0.0), ("a", 1.0), ("b", 2.0), ("c", 2.0)]


def test_an_event_that_another_schedules_for_this_instant_happens_at_this_instant() -> None:
    clock, happened = SimClock(), []
    clock.call_at(1.0, lambda: clock.call_at(1.0, lambda: happened.append(clock.now_s())))
    clock.sleep(1.0)
    assert happened == [1.0]


def test_a_cancelled_event_does_not_happen_and_an_infinite_one_never_does() -> None:
    clock, happened = SimClock(), []
    clock.call_at(1.0, lambda: happened.append("cancelled")).cancel()
    clock.call_at(math.inf, lambda: happened.append("never"))
    clock.sleep(5)
    with pytest.raises(RuntimeError, match="wait forever"):
        clock.wait_until(lambda: False, math.inf)
    assert happened == []
    assert clock.now_s() == 5


def test_waiting_ends_when_it_is_ready_or_over() -> None:
    clock, ready = SimClock(), []
    clock.call_at(3.0, lambda: ready.append(True))
    assert not clock.wait_until(lambda: bool(ready), 2.0)
    assert clock.now_s() == 2.0
    assert clock.wait_until(lambda: bool(ready), 9.0)
    assert clock.now_s() == 3.0


@pytest.mark.parametrize("duration_s", [-1.0, math.nan])
def test_time_does_not_run_backwards(duration_s: float, wall: WallClock) -> None:
    for clock in (SimClock(), wall):
        with pytest.raises(ValueError, match="a duration is zero or more seconds"):
            clock.sleep(duration_s)
        with pytest.raises(ValueError, match="a duration is zero or more seconds"):
            clock.wait_until(lambda: False, duration_s)


def test_simulated_work_runs_at_once_and_is_delivered_after_its_duration() -> None:
    clock, logged_steps = SimClock(), []

    def run(work: Work) -> float:
        logged_steps.append(("ran", clock.now_s()))
        work.sleep(1.5)
        work.sleep(0.5)
        return work.now_s()

    clock.call_at(1.0, lambda: clock.start(run, lambda outcome: logged_steps.append((outcome, clock.now_s()))))
    clock.sleep(2.9)
    assert logged_steps == [("ran", 1.0)]
    clock.sleep(0.1)
    assert logged_steps == [("ran", 1.0), (3.0, 3.0)]


def test_cancelled_work_ends_at_once_in_both_kinds_of_time(wall: WallClock) -> None:
    """In real time, the next `sleep` of the work raises an error."""
    for clock in (SimClock(), wall):
        delivered: list[str] = []

        def run(work: Work) -> str:
            try:
                work.sleep(3600)
            except Cancelled:
                return "cancelled"
            return "slept"

        def deliver(outcome: str, clock: Clock = clock, delivered: list[str] = delivered) -> None:
            delivered.append(outcome)
            clock.notify()

        work = clock.start(run, deliver)
        clock.sleep(0.01)
        start_s = clock.now_s()
        work.cancel()
        assert work.cancelled
        assert clock.wait_until(lambda delivered=delivered: len(delivered) == 1, 60)
        assert clock.now_s() - start_s < 60
        clock.sleep(0.01)
        assert len(delivered) == 1


def test_waiting_inside_an_event_is_refused() -> None:
    clock, errors = SimClock(), []

    def waits() -> None:
        with pytest.raises(RuntimeError, match=r"must not wait on the clock: use job\.sleep"):
            clock.sleep(1)
        errors.append("records")

    clock.call_at(1.0, waits)
    clock.start(lambda _: waits(), lambda _: None)
    clock.sleep(2)
    assert errors == ["records", "records"]


def test_simulated_time_belongs_to_one_thread() -> None:
    clock, records = SimClock(), []

    def elsewhere() -> None:
        for call in (lambda: clock.sleep(1), lambda: clock.call_at(1, lambda: None)):
            with pytest.raises(RuntimeError, match="belongs to the thread that created it: use WallClock"):
                call()
            records.append(True)

    thread = threading.Thread(target=elsewhere)
    thread.start()
    thread.join()
    assert records == [True, True]


# Real time


def test_real_events_happen_in_a_separate_thread_and_wake_waiting_threads(wall: WallClock) -> None:
    threads: list[str] = []

    def happen() -> None:
        threads.append(threading.current_thread().name)
        wall.notify()

    wall.call_at(wall.now_s() + 0.01, happen)
    assert wall.wait_until(lambda: bool(threads), 60)
    assert threads == ["codra-clock"]


def test_an_event_that_fails_does_not_stop_the_others(wall: WallClock, caplog: pytest.LogCaptureFixture) -> None:
    happened: list[bool] = []

    def exits() -> None:
        raise SystemExit

    wall.call_at(wall.now_s(), lambda: 1 // 0)
    wall.call_at(wall.now_s(), exits)
    wall.call_at(wall.now_s() + 0.01, lambda: (happened.append(True), wall.notify()))
    assert wall.wait_until(lambda: bool(happened), 60)
    assert [record.message for record in caplog.records] == ["an event failed"] * 2


def test_events_with_hostile_exceptions_do_not_stop_the_others(
    wall: WallClock, caplog: pytest.LogCaptureFixture
) -> None:
    happened: list[bool] = []

    def raise_error(kind: str) -> None:
        raise hostile_error(kind)

    for kind in HOSTILE_ERRORS:
        wall.call_at(wall.now_s(), partial(raise_error, kind))
    wall.call_at(wall.now_s() + 0.01, lambda: (happened.append(True), wall.notify()))
    assert wall.wait_until(lambda: bool(happened), 60)
    assert caplog.messages == ["an event failed"] * len(HOSTILE_ERRORS)
    assert all(text in caplog.text for text in HOSTILE_ERRORS.values())


def test_cancelled_real_events_need_no_memory_until_their_instants(wall: WallClock) -> None:
    happened = threading.Event()
    far_s = wall.now_s() + 1e9
    kept_timers = [wall.call_at(far_s, lambda: None) for _ in range(10)]
    for _ in range(20_000):
        wall.call_at(far_s, lambda: None).cancel()
    wall.call_at(wall.now_s(), happened.set)
    assert happened.wait(60.0)
    timers = [thing for thing in gc.get_objects() if type(thing) is Timer and thing.instant_s == far_s]
    assert len(timers) < 2_000
    assert not any(timer.is_cancelled for timer in kept_timers)


def test_an_event_must_not_wait_in_real_time_either(wall: WallClock) -> None:
    refusals: list[str] = []

    def waits() -> None:
        for call in (lambda: wall.sleep(1), lambda: wall.wait_until(lambda: False, 1)):
            with pytest.raises(RuntimeError, match="must not wait on the clock"):
                call()
        refusals.append("refused")
        wall.notify()

    wall.call_at(wall.now_s(), waits)
    assert wall.wait_until(lambda: bool(refusals), 60)


def test_waiting_on_a_closed_clock_returns_false() -> None:
    clock, answers = WallClock(), []
    thread = threading.Thread(target=lambda: answers.append(clock.wait_until(lambda: False, math.inf)))
    thread.start()
    clock.close()
    thread.join(60)
    assert answers == [False]


def test_a_wait_may_have_any_length(wall: WallClock) -> None:
    for timeout_s in (1e30, math.inf):
        assert wall.wait_until(lambda: True, timeout_s)
    outcomes: list[str] = []

    def run(work: Work) -> None:
        with pytest.raises(Cancelled):
            work.sleep(math.inf)
        outcomes.append("cancelled")

    wall.start(run, lambda _: wall.notify()).cancel()
    assert wall.wait_until(lambda: bool(outcomes), 60)


def test_a_real_clock_shows_the_time_of_day_or_the_given_start() -> None:
    with WallClock(5.0) as clock_with_start, WallClock() as default_clock:
        assert 5.0 <= clock_with_start.now_s() < 65.0
        assert default_clock.now_s() > 1.7e9


def test_events_of_a_locked_clock_hold_the_lock_and_work_does_not(wall: WallClock) -> None:
    lock = threading.RLock()
    clock, held = LockedClock(wall, lock), {}

    def is_free() -> bool:
        taken: list[bool] = []

        def take() -> None:
            taken.append(lock.acquire(blocking=False))
            if taken[0]:
                lock.release()

        thread = threading.Thread(target=take)
        thread.start()
        thread.join()
        return taken[0]

    def run(_: Work) -> None:
        held["work"] = not is_free()

    def happen(what: str) -> None:
        held[what] = not is_free()
        clock.notify()

    clock.call_at(clock.now_s(), lambda: happen("event"))
    assert clock.wait_until(lambda: "event" in held, 60)
    clock.start(run, lambda _: happen("delivery"))
    assert clock.wait_until(lambda: "delivery" in held, 60)
    assert held == {"event": True, "work": False, "delivery": True}


HANGS = """
import sys, threading, time
from codra_dsl.runtime import WallClock
clock = WallClock()
started = threading.Event()
def hang(work):
    started.set()
    time.sleep(3600)
clock.start(hang, print)
started.wait()
print("end", flush=True)
"""


def test_a_process_ends_although_work_hangs() -> None:
    with subprocess.Popen([sys.executable, "-c", HANGS], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "end\n"
        assert process.wait(timeout=2) == 0


def test_the_last_event_of_an_instant_runs_after_events_that_others_of_the_instant_schedule() -> None:
    clock, happened = SimClock(), list[str]()

    def first() -> None:
        happened.append("first")
        clock.call_at(1.0, lambda: happened.append("what it brings about"))

    clock.call_last_at(1.0, lambda: happened.append("last"))
    clock.call_last_at(1.0, lambda: happened.append("the very last"))
    clock.call_at(1.0, first)
    clock.call_at(2.0, lambda: happened.append("later"))
    clock.sleep(2.0)

    assert happened == ["first", "what it brings about", "last", "the very last", "later"]


class _HandlerError(BaseException):
    """Raised by a signal handler. As it is no `Exception`, no other code catches it."""


def test_a_signal_handler_that_raises_never_leaves_the_lock_of_a_step_taken(wall: WallClock) -> None:
    lock = threading.RLock()
    clock = LockedClock(wall, lock)
    without_step = clock.without_step()

    def interrupt(*_: object) -> None:
        raise _HandlerError

    def take_steps() -> None:
        signal.setitimer(signal.ITIMER_REAL, 1e-4)
        while True:
            with clock, clock, without_step:
                clock.now_s()
            with without_step:
                pass

    old_handler = signal.signal(signal.SIGALRM, interrupt)
    try:
        for _ in range(300):
            with pytest.raises(_HandlerError):
                take_steps()
            assert not lock._is_owned()  # type: ignore[attr-defined]
    finally:
        signal.signal(signal.SIGALRM, old_handler)


def test_code_that_only_reads_is_not_a_step_and_a_step_within_it_has_the_present_instant() -> None:
    sim = SimClock()
    clock = LockedClock(sim, threading.RLock())
    with clock:
        first_s = clock.now_s()
    sim._now_s = 5.0  # a step within code that holds the lock, without events in between
    with clock.without_step():
        assert clock.now_s() == 5.0
        with clock:
            sim._now_s = 7.0
            assert clock.now_s() == 5.0
    assert (first_s, clock.now_s()) == (0.0, 7.0)
