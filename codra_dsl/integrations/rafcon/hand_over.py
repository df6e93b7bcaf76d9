"""One thread at a time: calls of other threads are run by the one that serves them.

RAFCON runs each state in a thread of its own, and simulated time belongs to one thread. While a state waits for its
call, nothing else of a hierarchy runs, so the order of calls is that of the state machine.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

Result = TypeVar("Result")


class _Call:
    """A call, from the thread that asks for it to the one that runs it and back."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._function = function
        self._done = threading.Event()
        self._result: Any = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """Call the function in this thread; what it raises is raised where it was asked for."""
        try:
            self._result = self._function()
        except Exception as error:  # noqa: BLE001 - it is raised in the thread that asked
            self._error = error
        except BaseException as error:
            self._error = RuntimeError(f"the run was interrupted: {type(error).__name__}")
            raise
        finally:
            self._done.set()

    def refuse(self) -> None:
        """Let who asked know that nobody will call it."""
        self._error = RuntimeError("nobody serves calls any more: the run is over")
        self._done.set()

    def result(self) -> Any:
        """Wait, and return what the function returned, or raise what it raised."""
        self._done.wait()
        if self._error is not None:
            raise self._error
        return self._result


class HandOver:
    """Lets other threads run functions in the one that calls `serve`."""

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[_Call | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._is_open = True
        self._server = -1

    def call(self, function: Callable[[], Result]) -> Result:
        """Return what a function returns, or raise what it raises, when it was run by the thread that serves.

        Raises:
            RuntimeError: if nobody serves any more.
        """
        if threading.get_ident() == self._server:
            return function()
        call = _Call(function)
        with self._lock:
            if self._is_open:
                self._calls.put(call)
            else:
                call.refuse()
        return cast("Result", call.result())

    def serve(self) -> None:
        """Run calls in this thread until `end` is called."""
        self._server = threading.get_ident()
        while (call := self._calls.get()) is not None:
            call.run()

    def end(self) -> None:
        """Serve what was asked so far, and refuse what is asked from now on."""
        with self._lock:
            self._is_open = False
            self._calls.put(None)

    def refuse(self) -> None:
        """Refuse what was asked and is not done, and what is asked from now on."""
        self.end()
        while (call := self._calls.get()) is not None:
            call.refuse()

    def of(self, handle: object) -> Any:
        """Return a handle whose methods are run by the thread that serves."""
        return _Handed(handle, self)


class _Handed:
    """A handle of one thread, for others."""

    def __init__(self, handle: object, hand_over: HandOver) -> None:
        self._handle = handle
        self._hand_over = hand_over

    def __getattr__(self, name: str) -> Any:
        attribute = self._hand_over.call(lambda: getattr(self._handle, name))
        if not callable(attribute):
            return attribute
        return lambda *values, **named: self._hand_over.call(lambda: attribute(*values, **named))
