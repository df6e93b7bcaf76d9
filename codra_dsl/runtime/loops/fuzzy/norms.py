"""T-norms (and) and S-norms (or) of two degrees, one function per norm. NaN is handled as in FuzzyLite."""

from __future__ import annotations

from codra_dsl.runtime.loops.fuzzy.terms import quotient


def algebraic_product(a: float, b: float) -> float:
    """Return a * b."""
    return a * b


def bounded_difference(a: float, b: float) -> float:
    """Return max(0, a + b - 1)."""
    excess = a + b - 1.0
    return 0.0 if excess < 0.0 else excess


def drastic_product(a: float, b: float) -> float:
    """Return the lesser degree if the greater degree is 1, otherwise 0."""
    return minimum(a, b) if maximum(a, b) == 1.0 else 0.0


def einstein_product(a: float, b: float) -> float:
    """Return a * b / (2 - (a + b - a * b))."""
    return quotient(a * b, 2.0 - (a + b - a * b))


def hamacher_product(a: float, b: float) -> float:
    """Return a * b / (a + b - a * b), and 0 for two zeros."""
    return quotient(a * b, a + b - a * b) if a + b != 0.0 else 0.0


def minimum(a: float, b: float) -> float:
    """Return the lesser degree; NaN if a degree is NaN."""
    return a if a < b or a != a else b


def nilpotent_minimum(a: float, b: float) -> float:
    """Return the lesser degree if a + b is more than 1, otherwise 0."""
    return minimum(a, b) if a + b > 1.0 else 0.0


def algebraic_sum(a: float, b: float) -> float:
    """Return a + b - a * b."""
    return a + b - a * b


def bounded_sum(a: float, b: float) -> float:
    """Return min(1, a + b)."""
    total = a + b
    return 1.0 if total > 1.0 else total


def drastic_sum(a: float, b: float) -> float:
    """Return the greater degree if the lesser degree is 0, otherwise 1."""
    return maximum(a, b) if minimum(a, b) == 0.0 else 1.0


def einstein_sum(a: float, b: float) -> float:
    """Return (a + b) / (1 + a b)."""
    return quotient(a + b, 1.0 + a * b)


def hamacher_sum(a: float, b: float) -> float:
    """Return (a + b - 2 a b) / (1 - a b), and 1 where a b is 1.

    If a or b is above 0.5, the result is computed from the differences to 1, because near 1 the formula above would
    return only rounding errors.
    """
    if (a > 0.5 or b > 0.5) and a * b != 1.0:
        missing_a, missing_b = 1.0 - a, 1.0 - b
        missing_product = missing_a * missing_b
        return 1.0 - quotient(missing_product, missing_a + missing_b - missing_product)
    return quotient(a + b - 2.0 * a * b, 1.0 - a * b) if a * b != 1.0 else 1.0


def maximum(a: float, b: float) -> float:
    """Return the greater degree; NaN if a degree is NaN."""
    return a if a > b or a != a else b


def nilpotent_maximum(a: float, b: float) -> float:
    """Return the greater degree if a + b is less than 1, otherwise 1."""
    return maximum(a, b) if a + b < 1.0 else 1.0


def normalized_sum(a: float, b: float) -> float:
    """Return (a + b) / max(1, a + b)."""
    total = a + b
    return total / maximum(1.0, total)


def unbounded_sum(a: float, b: float) -> float:
    """Return a + b, which can exceed 1."""
    return a + b
