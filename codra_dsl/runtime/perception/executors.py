"""The executors of a forest's algorithms: created when the forest is built, closed when the forest ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence

from codra_dsl.isolation.error_text import described, message_of
from codra_dsl.runtime.clock import Cancelled, Work, is_interrupt
from codra_dsl.runtime.perception.functions import Executor, Function, JobError, imported
from codra_dsl.runtime.perception.handles import check_handles
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.perception.outcome import Failure, Result, checked
from codra_dsl.runtime.perception.process_executor import ProcessExecutor
from codra_dsl.runtime.perception.thread_executor import ThreadExecutor
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

CLOSE_TIMEOUT_S = 1.0
"""How long the method `close` of a perception class may delay the end of the program."""

_MAX_MESSAGE_CHARACTERS = 2_000

StartWork = Callable[[Callable[[Work], None], Callable[[None], None]], Work]
"""The type of a function that starts a unit of work, as `Clock.start` does."""


class Executors:
    """Finds the function of each algorithm, and creates its executor."""

    def __init__(self, find_function: Callable[[Algorithm], Function], start_work: StartWork) -> None:
        """Store the arguments without finding anything.

        Args:
            find_function: returns the function or class of an algorithm. Another process can run only the function to
                which `call` refers. So if `find_function` is not `imported`, all functions run in threads.
            start_work: starts a unit of work in the place where jobs run.
        """
        self._find_function = find_function
        self._start_work = start_work
        self._executors: dict[str, Executor] = {}
        self._close_events: list[threading.Event] = []

    def executor_of(self, algorithm: Algorithm) -> Executor:
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

    def execute(
        self, algorithm: Algorithm, job: RunningJob, arguments: Mapping[str, object], handles: Mapping[str, object]
    ) -> Result | Failure:
        """Execute a job in the thread of this call, and return its checked outcome.

        Args:
            algorithm: the algorithm.
            job: the job.
            arguments: the values of context-variables that the function receives.
            handles: the handles of all resources.
        """
        all_arguments = {**algorithm.parameters, **arguments}
        own_handles = {name: handles[name] for name in algorithm.handles}
        try:
            return checked(algorithm, self.executor_of(algorithm).perform(job, all_arguments, own_handles))
        except Cancelled:
            return Failure(Reason.FAILED, "it ended because it was cancelled")
        except JobError as error:
            return Failure(Reason.FAILED, message_of(error, _MAX_MESSAGE_CHARACTERS))
        except BaseException as error:  # errors of a user's function must not reach the forest
            if is_interrupt(error):
                raise
            return Failure(Reason.FAILED, described(error))

    def close(self) -> None:
        """Close the objects of perception classes, and end all processes."""
        for executor in self._executors.values():
            executor.begin_close()
        timeout_s = CLOSE_TIMEOUT_S
        for close_event in self._close_events:
            timeout_s = CLOSE_TIMEOUT_S if close_event.wait(timeout_s) else 0.0
        for executor in self._executors.values():
            executor.close()

    def _create_executor(self, algorithm: Algorithm, handles: Mapping[str, object]) -> Executor:
        if algorithm.isolate == "process" and self._find_function is imported:
            check_handles(algorithm, handles)
            return ProcessExecutor(algorithm)
        return ThreadExecutor(algorithm, self._find_function(algorithm), self._start_function)

    def _start_function(self, function: Callable[[], None]) -> None:
        """Run a function in the place where jobs run."""
        close_event = threading.Event()
        self._close_events.append(close_event)

        def run_and_signal(_: Work) -> None:
            function()
            close_event.set()

        self._start_work(run_and_signal, lambda _: None)
