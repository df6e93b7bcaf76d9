"""The executors of the algorithms of a forest: created when the forest is built, closed at its end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence

from codra_dsl.runtime.clock import Work
from codra_dsl.runtime.perception.functions import Executor, Function, imported
from codra_dsl.runtime.perception.process_executor import ProcessExecutor, check_handles
from codra_dsl.runtime.perception.thread_executor import ThreadExecutor
from codra_dsl.runtime.values.model import Algorithm

CLOSE_S = 1.0
"""How long `close` of a class may delay the end of the program."""

Start = Callable[[Callable[[Work], None], Callable[[None], None]], Work]
"""Starts a unit of work, like `Clock.start`."""


class Executors:
    """Finds the function of each algorithm, and creates its executor."""

    def __init__(self, find: Callable[[Algorithm], Function], start: Start) -> None:
        """Store the arguments without finding anything.

        Args:
            find: returns the function, or class, of an algorithm. Only the function that `call` names can run in
                another process, so functions of a `find` other than `imported` run in threads.
            start: starts a unit of work where jobs run.
        """
        self._find = find
        self._start = start
        self._executors: dict[str, Executor] = {}
        self._closing: list[threading.Event] = []

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
                self._executors[algorithm.name] = self._executor(algorithm, handles)
            for executor in self._executors.values():
                executor.await_ready()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the objects of classes, and end all processes."""
        for executor in self._executors.values():
            executor.hang_up()
        patience_s = CLOSE_S
        for closed in self._closing:
            patience_s = CLOSE_S if closed.wait(patience_s) else 0.0
        for executor in self._executors.values():
            executor.close()

    def _executor(self, algorithm: Algorithm, handles: Mapping[str, object]) -> Executor:
        if algorithm.isolate == "process" and self._find is imported:
            check_handles(algorithm, handles)
            return ProcessExecutor(algorithm)
        return ThreadExecutor(algorithm, self._find(algorithm), self._begin)

    def _begin(self, run: Callable[[], None]) -> None:
        """Run a function where jobs run."""
        closed = threading.Event()
        self._closing.append(closed)

        def body(_: Work) -> None:
            run()
            closed.set()

        self._start(body, _ignore)


def _ignore(_: object) -> None:
    pass
