"""Pause Python's cyclic garbage collector while many values are created and all of them stay in use."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = [
    "paused_collector",
]

_program_freezes: list[bool] = []
"""Holds `True` once objects were found that the program has frozen. They are counted only until then, because Python
walks through all of them to count them, for 70 ms in a large program."""


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
            if not _is_freezing_left_to_program():
                gc.freeze()
                gc.unfreeze()
            gc.enable()


def _is_freezing_left_to_program() -> bool:
    """Return whether the program manages frozen objects, which `gc.unfreeze` would return to the collector."""
    if not _program_freezes and gc.get_freeze_count() > 0:
        _program_freezes.append(True)
    return bool(_program_freezes)
