"""The breakpoints of membership functions: between two breakpoints a function is monotone.

So the bounds of a function are computed from its values at the breakpoints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

from codra_dsl.runtime.loops.fuzzy import terms

TermPair = tuple[tuple[Callable[..., float], tuple[float, ...]], tuple[Callable[..., float], tuple[float, ...]]]


def _height(*parameters: float) -> float:
    return parameters[4] if len(parameters) > 4 else 1.0


def _slopes(bottom_left: float, top_left: float, top_right: float, bottom_right: float, *_: float) -> TermPair:
    return (terms.s_shape, (bottom_left, top_left)), (terms.z_shape, (top_right, bottom_right))


def _sigmoids(left: float, rising: float, falling: float, right: float, *_: float) -> TermPair:
    return (terms.sigmoid, (left, rising)), (terms.sigmoid, (right, falling))


def _gaussian_product(mean_a: float, deviation_a: float, mean_b: float, deviation_b: float, *_: float) -> list[float]:
    """Return both means, and the top of the product of the two bell curves.

    Where the halves of the curves overlap, this product is the membership.
    """
    first, second = deviation_a * deviation_a, deviation_b * deviation_b
    top = [(mean_a * second + mean_b * first) / (first + second)] if first + second > 0.0 else []
    return [mean_a, mean_b, *top]


BREAKPOINTS: Mapping[Callable[..., float], Callable[..., Iterable[float]]] = MappingProxyType(
    {
        terms.arc: lambda start, end, *_: (start, end),
        terms.bell: lambda center, *_: (center,),
        terms.binary: lambda start, *_: (start,),
        terms.concave: lambda inflection, end, *_: (inflection, end),
        terms.constant: lambda *_: (),
        terms.cosine: lambda center, width, *_: (center - 0.5 * width, center, center + 0.5 * width),
        terms.discrete: lambda xs, *_: xs,
        terms.gaussian: lambda mean, *_: (mean,),
        terms.gaussian_product: _gaussian_product,
        terms.ramp: lambda start, end, *_: (start, end),
        terms.rectangle: lambda start, end, *_: (start, end),
        terms.semi_ellipse: lambda start, end, *_: (start, (start + end) / 2.0, end),
        terms.sigmoid: lambda *_: (),
        terms.spike: lambda center, *_: (center,),
        terms.s_shape: lambda start, end, *_: (start, 0.5 * (start + end), end),
        terms.trapezoid: lambda a, b, c, d, *_: (a, b, c, d),
        terms.triangle: lambda left, top, right, *_: (left, top, right),
        terms.z_shape: lambda start, end, *_: (start, 0.5 * (start + end), end),
    }
)
"""For each membership function, a function that returns its breakpoints from its parameters."""

COMPOSITES: Mapping[Callable[..., float], tuple[Callable[..., TermPair], Callable[..., float]]] = MappingProxyType(
    {
        terms.pi_shape: (_slopes, _height),
        terms.sigmoid_difference: (_sigmoids, _height),
        terms.sigmoid_product: (_sigmoids, _height),
    }
)
"""The terms that are composed of two others.

For each such term, one function returns the two terms with their parameters, and another function returns the height.
"""
