"""Membership functions of terms, one function per shape, and the inverses of the monotone functions.

`x` is in the unit of its variable; a function returns a degree from 0 to its height, and NaN for NaN. The functions
raise no exceptions: they return NaN outside their domain, and a division by zero is infinite, as in IEEE 754.
"""

from __future__ import annotations

import math
from bisect import bisect_right

_LARGEST_EXPONENT = 709.0


def quotient(a: float, b: float) -> float:
    """Return a / b; infinite or NaN if b is 0."""
    if b != 0.0:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


def exponential(x: float) -> float:
    """Return e to the power of x; infinite if the result is too large."""
    return math.inf if x > _LARGEST_EXPONENT else math.exp(x)


def root(x: float) -> float:
    """Return the square root; NaN for a negative number."""
    return math.nan if x < 0.0 else math.sqrt(x)


def power(base: float, exponent: float) -> float:
    """Return a power of a non-negative number; infinite if the result is too large."""
    try:
        return math.pow(base, exponent)
    except OverflowError:
        return math.inf
    except ValueError:  # zero to a negative power
        return math.inf if base == 0.0 else math.nan


def logarithm(x: float) -> float:
    """Return the natural logarithm: minus infinity for 0, NaN for a negative number."""
    if x > 0.0 or x != x:
        return math.log(x)
    return -math.inf if x == 0.0 else math.nan


