"""Exact interval arithmetic: the possible sums, products and comparisons of numbers from given ranges.

All numbers are fractions in base units; an unbounded end is infinite.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from fractions import Fraction

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.units import Unit

Number = Fraction | float
"""An exact number, or an infinite float."""

_RADIANS_PER_DEGREE = Fraction(repr(math.pi)) / 180


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """All numbers between two ends. An end belongs to the interval unless the end is open."""

    low: Number
    high: Number
    low_open: bool = False
    high_open: bool = False

    @property
    def is_point(self) -> bool:
        """Whether the interval contains only one number."""
        return self.low == self.high

    @property
    def is_empty(self) -> bool:
        """Whether the interval contains no number."""
        return self.low > self.high or (self.is_point and (self.low_open or self.high_open))


FULL = Interval(-math.inf, math.inf)
"""All numbers."""


def point(number: Number) -> Interval:
    """Return the interval of one number."""
    return Interval(number, number)


def in_base(value: float, unit: Unit) -> Number:
    """Return a value in base units, computed exactly from its decimal text."""
    if isinstance(value, float) and not math.isfinite(value):
        return value
    exact_value = Fraction(value if isinstance(value, int) else repr(value)) * unit.factor
    return exact_value * _RADIANS_PER_DEGREE**unit.degrees if unit.degrees else exact_value


def hull(intervals: Iterable[Interval]) -> Interval:
    """Return the smallest interval that contains all of these intervals."""
    interval_list = list(intervals)
    low, low_open = min((interval.low, interval.low_open) for interval in interval_list)
    high, high_closed = max((interval.high, not interval.high_open) for interval in interval_list)
    return Interval(low, high, low_open, not high_closed)


def intersection(one: Interval, other: Interval) -> Interval:
    """Return the intersection of two intervals."""
    low, low_open = max((interval.low, interval.low_open) for interval in (one, other))
    high, high_closed = min((interval.high, not interval.high_open) for interval in (one, other))
    return Interval(low, high, low_open, not high_closed)


def negative(one: Interval) -> Interval:
    """Return the negated numbers of an interval."""
    return Interval(-one.high, -one.low, one.high_open, one.low_open)


def total(one: Interval, other: Interval) -> Interval:
    """Return all sums of a number of the first interval and a number of the second."""
    low, high = _add(one.low, other.low), _add(one.high, other.high)
    return Interval(low, high, one.low_open or other.low_open, one.high_open or other.high_open)


def product(one: Interval, other: Interval) -> Interval:
    """Return an interval that contains all products of a number of one interval and a number of the other.

    If it is uncertain whether an end is a product, the end is included.
    """
    if other.is_point:
        return _scaled(one, other.low)
    if one.is_point:
        return _scaled(other, one.low)
    ends = [_times(end, other_end) for end in (one.low, one.high) for other_end in (other.low, other.high)]
    return Interval(min(ends), max(ends))


def quotient(one: Interval, other: Interval) -> Interval:
    """Return an interval that contains all quotients with a divisor other than zero."""
    if other.is_point and not isinstance(other.low, float) and other.low != 0:
        return _scaled(one, 1 / other.low)
    return FULL


def magnitude(one: Interval) -> Interval:
    """Return the absolute values of the numbers of an interval."""
    if one.low >= 0:
        return one
    if one.high <= 0:
        return negative(one)
    negated_interval = negative(one)
    high, high_closed = max((interval.high, not interval.high_open) for interval in (one, negated_interval))
    return Interval(Fraction(0), high, high_open=not high_closed)


def smallest(one: Interval, other: Interval) -> Interval:
    """Return the possible values of the smaller of two numbers."""
    low, low_open = min((interval.low, interval.low_open) for interval in (one, other))
    high, high_closed = min((interval.high, not interval.high_open) for interval in (one, other))
    return Interval(low, high, low_open, not high_closed)


def largest(one: Interval, other: Interval) -> Interval:
    """Return the possible values of the larger of two numbers."""
    return negative(smallest(negative(one), negative(other)))


def can_be_less(one: Interval, other: Interval) -> bool:
    """Return whether a number of the first interval can be less than a number of the second."""
    return one.low < other.high


def can_be_equal(one: Interval, other: Interval) -> bool:
    """Return whether two intervals have a number in common."""
    return not intersection(one, other).is_empty


def pieces(interval: Interval, points: Iterable[Number], step: Fraction | None) -> tuple[Interval, ...]:
    """Return the pieces of an interval that is cut at some points: these points, and the intervals between them.

    Args:
        interval: the interval to cut.
        points: where to cut; points outside the interval are ignored.
        step: if not None, the pieces are narrowed to the multiples of this number.
    """
    parts: list[Interval] = []
    low, low_open = interval.low, interval.low_open
    for cut in sorted(set(points)):
        if can_be_equal(interval, point(cut)):
            parts += (Interval(low, cut, low_open, True), point(cut))
            low, low_open = cut, True
    parts.append(Interval(low, interval.high, low_open, interval.high_open))
    narrowed_parts = parts if step is None else [_multiples(part, step) for part in parts]
    return tuple(part for part in narrowed_parts if not part.is_empty)


def _multiples(one: Interval, step: Fraction) -> Interval:
    """Return the smallest interval that contains all multiples of a step in the given interval."""
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
    scaled_interval = Interval(_times(one.low, factor), _times(one.high, factor), one.low_open, one.high_open)
    return (
        scaled_interval
        if factor > 0
        else Interval(scaled_interval.high, scaled_interval.low, scaled_interval.high_open, scaled_interval.low_open)
    )


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
