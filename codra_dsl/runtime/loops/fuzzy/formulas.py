"""The operators and functions in formulas of `Function` terms, for plain numbers.

Most of them come from numpy, so that results outside a function's domain equal those of FuzzyLite: such results are NaN
or infinite, and no exception is raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from codra_dsl.runtime.loops.fuzzy.terms import quotient

UFUNCS: Mapping[str, np.ufunc] = MappingProxyType(
    {
        "!": np.logical_not,
        "^": np.float_power,
        "**": np.float_power,
        "%": np.remainder,
        "and": np.logical_and,
        "or": np.logical_or,
        "acos": np.arccos,
        "asin": np.arcsin,
        "atan": np.arctan,
        "ceil": np.ceil,
        "cos": np.cos,
        "cosh": np.cosh,
        "exp": np.exp,
        "abs": np.fabs,
        "fabs": np.fabs,
        "floor": np.floor,
        "log": np.log,
        "log10": np.log10,
        "round": np.rint,
        "sin": np.sin,
        "sinh": np.sinh,
        "sqrt": np.sqrt,
        "tan": np.tan,
        "tanh": np.tanh,
        "log1p": np.log1p,
        "acosh": np.arccosh,
        "asinh": np.arcsinh,
        "atanh": np.arctanh,
        "pow": np.float_power,
        "atan2": np.arctan2,
        "fmod": np.fmod,
    }
)
"""The functions that numpy computes."""


def _are_same(a: float, b: float) -> bool:
    return a == b or (a != a and b != b)


PLAIN_FUNCTIONS: Mapping[str, Callable[..., float]] = MappingProxyType(
    {
        "~": lambda a: -a,
        ".-": lambda a: -a,
        ".+": lambda a: a,
        "+": lambda a, b: a + b,
        "-": lambda a, b: a - b,
        "*": lambda a, b: a * b,
        "/": quotient,
        "gt": lambda a, b: float(a > b),
        "ge": lambda a, b: float(a >= b or _are_same(a, b)),
        "eq": lambda a, b: float(_are_same(a, b)),
        "neq": lambda a, b: float(not _are_same(a, b)),
        "le": lambda a, b: float(a <= b or _are_same(a, b)),
        "lt": lambda a, b: float(a < b),
        "min": min,
        "max": max,
        "pi": lambda: math.pi,
    }
)
"""The functions that need no numpy."""


def calculate(name: str, *operands: float) -> float:
    """Return the result of an operator or function for its operands."""
    plain_function = PLAIN_FUNCTIONS.get(name)
    if plain_function is not None:
        return plain_function(*operands)
    with np.errstate(all="ignore"):
        return float(UFUNCS[name](*operands))
