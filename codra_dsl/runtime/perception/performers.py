"""What does the jobs of each algorithm of a forest: made when it is built, closed in the end."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence

from codra_dsl.runtime.clock import Work
from codra_dsl.runtime.model import Algorithm
from codra_dsl.runtime.perception.calls import Function, Performer, imported
from codra_dsl.runtime.perception.isolated import Isolated, check_handles
from codra_dsl.runtime.perception.threaded import Threaded

CLOSE_S = 1.0
"""How long `close` of a class may hold up the end of the program."""

Start = Callable[[Callable[[Work], None], Callable[[None], None]], Work]
"""Starts a piece of work, as a clock does."""


class Performers:
    """Finds the function of each algorithm, and the place where it runs."""

    def __init__(self, find: Callable[[Algorithm], Function], start: Start) -> None:
        """Find nothing yet.

        Args:
            find: returns the function, or class, of an algorithm. Only what `call` names can run in another process, so
                what another `find` returns runs in threads.
            start: starts a piece of work where jobs run.
        """
        self._find = find
        self._start = start
        self._performers: dict[str, Performer] = {}
        self._closing: list[threading.Event] = []

    def of(self, algorithm: Algorithm) -> Performer:
        """Return what does the jobs of an algorithm."""
        return self._performers[algorithm.name]

    def prepare(self, algorithms: Sequence[Algorithm], handles: Mapping[str, object]) -> None:
        """Find all functions; processes start together.

        Raises:
            CallError: if one is missing, or a process can do nothing with a handle.
        """
        try:
            for algorithm in algorithms:
                self._performers[algorithm.name] = self._performer(algorithm, handles)
            for performer in self._performers.values():
                performer.await_ready()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let all end: classes are closed, processes ended."""
        for performer in self._performers.values():
            performer.hang_up()
        patience_s = CLOSE_S
        for closed in self._closing:
            patience_s = CLOSE_S if closed.wait(patience_s) else 0.0
        for performer in self._performers.values():
            performer.close()

    def _performer(self, algorithm: Algorithm, handles: Mapping[str, object]) -> Performer:
        if algorithm.isolate == "process" and self._find is imported:
            check_handles(algorithm, handles)
            return Isolated(algorithm)
        return Threaded(algorithm, self._find(algorithm), self._begin)

    def _begin(self, run: Callable[[], None]) -> None:
        """Run something where jobs run."""
        closed = threading.Event()
        self._closing.append(closed)

        def body(_: Work) -> None:
            run()
            closed.set()

        self._start(body, _nothing)


def _nothing(_: object) -> None:
    pass
