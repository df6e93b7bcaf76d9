"""Defuzzifiers: one number from the samples of a fuzzy set; `xs` are the points and `ys` their degrees."""

from __future__ import annotations

import math

import numpy as np

from codra_dsl.runtime.loops.fuzzy.sampled import Samples


def centroid(xs: Samples, ys: Samples) -> float:
    """Return the centre of gravity."""
    total = float(np.add.reduce(ys))
    return float(xs.dot(ys)) / total if total != 0.0 else math.nan


def bisector(xs: Samples, ys: Samples) -> float:
    """Return the point that halves the area; the mean of all points that are equally near to it."""
    area = np.nancumsum(ys)
    if area[-1] == 0.0:
        return math.nan
    away = np.abs(area / area[-1] - 0.5)
    nearest = xs[away == away.min()]
    return float(nearest.mean()) if len(nearest) else math.nan


def smallest_of_maximum(xs: Samples, ys: Samples) -> float:
    """Return the first point with the greatest degree."""
    greatest = _at_maximum(xs, ys)
    return float(greatest.min()) if len(greatest) else math.nan


def mean_of_maximum(xs: Samples, ys: Samples) -> float:
    """Return the mean of the points with the greatest degree."""
    greatest = _at_maximum(xs, ys)
    return float(greatest.mean()) if len(greatest) else math.nan


def largest_of_maximum(xs: Samples, ys: Samples) -> float:
    """Return the last point with the greatest degree."""
    greatest = _at_maximum(xs, ys)
    return float(greatest.max()) if len(greatest) else math.nan


def _at_maximum(xs: Samples, ys: Samples) -> Samples:
    greatest: Samples = xs[(ys > 0.0) & (ys == ys.max())]
    return greatest


def midpoints(minimum: float, maximum: float, resolution: int) -> Samples:
    """Return the points at which FuzzyLite samples a range: the middles of equal pieces, as many as the resolution."""
    return minimum + (np.arange(resolution, dtype=np.float64) + 0.5) * ((maximum - minimum) / resolution)
