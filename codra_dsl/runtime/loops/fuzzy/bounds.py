"""Inference with unknown inputs: every value is an interval that contains all possible values.

A compiled engine has two functions of the same form: `infer` with numbers, and `infer_bounds`, which calls this module
with the same functions of `terms`, `norms` and `hedges`. One code generator writes both, so properties that are proven
for one also hold for the other.

Norms and hedges are monotone on degrees, so the ends of their arguments suffice. Terms are monotone between their
breakpoints, so the ends and the breakpoints suffice. If a function is not known to be monotone, the result is all
numbers, not a guess. Two mentions of one input are treated as two inputs, so an interval can be too wide, but never too
narrow; `refined` returns narrower intervals.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from typing import NamedTuple, Protocol

from codra_dsl.runtime.loops.fuzzy import hedges, norms
from codra_dsl.runtime.loops.fuzzy.breakpoints import BREAKPOINTS, COMPOSITES

MAX_BOXES = 4096
"""The largest number of boxes into which `refined` cuts the inputs."""


class End(Enum):
    """An end of an interval."""

    LOW = "low"
    HIGH = "high"


class Bounds(NamedTuple):
    """The possible values: from low to high, both included, and possibly unknown (NaN).

    Both ends are NaN if the value is certainly unknown.
    """

    low: float
    high: float
    may_be_unknown: bool = False

    def worse(self, end: End) -> float:
        """Return the given end; NaN if the value may be unknown."""
        if self.may_be_unknown:
            return math.nan
        return self.low if end is End.LOW else self.high

    def holds(self, value: float) -> bool:
        """Return whether a value is possible."""
        return self.may_be_unknown if value != value else self.low <= value <= self.high


class BoundedInference(NamedTuple):
    """The possible results of one call of an engine.

    Attributes:
        values: the values of the outputs, in the engine's order.
        strengths: the weighted strengths of the rules.
    """

    values: tuple[Bounds, ...]
    strengths: tuple[Bounds, ...]


ANYTHING = Bounds(-math.inf, math.inf, may_be_unknown=True)
UNKNOWN = Bounds(math.nan, math.nan, may_be_unknown=True)

_EXACT_NORMS = frozenset(
    {norms.minimum, norms.maximum, norms.bounded_sum, norms.unbounded_sum, norms.bounded_difference}
)
"""The norms that never fall while an operand rises, even after rounding."""

_ROUNDING = 1e-15
"""The margin for other norms: rounding may have moved a value across a place where the norm jumps."""


def point(value: float) -> Bounds:
    """Return the interval of one value; all numbers if the value is not finite."""
    return Bounds(value, value) if value - value == 0.0 else ANYTHING


def is_degree(bounds: Bounds) -> bool:
    """Return whether all values are degrees: from 0 to 1, and known."""
    return bounds.low >= 0.0 and bounds.high <= 1.0 and not bounds.may_be_unknown


def is_finite(bounds: Bounds) -> bool:
    """Return whether all values are numbers and neither end is infinite."""
    return bounds.high - bounds.low < math.inf and not bounds.may_be_unknown


def hull(values: Iterable[float]) -> Bounds:
    """Return the interval from the least to the greatest value; all numbers if a value is NaN."""
    numbers = list(values)
    if any(value != value for value in numbers):
        return ANYTHING
    return Bounds(min(numbers), max(numbers))


def join(one: Bounds, other: Bounds) -> Bounds:
    """Return bounds that contain the values of both bounds."""
    may_be_unknown = one.may_be_unknown or other.may_be_unknown
    if one.low != one.low:
        return Bounds(other.low, other.high, may_be_unknown)
    if other.low != other.low:
        return Bounds(one.low, one.high, may_be_unknown)
    return Bounds(min(one.low, other.low), max(one.high, other.high), may_be_unknown)


def image(term: Callable[..., float], x: Bounds, *parameters: object) -> Bounds:
    """Return the possible degrees of a term."""
    if x.may_be_unknown:
        return ANYTHING
    if x.low == x.high:
        return hull([term(x.low, *parameters)])
    if term in COMPOSITES:
        return _composite_image(term, x, *parameters)
    places_near_breakpoints = (
        place
        for turning_point in BREAKPOINTS[term](*parameters)
        for place in (math.nextafter(turning_point, -math.inf), turning_point, math.nextafter(turning_point, math.inf))
    )
    places = [x.low, x.high, *(place for place in places_near_breakpoints if x.low < place < x.high)]
    return hull(term(place, *parameters) for place in places)


def _composite_image(term: Callable[..., float], x: Bounds, *parameters: object) -> Bounds:
    parts_of, height_of = COMPOSITES[term]
    first, second = (image(part, x, *part_parameters) for part, part_parameters in parts_of(*parameters))
    if not (is_finite(first) and is_finite(second)):
        return ANYTHING
    height = height_of(*parameters)
    if term.__name__ == "sigmoid_difference":
        return times(height, absolute(Bounds(first.low - second.high, first.high - second.low)))
    return times(height, Bounds(first.low * second.low, first.high * second.high))


def inverse(term: Callable[..., float], y: Bounds, *parameters: float) -> Bounds:
    """Return the places at which a monotone term can have these degrees."""
    if not is_degree(y):
        return ANYTHING
    return hull([term(y.low, *parameters), term(y.high, *parameters)])


def linear(inputs: Sequence[Bounds], coefficients: Sequence[float]) -> Bounds:
    """Return the sum of inputs times their coefficients, plus the last coefficient if there is no input for it."""
    total = point(coefficients[-1] if len(coefficients) > len(inputs) else 0.0)
    for coefficient, value in zip(coefficients, inputs, strict=False):
        part = times(coefficient, value)
        total = Bounds(total.low + part.low, total.high + part.high, total.may_be_unknown or part.may_be_unknown)
    return total if is_finite(total) else ANYTHING


def times(factor: float, bounds: Bounds) -> Bounds:
    """Return the bounds of a number times the values."""
    if not is_finite(bounds):
        return ANYTHING
    return hull([factor * bounds.low, factor * bounds.high])


def absolute(bounds: Bounds) -> Bounds:
    """Return the bounds of the absolute values."""
    ends = [abs(bounds.low), abs(bounds.high)]
    return Bounds(0.0 if bounds.low <= 0.0 <= bounds.high else min(ends), max(ends), bounds.may_be_unknown)


def norm(function: Callable[[float, float], float], a: Bounds, b: Bounds) -> Bounds:
    """Return the bounds of a norm of two degrees."""
    if a.low == a.high and b.low == b.high:
        return point(function(a.low, b.low))
    if function in _EXACT_NORMS and is_finite(a) and is_finite(b):
        return Bounds(function(a.low, b.low), function(a.high, b.high))
    if is_degree(a) and is_degree(b):
        return Bounds(max(0.0, function(a.low, b.low) - _ROUNDING), min(1.0, function(a.high, b.high) + _ROUNDING))
    return ANYTHING


def hedge(function: Callable[[float], float], x: Bounds) -> Bounds:
    """Return the bounds of a hedge of a degree."""
    if function is hedges.any_:
        return point(1.0)
    if function is hedges.not_ and is_finite(x):
        return Bounds(1.0 - x.high, 1.0 - x.low)
    return Bounds(function(x.low), function(x.high)) if is_degree(x) else ANYTHING


def clipped(bounds: Bounds, minimum: float, maximum: float) -> Bounds:
    """Return the bounds of the values after limiting them to a range; an unknown value stays unknown."""
    if bounds.low != bounds.low:
        return bounds
    low, high = (min(max(end, minimum), maximum) for end in bounds[:2])
    return Bounds(low, high, bounds.may_be_unknown)


def known(bounds: Bounds, *substitutes: Bounds) -> Bounds:
    """Return the bounds with substitutes in place of an unknown value: the previous value, then the default."""
    for substitute in substitutes:
        if not bounds.may_be_unknown:
            break
        known_bounds = Bounds(bounds.low, bounds.high)
        bounds = join(known_bounds, substitute)
    return bounds


class InferBounds(Protocol):
    """The function `infer_bounds` of a compiled engine."""

    def __call__(self, *inputs: Bounds) -> BoundedInference:
        """Return the possible results of the engine."""
        ...


def refined(infer: InferBounds, inputs: Sequence[Bounds], *, pieces: int) -> BoundedInference:
    """Return narrower bounds: every unknown input is cut into pieces, and the bounds of all boxes are joined.

    Like the result of one call, the union contains every result that the inputs allow. Infinite inputs are not cut.
    There are at most MAX_BOXES boxes; the number of pieces is reduced if necessary.
    """
    open_input_count = sum(1 for bounds in inputs if bounds.low < bounds.high and is_finite(bounds))
    while pieces > 1 and pieces**open_input_count > MAX_BOXES:
        pieces -= 1
    union: BoundedInference | None = None
    for box in itertools.product(*(_split(bounds, pieces) for bounds in inputs)):
        box_inference = infer(*box)
        union = box_inference if union is None else _join_inferences(union, box_inference)
    return infer(*inputs) if union is None else union


def _split(bounds: Bounds, piece_count: int) -> list[Bounds]:
    if not (bounds.low < bounds.high and is_finite(bounds)):
        return [bounds]
    ends = [bounds.low + (bounds.high - bounds.low) * index / piece_count for index in range(piece_count)] + [
        bounds.high
    ]
    return [Bounds(low, max(low, high)) for low, high in itertools.pairwise(ends)]


def _join_inferences(one: BoundedInference, other: BoundedInference) -> BoundedInference:
    return BoundedInference(
        values=tuple(map(join, one.values, other.values)),
        strengths=tuple(map(join, one.strengths, other.strengths)),
    )
