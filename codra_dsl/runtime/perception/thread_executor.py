"""Execute jobs in a thread of the program. A function in a thread can only end by itself."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from codra_dsl.isolation.error_text import described
from codra_dsl.isolation.function_host import FunctionHost
from codra_dsl.runtime.clock import Cancelled
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.perception.functions import Function, JobError
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.values.model import Algorithm

_LOGGER = logging.getLogger("codra_dsl.perception")

StartFunction = Callable[[Callable[[], None]], None]
"""The type of a function that runs another function in the place where jobs run."""


class ThreadExecutor:
    """Executes jobs by calling a function, or a method of an object."""

    def __init__(self, algorithm: Algorithm, function: Function, start_function: StartFunction) -> None:
        """Store the arguments without setting up anything.

        Args:
            algorithm: the algorithm.
            function: the function or class of the algorithm.
            start_function: runs `close` of an object in the place where jobs run.
        """
        self._algorithm = algorithm
        self._function_host = FunctionHost(function)
        self._start_function = start_function
        self._lock = new_lock()

    def perform(self, job: RunningJob, arguments: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return the function's return value. Before the first job, create the object of a class and set it up."""
        with self._lock:
            if not self._function_host.is_ready:
                try:
                    self._function_host.setup({**self._algorithm.parameters, **handles})
                except (Exception, SystemExit) as error:
                    raise JobError(f"setup: {described(error)}") from error
                if job.cancelled:
                    raise Cancelled
            return self._function_host.perceive(**arguments, **handles, job=job)

    def kill_job(self) -> None:
        """Do nothing: a thread can only end by itself."""

    def await_ready(self) -> None:
        """Do nothing: the function exists."""

    def begin_close(self) -> None:
        """Close the object, if there is one, once no job uses it."""
        if self._function_host.is_open:
            self._start_function(self._close)

    def close(self) -> None:
        """Do nothing: `Executors` waits until `close` of the object has ended."""

    def _close(self) -> None:
        with self._lock:
            try:
                self._function_host.close()
            except BaseException as error:  # noqa: BLE001 - errors of a user's class stay here
                _LOGGER.warning("perception %r: close: %s", self._algorithm.name, described(error))
