"""Let other threads call functions in one serving thread.

RAFCON runs each state in a thread of its own, and simulated time belongs to one thread. While a state waits for its
call, no other state of a hierarchy runs, so the order of calls is that of the state machine. Concurrent states are
refused in simulated time, because the operating system would determine the order of their calls.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast

Result = TypeVar("Result")


class _Call:
    """A call that the calling thread passes to the serving thread, which passes the result back."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._function = function
        self._done = threading.Event()
        self._result: Any = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """Call the function in this thread; its exception is raised in the calling thread."""
        try:
            self._result = self._function()
        except Exception as error:  # noqa: BLE001 - it is raised in the calling thread
            self._error = error
        except BaseException as error:
            self._error = RuntimeError(f"the run was interrupted: {type(error).__name__}")
            raise
        finally:
            self._done.set()

    def refuse(self) -> None:
        """End the call with an error, because it will not be served."""
        self._error = RuntimeError("calls are not served any more: the run is over")
        self._done.set()

    def wait_for_result(self) -> Any:
        """Wait, and return the result of the function, or raise its exception."""
        self._done.wait()
        if self._error is not None:
            raise self._error
        return self._result


class HandOver:
    """Lets other threads run functions in the thread that calls `serve`."""

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[_Call | None] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._is_open = True
        self._server_thread_id = -1

    def call(self, function: Callable[[], Result]) -> Result:
        """Run a function in the serving thread, and return its result or raise its exception.

        Raises:
            RuntimeError: if calls are not served any more.
        """
        if threading.get_ident() == self._server_thread_id:
            return function()
        call = _Call(function)
        with self._lock:
            if self._is_open:
                self._calls.put(call)
            else:
                call.refuse()
        return cast("Result", call.wait_for_result())

    def serve(self) -> None:
        """Run calls in this thread until `end` is called."""
        self._server_thread_id = threading.get_ident()
        while (call := self._calls.get()) is not None:
            call.run()

    def end(self) -> None:
        """Serve all earlier calls, and refuse later ones."""
        with self._lock:
            self._is_open = False
            self._calls.put(None)

    def refuse(self) -> None:
        """Refuse all calls that are not done yet, and later ones."""
        self.end()
        while (call := self._calls.get()) is not None:
            call.refuse()

    def proxy_of(self, handle: object) -> Any:
        """Return a handle whose methods run in the serving thread."""
        return _HandleProxy(handle, self)


class _HandleProxy:
    """A handle of the serving thread, for use in other threads."""

    def __init__(self, handle: object, hand_over: HandOver) -> None:
        self._handle = handle
        self._hand_over = hand_over

    def __getattr__(self, name: str) -> Any:
        attribute = self._hand_over.call(lambda: getattr(self._handle, name))
        if not callable(attribute):
            return attribute
        return lambda *values, **keywords: self._hand_over.call(lambda: attribute(*values, **keywords))
