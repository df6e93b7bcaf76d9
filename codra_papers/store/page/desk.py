"""Where other threads ask for what must be done in the thread of the simulation, in which alone its time passes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from queue import Empty, Full, Queue
from threading import Lock
from typing import Any, TypeVar

ResultT = TypeVar("ResultT")

MOST_WAITING = 64
"""More than so many acts do not wait: who asks is told."""


class BusyError(RuntimeError):
    """Nobody serves the desk any more, or too many are waiting there."""


class Desk:
    """Acts wait here until the simulation comes by."""

    def __init__(self) -> None:
        """Open the desk."""
        self._waiting: Queue[tuple[Future[Any], Callable[[], Any]]] = Queue(MOST_WAITING)
        self._lock = Lock()
        self._is_open = True

    def ask(self, act: Callable[[], ResultT]) -> Future[ResultT]:
        """Let something be done; the future has what came of it, or what it raised. May be called from any thread.

        Raises:
            BusyError: if too many are waiting, or nobody comes by any more.
        """
        future: Future[ResultT] = Future()
        with self._lock:
            if not self._is_open:
                raise BusyError("the run is over")
            try:
                self._waiting.put_nowait((future, act))
            except Full:
                raise BusyError("too many are asking at once; try again") from None
        return future

    def serve(self) -> None:
        """Do what waits. The simulation calls it, in an event."""
        for _ in range(self._waiting.qsize()):
            future, act = self._waiting.get_nowait()
            if future.set_running_or_notify_cancel():
                try:
                    result = act()
                except Exception as error:  # noqa: BLE001 - it belongs to who asked
                    future.set_exception(error)
                else:
                    future.set_result(result)

    def close(self) -> None:
        """Do nothing more: who waits is told."""
        with self._lock:
            self._is_open = False
        while True:
            try:
                future, _ = self._waiting.get_nowait()
            except Empty:
                return
            if future.set_running_or_notify_cancel():
                future.set_exception(BusyError("the run is over"))
