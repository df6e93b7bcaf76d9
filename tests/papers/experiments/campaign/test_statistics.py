"""Intervals and tests, compared with cases computed by hand and with simulated data whose truth is known."""

from __future__ import annotations

from itertools import product
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_papers.experiments.campaign.statistics import (
    Estimate,
    Share,
    mean_interval,
    ratio_difference,
    ratio_interval,
    ratio_of_sums,
    welch,
)

positive_numbers = st.floats(1.0, 1e4)
shares = st.lists(
    st.tuples(st.floats(0.0, 1.0), positive_numbers).map(lambda pair: Share(pair[0] * pair[1], pair[1])),
    min_size=2,
    max_size=8,
)


def test_a_ratio_of_sums_weighs_long_runs_more() -> None:
    assert ratio_of_sums([Share(1.0, 1.0), Share(0.0, 3.0)]) == 0.25


def test_without_a_held_value_there_is_no_ratio() -> None:
    assert ratio_of_sums([Share(0.0, 0.0)]) is None
    assert ratio_interval([Share(0.0, 0.0), Share(0.0, 0.0)]) == Estimate(value=None, low=None, high=None)


def test_one_run_gives_a_value_but_no_interval() -> None:
    estimate = ratio_interval([Share(1.0, 2.0)])

    assert estimate == Estimate(value=0.5, low=None, high=None)
    assert not estimate.is_positive
    assert not estimate.is_negative


def test_there_is_no_interval_if_a_resample_may_be_empty() -> None:
    assert ratio_interval([Share(1.0, 2.0), Share(0.0, 0.0)]) == Estimate(value=0.5, low=None, high=None)


def test_runs_that_all_agree_leave_no_doubt() -> None:
    difference = ratio_difference([Share(9.0, 10.0), Share(90.0, 100.0)], [Share(5.0, 10.0), Share(50.0, 100.0)])

    assert difference.value == pytest.approx(0.4)
    assert (difference.low, difference.high) == (pytest.approx(0.4), pytest.approx(0.4))
    assert difference.is_positive


def test_the_interval_lies_among_the_ratios_of_all_possible_resamples() -> None:
    runs = [Share(9.0, 10.0), Share(2.0, 10.0), Share(30.0, 40.0)]
    ratios = sorted(
        filter(None, (ratio_of_sums([runs[index] for index in indices]) for indices in product(range(3), repeat=3)))
    )
    estimate = ratio_interval(runs)

    assert estimate.low is not None
    assert estimate.high is not None
    assert min(abs(estimate.low - ratio) for ratio in ratios) < 1e-12
    assert min(abs(estimate.high - ratio) for ratio in ratios) < 1e-12
    assert ratios[0] <= estimate.low < 41 / 60 < estimate.high <= ratios[-1]


def test_a_negated_estimate_has_swapped_ends_and_no_negative_zero() -> None:
    estimate = -Estimate(value=-0.25, low=-0.5, high=0.0)

    assert repr(estimate) == repr(Estimate(value=0.25, low=0.0, high=0.5))


def test_pairing_removes_the_difficulty_that_a_run_has_for_both_arms() -> None:
    random = Random(1)
    shares_of_runs = [random.uniform(0.2, 0.9) for _ in range(20)]
    better_arm = [Share(100.0 * (share + 0.05), 100.0) for share in shares_of_runs]
    worse_arm = [Share(100.0 * share + random.gauss(0.0, 0.5), 100.0) for share in shares_of_runs]

    paired_difference = ratio_difference(better_arm, worse_arm)
    unpaired_difference = ratio_difference(better_arm, worse_arm[::-1])

    assert paired_difference.is_positive
    assert not unpaired_difference.is_positive


def test_different_numbers_of_runs_are_refused() -> None:
    with pytest.raises(ValueError, match="2 runs cannot be paired with 1"):
        ratio_difference([Share(1.0, 1.0)] * 2, [Share(1.0, 1.0)])


@given(shares)
def test_the_same_outcomes_give_the_same_interval_and_swapped_arms_give_its_negative(runs: list[Share]) -> None:
    other_runs = [Share(share.total - share.part, share.total) for share in runs]
    difference = ratio_difference(runs, other_runs)
    swapped_difference = ratio_difference(other_runs, runs)

    assert difference == ratio_difference(runs, other_runs)
    assert difference.value == pytest.approx(-swapped_difference.value, abs=1e-9)
    assert (
        difference.low is None
        or swapped_difference.high is None
        or difference.low == pytest.approx(-swapped_difference.high, abs=0.02)
    )