def arc(x: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the membership in a quarter of an ellipse that rises from start to end, and then stays constant."""
    if x != x:
        return math.nan
    radius = end - start
    centre = start + radius
    if (start > end and centre <= x <= start) or (start < end and start <= x <= centre):
        return height * quotient(root(radius * radius - (x - centre) * (x - centre)), abs(radius))
    return height if (start > end and x < end) or (start < end and x > end) else 0.0


def bell(x: float, center: float, width: float, slope: float, height: float = 1.0) -> float:
    """Return the membership in a generalised bell."""
    if x != x:
        return math.nan
    return height * (1.0 / (1.0 + power(abs(quotient(x - center, width)), 2.0 * slope)))


def binary(x: float, start: float, direction: float, height: float = 1.0) -> float:
    """Return the height at `start`, and on the side of `start` where `direction` is; otherwise 0."""
    if x != x:
        return math.nan
    return height if (direction > start and x >= start) or (direction < start and x <= start) else 0.0


def concave(x: float, inflection: float, end: float, height: float = 1.0) -> float:
    """Return the membership in a hyperbola that reaches its height at end."""
    if x != x:
        return math.nan
    if inflection <= end and x < end:
        return height * quotient(end - inflection, 2.0 * end - inflection - x)
    if inflection >= end and x > end:
        return height * quotient(inflection - end, inflection - 2.0 * end + x)
    return height


def constant(x: float, value: float) -> float:  # noqa: ARG001 - all membership functions have the same signature
    """Return the value for every x."""
    return value


def cosine(x: float, center: float, width: float, height: float = 1.0) -> float:
    """Return the membership in one wave of a cosine."""
    if x != x:
        return math.nan
    if math.isinf(x) or not center - 0.5 * width <= x <= center + 0.5 * width:
        return 0.0
    angle = quotient(2.0, width) * math.pi * (x - center)
    return math.nan if math.isinf(angle) else height * (0.5 * (1.0 + math.cos(angle)))


def discrete(x: float, xs: tuple[float, ...], ys: tuple[float, ...], height: float = 1.0) -> float:
    """Return the linear interpolation between points; constant before the first and after the last point.

    With only one point there is no interpolation: this point's membership also holds for a missing input, as in
    FuzzyLite.
    """
    if len(xs) == 1:
        return height * ys[0]
    if x != x:
        return math.nan
    right = bisect_right(xs, x)
    if right == 0:
        return height * ys[0]
    if right == len(xs):
        return height * ys[-1]
    slope = (ys[right] - ys[right - 1]) / (xs[right] - xs[right - 1])
    return height * (slope * (x - xs[right - 1]) + ys[right - 1])


def gaussian(x: float, mean: float, standard_deviation: float, height: float = 1.0) -> float:
    """Return the membership in a Gaussian bell curve."""
    away = x - mean
    return height * exponential(quotient(-(away * away), 2.0 * (standard_deviation * standard_deviation)))


def gaussian_product(
    x: float,
    mean_a: float,
    standard_deviation_a: float,
    mean_b: float,
    standard_deviation_b: float,
    height: float = 1.0,
) -> float:
    """Return the membership in two halves of Gaussian bell curves with a plateau between their means."""
    if x != x:
        return math.nan
    left = gaussian(x, mean_a, standard_deviation_a) if x < mean_a else 1.0
    right = gaussian(x, mean_b, standard_deviation_b) if x > mean_b else 1.0
    return height * left * right


def linear(inputs: tuple[float, ...], coefficients: tuple[float, ...]) -> float:
    """Return the sum of all inputs times their coefficients, plus the last coefficient if there is no input for it.

    Infinite and missing inputs have an effect even if their coefficient is 0: the sum is NaN then.
    """
    total = 0.0
    for coefficient, value in zip(coefficients, inputs, strict=False):
        total += coefficient * value
    return total + coefficients[-1] if len(coefficients) > len(inputs) else total


def pi_shape(
    x: float, bottom_left: float, top_left: float, top_right: float, bottom_right: float, height: float = 1.0
) -> float:
    """Return the membership in a plateau between two smooth slopes."""
    return height * (s_shape(x, bottom_left, top_left) * z_shape(x, top_right, bottom_right))


def ramp(x: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the membership that grows linearly from 0 at start to the height at end; end may lie below start."""
    if x != x or start == end:
        return math.nan
    if start < end:
        return 0.0 if x <= start else height * ((x - start) / (end - start)) if x < end else height
    return 0.0 if x >= start else height * ((start - x) / (start - end)) if x > end else height


def rectangle(x: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the height between start and end, both included, in any order; otherwise 0."""
    if x != x:
        return math.nan
    return height if min(start, end) <= x <= max(start, end) else 0.0


def semi_ellipse(x: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the membership in the upper half of an ellipse between start and end."""
    if x != x:
        return math.nan
    left, right = min(start, end), max(start, end)
    if not left <= x <= right:
        return 0.0
    radius = (right - left) / 2.0
    away = x - (left + radius)
    return height * quotient(root(radius * radius - away * away), radius)


def sigmoid(x: float, inflection: float, slope: float, height: float = 1.0) -> float:
    """Return the membership in a logistic curve, which falls if the slope is negative."""
    return height / (1.0 + exponential(-slope * (x - inflection)))


def sigmoid_difference(
    x: float, left: float, rising: float, falling: float, right: float, height: float = 1.0
) -> float:
    """Return the distance between two logistic curves."""
    return height * abs(sigmoid(x, left, rising) - sigmoid(x, right, falling))


def sigmoid_product(x: float, left: float, rising: float, falling: float, right: float, height: float = 1.0) -> float:
    """Return the product of two logistic curves."""
    return height * (sigmoid(x, left, rising) * sigmoid(x, right, falling))


def spike(x: float, center: float, width: float, height: float = 1.0) -> float:
    """Return the membership in a peak that falls exponentially to both sides."""
    return height * exponential(-abs(quotient(10.0, width) * (x - center)))


def s_shape(x: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the membership that grows smoothly from 0 at start to the height at end."""
    if x != x:
        return math.nan
    if x <= start:
        return 0.0
    if x <= 0.5 * (start + end):
        share = quotient(x - start, end - start)
        return height * (2.0 * (share * share))
    if x < end:
        share = quotient(x - end, end - start)
        return height * (1.0 - 2.0 * (share * share))
    return height


def trapezoid(
    x: float, bottom_left: float, top_left: float, top_right: float, bottom_right: float, height: float = 1.0
) -> float:
    """Return the membership in a plateau between two straight slopes; an infinite bottom makes a shoulder."""
    if x < bottom_left or x > bottom_right:
        return 0.0
    if top_left <= x <= top_right:
        return height
    if (bottom_left == -math.inf and x < top_left) or (bottom_right == math.inf and x > top_right):
        return height
    if x < top_left:
        return height * ((x - bottom_left) / (top_left - bottom_left))
    return height * ((bottom_right - x) / (bottom_right - top_right)) if x > top_right else math.nan


def triangle(x: float, left: float, top: float, right: float, height: float = 1.0) -> float:
    """Return the membership in two straight slopes that meet at the top; an infinite corner makes a shoulder."""
    if x < left or x > right:
        return 0.0
    if x == top or (left == -math.inf and x < top) or (right == math.inf and x > top):
        return height
    if x < top:
        return height * ((x - left) / (top - left))
    return height * ((right - x) / (right - top)) if x > top else math.nan


def z_shape(x: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the membership that falls smoothly from the height at start to 0 at end."""
    if x != x:
        return math.nan
    if x <= start:
        return height
    if x < 0.5 * (start + end):
        share = quotient(x - start, end - start)
        return height * (1.0 - 2.0 * (share * share))
    if x < end:
        share = quotient(x - end, end - start)
        return height * (2.0 * (share * share))
    return 0.0


def arc_inverse(y: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the x at which an arc has the degree y."""
    radius = end - start
    share = quotient(y * radius, height)
    away = root(radius * radius - share * share)
    return start + radius + (-away if start < end else away)


def concave_inverse(y: float, inflection: float, end: float, height: float = 1.0) -> float:
    """Return the x at which a concave term has the degree y."""
    return quotient(height * (inflection - end), y) + 2.0 * end - inflection


def ramp_inverse(y: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the x at which a ramp has the degree y."""
    return start + quotient((end - start) * y, height)


def sigmoid_inverse(y: float, inflection: float, slope: float, height: float = 1.0) -> float:
    """Return the x at which a logistic curve has the degree y."""
    return inflection + quotient(logarithm(quotient(height, y) - 1.0), -slope)


def s_shape_inverse(y: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the x at which an S-shape has the degree y."""
    if y <= height / 2.0:
        return start + (end - start) * root(quotient(y, 2.0 * height))
    return end - (end - start) * root(quotient(height - y, 2.0 * height))


def z_shape_inverse(y: float, start: float, end: float, height: float = 1.0) -> float:
    """Return the x at which a Z-shape has the degree y."""
    if y <= height / 2.0:
        return end - (end - start) * root(quotient(y, 2.0 * height))
    return start + (end - start) * root(quotient(height - y, 2.0 * height))
