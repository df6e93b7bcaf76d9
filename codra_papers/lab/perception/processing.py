"""How long perception takes: times drawn anew, or those of a computer that all who look at the same time share."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import count
from math import erfc, exp, floor, inf, log, pi, sqrt
from random import Random

SPREAD = 0.25
"""Deviation of the logarithm of every processing time: two of three calls take 0.78 to 1.28 times the median."""

SHORTEST_MEAN_S = 0.35
"""Of the work that a computer is asked about."""

_POINTS_PER_S = 20.0
"""More than any hazard: that of the shortest work is 18.5 at most, and it falls with the inverse of the mean."""

_CELL_S = 4.0
_CELLS_KEPT = 8
"""Who looks at the same time needs the same one or two; they are drawn again for who comes back."""

_Points = tuple[tuple[float, float], ...]


def processing_s(random: Random, mean_s: float) -> float:
    """Return a time drawn from the log-normal distribution with a mean."""
    return random.lognormvariate(_median_log(mean_s), SPREAD)


class Computer:
    """The computer that does a robot's vision: how long it takes depends on the seed, the instant and the mean alone.

    Points lie at random in the plane of instants and hazards, evenly, and work ends at the first point below its own
    hazard then (thinning; Lewis and Shedler 1979). So each time has the distribution of `processing_s` and depends on
    none before it, for one call at a time; calls that overlap are alike. Two robots that begin the same work a little
    apart often end it together, at the same point, and are in step until one of them does something else: they are
    equally lucky, which in comparisons is known as common random numbers, and look at the same frames.
    """

    def __init__(self, seed: int) -> None:
        self._points = lru_cache(maxsize=_CELLS_KEPT)(lambda cell: _points(seed, cell))

    def processing_s(self, start_s: float, mean_s: float) -> float:
        """Return how long work takes that begins at an instant.

        Args:
            start_s: the instant.
            mean_s: how long such work takes in the mean, at least `SHORTEST_MEAN_S`.

        Raises:
            ValueError: the mean is shorter, or no finite number.
        """
        if not SHORTEST_MEAN_S <= mean_s < inf:
            raise ValueError(f"a mean of {mean_s:g} s is not a number from {SHORTEST_MEAN_S:g} s on")
        median_log, first = _median_log(mean_s), floor(start_s / _CELL_S)
        return next(
            instant_s - start_s
            for cell in count(first)
            for instant_s, height in self._points(cell)
            if instant_s > start_s and height < _hazard(instant_s - start_s, median_log)
        )


def _median_log(mean_s: float) -> float:
    return log(mean_s) - SPREAD**2 / 2


def _points(seed: int, cell: int) -> _Points:
    return tuple(_drawn(Random(f"{seed} computer {cell}"), cell * _CELL_S))


def _drawn(random: Random, start_s: float) -> Iterator[tuple[float, float]]:
    """Draw the points of one cell: instants, and heights in 1/s."""
    instant_s = start_s + random.expovariate(_POINTS_PER_S)
    while instant_s < start_s + _CELL_S:
        yield instant_s, random.uniform(0.0, _POINTS_PER_S)
        instant_s += random.expovariate(_POINTS_PER_S)


def _hazard(elapsed_s: float, median_log: float) -> float:
    """Return the rate in 1/s at which a log-normal time ends that has not ended before."""
    away = (log(elapsed_s) - median_log) / SPREAD
    left = erfc(away / sqrt(2)) / 2
    return exp(-(away**2) / 2) / (sqrt(2 * pi) * elapsed_s * SPREAD * left) if left > 0.0 else inf
