"""Compute the support and the core of a term. They show which rules can act, without the computation of degrees."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import Term
from codra_dsl.language.fuzzy.words import Shape

Interval = tuple[float, float]
_ALL: Interval = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Extent:
    """The support and the core of a term.

    Attributes:
        open_intervals: open intervals in which the term's degree is above 0.
        full_intervals: closed intervals in which the degree is 1; they belong to the support as well.
        peak_intervals: closed intervals in which the degree is largest, if the largest degree is below 1. For
            `Discrete`: all given points at which the degree is above 0.
    """

    open_intervals: tuple[Interval, ...] = ()
    full_intervals: tuple[Interval, ...] = ()
    peak_intervals: tuple[Interval, ...] = ()

    def holds(self, x: float) -> bool:
        """Return whether a number's degree in the term is above 0."""
        inside = any(low < x < high for low, high in self.open_intervals)
        return inside or any(low <= x <= high for low, high in (*self.full_intervals, *self.peak_intervals))

    def is_full_at(self, x: float) -> bool:
        """Return whether a number's degree in the term is 1."""
        return any(low <= x <= high for low, high in self.full_intervals)

    @property
    def ends(self) -> tuple[float, ...]:
        """Return all finite ends of intervals, sorted. Support and core begin and end only at these, or at infinity."""
        endpoints = {
            end for interval in (*self.open_intervals, *self.full_intervals, *self.peak_intervals) for end in interval
        }
        return tuple(sorted(end for end in endpoints if math.isfinite(end)))


def extent(term: Term) -> Extent:
    """Return the extent of a term."""
    if term.height <= 0.0:
        return Extent()
    unscaled_extent = (
        _points(term.parameters) if term.shape is Shape.Discrete else _EXTENTS[term.shape](*term.parameters)
    )
    return (
        unscaled_extent
        if term.height == 1.0
        else Extent(open_intervals=unscaled_extent.open_intervals, peak_intervals=unscaled_extent.full_intervals)
    )


def _slope(start: float, end: float) -> Extent:
    if start == end:
        return Extent()
    rises = start < end
    return Extent(
        open_intervals=((start, math.inf) if rises else (-math.inf, start),),
        full_intervals=((end, math.inf) if rises else (-math.inf, end),),
    )


def _falling_slope(start: float, end: float) -> Extent:
    return Extent(open_intervals=((-math.inf, end),), full_intervals=((-math.inf, start),))


def _hyperbola(inflection: float, end: float) -> Extent:
    return Extent(open_intervals=(_ALL,), full_intervals=((end, math.inf) if inflection <= end else (-math.inf, end),))


def _everywhere(*_: float) -> Extent:
    return Extent(open_intervals=(_ALL,))


def _bell(center: float, *_: float) -> Extent:
    return Extent(open_intervals=(_ALL,), full_intervals=((center, center),))


def _two_bells(mean_a: float, _: float, mean_b: float, __: float) -> Extent:
    return Extent(open_intervals=(_ALL,), full_intervals=((mean_a, mean_b),) if mean_a <= mean_b else ())


def _wave(center: float, width: float) -> Extent:
    half = abs(width) / 2.0
    return Extent(open_intervals=((center - half, center + half),), full_intervals=((center, center),))


def _triangle(left: float, top: float, right: float) -> Extent:
    return Extent(open_intervals=((left, right),), full_intervals=((top, top),))


def _trapezoid(bottom_left: float, top_left: float, top_right: float, bottom_right: float) -> Extent:
    return Extent(open_intervals=((bottom_left, bottom_right),), full_intervals=((top_left, top_right),))


def _rectangle(start: float, end: float) -> Extent:
    return Extent(full_intervals=((min(start, end), max(start, end)),))


def _half_ellipse(start: float, end: float) -> Extent:
    return Extent(
        open_intervals=((min(start, end), max(start, end)),),
        full_intervals=(((start + end) / 2.0, (start + end) / 2.0),),
    )


def _edge(start: float, direction: float) -> Extent:
    return Extent(full_intervals=((start, math.inf) if direction > start else (-math.inf, start),))


def _constant(value: float) -> Extent:
    return Extent(open_intervals=(_ALL,) if value > 0.0 else (), full_intervals=(_ALL,) if value >= 1.0 else ())


def _points(points: tuple[float, ...]) -> Extent:
    corners = [(-math.inf, points[1]), *zip(points[::2], points[1::2], strict=True), (math.inf, points[-1])]
    pieces = list(pairwise(corners))
    return Extent(
        open_intervals=tuple((low, high) for (low, one), (high, other) in pieces if max(one, other) > 0.0),
        full_intervals=(
            *((low, high) for (low, one), (high, other) in pieces if min(one, other) >= 1.0),
            *((x, x) for x, y in corners if y >= 1.0),
        ),
        peak_intervals=tuple((x, x) for x, y in corners if y > 0.0),
    )


_EXTENTS: Mapping[Shape, Callable[..., Extent]] = {
    Shape.Arc: _slope,
    Shape.Bell: _bell,
    Shape.Binary: _edge,
    Shape.Concave: _hyperbola,
    Shape.Constant: _constant,
    Shape.Cosine: _wave,
    Shape.Gaussian: _bell,
    Shape.GaussianProduct: _two_bells,
    Shape.Linear: _everywhere,
    Shape.PiShape: _trapezoid,
    Shape.Ramp: _slope,
    Shape.Rectangle: _rectangle,
    Shape.SemiEllipse: _half_ellipse,
    Shape.Sigmoid: _everywhere,
    Shape.SigmoidDifference: _everywhere,
    Shape.SigmoidProduct: _everywhere,
    Shape.Spike: _bell,
    Shape.SShape: _slope,
    Shape.Trapezoid: _trapezoid,
    Shape.Triangle: _triangle,
    Shape.ZShape: _falling_slope,
}
