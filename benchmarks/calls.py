"""Measure calls within one process by the processor time of all its threads, so that other programs do not count.

The sides are measured in turns, so that a slower machine affects all of them.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Sequence

TURNS = 41


def in_turns(sides: Sequence[Callable[[], None]], calls: Sequence[int], turns: int = TURNS) -> list[float]:
    """Return the median processor time in seconds that one call of each side takes.

    Args:
        sides: the functions to measure.
        calls: the number of calls of each side in one turn.
        turns: the number of turns of each side.
    """
    taken_by_side: list[list[float]] = [[] for _ in sides]
    gc.collect()
    for _ in range(turns):
        for taken_s, side, count in zip(taken_by_side, sides, calls, strict=True):
            taken_s.append(_turn_s(side, count))
    return [statistics.median(taken_s) for taken_s in taken_by_side]


def _turn_s(side: Callable[[], None], calls: int) -> float:
    repeated = range(calls)
    began_s = time.process_time()
    for _ in repeated:
        side()
    return (time.process_time() - began_s) / calls
