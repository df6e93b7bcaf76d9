"""Perception functions as bad as they get, and one that is well behaved."""

from __future__ import annotations

import os
import signal

BAD = ("is_deaf", "eats_a_core", "returns_100_mb", "dies", "floods")


def looks(*, job: object) -> dict[str, object]:
    """Return at once."""
    return {"seen": True}


def is_deaf(*, job: object) -> dict[str, object]:
    """Ignore all signals, for ever, with a child that does the same."""
    for number in set(signal.Signals) - {signal.SIGKILL, signal.SIGSTOP}:
        signal.signal(number, signal.SIG_IGN)
    os.fork()
    while True:
        signal.pause()


def eats_a_core(*, job: object) -> dict[str, object]:
    """Compute for ever."""
    while True:
        pass


def returns_100_mb(*, job: object) -> dict[str, object]:
    """Return far more than a decision needs."""
    return {"seen": b"x" * 10**8}


def dies(*, job: object) -> dict[str, object]:
    """End the process."""
    os._exit(3)


def floods(*, job: object) -> dict[str, object]:
    """Print for ever."""
    while True:
        os.write(1, b"nonsense " * 1000)
