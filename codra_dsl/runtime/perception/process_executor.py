"""Execute jobs in a separate process, which can be ended, and whose memory is freed, regardless of the function."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import PurePath
from types import GeneratorType, ModuleType
from typing import Any

from codra_dsl.isolation.messages import GarbageError, decode_result, described
from codra_dsl.runtime.clock import Cancelled
from codra_dsl.runtime.perception.functions import CallError, JobError, absent
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.perception.process import Process
from codra_dsl.runtime.values.model import Algorithm

SETUP_S = 60.0
"""The time limit for importing a module and for `setup`; in simulated time, also for a job between two messages."""

_COPIED = (type(None), bool, int, float, complex, str, bytes, bytearray, list, tuple, dict, set, frozenset)
_ASKED_OF_JOBS = ("cancelled", "now_s", "sleep", "evidence")


class ProcessExecutor:
    """Executes jobs in a process that is reused from job to job, and replaced when it has ended."""

    def __init__(self, algorithm: Algorithm) -> None:
        """Start the process.

        Raises:
            CallError: if it cannot be started.
        """
        if algorithm.call.startswith("__main__:"):
            raise absent(algorithm, ", which its process cannot import: put it into a module")
        self._algorithm = algorithm
        self._is_imported = self._is_set_up = False
        self._is_closed = False
        self._given_names = frozenset(algorithm.given)
        self._performing: Process | None = None
        try:
            self._process: Process | None = self._started()
        except OSError as error:
            raise absent(algorithm, f": {described(error)}") from error

    def await_ready(self) -> None:
        """Wait until the process has imported the function.

        Raises:
            CallError: if it cannot import the function.
        """
        if self._process is not None:
            try:
                self._import(self._process)
            except JobError as error:
                raise absent(self._algorithm, error) from error

    def perform(self, job: RunningJob, given: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return the function's return value, reduced to the types that a decision can use."""
        try:
            process = self._usable()
        except OSError as error:
            raise JobError(f"its process cannot be started: {described(error)}") from error
        remote = {name: handle for name, handle in handles.items() if not is_copied(handle)}
        copied = {**given, **{name: handle for name, handle in handles.items() if name not in remote}}
        request = {"given": copied, "handles": list(remote), "index": job.index, "chance": job.chance}
        talk = _Talk(process, job, remote)
        try:
            self._prepare(
                talk, {**request, "given": {name: copied[name] for name in copied if name not in self._given_names}}
            )
            if job.cancelled:
                raise Cancelled
            self._performing = process
            return talk.result("perceive", request, max(SETUP_S, self._algorithm.timeout_s))
        except (JobError, Cancelled):
            raise
        except TimeoutError as error:  # in real time, the job's timeout would have ended it before
            self._drop(process)
            job.sleep(math.inf)
            raise JobError("its process no longer responds") from error
        except (EOFError, GarbageError, OSError) as error:
            raise self._lost(process, error) from error
        except BaseException:  # an interrupt of the program, in the middle of the exchange
            self._drop(process)
            raise
        finally:
            self._performing = None

    def give_up(self) -> None:
        """End the process, unless it is still being set up."""
        process = self._performing
        if process is not None:
            process.terminate()

    def hang_up(self) -> None:
        """Let the process end, without waiting for it."""
        self._is_closed = True
        process = self._process
        if process is not None:
            process.hang_up()

    def close(self) -> None:
        """Wait for the end of the process."""
        process, self._process = self._process, None
        if process is not None:
            process.ended()

    def _started(self) -> Process:
        self._is_imported = self._is_set_up = False
        return Process(self._algorithm.name, self._algorithm.call)

    def _usable(self) -> Process:
        """Return the process, or a new one if it has ended since its last job."""
        if self._process is None or (self._is_imported and not self._process.is_silent):
            if self._process is not None:
                self._drop(self._process)
            self._process = self._started()
        if self._is_closed:
            self._drop(self._process)
            raise Cancelled
        return self._process

    def _drop(self, process: Process) -> None:
        process.terminate()
        process.hang_up()
        process.leave()
        self._process = None

    def _lost(self, process: Process, error: Exception) -> JobError:
        """Return the error for a process with which communication is no longer possible."""
        if isinstance(error, GarbageError):
            self._drop(process)
            return JobError(str(error))
        self._process = None
        return JobError(f"its process {process.ended()}")

    def _import(self, process: Process) -> None:
        if self._is_imported:
            return
        talk = _Talk(process, None, {})
        try:
            kind, *details = talk.next_message(SETUP_S)
        except (TimeoutError, GarbageError) as error:
            self._drop(process)
            raise JobError(f": not imported within {SETUP_S:g} s") from error
        except (EOFError, OSError) as error:
            raise JobError(f": {self._lost(process, error)}") from error
        if kind != "here":
            self._drop(process)
            raise JobError("".join(str(detail)[:1000] for detail in details))
        self._is_imported = True

    def _prepare(self, talk: _Talk, request: Mapping[str, object]) -> None:
        try:
            self._import(talk.process)
        except JobError as error:
            raise JobError(f"calls {self._algorithm.call!r}{error}") from error
        if not self._is_set_up:
            talk.result("setup", request, SETUP_S)
            self._is_set_up = True


