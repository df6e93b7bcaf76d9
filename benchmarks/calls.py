"""Measure calls within one process by the processor time of all its threads, which excludes the time of other programs.

The sides are measured in turns, so that a slower machine affects all of them.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Sequence

TURNS = 41


def in_turns(sides: Sequence[Callable[[], None]], call_counts: Sequence[int], turn_count: int = TURNS) -> list[float]:
    """Return the median processor time in seconds that one call of each side takes.

    Args:
        sides: the functions to measure.
        call_counts: the number of calls of each side in one turn.
        turn_count: the number of turns of each side.
    """
    durations_s_by_side: list[list[float]] = [[] for _ in sides]
    gc.collect()
    for _ in range(turn_count):
        for durations_s, side, count in zip(durations_s_by_side, sides, call_counts, strict=True):
            durations_s.append(_turn_s(side, count))
    return [statistics.median(durations_s) for durations_s in durations_s_by_side]


def _turn_s(side: Callable[[], None], call_count: int) -> float:
    call_indices = range(call_count)
    start_s = time.process_time()
    for _ in call_indices:
        side()
    return (time.process_time() - start_s) / call_count
