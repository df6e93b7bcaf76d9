"""A queue of calls from other threads to the thread of the simulation.

The simulation runs the calls between two of its events, and browsers wait for the results. So simulated time passes in
only one thread, and a run with a page replays like any other run.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty, Full, Queue
from threading import Lock
from typing import Any, TypeVar

ResultT = TypeVar("ResultT")

MOST_WAITING = 64
"""The largest number of waiting calls. Further calls get an error."""


class BusyError(RuntimeError):
    """The desk is closed, or too many calls are waiting."""


class Desk:
    """A queue of calls that the simulation runs in `serve`."""

    def __init__(self) -> None:
        """Open the desk."""
        self._waiting_calls: Queue[tuple[Future[Any], Callable[[], Any]]] = Queue(MOST_WAITING)
        self._lock = Lock()
        self._is_open = True

    def ask(self, call: Callable[[], ResultT]) -> Future[ResultT]:
        """Add a call to the queue. The future gets the result or the exception of the call.

        Any thread may call this method.

        Raises:
            BusyError: too many calls are waiting, or the desk is closed.
        """
        future: Future[ResultT] = Future()
        with self._lock:
            if not self._is_open:
                raise BusyError("the run is over")
            try:
                self._waiting_calls.put_nowait((future, call))
            except Full:
                raise BusyError("too many requests are waiting; try again") from None
        return future

    def serve(self) -> None:
        """Run the waiting calls. The simulation calls this in an event."""
        for _ in range(self._waiting_calls.qsize()):
            future, call = self._waiting_calls.get_nowait()
            if future.set_running_or_notify_cancel():
                try:
                    result = call()
                except Exception as error:  # noqa: BLE001 - the caller of `ask` gets it
                    future.set_exception(error)
                else:
                    future.set_result(result)

    def close(self) -> None:
        """Close the desk: the waiting calls get an error."""
        with self._lock:
            self._is_open = False
        while True:
            try:
                future, _ = self._waiting_calls.get_nowait()
            except Empty:
                return
            if future.set_running_or_notify_cancel():
                future.set_exception(BusyError("the run is over"))
