"""Statistics of trials: paired bootstrap intervals over runs, and Welch's t-test with the effect size."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

CONFIDENCE_LEVEL = 0.95
"""The confidence level: the share of intervals that contain the true value."""

RESAMPLE_COUNT = 10_000
SEED = 2026
"""The seed of all resampling. It is fixed, so the same outcomes give the same intervals."""

_ROUNDING_ERROR = 1e-12
"""Differences between ratios that are smaller than this are only rounding errors of sums."""

_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value with its confidence interval at `CONFIDENCE_LEVEL`.

    Attributes:
        value: the value; None if the data give no value. For example, the ratio of the seconds with a right value to
            the seconds with any value does not exist if there never was a value.
        low, high: the ends of the interval; None if the data give no interval, e.g. because there is only one run.
    """

    value: float | None
    low: float | None
    high: float | None

    @property
    def is_positive(self) -> bool:
        """Return whether the interval lies completely above zero."""
        return self.low is not None and self.low > 0.0

    @property
    def is_negative(self) -> bool:
        """Return whether the interval lies completely below zero."""
        return self.high is not None and self.high < 0.0

    def __neg__(self) -> Estimate:
        """Return the estimate of the negated value."""
        value, low, high = (None if number is None else 0.0 - number for number in (self.value, self.high, self.low))
        return Estimate(value=value, low=low, high=high)


@dataclass(frozen=True, slots=True)
class Share:
    """A part of a total in one run, e.g. the seconds with a right value among the seconds with any value."""

    part: float
    total: float


def ratio_of_sums(shares: Sequence[Share]) -> float | None:
    """Return the sum of all parts divided by the sum of all totals, as in P1's Table 2; None for 0 / 0."""
    total = math.fsum(share.total for share in shares)
    return math.fsum(share.part for share in shares) / total if total else None


def ratio_interval(shares: Sequence[Share]) -> Estimate:
    """Return the ratio of the sums over all runs, with its interval.

    Args:
        shares: one share per run.
    """
    return _estimate_with_interval(_ratio, ratio_of_sums(shares), shares)


def ratio_difference(first: Sequence[Share], second: Sequence[Share]) -> Estimate:
    """Return the ratio of sums of one arm minus the ratio of sums of another arm, with the interval of the difference.

    Both arms watch the same frames (P1, section 4.1), so a run that is hard for one arm is also hard for the other.
    Therefore, each run that is drawn for a resample contributes the shares of both arms.

    Args:
        first: the shares of one arm, one per run.
        second: the shares of the other arm, for the same runs in the same order.

    Raises:
        ValueError: if the numbers of runs differ.
    """
    if len(first) != len(second):
        raise ValueError(f"{len(first)} runs cannot be paired with {len(second)}")
    first_ratio, second_ratio = ratio_of_sums(first), ratio_of_sums(second)
    value = None if first_ratio is None or second_ratio is None else first_ratio - second_ratio
    return _estimate_with_interval(_difference_of_ratios, value, first, second)


def mean_interval(values: Sequence[float]) -> Estimate:
    """Return the mean over runs, with its interval.

    Args:
        values: one value per run, e.g. the difference between two arms.
    """
    return ratio_interval([Share(value, 1.0) for value in values])


def quantile_interval(runs: Sequence[Sequence[float]], quantile: float) -> Estimate:
    """Return a quantile of the values of all runs together, with its percentile interval.

    Runs are resampled, each run with all of its values. Resamples without any value are ignored.

    Args:
        runs: the values of each run; a run may have none, and values may be infinite.
        quantile: a share between 0 and 1. The result is one of the values: the smallest value v for which at least
            this share of all values is at most v.
    """
    values_with_runs = sorted((value, run) for run, values in enumerate(runs) for value in values)
    if not values_with_runs:
        return Estimate(value=None, low=None, high=None)
    values, runs_of_values = np.array([value for value, _ in values_with_runs]), [run for _, run in values_with_runs]
    value = float(values[_quantile_indices(np.ones((1, len(values_with_runs))), quantile)[0]])
    if len(runs) < 2:
        return Estimate(value=value, low=None, high=None)
    drawn_runs = np.random.default_rng(SEED).integers(len(runs), size=(RESAMPLE_COUNT, len(runs)))
    counts = np.stack([(drawn_runs == run).sum(-1) for run in range(len(runs))], axis=-1)[:, runs_of_values]
    resampled_quantiles = np.sort(values[_quantile_indices(counts[counts.sum(-1) > 0].astype(float), quantile)])
    tail_share = (1.0 - CONFIDENCE_LEVEL) / 2.0
    low, high = (
        float(resampled_quantiles[int(share * (len(resampled_quantiles) - 1))])
        for share in (tail_share, 1.0 - tail_share)
    )
    return Estimate(value=value, low=low, high=high)


def _quantile_indices(counts: _Array, quantile: float) -> NDArray[np.intp]:
    """For each row of `counts`, return the index of a quantile among the sorted values.

    A row states how often each value occurs.
    """
    sums = counts.cumsum(-1)
    indices: NDArray[np.intp] = np.argmax(sums >= quantile * sums[:, -1:] - _ROUNDING_ERROR, axis=-1)
    return indices


