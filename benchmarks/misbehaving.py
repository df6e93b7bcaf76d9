"""Perception functions that misbehave in the worst ways, and one that behaves well."""

from __future__ import annotations

import os
import signal
from typing import Any

LOOK_STARTS_S: dict[tuple[int, int], float] = {}
"""The real start of each job of the well-behaved function. The key is (number of the algorithm, index of the job)."""

MISBEHAVIOURS = ("is_deaf", "eats_a_core", "returns_100_mb", "dies", "floods")


def look_at_once(*, other: int, job: Any) -> dict[str, object]:
    """Record the time, and return at once."""
    LOOK_STARTS_S[other, job.index] = job.now_s()
    return {"seen": True}


def is_deaf(*, job: Any) -> dict[str, object]:
    """Ignore all signals forever, with a child process that does the same."""
    for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
        signal.signal(number, signal.SIG_IGN)
    os.fork()
    while True:
        signal.pause()


def eats_a_core(*, job: Any) -> dict[str, object]:
    """Compute forever."""
    while True:
        pass


def returns_100_mb(*, job: Any) -> dict[str, object]:
    """Return far more than a decision needs."""
    return {"seen": b"x" * 10**8}


def dies(*, job: Any) -> dict[str, object]:
    """End the process."""
    os._exit(3)


def floods(*, job: Any) -> dict[str, object]:
    """Print forever."""
    while True:
        os.write(1, b"nonsense " * 1000)
