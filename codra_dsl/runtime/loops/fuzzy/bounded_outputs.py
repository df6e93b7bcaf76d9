"""Output variables for intervals of degrees.

An integral is bounded by the envelope of its fuzzy set: the least and the greatest degree at each point. An extreme
centroid within an envelope has the greatest degrees on one side of a cut and the least degrees on the other side
(Karnik and Mendel's theorem about interval type-2 sets). The same holds for the weights of an extreme weighted mean.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from codra_dsl.runtime.loops.fuzzy import defuzzifiers, norms
from codra_dsl.runtime.loops.fuzzy.bounds import ANYTHING, UNKNOWN, Bounds, is_degree, is_finite, norm
from codra_dsl.runtime.loops.fuzzy.outputs import Defuzzify, Integral, Weighted
from codra_dsl.runtime.loops.fuzzy.sampled import NORMS_OF_SAMPLES, Norm, Samples

Degrees = Sequence[Bounds | None]
Value = Bounds | Callable[[Bounds], Bounds]

_MAX_CACHED_INTEGRALS = 1024

_ROUNDING = 1e-9
"""The result of a sum is widened by this share of the largest number in the sum."""


def usable_degree(degree: Bounds) -> Bounds:
    """Return the degrees that are used for a conclusion: 0 for NaN, 1 for infinity, and 0 for minus infinity."""
    low, high = degree.low, degree.high
    if degree.may_be_unknown:
        low, high = min(low, 0.0), max(high, 0.0)
    low, high = (min(low, 1.0) if high == math.inf else low), (max(high, 0.0) if low == -math.inf else high)
    return Bounds(low, high)


def _widen(low: float, high: float, scale: float, *, may_be_unknown: bool) -> Bounds:
    slack = _ROUNDING * scale
    return Bounds(low - slack, high + slack, may_be_unknown)


def degree_so_far(aggregation: Norm, degrees: Degrees) -> Bounds:
    """Return the possible degrees that a rule reads for a term; they follow from conclusions of earlier rules."""
    return grouped(aggregation, (0,) * len(degrees), degrees).get(0, Bounds(0.0, 0.0))


def grouped(aggregation: Norm, conclusions: Sequence[int], degrees: Degrees) -> dict[int, Bounds]:
    """Return a mapping from each term with a conclusion that can act to its possible aggregated degrees."""
    degrees_by_term: dict[int, Bounds] = {}
    for term, degree in zip(conclusions, degrees, strict=True):
        if degree is not None:
            used_degree = usable_degree(degree)
            degrees_by_term[term] = (
                usable_degree(norm(aggregation, degrees_by_term[term], used_degree))
                if term in degrees_by_term
                else used_degree
            )
    return degrees_by_term


def integral(
    output: Integral, degrees: Degrees, memberships: Sequence[Callable[[Bounds], Bounds]] | None = None
) -> Bounds:
    """Return the bounds of an integral; `memberships` must be given if they depend on inputs."""
    if memberships is None:
        return _plain_integral(output, tuple(degrees))
    return _integral(output, degrees, _samples(output, memberships))


@lru_cache(maxsize=_MAX_CACHED_INTEGRALS)
def _plain_integral(output: Integral, degrees: tuple[Bounds | None, ...]) -> Bounds:
    """Return `_integral` for the output's own terms.

    One scene is analysed with many values of an unknown input, or with many changes of one input. Most outputs do not
    read this input, so their degrees remain the same.
    """
    return _integral(output, degrees, [(samples, samples) for samples in output.terms] if output.is_plain else None)


def _integral(output: Integral, degrees: Degrees, terms: list[tuple[Samples, Samples]] | None) -> Bounds:
    envelope = _envelope(output, degrees, terms)
    if envelope is None:
        return ANYTHING
    lows, highs = envelope
    if not highs.any():
        return UNKNOWN
    low, high = _DEFUZZIFIERS[output.defuzzify](output.points, lows, highs)
    scale = max(abs(output.minimum), abs(output.maximum))
    return _widen(low, high, scale, may_be_unknown=not lows.any())


def _samples(
    output: Integral, memberships: Sequence[Callable[[Bounds], Bounds]]
) -> list[tuple[Samples, Samples]] | None:
    points = output.points.tolist()
    rows = [[membership(Bounds(x, x)) for x in points] for membership in memberships]
    if not all(is_degree(degree) for row in rows for degree in row):
        return None
    return [(np.array([degree.low for degree in row]), np.array([degree.high for degree in row])) for row in rows]


def _envelope(
    output: Integral, degrees: Degrees, terms: list[tuple[Samples, Samples]] | None
) -> tuple[Samples, Samples] | None:
    """Return the least and the greatest degrees at each point; None if these degrees cannot be computed."""
    if terms is None:
        return None
    lows, highs = np.zeros(output.resolution), np.zeros(output.resolution)
    aggregate = NORMS_OF_SAMPLES[output.aggregation]
    with np.errstate(all="ignore"):
        for conclusion, degree in zip(output.conclusions, degrees, strict=True):
            if degree is None:
                continue
            used_degree, imply = usable_degree(degree), NORMS_OF_SAMPLES[conclusion.implication]
            uses_minimum_and_maximum = conclusion.implication is norms.minimum and output.aggregation is norms.maximum
            if not (
                is_degree(used_degree)
                or (uses_minimum_and_maximum and is_finite(used_degree) and used_degree.low >= 0.0)
            ):
                return None
            lows = aggregate(lows, imply(used_degree.low, terms[conclusion.term][0]))
            highs = aggregate(highs, imply(used_degree.high, terms[conclusion.term][1]))
    return lows, highs


def _centroid(xs: Samples, lows: Samples, highs: Samples) -> tuple[float, float]:
    return _extreme_means(xs, xs, lows, highs)


def _extreme_means(x_lows: Samples, x_highs: Samples, lows: Samples, highs: Samples) -> tuple[float, float]:
    """Return the least and the greatest weighted mean of values; at least one weight must be able to exceed 0."""
    order_of_lows, order_of_highs = np.argsort(x_lows, kind="stable"), np.argsort(x_highs, kind="stable")
    low_means = _means_by_cut(x_lows[order_of_lows], highs[order_of_lows], lows[order_of_lows])
    high_means = _means_by_cut(x_highs[order_of_highs], lows[order_of_highs], highs[order_of_highs])
    return float(np.nanmin(low_means)), float(np.nanmax(high_means))


def _means_by_cut(xs: Samples, before: Samples, after: Samples) -> Samples:
    """Return for each cut the mean with one set of weights before the cut and the other set after it."""
    weights = _sums_by_cut(before, after)
    with np.errstate(all="ignore"):
        return np.where(weights > 0.0, _sums_by_cut(xs * before, xs * after) / weights, math.nan)


def _sums_by_cut(before: Samples, after: Samples) -> Samples:
    left = np.concatenate(([0.0], np.cumsum(before)))
    right = np.concatenate((np.cumsum(after[::-1])[::-1], [0.0]))
    return left + right


def _bisector(xs: Samples, lows: Samples, highs: Samples) -> tuple[float, float]:
    """Return the first and the last point that can halve the area best."""
    low_left, high_left = np.cumsum(lows), np.cumsum(highs)
    low_right, high_right = low_left[-1] - low_left, high_left[-1] - high_left
    with np.errstate(all="ignore"):
        min_left_shares = np.nan_to_num(low_left / (low_left + high_right), nan=0.0)
        max_left_shares = np.nan_to_num(high_left / (high_left + low_right), nan=1.0)
    largest_errors = np.maximum(np.abs(min_left_shares - 0.5), np.abs(max_left_shares - 0.5))
    smallest_errors = np.where(
        (min_left_shares <= 0.5) & (max_left_shares >= 0.5),
        0.0,
        np.minimum(np.abs(min_left_shares - 0.5), np.abs(max_left_shares - 0.5)),
    )
    possible_points = xs[smallest_errors <= largest_errors.min() + _ROUNDING]
    return float(possible_points.min()), float(possible_points.max())


def _maxima(xs: Samples, lows: Samples, highs: Samples) -> tuple[float, float]:
    """Return the first and the last point that can have the greatest degree."""
    possible_points = xs[(highs > 0.0) & (highs >= lows.max() - _ROUNDING)]
    return float(possible_points.min()), float(possible_points.max())


_DEFUZZIFIERS: Mapping[Defuzzify, Callable[[Samples, Samples, Samples], tuple[float, float]]] = MappingProxyType(
    {
        defuzzifiers.centroid: _centroid,
        defuzzifiers.bisector: _bisector,
        defuzzifiers.smallest_of_maximum: _maxima,
        defuzzifiers.mean_of_maximum: _maxima,
        defuzzifiers.largest_of_maximum: _maxima,
    }
)


def average(output: Weighted, degrees: Degrees, values: Sequence[Value]) -> Bounds:
    """Return the bounds of the weighted mean of an output's values."""
    weighted_terms = _weighted_terms(output, degrees, values)
    if weighted_terms is None:
        return ANYTHING
    weights = [weight for weight, _ in weighted_terms if weight.high > 0.0]
    term_values = [value for weight, value in weighted_terms if weight.high > 0.0]
    if not weights:
        return UNKNOWN
    lows, highs = np.array([weight.low for weight in weights]), np.array([weight.high for weight in weights])
    value_lows, value_highs = (
        np.array([value.low for value in term_values]),
        np.array([value.high for value in term_values]),
    )
    low, high = _extreme_means(value_lows, value_highs, lows, highs)
    scale = float(max(np.abs(value_lows).max(), np.abs(value_highs).max()))
    return _widen(low, high, scale, may_be_unknown=not lows.any())


