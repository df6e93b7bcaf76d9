"""Delay Ctrl-C until the end of a block of code."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Deliver interrupts only after the `with` block.

    A process that is started within the block never receives interrupts. Ctrl-C at a terminal goes to all processes,
    but a process that was started in the block ignores Ctrl-C. The parent process has to end such a process.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
