"""The inputs of the reference values: the same for every caller, made without a library."""

from __future__ import annotations

import random
from collections.abc import Sequence

ROWS = 1000
_NOTABLE = 20


def rows(engine: str, ranges: Sequence[tuple[float, float]]) -> list[tuple[float, ...]]:
    """Return the inputs of an engine: random values around the ranges, fractions of them, infinities and NaN."""
    chance = random.Random(engine)
    return [tuple(_value(chance, low, high) for low, high in ranges) for _ in range(ROWS)]


def _value(chance: random.Random, low: float, high: float) -> float:
    kind, width = chance.random(), high - low
    if kind < 0.06:
        return (float("nan"), float("inf"), float("-inf"))[int(kind * 50)]
    if kind < 0.25:
        return low + width * chance.randint(-2, _NOTABLE + 2) / _NOTABLE
    return chance.uniform(low - 0.2 * width, high + 0.2 * width)
