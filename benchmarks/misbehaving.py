"""Perception functions as bad as they get, and one that is well behaved."""

from __future__ import annotations

import os
import signal
from typing import Any

LOOKED_S: dict[tuple[int, int], float] = {}
"""When the jobs of the well-behaved really began, by algorithm and number."""

BAD = ("is_deaf", "eats_a_core", "returns_100_mb", "dies", "floods")


def looks(*, other: int, job: Any) -> dict[str, object]:
    """Note when it is, and return at once."""
    LOOKED_S[other, job.index] = job.now_s()
    return {"seen": True}


def is_deaf(*, job: Any) -> dict[str, object]:
    """Ignore all signals, for ever, with a child that does the same."""
    for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
        signal.signal(number, signal.SIG_IGN)
    os.fork()
    while True:
        signal.pause()


def eats_a_core(*, job: Any) -> dict[str, object]:
    """Compute for ever."""
    while True:
        pass


def returns_100_mb(*, job: Any) -> dict[str, object]:
    """Return far more than a decision needs."""
    return {"seen": b"x" * 10**8}


def dies(*, job: Any) -> dict[str, object]:
    """End the process."""
    os._exit(3)


def floods(*, job: Any) -> dict[str, object]:
    """Print for ever."""
    while True:
        os.write(1, b"nonsense " * 1000)
