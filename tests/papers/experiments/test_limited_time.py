from __future__ import annotations

import math

import pytest

from codra_dsl.runtime import SimClock
from codra_papers.experiments.limited_time import LimitedClock, TimeIsUp


def limited_clock(end_s: float) -> LimitedClock:
    return LimitedClock(SimClock(), end_s, lambda _: None)


def never() -> bool:
    return False


def test_a_sleep_beyond_the_end_ends_there() -> None:
    clock = limited_clock(5.0)
    clock.sleep(3.0)

    with pytest.raises(TimeIsUp):
        clock.sleep(3.0)
    assert clock.now_s() == 5.0


def test_a_wait_beyond_the_end_ends_there() -> None:
    clock = limited_clock(5.0)
    clock.sleep(3.0)

    with pytest.raises(TimeIsUp):
        clock.wait_until(never, math.inf)
    assert clock.now_s() == 5.0


def test_a_wait_that_times_out_before_the_end_returns_false() -> None:
    clock = limited_clock(5.0)

    assert not clock.wait_until(never, 4.0)
    assert clock.now_s() == 4.0


def test_an_event_at_the_end_itself_still_counts() -> None:
    clock = limited_clock(5.0)
    call_instants_s: list[float] = []
    clock.call_at(5.0, lambda: call_instants_s.append(clock.now_s()))

    assert clock.wait_until(lambda: bool(call_instants_s), 9.0)
    assert call_instants_s == [5.0]


def test_time_without_an_end_continues() -> None:
    clock = limited_clock(math.inf)
    clock.sleep(1e9)

    assert not clock.wait_until(never, 1e9)
    assert clock.now_s() == 2e9
