"""Activation methods: which rules of a block act, and how strongly.

A gate and a threshold decide rule by rule; the other methods decide about all rules at once. None means that a rule
does not act. This differs from acting with degree 0: in Tsukamoto's method, a rule that acts with degree 0 can have an
infinite value, but a rule that does not act has no effect. FuzzyLite makes the same distinction.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from types import MappingProxyType

from codra_dsl.runtime.loops.fuzzy.terms import quotient

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
    """Admits rules that are strong enough, in the order of the calls and up to a limit.

    FuzzyLite's First and Last do the same.
    """

    __slots__ = ("_remaining_rule_count", "_threshold")

    def __init__(self, rules: int, threshold: float) -> None:
        self._remaining_rule_count = rules
        self._threshold = threshold

    def admit(self, degree: float) -> float | None:
        """Return the degree with which the next rule acts; None if it does not act."""
        if self._remaining_rule_count > 0 and degree > 0.0 and degree >= self._threshold:
            self._remaining_rule_count -= 1
            return degree
        return None


def threshold(degree: float, comparator: str, limit: float) -> float | None:
    """Return the degree if the comparison holds; None if it does not."""
    return degree if COMPARATORS[comparator](degree, limit) else None


def highest(degrees: tuple[float, ...], rules: int) -> tuple[float | None, ...]:
    """Return the degrees of the strongest rules; among equally strong rules, the first ones are chosen."""
    return _select_first_by_key(degrees, rules, [-degree for degree in degrees])


def lowest(degrees: tuple[float, ...], rules: int) -> tuple[float | None, ...]:
    """Return the degrees of the weakest rules above 0; among equally strong rules, the first ones are chosen."""
    return _select_first_by_key(degrees, rules, list(degrees))


def _select_first_by_key(degrees: tuple[float, ...], rules: int, keys: list[float]) -> tuple[float | None, ...]:
    keys_and_indices = sorted((keys[index], index) for index, degree in enumerate(degrees) if degree > 0.0)
    chosen_indices = {index for _, index in keys_and_indices[: max(rules, 0)]}
    return tuple(degree if index in chosen_indices else None for index, degree in enumerate(degrees))


def proportional(degrees: tuple[float, ...]) -> tuple[float | None, ...]:
    """Return, for each degree above 0, its share of the sum of these degrees."""
    total = sum(degree for degree in degrees if degree > 0.0)
    return tuple(quotient(degree, total) if degree > 0.0 else None for degree in degrees)


def hedged(degree: float | None, hedge: Callable[[float], float]) -> float | None:
    """Return the degree of a conclusion with a hedge."""
    return None if degree is None else hedge(degree)
