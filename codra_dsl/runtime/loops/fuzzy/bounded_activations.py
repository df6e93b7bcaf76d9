"""Activation methods for intervals of degrees: a rule acts certainly, possibly, or not at all (None).

For an interval it makes no difference whether a rule acts with degree 0 or not at all, so the interval of a rule that
possibly acts includes 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from codra_dsl.runtime.loops.fuzzy.bounds import Bounds, hedge, is_finite

_ROUNDING = 1e-12
"""The margin that is added to the bounds of a share."""


def _include_inactive(degree: Bounds) -> Bounds:
    return Bounds(min(0.0, degree.low), max(0.0, degree.high), degree.may_be_unknown)


class Gate:
    """Admits rules that are strong enough, in the order of the calls and up to a limit."""

    __slots__ = ("_certain_count", "_limit", "_possible_count", "_threshold")

    def __init__(self, rules: int, threshold: float) -> None:
        self._limit = rules
        self._threshold = threshold
        self._certain_count = 0
        self._possible_count = 0

    def admit(self, degree: Bounds) -> Bounds | None:
        """Return the degree with which the next rule acts; None if it cannot act."""
        is_certain = degree.low > 0.0 and degree.low >= self._threshold and not degree.may_be_unknown
        is_possible = degree.high > 0.0 and degree.high >= self._threshold
        may_act = is_possible and self._certain_count < self._limit
        must_act = is_certain and self._possible_count < self._limit
        self._certain_count += is_certain
        self._possible_count += is_possible
        if not may_act:
            return None
        return degree if must_act else _include_inactive(degree)


def threshold(degree: Bounds, comparator: str, limit: float) -> Bounds | None:
    """Return the degree if the comparison can hold; None if it cannot."""
    may_hold, must_hold = _comparison_possibilities(degree, comparator, limit)
    if not may_hold:
        return None
    return degree if must_hold and not degree.may_be_unknown else _include_inactive(degree)


def _comparison_possibilities(degree: Bounds, comparator: str, limit: float) -> tuple[bool, bool]:
    """Return whether a comparison can hold, and whether it certainly holds."""
    low, high = degree.low, degree.high
    if comparator == "==":
        return low <= limit <= high, low == limit == high
    if comparator == "!=":
        return not low == limit == high or degree.may_be_unknown, not low <= limit <= high
    if comparator in (">", ">="):
        possibilities = (high > limit, low > limit) if comparator == ">" else (high >= limit, low >= limit)
    else:
        possibilities = (low < limit, high < limit) if comparator == "<" else (low <= limit, high <= limit)
    return possibilities


def highest(degrees: Sequence[Bounds], rules: int) -> tuple[Bounds | None, ...]:
    """Return the degrees of the strongest rules; among equally strong rules, the first ones are chosen."""
    return _select_first_by_key(degrees, rules, [Bounds(-degree.high, -degree.low) for degree in degrees])


def lowest(degrees: Sequence[Bounds], rules: int) -> tuple[Bounds | None, ...]:
    """Return the degrees of the weakest rules above 0; among equally strong rules, the first ones are chosen."""
    return _select_first_by_key(degrees, rules, degrees)


def _select_first_by_key(degrees: Sequence[Bounds], rules: int, keys: Sequence[Bounds]) -> tuple[Bounds | None, ...]:
    acting_degrees: list[Bounds | None] = []
    for index, (degree, key) in enumerate(zip(degrees, keys, strict=True)):
        certain_rival_count = possible_rival_count = 0
        for other_index, (other_degree, other_key) in enumerate(zip(degrees, keys, strict=True)):
            if other_index == index or other_degree.high <= 0.0:
                continue
            is_certain = other_degree.low > 0.0 and not other_degree.may_be_unknown
            certain_rival_count += is_certain and (other_key.high, other_index) < (key.low, index)
            possible_rival_count += (other_key.low, other_index) < (key.high, index)
        if degree.high <= 0.0 or certain_rival_count >= rules:
            acting_degrees.append(None)
        else:
            must_act = degree.low > 0.0 and possible_rival_count < rules and not degree.may_be_unknown
            acting_degrees.append(degree if must_act else _include_inactive(degree))
    return tuple(acting_degrees)


def proportional(degrees: Sequence[Bounds]) -> tuple[Bounds | None, ...]:
    """Return, for each degree above 0, its share of the sum of these degrees."""
    if not all(map(is_finite, degrees)):
        return tuple(Bounds(0.0, 1.0) for _ in degrees)
    lows, highs = ([max(0.0, degree[end]) for degree in degrees] for end in (0, 1))
    acting_degrees: list[Bounds | None] = []
    for index, (low, high) in enumerate(zip(lows, highs, strict=True)):
        if high == 0.0:
            acting_degrees.append(None)
            continue
        least_share = low / (low + sum(highs[:index]) + sum(highs[index + 1 :])) if low > 0.0 else 0.0
        most_share = high / (high + sum(lows[:index]) + sum(lows[index + 1 :]))
        acting_degrees.append(Bounds(max(0.0, least_share - _ROUNDING), min(1.0, most_share + _ROUNDING)))
    return tuple(acting_degrees)


def hedged(degree: Bounds | None, function: Callable[[float], float]) -> Bounds | None:
    """Return the degree of a conclusion with a hedge.

    If the rule possibly does not act, the result includes 0, which can differ from the hedge of 0.
    """
    if degree is None:
        return None
    bounds = hedge(function, degree)
    return bounds if degree.low > 0.0 else _include_inactive(bounds)