def a_run(random: np.random.Generator) -> tuple[Share, Share]:
    """Return a run in which one arm is rarely wrong and the other often for long: shares as skewed as real ones."""
    length_s = random.uniform(800.0, 1500.0)
    rare_share = min(0.9, random.exponential(0.01))
    frequent_share = random.uniform(0.0, 0.6) if random.random() < 0.5 else min(0.9, random.exponential(0.02))
    return Share(length_s * (1 - rare_share), length_s), Share(length_s * (1 - frequent_share), length_s)


def covers(runs: list[tuple[Share, Share]], true_difference: float) -> bool:
    difference = ratio_difference([first for first, _ in runs], [second for _, second in runs])
    assert difference.low is not None
    assert difference.high is not None
    return difference.low <= true_difference <= difference.high


def test_about_nineteen_of_twenty_intervals_hold_the_true_difference() -> None:
    random = np.random.default_rng(7)
    many_runs = [a_run(random) for _ in range(100_000)]
    true_difference = ratio_difference_of(many_runs)
    covering_count = sum(covers([a_run(random) for _ in range(20)], true_difference) for _ in range(200))

    assert 180 <= covering_count <= 199


def ratio_difference_of(runs: list[tuple[Share, Share]]) -> float:
    first, second = (ratio_of_sums([run[arm] for run in runs]) for arm in (0, 1))
    assert first is not None
    assert second is not None
    return first - second


def test_the_mean_of_runs_is_the_mean() -> None:
    estimate = mean_interval([1.0, 2.0, 3.0, 6.0])

    assert estimate.value == 3.0
    assert estimate.low is not None
    assert estimate.high is not None
    assert 1.0 < estimate.low < 3.0 < estimate.high < 6.0


def test_welch_equals_the_calculation_by_hand() -> None:
    welch_result = welch([1.0, 2.0, 3.0, 4.0], [10.0, 14.0, 18.0, 22.0, 26.0])

    assert welch_result is not None
    assert welch_result.difference.value == -15.5
    # By hand: variances 5/3 and 40, standard error sqrt(5/12 + 8) = 2.9011, 4.41 degrees of freedom.
    assert welch_result.t == pytest.approx(-15.5 / (5 / 12 + 8) ** 0.5)
    assert welch_result.degrees == pytest.approx((5 / 12 + 8) ** 2 / ((5 / 12) ** 2 / 3 + 8**2 / 4))
    assert 0.001 < welch_result.p < 0.01
    assert welch_result.difference.is_negative
    assert welch_result.hedges_g.value == pytest.approx((1 - 3 / 27) * -15.5 / ((5 / 3 + 40) / 2) ** 0.5)


def test_samples_that_do_not_vary_are_not_tested() -> None:
    assert welch([1.0, 1.0], [2.0, 2.0]) is None


def test_a_sample_of_one_is_refused() -> None:
    with pytest.raises(ValueError, match="two values"):
        welch([1.0], [2.0, 3.0])


def test_welch_equals_the_output_of_r_for_its_data_on_sleep() -> None:
    first_sample = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
    second_sample = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]

    welch_result = welch(
        first_sample, second_sample
    )  # as `t.test(extra ~ group, data = sleep)` is printed in R's manual

    assert welch_result is not None
    assert welch_result.t == pytest.approx(-1.8608, abs=5e-5)
    assert welch_result.degrees == pytest.approx(17.776, abs=5e-4)
    assert welch_result.p == pytest.approx(0.07939, abs=5e-6)
    assert welch_result.difference.low == pytest.approx(-3.3654832, abs=5e-8)
    assert welch_result.difference.high == pytest.approx(0.2054832, abs=5e-8)


def test_the_effect_and_its_interval_are_those_that_statpsych_prints() -> None:
    first_sample, second_sample = (sample_of(30, mean, deviation) for mean, deviation in ((35.1, 7.32), (26.7, 6.98)))

    welch_result = welch(
        first_sample, second_sample
    )  # as `ci.stdmean2(.05, 35.1, 26.7, 7.32, 6.98, 30, 30)` is printed in its manual

    assert welch_result is not None
    assert welch_result.hedges_g.value == pytest.approx(1.159240, abs=1e-5)
    assert welch_result.hedges_g.low == pytest.approx(0.6170771, abs=1e-5)
    assert welch_result.hedges_g.high == pytest.approx(1.731909, abs=1e-5)


def sample_of(count: int, mean: float, deviation: float) -> list[float]:
    """Return a sample that has exactly this mean and standard deviation."""
    raw_values = np.arange(count, dtype=float)
    return list(mean + deviation * (raw_values - raw_values.mean()) / raw_values.std(ddof=1))
