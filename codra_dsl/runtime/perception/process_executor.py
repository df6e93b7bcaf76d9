"""Execute jobs in a separate process, which can always be ended, and whose memory is then freed."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from typing import Any

from codra_dsl.isolation.error_text import described
from codra_dsl.isolation.messages import GarbageError, decode_result
from codra_dsl.runtime.clock import Cancelled
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.perception.functions import JobError, call_error
from codra_dsl.runtime.perception.handles import has_method, is_copied, method_of, value_of
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.perception.process import Process
from codra_dsl.runtime.values.model import Algorithm

SETUP_TIMEOUT_S = 60.0
"""The time limit for the import of a module and for `setup`.

In simulated time, a job may also take this long between two messages, or longer if its timeout is longer.
"""

_JOB_MEMBERS = ("cancelled", "now_s", "sleep", "evidence")


class ProcessExecutor:
    """Executes jobs in a process. All jobs use the same process; if it has ended, the next job starts a new process."""

    def __init__(self, algorithm: Algorithm) -> None:
        """Start the process.

        Raises:
            CallError: if the process cannot be started.
        """
        if algorithm.call.startswith("__main__:"):
            raise call_error(algorithm, ", which its process cannot import: put the function into a module")
        self._algorithm = algorithm
        self._is_imported = self._is_set_up = False
        self._is_closed = False
        self._lock = new_lock()
        self._context_argument_names = frozenset(algorithm.given)
        self._working_process: Process | None = None
        try:
            self._process: Process | None = self._start_process()
        except OSError as error:
            raise call_error(algorithm, f": {described(error)}") from error

    def await_ready(self) -> None:
        """Wait until the process has imported the function.

        Raises:
            CallError: if the process cannot import the function.
        """
        if self._process is not None:
            try:
                self._await_import(self._process)
            except JobError as error:
                raise call_error(self._algorithm, error) from error

    def perform(self, job: RunningJob, arguments: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return the function's return value, reduced to the types that a decision can use.

        On a host, a job of a lost connection may still be running; the next job waits for its end.
        """
        with self._lock:
            return self._perform(job, arguments, handles)

    def kill_job(self) -> None:
        """End the process, unless it is still executing `setup`."""
        process = self._working_process
        if process is not None:
            process.terminate()
            process.wait_for_end_in_background()  # if nothing ends the process, this closes the connection to it

    def begin_close(self) -> None:
        """Let the process end, without waiting for it."""
        self._is_closed = True
        process = self._process
        if process is not None:
            process.hang_up()

    def close(self) -> None:
        """Wait for the end of the process."""
        process, self._process = self._process, None
        if process is not None:
            process.wait_for_end()

    def _perform(self, job: RunningJob, arguments: Mapping[str, object], handles: Mapping[str, object]) -> object:
        try:
            process = self._usable_process()
        except OSError as error:
            raise JobError(f"its process cannot be started: {described(error)}") from error
        remote_handles = {name: handle for name, handle in handles.items() if not is_copied(handle)}
        copied_values = {
            **arguments,
            **{name: handle for name, handle in handles.items() if name not in remote_handles},
        }
        request = {
            "arguments": copied_values,
            "handles": list(remote_handles),
            "index": job.index,
            "random_seed": job.random_seed,
        }
        exchange = _Exchange(process, job, remote_handles)
        try:
            setup_values = {
                name: copied_values[name] for name in copied_values if name not in self._context_argument_names
            }
            self._set_up(exchange, {**request, "arguments": setup_values})
            if job.cancelled:
                raise Cancelled
            self._working_process = process
            return exchange.request_result("perceive", request, max(SETUP_TIMEOUT_S, self._algorithm.timeout_s))
        except (JobError, Cancelled):
            raise
        except TimeoutError as error:  # only in simulated time: in real time, the job's timeout comes first
            self._drop_process(process)
            job.sleep(math.inf)
            raise JobError("its process no longer responds") from error
        except (EOFError, GarbageError, OSError) as error:
            raise self._communication_error(process, error) from error
        except BaseException:  # an interrupt of the program, in the middle of the exchange
            self._drop_process(process)
            raise
        finally:
            self._working_process = None

    def _start_process(self) -> Process:
        self._is_imported = self._is_set_up = False
        return Process(self._algorithm.name, self._algorithm.call)

    def _usable_process(self) -> Process:
        """Return the process, or a new one if it has ended since its last job."""
        if self._process is None or (self._is_imported and not self._process.is_idle):
            if self._process is not None:
                self._drop_process(self._process)
            self._process = self._start_process()
        if self._is_closed:
            self._drop_process(self._process)
            raise Cancelled
        return self._process

    def _drop_process(self, process: Process) -> None:
        process.terminate()
        process.hang_up()
        process.wait_for_end_in_background()
        self._process = None

    def _communication_error(self, process: Process, error: Exception) -> JobError:
        """Return the error of a job whose process can no longer communicate with the program."""
        if isinstance(error, GarbageError):
            self._drop_process(process)
            return JobError(str(error))
        self._process = None
        return JobError(f"its process {process.wait_for_end()}")

    def _await_import(self, process: Process) -> None:
        if self._is_imported:
            return
        exchange = _Exchange(process, None, {})
        try:
            kind, *details = exchange.receive_message(SETUP_TIMEOUT_S)
        except (TimeoutError, GarbageError) as error:
            self._drop_process(process)
            raise JobError(f": not imported within {SETUP_TIMEOUT_S:g} s") from error
        except (EOFError, OSError) as error:
            raise JobError(f": {self._communication_error(process, error)}") from error
        if kind != "here":
            self._drop_process(process)
            raise JobError("".join(str(detail)[:1000] for detail in details))
        self._is_imported = True

    def _set_up(self, exchange: _Exchange, request: Mapping[str, object]) -> None:
        try:
            self._await_import(exchange.process)
        except JobError as error:
            raise JobError(f"calls {self._algorithm.call!r}{error}") from error
        if not self._is_set_up:
            exchange.request_result("setup", request, SETUP_TIMEOUT_S)
            self._is_set_up = True


