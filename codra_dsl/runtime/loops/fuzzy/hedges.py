"""Hedges: words before a term that change its degree. A name ends in an underscore if Python already uses the word."""

from __future__ import annotations

from codra_dsl.runtime.loops.fuzzy.terms import root


def any_(x: float) -> float:  # noqa: ARG001 - all hedges have the same signature
    """Return 1 for every degree."""
    return 1.0


def extremely(x: float) -> float:
    """Return the degree with its contrast raised."""
    return 2.0 * (x * x) if x <= 0.5 else 1.0 - 2.0 * ((1.0 - x) * (1.0 - x))


def not_(x: float) -> float:
    """Return 1 - x."""
    return 1.0 - x


def seldom(x: float) -> float:
    """Return the degree with its contrast lowered."""
    return root(0.5 * x) if x <= 0.5 else 1.0 - root(0.5 * (1.0 - x))


def somewhat(x: float) -> float:
    """Return the square root, which raises the degree."""
    return root(x)


def very(x: float) -> float:
    """Return the square, which lowers the degree."""
    return x * x
