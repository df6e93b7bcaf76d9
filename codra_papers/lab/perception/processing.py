"""Durations of perception: either drawn for each call, or given by a computer that all simultaneous callers share."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import count
from math import erfc, exp, floor, inf, log, pi, sqrt
from random import Random

SPREAD = 0.25
"""Standard deviation of the logarithm of every processing time: two of three calls take 0.78 to 1.28 times the
median."""

SHORTEST_MEAN_S = 0.35
"""Shortest mean duration of work that `Computer` accepts."""

_POINTS_PER_S = 20.0
"""The density of the random points of `Computer`: per second, and up to this hazard in 1/s. No hazard is that large:
for work with the shortest mean, the hazard is at most 18.5 1/s, and the largest hazard is
inversely proportional to the mean."""

_CELL_S = 4.0
_CELL_CACHE_SIZE = 8
"""Number of cells of time that are cached. Simultaneous callers need the same one or two cells. If a dropped cell is
needed, it is drawn again with the same points."""

_Points = tuple[tuple[float, float], ...]


def processing_s(random: Random, mean_s: float) -> float:
    """Return a time drawn from the log-normal distribution with this mean."""
    return random.lognormvariate(_median_log(mean_s), SPREAD)


class Computer:
    """The computer for a robot's vision. The duration of work depends only on the seed, the instant and the mean.

    Points lie at random in the plane of instants and hazards, with uniform density. The hazard
    of the work is a curve in this plane. Work ends at the first point below the curve (thinning; Lewis and Shedler
    1979). So durations have
    the distribution of `processing_s`. The durations of consecutive calls are independent; those of overlapping calls
    are correlated. Two robots that begin the same work at slightly different instants often end it at the same point.
    Then they remain synchronised and use the same frames, until one of them does other work. In comparisons, this
    method is known as common random numbers.
    """

    def __init__(self, seed: int) -> None:
        self._points = lru_cache(maxsize=_CELL_CACHE_SIZE)(lambda cell: _points(seed, cell))

    def processing_s(self, start_s: float, mean_s: float) -> float:
        """Return the duration of work that begins at an instant.

        Args:
            start_s: the instant at which the work begins.
            mean_s: the mean duration of such work, at least `SHORTEST_MEAN_S`.

        Raises:
            ValueError: `mean_s` is less than `SHORTEST_MEAN_S`, or not finite.
        """
        if not SHORTEST_MEAN_S <= mean_s < inf:
            raise ValueError(f"the mean must be at least {SHORTEST_MEAN_S:g} s and finite, but is {mean_s:g} s")
        median_log, first_cell = _median_log(mean_s), floor(start_s / _CELL_S)
        return next(
            instant_s - start_s
            for cell in count(first_cell)
            for instant_s, height in self._points(cell)
            if instant_s > start_s and height < _hazard(instant_s - start_s, median_log)
        )


def _median_log(mean_s: float) -> float:
    return log(mean_s) - SPREAD**2 / 2


def _points(seed: int, cell: int) -> _Points:
    return tuple(_draw_points(Random(f"{seed} computer {cell}"), cell * _CELL_S))


def _draw_points(random: Random, start_s: float) -> Iterator[tuple[float, float]]:
    """Draw the points of one cell: instants, and heights in 1/s."""
    instant_s = start_s + random.expovariate(_POINTS_PER_S)
    while instant_s < start_s + _CELL_S:
        yield instant_s, random.uniform(0.0, _POINTS_PER_S)
        instant_s += random.expovariate(_POINTS_PER_S)


def _hazard(elapsed_s: float, median_log: float) -> float:
    """Return the hazard rate, in 1/s, of work with a log-normal duration that has lasted for `elapsed_s`."""
    deviations = (log(elapsed_s) - median_log) / SPREAD
    remaining_share = erfc(deviations / sqrt(2)) / 2
    return (
        exp(-(deviations**2) / 2) / (sqrt(2 * pi) * elapsed_s * SPREAD * remaining_share)
        if remaining_share > 0.0
        else inf
    )
