"""Times calls within one process: its processor time, all threads counted, so that other programs do not count.

Sides have their turns, so that what slows the machine down hits all.
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
        sides: what is called.
        calls: how often each side is called in one turn.
        turns: how often each side has its turn.
    """
    found: list[list[float]] = [[] for _ in sides]
    gc.collect()
    for _ in range(turns):
        for taken_s, side, count in zip(found, sides, calls, strict=True):
            taken_s.append(_turn_s(side, count))
    return [statistics.median(taken_s) for taken_s in found]


def _turn_s(side: Callable[[], None], calls: int) -> float:
    repeated = range(calls)
    began_s = time.process_time()
    for _ in repeated:
        side()
    return (time.process_time() - began_s) / calls
