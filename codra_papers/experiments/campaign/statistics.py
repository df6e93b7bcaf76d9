"""How sure a difference is: paired bootstrap intervals over runs, and Welch's t-test with the size of the effect."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.95
"""How many of all intervals made this way hold what they are made for."""

RESAMPLES = 10_000
SEED = 2026
"""All resampling starts from this seed: the same outcomes give the same intervals."""

_NOTHING = 1e-12
"""Ratios that differ by less differ by how sums are rounded."""

_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A number, and between which two the true one probably lies, with `LEVEL`.

    Attributes:
        value: None if the data give none, e.g. a ratio where nothing was held.
        low, high: None if the data give no interval, e.g. because there is one run only.
    """

    value: float | None
    low: float | None
    high: float | None

    @property
    def is_positive(self) -> bool:
        """Return whether the whole interval lies above zero."""
        return self.low is not None and self.low > 0.0

    @property
    def is_negative(self) -> bool:
        """Return whether the whole interval lies below zero."""
        return self.high is not None and self.high < 0.0


@dataclass(frozen=True, slots=True)
class Share:
    """A part of a whole in one run, e.g. right seconds of held ones."""

    part: float
    whole: float


def ratio_of_sums(shares: Sequence[Share]) -> float | None:
    """Return the ratio of what the parts and the wholes of all runs add up to, as P1's Table 2 does; None for 0 / 0."""
    whole = math.fsum(share.whole for share in shares)
    return math.fsum(share.part for share in shares) / whole if whole else None


def ratio_interval(shares: Sequence[Share]) -> Estimate:
    """Return the ratio of sums over runs, with its interval.

    Args:
        shares: one a run.
    """
    return _resampled(_ratio, ratio_of_sums(shares), shares)


def ratio_difference(first: Sequence[Share], second: Sequence[Share]) -> Estimate:
    """Return how much larger the ratio of sums of one arm is than that of another, with its interval.

    Runs are resampled, each with both arms: what makes a run hard makes it hard for both (P1, section 4.1: they watch
    the same frames).

    Args:
        first: of one arm, one a run.
        second: of the other, of the same runs in the same order.

    Raises:
        ValueError: if the numbers of runs differ.
    """
    if len(first) != len(second):
        raise ValueError(f"{len(first)} runs cannot be paired with {len(second)}")
    left, right = ratio_of_sums(first), ratio_of_sums(second)
    value = None if left is None or right is None else left - right
    return _resampled(_difference_of_ratios, value, first, second)


def mean_interval(values: Sequence[float]) -> Estimate:
    """Return the mean over runs, with its interval.

    Args:
        values: one a run, e.g. differences between two arms.
    """
    return ratio_interval([Share(value, 1.0) for value in values])


def quantile_interval(runs: Sequence[Sequence[float]], quantile: float) -> Estimate:
    """Return a quantile of what all runs came to together, with its percentile interval.

    Runs are resampled, each with all of its values; resamples without any are left out.

    Args:
        runs: the values of each run, of which there may be none; infinite ones too.
        quantile: between 0 and 1. It is one of the values: the least that so large a share of them does not exceed.
    """
    order = sorted((value, run) for run, values in enumerate(runs) for value in values)
    if not order:
        return Estimate(value=None, low=None, high=None)
    values, owners = np.array([value for value, _ in order]), [run for _, run in order]
    value = float(values[_place(np.ones((1, len(order))), quantile)[0]])
    if len(runs) < 2:
        return Estimate(value=value, low=None, high=None)
    drawn = np.random.default_rng(SEED).integers(len(runs), size=(RESAMPLES, len(runs)))
    counts = np.stack([(drawn == run).sum(-1) for run in range(len(runs))], axis=-1)[:, owners]
    found = np.sort(values[_place(counts[counts.sum(-1) > 0].astype(float), quantile)])
    tail = (1.0 - LEVEL) / 2.0
    low, high = (float(found[int(share * (len(found) - 1))]) for share in (tail, 1.0 - tail))
    return Estimate(value=value, low=low, high=high)


def _place(counts: _Array, quantile: float) -> NDArray[np.intp]:
    """Return where a quantile stands among values in order, each of which counts so often, row by row."""
    sums = counts.cumsum(-1)
    places: NDArray[np.intp] = np.argmax(sums >= quantile * sums[:, -1:] - _NOTHING, axis=-1)
    return places