class _Talk:
    """The exchange of messages about one job: answers the requests of the process until it reports the outcome."""

    def __init__(self, process: Process, job: RunningJob | None, handles: Mapping[str, object]) -> None:
        self.process = process
        self._job = job
        self._handles = handles

    def next_message(self, limit_s: float) -> list[Any]:
        """Return the next message of the process."""
        self.process.connection.connection.settimeout(limit_s)
        return self.process.connection.receive_reply()

    def result(self, step: str, request: Mapping[str, object], limit_s: float) -> object:
        """Send a request to the process and return its result."""
        self.process.connection.connection.settimeout(limit_s)
        try:
            self.process.connection.send((step, request))
        except (TypeError, ValueError) as error:
            raise JobError(f"its arguments: {error}") from error
        while True:
            message = self.next_message(limit_s)
            match message:
                case ["ready"]:
                    return None
                case ["returned", encoded]:
                    return decode_result(encoded)
                case ["raised", str(text)]:
                    raise JobError(text[:1000])
                case ["cancelled"]:
                    raise Cancelled
                case _:
                    self._give(*self._answer(message))

    def _give(self, kind: str, content: object) -> None:
        try:
            self.process.connection.send((kind, content))
        except (TypeError, ValueError) as error:
            self.process.connection.send(("raised", type(error)(f"the content of the handle: {error}")))

    def _answer(self, request: list[Any]) -> tuple[str, object]:
        try:
            match request:
                case ["job", str(name), list(arguments)] if name in _ASKED_OF_JOBS:
                    attribute = getattr(self._job, name)
                    return "value", attribute(*arguments) if callable(attribute) else attribute
                case ["get", list(path)]:
                    return self._attribute(path)
                case ["call", list(path), list(arguments), dict(named)]:
                    return "value", self._resolved(path)(*arguments, **named)
                case _:
                    raise GarbageError("its process sent an unknown request")
        except (Cancelled, GarbageError) as error:
            if isinstance(error, GarbageError):
                raise
            return "cancelled", None
        except Exception as error:  # noqa: BLE001 - the caller of a handle gets its error
            return "raised", _copyable(error)

    def _attribute(self, path: list[Any]) -> tuple[str, object]:
        """Return a copy of an attribute of a handle, or a reference if the attribute cannot be copied."""
        value = self._resolved(path)
        if callable(value) or not (is_copied(value) or _can_be_copied(value)):
            return "remote", None
        return "value", value

    def _resolved(self, path: list[Any]) -> Any:
        if not path or path[0] not in self._handles:
            raise GarbageError("its process asked for a handle that it does not have")
        resolved: Any = self._handles[path[0]]
        for name in path[1:]:
            if not isinstance(name, str) or name.startswith("_"):
                raise GarbageError("its process asked for a private attribute of a handle")
            resolved = getattr(resolved, name)
        return resolved


def check_handles(algorithm: Algorithm, handles: Mapping[str, object]) -> None:
    """Raise an error for a handle that a process can neither copy nor call.

    Raises:
        CallError: if there is such a handle.
    """
    for name in algorithm.handles:
        handle = handles[name]
        if is_copied(handle) and not _can_be_copied(handle):
            why = f"is a {type(handle).__name__} whose content cannot be copied: give an object with a method instead"
        elif isinstance(handle, (type, ModuleType, GeneratorType)):
            why = f"is a {type(handle).__name__}: give an object with methods, or let `call` name a class with `setup`"
        elif not is_copied(handle) and not callable(handle) and not _offers(dir(handle)):
            why = f"is a {type(handle).__name__} without methods: give an object with one"
        else:
            continue
        where = f"perception {algorithm.name!r} runs in a separate process"
        raise CallError(f"{where}, which cannot use handle {name!r}: it {why}")


def is_copied(handle: object) -> bool:
    """Return whether a process gets a copy of a handle, because the handle is a plain value."""
    is_array = type(handle).__module__.partition(".")[0] == "numpy"
    return is_array or type(handle) in _COPIED or isinstance(handle, (Enum, PurePath))


def _can_be_copied(value: object) -> bool:
    try:
        pickle.dumps(value, protocol=5)
    except Exception:  # noqa: BLE001 - for any reason
        return False
    return True


def _offers(names: Iterable[str]) -> bool:
    return any(not name.startswith("_") for name in names)


def _copyable(error: Exception) -> Exception:
    """Return an error as a process can raise it."""
    try:
        copied = pickle.loads(pickle.dumps(error))
        return error if type(copied) is type(error) else RuntimeError(described(error))
    except Exception:  # noqa: BLE001 - an error with arguments of its own
        return RuntimeError(described(error))
