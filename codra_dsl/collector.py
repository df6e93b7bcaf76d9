"""Python's cyclic garbage collector, paused while many values are made and none of them is garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def paused_collector() -> Iterator[None]:
    """Pause the collector, which would look through all values again and again as they grow in number.

    What was made counts as old afterwards, so that the collector does not look through all of it at once. Also a
    decorator: `@paused_collector()`.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            if gc.get_freeze_count() == 0:  # else it is the caller's business what is frozen
                gc.freeze()
                gc.unfreeze()
            gc.enable()
