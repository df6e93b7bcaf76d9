"""Daemon threads that run functions one after the other."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue

from codra_dsl.runtime.forks import new_lock

IDLE_S = 10.0
"""How long a thread waits for the next function before it ends."""


class WorkerThreads:
    """Runs each function at once, in a thread that has none to run; if there is no such thread, in a new one.

    So a function that hangs delays no other function. The threads are daemons, so it does not delay the end of the
    process either. Starting a thread takes several times as long as giving a function to a waiting thread.

    Attributes:
        idle_count: how many threads wait, without those for which a function is ready.
    """

    def __init__(self, name: str) -> None:
        """Start no thread yet.

        Args:
            name: the name of the threads.
        """
        self._name = name
        self._lock = new_lock()
        self.idle_count = 0
        self._reset()

    def run(self, function: Callable[[], object]) -> None:
        """Run a function, which must not raise.

        Raises:
            RuntimeError: if a new thread is needed and the machine cannot start one.
        """
        with self._lock:
            if self._process_id != os.getpid():  # after a fork, the threads exist only in the parent
                self._reset()
            if self.idle_count:
                self.idle_count -= 1
                self._functions.put(function)
                return
        threading.Thread(target=self._run_functions, args=([function],), name=self._name, daemon=True).start()

    def close(self) -> None:
        """End the threads that wait; the others end after their functions."""
        with self._lock:
            self._is_closed = True
            for _ in range(self.idle_count):
                self._functions.put(None)
            self.idle_count = 0

    def _reset(self) -> None:
        self._process_id = os.getpid()
        self._functions: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self.idle_count = 0
        self._is_closed = False

    def _run_functions(self, first_function: list[Callable[[], object]]) -> None:
        function: Callable[[], object] | None = first_function.pop()  # because a thread keeps its arguments
        while function is not None:
            function()
            function = None  # a waiting thread keeps nothing of the last function in memory
            function = self._next_function()

    def _next_function(self) -> Callable[[], object] | None:
        with self._lock:
            if self._is_closed:
                return None
            self.idle_count += 1
        while True:
            try:
                return self._functions.get(timeout=IDLE_S)
            except Empty:
                with self._lock:
                    if self.idle_count:  # otherwise each waiting thread gets one of the functions in the queue
                        self.idle_count -= 1
                        return None