@dataclass(frozen=True, slots=True, kw_only=True)
class Welch:
    """The result of a two-sided Welch's t-test of two independent samples (P1, section 4.2, footnote 4).

    Attributes:
        difference: the mean of the first sample minus the mean of the second sample. The interval uses the t
            distribution of the test.
        t: the test statistic.
        degrees: the degrees of freedom by Welch and Satterthwaite.
        p: the probability of a difference at least as large if the means were equal.
        hedges_g: the difference in units of the root of the mean variance. The value is corrected for small samples.
            The interval does not assume equal variances (Bonett, Psychological Methods 13, 2008).
    """

    difference: Estimate
    t: float
    degrees: float
    p: float
    hedges_g: Estimate


def welch(first: Sequence[float], second: Sequence[float]) -> Welch | None:
    """Compare the means of two samples whose variances may differ.

    Args:
        first: the first sample, at least two values.
        second: the second sample, at least two values.

    Returns:
        The result of the test; None if neither sample varies, because the test needs a variance.

    Raises:
        ValueError: if a sample has fewer than two values.
    """
    from scipy import stats

    if min(len(first), len(second)) < 2:
        raise ValueError("a variance needs at least two values")
    if _variance(first) + _variance(second) == 0.0:
        return None
    t_test = stats.ttest_ind(first, second, equal_var=False)
    interval = t_test.confidence_interval(CONFIDENCE_LEVEL)
    difference = float(np.mean(first) - np.mean(second))
    return Welch(
        difference=Estimate(value=difference, low=float(interval.low), high=float(interval.high)),
        t=float(t_test.statistic),
        degrees=float(t_test.df),
        p=float(t_test.pvalue),
        hedges_g=_hedges_g(difference, first, second),
    )


def _hedges_g(difference: float, first: Sequence[float], second: Sequence[float]) -> Estimate:
    from scipy import stats

    variances, degrees = (_variance(first), _variance(second)), (len(first) - 1, len(second) - 1)
    mean_variance = sum(variances) / 2
    effect = difference / math.sqrt(mean_variance)
    shares = [variance / mean_variance for variance in variances]
    spread = effect**2 / 8 * sum(share**2 / degree for share, degree in zip(shares, degrees, strict=True))
    deviation = math.sqrt(spread + sum(share / degree for share, degree in zip(shares, degrees, strict=True)))
    half_width = float(stats.norm.ppf((1.0 + CONFIDENCE_LEVEL) / 2)) * deviation
    correction = 1.0 - 3.0 / (4.0 * sum(degrees) - 1.0)
    return Estimate(value=correction * effect, low=effect - half_width, high=effect + half_width)


def _variance(values: Sequence[float]) -> float:
    return float(np.var(values, ddof=1)) if len(set(values)) > 1 else 0.0


# Resampling


def _ratio(part: _Array, total: _Array, axis: int = -1) -> Any:
    return part.sum(axis) / total.sum(axis)


def _difference_of_ratios(
    first_part: _Array, first_total: _Array, second_part: _Array, second_total: _Array, axis: int = -1
) -> Any:
    return _ratio(first_part, first_total, axis) - _ratio(second_part, second_total, axis)


def _estimate_with_interval(statistic: Any, value: float | None, *samples: Sequence[Share]) -> Estimate:
    """Return a value with its bootstrap interval.

    The interval is bias-corrected and accelerated (BCa), because the distribution of shares near 1 is skewed. The
    interval is missing if there is only one run, or if a resample has no ratio because all of its totals are 0.
    """
    if value is None or len(samples[0]) < 2:
        return Estimate(value=value, low=None, high=None)
    columns = [
        np.array(column) for sample in samples for column in ([s.part for s in sample], [s.total for s in sample])
    ]
    drawn_runs = np.random.default_rng(SEED).integers(len(columns[0]), size=(RESAMPLE_COUNT, len(columns[0])))
    if any((column[drawn_runs].sum(-1) == 0.0).any() for column in columns[1::2]):
        return Estimate(value=value, low=None, high=None)
    low, high = _bootstrap_interval(statistic, columns)
    return Estimate(value=value, low=low, high=high)


def _bootstrap_interval(statistic: Any, columns: Sequence[_Array]) -> tuple[float, float] | tuple[None, None]:
    """Return the ends of the interval; both are None if the data do not determine them.

    If leaving out any single run does not change the value, both ends are the value.
    """
    from scipy import stats

    runs = range(len(columns[0]))
    statistics_without_one_run = np.array([statistic(*(np.delete(column, run) for column in columns)) for run in runs])
    if np.ptp(statistics_without_one_run) <= _ROUNDING_ERROR:
        return float(statistics_without_one_run[0]), float(statistics_without_one_run[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)  # the ends are NaN in this case
        interval = stats.bootstrap(
            columns,
            statistic,
            paired=True,
            vectorized=True,
            n_resamples=RESAMPLE_COUNT,
            confidence_level=CONFIDENCE_LEVEL,
            method="BCa",
            rng=np.random.default_rng(SEED),
        ).confidence_interval
    ends = float(interval.low), float(interval.high)
    return (None, None) if any(map(math.isnan, ends)) else ends
