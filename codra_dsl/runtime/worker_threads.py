"""Daemon threads that run functions one after the other."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from contextvars import Context
from queue import Empty, SimpleQueue

from codra_dsl.runtime.forks import new_lock

_Inbox = SimpleQueue[Callable[[], object] | None]
"""The queue with the next function of one thread; None ends the thread."""

IDLE_S = 10.0
"""How long a thread waits for the next function before it ends."""


class WorkerThreads:
    """Runs each function at once, in an idle thread, or in a new thread if none is idle.

    So a function that hangs delays no other function. The threads are daemons, so it does not delay the end of the
    process either. Starting a thread takes several times as long as giving a function to a waiting thread.

    A function goes to the thread that has waited for the shortest time. So after many functions have run at the same
    time, the threads that are no longer needed end. Each function has its own `contextvars` context.
    """

    def __init__(self, name: str) -> None:
        """Start no thread yet.

        Args:
            name: the name of the threads.
        """
        self._name = name
        self._lock = new_lock()
        self._reset()

    @property
    def idle_count(self) -> int:
        """Return how many threads wait, without those for which a function is ready."""
        return len(self._waiting_inboxes)

    def run(self, function: Callable[[], object]) -> None:
        """Run a function, which must not raise.

        Raises:
            RuntimeError: if a new thread is needed and the machine cannot start one.
        """
        with self._lock:
            if self._process_id != os.getpid():  # after a fork, the threads exist only in the parent
                self._reset()
            if self._waiting_inboxes:
                self._waiting_inboxes.pop().put(function)
                return
        threading.Thread(target=self._run_functions, args=([function],), name=self._name, daemon=True).start()

    def close(self) -> None:
        """End the threads that wait; the others end after their functions."""
        with self._lock:
            self._is_closed = True
            while self._waiting_inboxes:
                self._waiting_inboxes.pop().put(None)

    def _reset(self) -> None:
        self._process_id = os.getpid()
        self._waiting_inboxes: list[_Inbox] = []
        self._is_closed = False

    def _run_functions(self, first_function: list[Callable[[], object]]) -> None:
        inbox = _Inbox()
        function: Callable[[], object] | None = first_function.pop()  # because a thread keeps its arguments
        while function is not None:
            Context().run(function)
            function = None  # a waiting thread keeps nothing of the last function in memory
            function = self._next_function(inbox)

    def _next_function(self, inbox: _Inbox) -> Callable[[], object] | None:
        with self._lock:
            if self._is_closed or self._process_id != os.getpid():  # a function may fork: the child's copy ends
                return None
            self._waiting_inboxes.append(inbox)
        try:
            return inbox.get(timeout=IDLE_S)
        except Empty:
            with self._lock:
                if inbox in self._waiting_inboxes:
                    self._waiting_inboxes.remove(inbox)
                # A function can have come meanwhile. If a signal handler interrupted `run`, none comes.
                return None if inbox.empty() else inbox.get()