class _Exchange:
    """The exchange of messages about one job. The requests of the process are answered until the outcome arrives."""

    def __init__(self, process: Process, job: RunningJob | None, handles: Mapping[str, object]) -> None:
        self.process = process
        self._job = job
        self._handles = handles

    def receive_message(self, timeout_s: float) -> list[Any]:
        """Return the next message of the process."""
        self.process.connection.socket.settimeout(timeout_s)
        return self.process.connection.receive_json()

    def request_result(self, method: str, request: Mapping[str, object], timeout_s: float) -> object:
        """Send a request to the process and return its result."""
        self.process.connection.socket.settimeout(timeout_s)
        try:
            self.process.connection.send_pickle((method, request))
        except (TypeError, ValueError) as error:
            raise JobError(f"its arguments: {error}") from error
        while True:
            message = self.receive_message(timeout_s)
            match message:
                case ["ready"]:
                    return None
                case ["returned", encoded_result]:
                    return decode_result(encoded_result)
                case ["raised", str(text)]:
                    raise JobError(text[:1000])
                case ["cancelled"]:
                    raise Cancelled
                case _:
                    self._send_answer(*self._answer_request(message))

    def _send_answer(self, kind: str, content: object) -> None:
        try:
            self.process.connection.send_pickle((kind, content))
        except (TypeError, ValueError) as error:
            self.process.connection.send_pickle(("raised", type(error)(f"the content of the handle: {error}")))

    def _answer_request(self, request: list[Any]) -> tuple[str, object]:
        try:
            match request:
                case ["job", str(name), list(arguments)] if name in _JOB_MEMBERS:
                    attribute = getattr(self._job, name)
                    return "value", attribute(*arguments) if callable(attribute) else attribute
                case ["get", str(handle_name), str(name)]:
                    handle = self._public_handle(handle_name, name)
                    is_method = has_method(handle, name)
                    return ("method", None) if is_method else ("value", value_of(handle_name, handle, name))
                case ["call", str(handle_name), str() | None as name, list(arguments), dict(keyword_arguments)]:
                    method = method_of(handle_name, self._public_handle(handle_name, name), name)
                    return "value", method(*arguments, **keyword_arguments)
                case _:
                    raise GarbageError("its process sent an unknown request")
        except (Cancelled, GarbageError) as error:
            if isinstance(error, GarbageError):
                raise
            return "cancelled", None
        except Exception as error:  # noqa: BLE001 - the caller of a handle gets its error
            return "raised", _copyable_error(error)

    def _public_handle(self, handle_name: str, member: str | None) -> object:
        """Return a handle whose member is requested."""
        if handle_name not in self._handles:
            raise GarbageError("its process asked for a handle that it does not have")
        if member is not None and member.startswith("_"):
            raise GarbageError("its process asked for a private attribute of a handle")
        return self._handles[handle_name]


def _copyable_error(error: Exception) -> Exception:
    """Return an error that a process can raise: the error itself or, if it cannot be copied, an error with its text."""
    try:
        copied_error = pickle.loads(pickle.dumps(error))
        return error if type(copied_error) is type(error) else RuntimeError(described(error))
    except BaseException:  # noqa: BLE001 - an error with arguments of its own, or one that raises when it is pickled
        return RuntimeError(described(error))
