"""Execute jobs in a separate process: whatever the function does, the process can be ended, and its memory is freed."""

from __future__ import annotations

import math
import pickle
from collections.abc import Mapping
from enum import Enum
from pathlib import PurePath
from types import GeneratorType, ModuleType
from typing import Any

from codra_dsl.isolation.messages import GarbageError, decode_result, described
from codra_dsl.runtime.clock import Cancelled
from codra_dsl.runtime.perception.functions import CallError, JobError, call_error
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.perception.process import Process
from codra_dsl.runtime.values.model import Algorithm

SETUP_TIMEOUT_S = 60.0
"""The time limit for the import of a module and for `setup`.

In simulated time, a job may also take this long between two messages, or longer if its timeout is longer.
"""

_COPIED_TYPES = (type(None), bool, int, float, complex, str, bytes, bytearray, list, tuple, dict, set, frozenset)
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
        """Return the function's return value, reduced to the types that a decision can use."""
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

    def kill_job(self) -> None:
        """End the process, unless it is still executing `setup`."""
        process = self._working_process
        if process is not None:
            process.terminate()

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
                case ["get", list(path)]:
                    return self._attribute_answer(path)
                case ["call", list(path), list(arguments), dict(keyword_arguments)]:
                    return "value", self._resolve_path(path)(*arguments, **keyword_arguments)
                case _:
                    raise GarbageError("its process sent an unknown request")
        except (Cancelled, GarbageError) as error:
            if isinstance(error, GarbageError):
                raise
            return "cancelled", None
        except Exception as error:  # noqa: BLE001 - the caller of a handle gets its error
            return "raised", _copyable_error(error)

    def _attribute_answer(self, path: list[Any]) -> tuple[str, object]:
        """Return a copy of an attribute of a handle, or a reference if the attribute cannot be copied."""
        value = self._resolve_path(path)
        if callable(value) or not (is_copied(value) or _can_be_copied(value)):
            return "remote", None
        return "value", value

    def _resolve_path(self, path: list[Any]) -> Any:
        if not path or path[0] not in self._handles:
            raise GarbageError("its process asked for a handle that it does not have")
        value: Any = self._handles[path[0]]
        for name in path[1:]:
            if not isinstance(name, str) or name.startswith("_"):
                raise GarbageError("its process asked for a private attribute of a handle")
            value = getattr(value, name)
        return value


def check_handles(algorithm: Algorithm, handles: Mapping[str, object]) -> None:
    """Raise an error for a handle that can neither be copied to a process nor be called from there.

    Raises:
        CallError: if there is such a handle.
    """
    for name in algorithm.handles:
        handle = handles[name]
        if is_copied(handle) and not _can_be_copied(handle):
            problem = (
                f"is a {type(handle).__name__} whose content cannot be copied: give an object with a method instead"
            )
        elif isinstance(handle, (type, ModuleType, GeneratorType)):
            problem = (
                f"is a {type(handle).__name__}: give an object with methods, or let `call` name a class with `setup`"
            )
        elif not is_copied(handle) and not callable(handle) and all(member.startswith("_") for member in dir(handle)):
            problem = f"is a {type(handle).__name__} without methods: give an object with a method"
        else:
            continue
        process_text = f"perception {algorithm.name!r} runs in a separate process"
        raise CallError(f"{process_text}, which cannot use handle {name!r}: it {problem}")


def is_copied(handle: object) -> bool:
    """Return whether a process gets a copy of a handle, because the handle is a plain value."""
    is_array = type(handle).__module__.partition(".")[0] == "numpy"
    return is_array or type(handle) in _COPIED_TYPES or isinstance(handle, (Enum, PurePath))


def _can_be_copied(value: object) -> bool:
    try:
        pickle.dumps(value, protocol=5)
    except Exception:  # noqa: BLE001 - for any reason
        return False
    return True


def _copyable_error(error: Exception) -> Exception:
    """Return an error that a process can raise: the error itself or, if it cannot be copied, an error with its text."""
    try:
        copied_error = pickle.loads(pickle.dumps(error))
        return error if type(copied_error) is type(error) else RuntimeError(described(error))
    except Exception:  # noqa: BLE001 - an error with arguments of its own
        return RuntimeError(described(error))
