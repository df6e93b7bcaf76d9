"""Ctrl-C, at a better moment."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Let an interrupt come when the block is over.

    A process that begins within the block holds interrupts back for ever, so that Ctrl-C at a terminal, which goes to
    all processes, leaves it alone: who began it ends it.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
