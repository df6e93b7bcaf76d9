"""Defuzzifiers, which turn the samples of a fuzzy set into one number; `xs` are the points and `ys` their degrees."""

from __future__ import annotations

import math

import numpy as np

from codra_dsl.runtime.loops.fuzzy.sampled import Samples


def centroid(xs: Samples, ys: Samples) -> float:
    """Return the centre of gravity."""
    total = float(np.add.reduce(ys))
    return float(xs.dot(ys)) / total if total != 0.0 else math.nan


def bisector(xs: Samples, ys: Samples) -> float:
    """Return the point that halves the area best; if several points halve it equally well, return their mean."""
    area = np.nancumsum(ys)
    if area[-1] == 0.0:
        return math.nan
    errors = np.abs(area / area[-1] - 0.5)
    best_points = xs[errors == errors.min()]
    return float(best_points.mean()) if len(best_points) else math.nan


def smallest_of_maximum(xs: Samples, ys: Samples) -> float:
    """Return the first point with the greatest degree."""
    top_points = _points_at_maximum(xs, ys)
    return float(top_points.min()) if len(top_points) else math.nan


def mean_of_maximum(xs: Samples, ys: Samples) -> float:
    """Return the mean of the points with the greatest degree."""
    top_points = _points_at_maximum(xs, ys)
    return float(top_points.mean()) if len(top_points) else math.nan


def largest_of_maximum(xs: Samples, ys: Samples) -> float:
    """Return the last point with the greatest degree."""
    top_points = _points_at_maximum(xs, ys)
    return float(top_points.max()) if len(top_points) else math.nan


def _points_at_maximum(xs: Samples, ys: Samples) -> Samples:
    top_points: Samples = xs[(ys > 0.0) & (ys == ys.max())]
    return top_points


def midpoints(minimum: float, maximum: float, resolution: int) -> Samples:
    """Return the points at which FuzzyLite samples a range: the middles of equal pieces, as many as the resolution."""
    return minimum + (np.arange(resolution, dtype=np.float64) + 0.5) * ((maximum - minimum) / resolution)