def total(output: Weighted, degrees: Degrees, values: Sequence[Value]) -> Bounds:
    """Return the bounds of the sum of an output's values times their degrees."""
    weighted_terms = _weighted_terms(output, degrees, values)
    if weighted_terms is None:
        return ANYTHING
    if not any(weight.high > 0.0 for weight, _ in weighted_terms):
        return UNKNOWN
    low = sum(min(weight.low * value.low, weight.high * value.low) for weight, value in weighted_terms)
    high = sum(max(weight.low * value.high, weight.high * value.high) for weight, value in weighted_terms)
    scale = sum(weight.high * max(abs(value.low), abs(value.high)) for weight, value in weighted_terms)
    return _widen(low, high, scale, may_be_unknown=not any(weight.low > 0.0 for weight, _ in weighted_terms))


def _weighted_terms(output: Weighted, degrees: Degrees, values: Sequence[Value]) -> list[tuple[Bounds, Bounds]] | None:
    """Return the weights and values of the used terms; None if one is not finite, or if a weight can be negative."""
    weighted_terms = []
    for term, weight in grouped(output.aggregation, output.conclusions, degrees).items():
        value = values[term]
        number = value if isinstance(value, Bounds) else value(weight)
        if weight.low < 0.0 or not is_finite(weight) or not is_finite(number):
            return None
        weighted_terms.append((weight, number))
    return weighted_terms
