"""Pause Python's cyclic garbage collector while many values are created and all of them stay in use."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = [
    "paused_collector",
]


@contextmanager
def paused_collector() -> Iterator[None]:
    """Pause the collector, which would traverse all values again and again as their number grows.

    Afterwards the new values belong to the old generation, so that the collector does not traverse all of them at once.
    Also works as a decorator: `@paused_collector()`.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            if gc.get_freeze_count() == 0:  # else the caller manages frozen objects
                gc.freeze()
                gc.unfreeze()
            gc.enable()