@dataclass(frozen=True, slots=True, kw_only=True)
class Welch:
    """What a two-sided Welch's t-test says of two independent samples (P1, section 4.2, footnote 4).

    Attributes:
        difference: of the means, first less second, with its interval by the same t distribution.
        t: the test statistic.
        degrees: of freedom, by Welch and Satterthwaite.
        p: how probable a difference at least as large were if the means were equal.
        hedges_g: the difference in units of the root of the mean variance, corrected for small samples, with an
            interval that lets variances differ (Bonett, Psychological Methods 13, 2008).
    """

    difference: Estimate
    t: float
    degrees: float
    p: float
    hedges_g: Estimate


def welch(first: Sequence[float], second: Sequence[float]) -> Welch | None:
    """Compare the means of two samples whose variances may differ.

    Args:
        first: at least two values.
        second: likewise.

    Returns:
        None if neither sample varies: there is nothing to test by then.

    Raises:
        ValueError: if a sample has fewer than two values.
    """
    from scipy import stats

    if min(len(first), len(second)) < 2:
        raise ValueError("a variance needs two values at least")
    if _variance(first) + _variance(second) == 0.0:
        return None
    found = stats.ttest_ind(first, second, equal_var=False)
    interval = found.confidence_interval(LEVEL)
    difference = float(np.mean(first) - np.mean(second))
    return Welch(
        difference=Estimate(value=difference, low=float(interval.low), high=float(interval.high)),
        t=float(found.statistic),
        degrees=float(found.df),
        p=float(found.pvalue),
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
    reach = float(stats.norm.ppf((1.0 + LEVEL) / 2)) * deviation
    correction = 1.0 - 3.0 / (4.0 * sum(degrees) - 1.0)
    return Estimate(value=correction * effect, low=effect - reach, high=effect + reach)


def _variance(values: Sequence[float]) -> float:
    return float(np.var(values, ddof=1)) if len(set(values)) > 1 else 0.0


# Resampling


def _ratio(part: _Array, whole: _Array, axis: int = -1) -> Any:
    return part.sum(axis) / whole.sum(axis)


def _difference_of_ratios(
    first_part: _Array, first_whole: _Array, second_part: _Array, second_whole: _Array, axis: int = -1
) -> Any:
    return _ratio(first_part, first_whole, axis) - _ratio(second_part, second_whole, axis)


def _resampled(statistic: Any, value: float | None, *samples: Sequence[Share]) -> Estimate:
    """Return a value with its interval: bias-corrected and accelerated, since shares near 1 are skewed.

    There is none for one run, nor if a resample has no ratio because all of its wholes are 0.
    """
    if value is None or len(samples[0]) < 2:
        return Estimate(value=value, low=None, high=None)
    columns = [
        np.array(column) for sample in samples for column in ([s.part for s in sample], [s.whole for s in sample])
    ]
    rows = np.random.default_rng(SEED).integers(len(columns[0]), size=(RESAMPLES, len(columns[0])))
    if any((column[rows].sum(-1) == 0.0).any() for column in columns[1::2]):
        return Estimate(value=value, low=None, high=None)
    low, high = _interval(statistic, columns)
    return Estimate(value=value, low=low, high=high)


def _interval(statistic: Any, columns: Sequence[_Array]) -> tuple[float, float] | tuple[None, None]:
    """Return the ends; if leaving out any run changes nothing, both are the value itself."""
    from scipy import stats

    runs = range(len(columns[0]))
    without_one = np.array([statistic(*(np.delete(column, run) for column in columns)) for run in runs])
    if np.ptp(without_one) <= _NOTHING:
        return float(without_one[0]), float(without_one[0])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)  # then the ends are NaN
        found = stats.bootstrap(
            columns,
            statistic,
            paired=True,
            vectorized=True,
            n_resamples=RESAMPLES,
            confidence_level=LEVEL,
            method="BCa",
            rng=np.random.default_rng(SEED),
        ).confidence_interval
    ends = float(found.low), float(found.high)
    return (None, None) if any(map(math.isnan, ends)) else ends
