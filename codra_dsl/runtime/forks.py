"""Locks of a program that forks: a child process does not wait for threads that exist only in its parent."""

from __future__ import annotations

import os
import threading
import weakref
from typing import Any

_locks: weakref.WeakSet[Any] = weakref.WeakSet()


def new_lock() -> threading.RLock:
    """Return a reentrant lock, which a signal handler may take again.

    In a child process that `os.fork` creates, the lock is free unless the forking thread has it. In the parent, another
    thread may have the lock at this instant. In the child, this thread does not exist and would never release the lock.
    """
    lock = threading.RLock()
    _locks.add(lock)
    return lock


def _free_locks() -> None:
    for lock in tuple(_locks):
        if not lock._is_owned():
            lock._at_fork_reinit()


os.register_at_fork(after_in_child=_free_locks)
