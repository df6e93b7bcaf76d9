"""Jobs in a thread of the program: the function is called, and nothing can end it but itself."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping

from codra_dsl.isolation.messages import described
from codra_dsl.isolation.perceiver import Perceiver
from codra_dsl.runtime.clock import Cancelled
from codra_dsl.runtime.model import Algorithm
from codra_dsl.runtime.perception.calls import Function, ToldError
from codra_dsl.runtime.perception.job import RunningJob

_LOGGER = logging.getLogger("codra_dsl.perception")

Begin = Callable[[Callable[[], None]], None]
"""Runs something where jobs run."""


class Threaded:
    """Does jobs by calling a function, or the object of a class."""

    def __init__(self, algorithm: Algorithm, function: Function, begin: Begin) -> None:
        """Set up nothing yet.

        Args:
            algorithm: whose jobs they are.
            function: or class.
            begin: runs `close` where jobs run.
        """
        self._algorithm = algorithm
        self._perceiver = Perceiver(function)
        self._begin = begin
        self._turn = threading.Lock()

    def perform(self, job: RunningJob, given: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return what the function returns; set it up before, if it is the first job."""
        with self._turn:
            if not self._perceiver.is_ready:
                try:
                    self._perceiver.setup({**self._algorithm.parameters, **handles})
                except (Exception, SystemExit) as error:
                    raise ToldError(f"setup: {described(error)}") from error
                if job.cancelled:
                    raise Cancelled
            return self._perceiver.perceive(**given, **handles, job=job)

    def give_up(self) -> None:
        """Do nothing: a thread ends by itself, or not at all."""

    def await_ready(self) -> None:
        """Do nothing: the function is there."""

    def hang_up(self) -> None:
        """Close the object, if there is one, once no job is at work on it."""
        if self._perceiver.is_open:
            self._begin(self._close)

    def close(self) -> None:
        """Do nothing: whoever runs `close` waits for it."""

    def _close(self) -> None:
        with self._turn:
            try:
                self._perceiver.close()
            except BaseException as error:  # noqa: BLE001 - whatever a user's class raises stays here
                _LOGGER.warning("perception %r: close: %s", self._algorithm.name, described(error))
