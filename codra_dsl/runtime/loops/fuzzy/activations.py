"""Which rules of a block act, and how strongly: gates decide rule by rule, the others about all rules at once.

None is a rule that does not act. That differs from one that acts with degree 0: only the latter counts in Tsukamoto's
method, whose inverses can be infinite at 0.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType

from codra_dsl.runtime.loops.fuzzy.terms import divided

COMPARATORS: Mapping[str, Callable[[float, float], bool]] = MappingProxyType(
    {
        "<": operator.lt,
        "<=": operator.le,
        "==": operator.eq,
        "!=": operator.ne,
        ">=": operator.ge,
        ">": operator.gt,
    }
)
"""The comparisons of a threshold."""


class Gate:
    """The first rules that are asked about, as many as there may be, and strong enough: FuzzyLite's First and Last."""

    __slots__ = ("_left", "_threshold")

    def __init__(self, rules: int, threshold: float) -> None:
        self._left = rules
        self._threshold = threshold

    def admit(self, degree: float) -> float | None:
        """Return the degree with which the next rule acts."""
        if self._left > 0 and degree > 0.0 and degree >= self._threshold:
            self._left -= 1
            return degree
        return None


def threshold(degree: float, comparator: str, limit: float) -> float | None:
    """Return the degree if it compares as stated."""
    return degree if COMPARATORS[comparator](degree, limit) else None


def highest(degrees: tuple[float, ...], rules: int) -> tuple[float | None, ...]:
    """Return the degrees of the strongest rules, of equal ones the first."""
    return _foremost(degrees, rules, [-degree for degree in degrees])


def lowest(degrees: tuple[float, ...], rules: int) -> tuple[float | None, ...]:
    """Return the degrees of the weakest rules above 0, of equal ones the first."""
    return _foremost(degrees, rules, list(degrees))


def _foremost(degrees: tuple[float, ...], rules: int, keys: list[float]) -> tuple[float | None, ...]:
    acting = sorted((keys[index], index) for index, degree in enumerate(degrees) if degree > 0.0)
    chosen = {index for _, index in acting[: max(rules, 0)]}
    return tuple(degree if index in chosen else None for index, degree in enumerate(degrees))


def proportional(degrees: tuple[float, ...]) -> tuple[float | None, ...]:
    """Return each degree above 0 as its share of their sum."""
    total = sum(degree for degree in degrees if degree > 0.0)
    return tuple(divided(degree, total) if degree > 0.0 else None for degree in degrees)


def hedged(degree: float | None, hedge: Callable[[float], float]) -> float | None:
    """Return the degree of a conclusion with a hedge."""
    return None if degree is None else hedge(degree)
