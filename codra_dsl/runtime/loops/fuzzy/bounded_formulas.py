"""Formulas with intervals as operands."""

from __future__ import annotations

import math

from codra_dsl.runtime.loops.fuzzy.bounds import ANYTHING, Bounds, absolute, hull, is_finite, point
from codra_dsl.runtime.loops.fuzzy.formulas import calculate as calculate_number

_RISING_CURVES = frozenset(
    {"exp", "log", "log10", "log1p", "sqrt", "sinh", "asinh", "tanh", "asin", "atan", "acosh", "atanh"}
)
_RISING_NAMES = _RISING_CURVES | {"floor", "ceil", "round", ".+", "+", "min", "max"}
_FALLING_NAMES = frozenset({"acos", "~", ".-"})
_LOGICAL_NAMES = frozenset({"gt", "ge", "eq", "neq", "le", "lt", "and", "or", "!"})
_ROUNDING = 1e-12


def calculate(name: str, *operands: Bounds) -> Bounds:
    """Return the bounds of the result of an operator or function.

    If these bounds cannot be determined easily, all numbers are returned, not a guess.
    """
    if name in _LOGICAL_NAMES:
        return Bounds(0.0, 1.0)
    if all(operand.low == operand.high and not operand.may_be_unknown for operand in operands):
        return point(calculate_number(name, *(operand.low for operand in operands)))
    if not all(map(is_finite, operands)):
        return ANYTHING
    lows, highs = [operand.low for operand in operands], [operand.high for operand in operands]
    if name in _RISING_NAMES:
        return _finite_hull([calculate_number(name, *lows), calculate_number(name, *highs)])
    if name in _FALLING_NAMES:
        return _finite_hull([calculate_number(name, *highs), calculate_number(name, *lows)])
    if name in ("abs", "fabs"):
        return absolute(operands[0])
    if name in ("sin", "cos"):
        return Bounds(-1.0, 1.0)
    return _calculate_binary(name, *operands)


def _calculate_binary(name: str, a: Bounds, b: Bounds = ANYTHING) -> Bounds:
    if name == "-":
        return _finite_hull([a.low - b.high, a.high - b.low])
    if name == "*" or (name == "/" and b.low * b.high > 0.0):
        return _finite_hull([calculate_number(name, x, y) for x in a[:2] for y in b[:2]])
    if name in ("^", "**", "pow") and a.low > 0.0:
        return _finite_hull([calculate_number(name, x, y) for x in a[:2] for y in b[:2]])
    return ANYTHING


def _finite_hull(values: list[float]) -> Bounds:
    bounds = hull(values)
    if not is_finite(bounds):
        return ANYTHING
    slack = _ROUNDING * max(abs(bounds.low), abs(bounds.high), math.ulp(0.0))
    return Bounds(bounds.low - slack, bounds.high + slack)
