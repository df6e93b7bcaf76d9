"""Ranges of numbers, exact: what sums, products and comparisons of numbers from given ranges can be.

All numbers are in base units, as fractions; an end without bound is infinite.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

from codra_dsl.units import Unit

Number = Fraction | float
"""An exact number; a float only where it is infinite."""

_RADIANS_PER_DEGREE = Fraction(repr(math.pi)) / 180


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """All numbers between two ends, which belong to it unless they are open."""

    low: Number
    high: Number
    low_open: bool = False
    high_open: bool = False

    @property
    def is_point(self) -> bool:
        """Whether it holds one number only."""
        return self.low == self.high

    @property
    def is_empty(self) -> bool:
        """Whether it holds no number."""
        return self.low > self.high or (self.is_point and (self.low_open or self.high_open))


FULL = Interval(-math.inf, math.inf)
"""All numbers."""


def point(number: Number) -> Interval:
    """Return one number."""
    return Interval(number, number)


def in_base(value: float, unit: Unit) -> Number:
    """Return a value in base units, the decimal number that it is written as."""
    if isinstance(value, float) and not math.isfinite(value):
        return value
    exact = Fraction(value if isinstance(value, int) else repr(value)) * unit.factor
    return exact * _RADIANS_PER_DEGREE**unit.degrees if unit.degrees else exact


def hull(intervals: Iterable[Interval]) -> Interval:
    """Return the smallest interval that holds some others."""
    several = list(intervals)
    low, low_open = min((each.low, each.low_open) for each in several)
    high, high_closed = max((each.high, not each.high_open) for each in several)
    return Interval(low, high, low_open, not high_closed)


def common(one: Interval, other: Interval) -> Interval:
    """Return what lies in both of two intervals."""
    low, low_open = max((each.low, each.low_open) for each in (one, other))
    high, high_closed = min((each.high, not each.high_open) for each in (one, other))
    return Interval(low, high, low_open, not high_closed)


def negative(one: Interval) -> Interval:
    """Return the numbers of an interval with the other sign."""
    return Interval(-one.high, -one.low, one.high_open, one.low_open)


def total(one: Interval, other: Interval) -> Interval:
    """Return all sums."""
    low, high = _add(one.low, other.low), _add(one.high, other.high)
    return Interval(low, high, one.low_open or other.low_open, one.high_open or other.high_open)


def product(one: Interval, other: Interval) -> Interval:
    """Return all products; ends belong to it where that is not certain."""
    if other.is_point:
        return _scaled(one, other.low)
    if one.is_point:
        return _scaled(other, one.low)
    ends = [_times(mine, theirs) for mine in (one.low, one.high) for theirs in (other.low, other.high)]
    return Interval(min(ends), max(ends))


def quotient(one: Interval, other: Interval) -> Interval:
    """Return at least all quotients by numbers other than zero."""
    if other.is_point and not isinstance(other.low, float) and other.low != 0:
        return _scaled(one, 1 / other.low)
    return FULL


def magnitude(one: Interval) -> Interval:
    """Return the numbers of an interval without their sign."""
    if one.low >= 0:
        return one
    if one.high <= 0:
        return negative(one)
    mirrored = negative(one)
    high, high_closed = max((each.high, not each.high_open) for each in (one, mirrored))
    return Interval(Fraction(0), high, high_open=not high_closed)


def smallest(one: Interval, other: Interval) -> Interval:
    """Return what the smaller of two numbers can be."""
    low, low_open = min((each.low, each.low_open) for each in (one, other))
    high, high_closed = min((each.high, not each.high_open) for each in (one, other))
    return Interval(low, high, low_open, not high_closed)


def largest(one: Interval, other: Interval) -> Interval:
    """Return what the larger of two numbers can be."""
    return negative(smallest(negative(one), negative(other)))


def can_be_less(one: Interval, other: Interval) -> bool:
    """Return whether a number of the first can be less than one of the second."""
    return one.low < other.high


def can_be_equal(one: Interval, other: Interval) -> bool:
    """Return whether two intervals have a number in common."""
    return not common(one, other).is_empty


def pieces(whole: Interval, points: Iterable[Number], step: Fraction | None) -> tuple[Interval, ...]:
    """Return an interval cut at some points into these points and what lies between them.

    Args:
        whole: the interval.
        points: where to cut; those outside have no part in the answer.
        step: if only multiples of a number are possible, that number.
    """
    found: list[Interval] = []
    low, low_open = whole.low, whole.low_open
    for cut in sorted(set(points)):
        if can_be_equal(whole, point(cut)):
            found += (Interval(low, cut, low_open, True), point(cut))
            low, low_open = cut, True
    found.append(Interval(low, whole.high, low_open, whole.high_open))
    kept = found if step is None else [_multiples(each, step) for each in found]
    return tuple(each for each in kept if not each.is_empty)


def _multiples(one: Interval, step: Fraction) -> Interval:
    """Return the smallest interval that holds the multiples of a step in another."""
    low, high = one.low, one.high
    if isinstance(low, Fraction):
        first = math.ceil(low / step)
        low = step * (first + (one.low_open and first * step == low))
    if isinstance(high, Fraction):
        last = math.floor(high / step)
        high = step * (last - (one.high_open and last * step == high))
    return Interval(low, high)


def _scaled(one: Interval, factor: Number) -> Interval:
    if factor == 0:
        return point(Fraction(0))
    scaled = Interval(_times(one.low, factor), _times(one.high, factor), one.low_open, one.high_open)
    return scaled if factor > 0 else Interval(scaled.high, scaled.low, scaled.high_open, scaled.low_open)


def _add(one: Number, other: Number) -> Number:
    if isinstance(one, float):
        return one
    return other if isinstance(other, float) else one + other


def _times(one: Number, other: Number) -> Number:
    if one == 0 or other == 0:
        return Fraction(0)
    if isinstance(one, float) or isinstance(other, float):
        return math.inf if (one > 0) == (other > 0) else -math.inf
    return one * other
