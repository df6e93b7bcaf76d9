"""Hedges: what a word before a term makes of its degree. Their names end in an underscore where Python has the word."""

from __future__ import annotations

from codra_dsl.runtime.loops.fuzzy.terms import root


def any_(x: float) -> float:  # noqa: ARG001 - hedges have one form
    """Return 1, whatever the degree is."""
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
    """Return the square root, which is more."""
    return root(x)


def very(x: float) -> float:
    """Return the square, which is less."""
    return x * x
