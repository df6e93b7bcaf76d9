"""Delay Ctrl-C until the end of a block of code, or until an instant between two events of a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
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


@contextmanager
def noted_interrupt() -> Iterator[Callable[[], None]]:
    """Note the first interrupt in the `with` block; yield a function that raises it.

    So a run in simulated time ends between two events, and its journal never has a part of an event. A second interrupt
    is delivered at once, because an event can take a long time. An interrupt that the run has not raised is raised at
    the end of the block.
    """
    is_interrupted = threading.Event()

    def note(*_: object) -> None:
        signal.signal(signal.SIGINT, before)
        is_interrupted.set()

    def raise_interrupt() -> None:
        if is_interrupted.is_set():
            is_interrupted.clear()
            raise KeyboardInterrupt

    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield raise_interrupt  # interrupts are ignored, or another program handles them
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield raise_interrupt
    finally:
        signal.signal(signal.SIGINT, before)
    raise_interrupt()
