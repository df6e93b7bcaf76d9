"""Durations of perception: they are log-normal, and come from one stream that keeps equal callers synchronised."""

from __future__ import annotations

from math import inf, log, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest, norm

from codra_papers.lab.perception.functions import FIND_IN_VIEW_S, LOCALIZE_LID_S, LOCALIZE_ROTOR_S
from codra_papers.lab.perception.processing import SHORTEST_MEAN_S, SPREAD, Computer

MEANS_S = (FIND_IN_VIEW_S, LOCALIZE_ROTOR_S, LOCALIZE_LID_S)


def ends_of_work(computer: Computer, mean_s: float, count: int, start_s: float = 7.0) -> list[float]:
    """Begin each work as soon as the previous work is done. Return the instants at which work begins and ends."""
    ends_s = [start_s]
    for _ in range(count):
        ends_s.append(ends_s[-1] + computer.processing_s(ends_s[-1], mean_s))
    return ends_s


def one_after_another(computer: Computer, mean_s: float, count: int) -> list[float]:
    return np.diff(ends_of_work(computer, mean_s, count)).tolist()


@pytest.mark.parametrize("mean_s", [SHORTEST_MEAN_S, *MEANS_S, 20.0])
def test_times_are_log_normal_with_the_mean_asked_for_and_the_spread(mean_s: float) -> None:
    logs = np.log(one_after_another(Computer(3), mean_s, 1500))

    assert kstest(logs, norm(log(mean_s) - SPREAD**2 / 2, SPREAD).cdf).pvalue > 0.01
    assert np.exp(logs).mean() == pytest.approx(mean_s, rel=0.03)


def test_times_of_consecutive_calls_are_log_normal_and_independent() -> None:
    """The function is called like by naive observers: again as soon as it is done."""
    computer, now_s, deviations = Computer(9), 0.0, []
    for mean_s in (FIND_IN_VIEW_S, FIND_IN_VIEW_S, LOCALIZE_LID_S, LOCALIZE_ROTOR_S, LOCALIZE_LID_S) * 500:
        time_s = computer.processing_s(now_s, mean_s)
        deviations.append((log(time_s / mean_s) + SPREAD**2 / 2) / SPREAD)
        now_s += time_s

    assert kstest(deviations, norm().cdf).pvalue > 0.01
    assert abs(np.corrcoef(deviations[1:], deviations[:-1])[0, 1]) < 0.06


def test_times_are_independent_of_the_next() -> None:
    logs = np.log(one_after_another(Computer(4), LOCALIZE_LID_S, 3000))

    assert abs(np.corrcoef(logs[1:], logs[:-1])[0, 1]) < 0.05


def test_equal_work_that_begins_a_little_later_nearly_always_ends_at_the_same_instant() -> None:
    computer = Computer(5)
    starts_s = [40.0 + 3.0 * index for index in range(500)]
    ends_s = [start_s + computer.processing_s(start_s, LOCALIZE_LID_S) for start_s in starts_s]
    later_s = [start_s + 0.1 + computer.processing_s(start_s + 0.1, LOCALIZE_LID_S) for start_s in starts_s]

    assert np.mean([end_s == later_end_s for end_s, later_end_s in zip(ends_s, later_s, strict=True)]) > 0.8


def test_callers_with_equal_work_are_soon_in_step() -> None:
    computer = Computer(6)
    first_s, second_s = (set(ends_of_work(computer, LOCALIZE_LID_S, 40, start_s)) for start_s in (10.0, 11.3))

    assert len(first_s & second_s) > 30


@given(st.integers(0, 50), st.floats(0.0, 10_000.0), st.floats(SHORTEST_MEAN_S, 30.0))
def test_the_same_seed_instant_and_mean_give_the_same_time_after_any_other_calls(
    seed: int, start_s: float, mean_s: float
) -> None:
    asked_by_others = Computer(seed)
    one_after_another(asked_by_others, 1.0, 20)
    time_s = asked_by_others.processing_s(start_s, mean_s)

    assert time_s == Computer(seed).processing_s(start_s, mean_s)
    assert 0.0 < time_s < 6.0 * mean_s


def test_another_seed_gives_other_times() -> None:
    first, second = (one_after_another(Computer(seed), 1.6, 50) for seed in (1, 2))

    assert not set(first) & set(second)


@pytest.mark.parametrize("mean_s", [0.1, -1.0, inf, nan])
def test_an_unsupported_mean_is_refused(mean_s: float) -> None:
    with pytest.raises(ValueError, match=r"must be at least 0\.35 s and finite"):
        Computer(1).processing_s(3.0, mean_s)
