"""Locks of the runtime in programs that fork and that handle signals."""

from __future__ import annotations

import os
import re
import threading
from pathlib import Path

from codra_dsl.runtime import forks
from codra_dsl.runtime.forks import new_lock

RUNTIME = Path(forks.__file__).parent
OTHER_LOCK = re.compile(r"threading\.R?Lock\(\)")


def test_a_lock_of_another_thread_is_free_in_a_fork() -> None:
    lock, is_taken, may_release = new_lock(), threading.Event(), threading.Event()

    def hold() -> None:
        with lock:
            is_taken.set()
            may_release.wait()

    thread = threading.Thread(target=hold)
    thread.start()
    is_taken.wait()
    child = os.fork()
    if child == 0:
        os._exit(0 if lock.acquire(timeout=10.0) else 1)
    may_release.set()
    thread.join()
    assert os.waitpid(child, 0)[1] == 0


def test_all_locks_of_the_runtime_are_free_in_a_fork_and_can_be_taken_again_by_a_signal_handler() -> None:
    """A child process writes no journal, so the lock of the journal's file is not needed in it."""
    files = {
        str(path.relative_to(RUNTIME))
        for path in RUNTIME.rglob("*.py")
        if OTHER_LOCK.search(path.read_text(encoding="utf-8"))
    }
    assert files == {"forks.py", "journal/mcap_file.py"}
