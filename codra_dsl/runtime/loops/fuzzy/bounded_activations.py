"""Activation methods for intervals of degrees: a rule acts certainly, possibly, or not at all (None).

For an interval it makes no difference whether a rule acts with degree 0 or not at all, so the interval of a rule that
possibly acts includes 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from codra_dsl.runtime.loops.fuzzy.bounds import Bounds, hedge, is_finite

_ROUNDING = 1e-12
"""The margin that is added to the bounds of a share."""


def _perhaps(degree: Bounds) -> Bounds:
    return Bounds(min(0.0, degree.low), max(0.0, degree.high), degree.may_be_unknown)


class Gate:
    """Admits rules that are strong enough, in the order of the calls and up to a limit."""

    __slots__ = ("_perhaps_before", "_rules", "_surely_before", "_threshold")

    def __init__(self, rules: int, threshold: float) -> None:
        self._rules = rules
        self._threshold = threshold
        self._surely_before = 0
        self._perhaps_before = 0

    def admit(self, degree: Bounds) -> Bounds | None:
        """Return the degree with which the next rule acts; None if it cannot act."""
        surely = degree.low > 0.0 and degree.low >= self._threshold and not degree.may_be_unknown
        perhaps = degree.high > 0.0 and degree.high >= self._threshold
        can = perhaps and self._surely_before < self._rules
        must = surely and self._perhaps_before < self._rules
        self._surely_before += surely
        self._perhaps_before += perhaps
        if not can:
            return None
        return degree if must else _perhaps(degree)


def threshold(degree: Bounds, comparator: str, limit: float) -> Bounds | None:
    """Return the degree if the comparison can hold."""
    can, must = _compares(degree, comparator, limit)
    if not can:
        return None
    return degree if must and not degree.may_be_unknown else _perhaps(degree)


def _compares(degree: Bounds, comparator: str, limit: float) -> tuple[bool, bool]:
    """Return whether a comparison can hold, and whether it certainly holds."""
    low, high = degree.low, degree.high
    if comparator == "==":
        return low <= limit <= high, low == limit == high
    if comparator == "!=":
        return not low == limit == high or degree.may_be_unknown, not low <= limit <= high
    if comparator in (">", ">="):
        ends = (high > limit, low > limit) if comparator == ">" else (high >= limit, low >= limit)
    else:
        ends = (low < limit, high < limit) if comparator == "<" else (low <= limit, high <= limit)
    return ends


def highest(degrees: Sequence[Bounds], rules: int) -> tuple[Bounds | None, ...]:
    """Return the degrees of the strongest rules; among equal ones the first."""
    return _foremost(degrees, rules, [Bounds(-degree.high, -degree.low) for degree in degrees])


def lowest(degrees: Sequence[Bounds], rules: int) -> tuple[Bounds | None, ...]:
    """Return the degrees of the weakest rules above 0; among equal ones the first."""
    return _foremost(degrees, rules, degrees)


def _foremost(degrees: Sequence[Bounds], rules: int, keys: Sequence[Bounds]) -> tuple[Bounds | None, ...]:
    acting: list[Bounds | None] = []
    for index, (degree, key) in enumerate(zip(degrees, keys, strict=True)):
        surely = perhaps = 0
        for other, (its_degree, its_key) in enumerate(zip(degrees, keys, strict=True)):
            if other == index or its_degree.high <= 0.0:
                continue
            is_sure = its_degree.low > 0.0 and not its_degree.may_be_unknown
            surely += is_sure and (its_key.high, other) < (key.low, index)
            perhaps += (its_key.low, other) < (key.high, index)
        if degree.high <= 0.0 or surely >= rules:
            acting.append(None)
        else:
            must = degree.low > 0.0 and perhaps < rules and not degree.may_be_unknown
            acting.append(degree if must else _perhaps(degree))
    return tuple(acting)


def proportional(degrees: Sequence[Bounds]) -> tuple[Bounds | None, ...]:
    """Return each degree above 0 as its share of their sum."""
    if not all(map(is_finite, degrees)):
        return tuple(Bounds(0.0, 1.0) for _ in degrees)
    lows, highs = ([max(0.0, degree[end]) for degree in degrees] for end in (0, 1))
    acting: list[Bounds | None] = []
    for at, (low, high) in enumerate(zip(lows, highs, strict=True)):
        if high == 0.0:
            acting.append(None)
            continue
        least = low / (low + sum(highs[:at]) + sum(highs[at + 1 :])) if low > 0.0 else 0.0
        most = high / (high + sum(lows[:at]) + sum(lows[at + 1 :]))
        acting.append(Bounds(max(0.0, least - _ROUNDING), min(1.0, most + _ROUNDING)))
    return tuple(acting)


def hedged(degree: Bounds | None, of: Callable[[float], float]) -> Bounds | None:
    """Return the degree of a conclusion with a hedge.

    A rule that possibly does not act counts as 0, not as the hedge of 0.
    """
    if degree is None:
        return None
    bounds = hedge(of, degree)
    return bounds if degree.low > 0.0 else _perhaps(bounds)
