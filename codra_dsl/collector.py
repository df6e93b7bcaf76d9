"""Pause Python's cyclic garbage collector while many values are created and all of them stay in use."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = [
    "paused_collector",
]

_MANY_OBJECTS = 100_000
"""The collector needs about 10 ms for this many objects."""


@contextmanager
def paused_collector() -> Iterator[None]:
    """Pause the collector, which would traverse all values again and again as their number grows.

    Afterwards the new values, if they are many, belong to the old generation, so that the collector does not traverse
    all of them at once. Python does not count values that get old in this way. So a program that creates many small
    contexts one after another in this way would never collect the unused ones.
    Also works as a decorator: `@paused_collector()`.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            new_objects, _, _ = gc.get_count()
            if new_objects >= _MANY_OBJECTS and gc.get_freeze_count() == 0:  # else the program manages frozen objects
                gc.freeze()
                gc.unfreeze()
            gc.enable()
