from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from codra_dsl.runtime import SimClock
from codra_papers.experiments.interrupts import noted_interrupt
from codra_papers.experiments.limited_time import LimitedClock


@pytest.fixture(autouse=True)
def _heeded_interrupts() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(10):  # Python calls the handler of a signal between two instructions
        pass


def test_an_interrupt_ends_a_wait_after_the_event_in_which_it_came() -> None:
    happened = []
    with noted_interrupt() as raise_interrupt:
        clock = LimitedClock(SimClock(), 10.0, lambda _: None, raise_interrupt)
        clock.call_at(1.0, lambda: (interrupt(), happened.append("all of the first event")))
        clock.call_at(1.0, lambda: happened.append("the second event"))

        with pytest.raises(KeyboardInterrupt):
            clock.sleep(5.0)

    assert (happened, clock.now_s()) == (["all of the first event"], 1.0)


def test_an_interrupt_between_two_waits_is_raised_at_the_start_of_the_next_wait() -> None:
    with noted_interrupt() as raise_interrupt:
        clock = LimitedClock(SimClock(), 10.0, lambda _: None, raise_interrupt)
        interrupt()

        with pytest.raises(KeyboardInterrupt):
            clock.wait_until(lambda: True, 5.0)


def test_a_second_interrupt_is_raised_at_once() -> None:
    happened = []

    def work_long() -> None:
        interrupt()
        happened.append("after the first")
        interrupt()
        happened.append("after the second")

    def run() -> None:
        with noted_interrupt() as raise_interrupt:
            clock = LimitedClock(SimClock(), 10.0, lambda _: None, raise_interrupt)
            clock.call_at(1.0, work_long)
            clock.sleep(5.0)

    with pytest.raises(KeyboardInterrupt):
        run()
    assert happened == ["after the first"]


def test_the_handler_of_another_program_is_kept() -> None:
    handled = []
    signal.signal(signal.SIGINT, lambda *_: handled.append("by the other program"))
    with noted_interrupt() as raise_interrupt:
        interrupt()
        raise_interrupt()

    assert handled == ["by the other program"]


def test_an_interrupt_after_the_last_wait_is_raised_at_the_end_of_the_run() -> None:
    with pytest.raises(KeyboardInterrupt), noted_interrupt():
        interrupt()
