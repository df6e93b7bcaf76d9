"""The executors of a forest's algorithms: created when the forest is built, closed when the forest ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence

from codra_dsl.runtime.clock import Work
from codra_dsl.runtime.perception.functions import Executor, Function, imported
from codra_dsl.runtime.perception.process_executor import ProcessExecutor, check_handles
from codra_dsl.runtime.perception.thread_executor import ThreadExecutor
from codra_dsl.runtime.values.model import Algorithm

CLOSE_S = 1.0
"""How long the method `close` of a perception class may delay the end of the program."""

Start = Callable[[Callable[[Work], None], Callable[[None], None]], Work]
"""The type of a function that starts a unit of work, as `Clock.start` does."""


class Executors:
    """Finds the function of each algorithm, and creates its executor."""

    def __init__(self, find: Callable[[Algorithm], Function], start: Start) -> None:
        """Store the arguments without finding anything.

        Args:
            find: returns the function or class of an algorithm. Another process can run only the function to which
                `call` refers. So if `find` is not `imported`, all functions run in threads.
            start: starts a unit of work in the place where jobs run.
        """
        self._find = find
        self._start = start
        self._executors: dict[str, Executor] = {}
        self._close_events: list[threading.Event] = []

    def of(self, algorithm: Algorithm) -> Executor:
        """Return the executor of an algorithm."""
        return self._executors[algorithm.name]

    def prepare(self, algorithms: Sequence[Algorithm], handles: Mapping[str, object]) -> None:
        """Find all functions, and start processes in parallel.

        Raises:
            CallError: if a function is missing, or a process cannot use a handle.
        """
        try:
            for algorithm in algorithms:
                self._executors[algorithm.name] = self._create_executor(algorithm, handles)
            for executor in self._executors.values():
                executor.await_ready()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the objects of perception classes, and end all processes."""
        for executor in self._executors.values():
            executor.hang_up()
        patience_s = CLOSE_S
        for close_event in self._close_events:
            patience_s = CLOSE_S if close_event.wait(patience_s) else 0.0
        for executor in self._executors.values():
            executor.close()

    def _create_executor(self, algorithm: Algorithm, handles: Mapping[str, object]) -> Executor:
        if algorithm.isolate == "process" and self._find is imported:
            check_handles(algorithm, handles)
            return ProcessExecutor(algorithm)
        return ThreadExecutor(algorithm, self._find(algorithm), self._begin)

    def _begin(self, run: Callable[[], None]) -> None:
        """Run a function in the place where jobs run."""
        close_event = threading.Event()
        self._close_events.append(close_event)

        def run_and_mark(_: Work) -> None:
            run()
            close_event.set()

        self._start(run_and_mark, lambda _: None)
