"""Jobs in a process of its own: whatever the function does, the process can be ended, and its memory returns."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import PurePath
from types import GeneratorType, ModuleType
from typing import Any

from codra_dsl.isolation.messages import GarbageError, described, heard_result
from codra_dsl.runtime.clock import Cancelled
from codra_dsl.runtime.model import Algorithm
from codra_dsl.runtime.perception.calls import CallError, ToldError, absent
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.perception.process import Process

SETUP_S = 60.0
"""How long importing a module, or `setup`, may take; and, where time is simulated, how long a job may say nothing."""

_COPIED = (type(None), bool, int, float, complex, str, bytes, bytearray, list, tuple, dict, set, frozenset)
_ASKED_OF_JOBS = ("cancelled", "now_s", "sleep", "evidence")


class Isolated:
    """Does jobs in a process that stays from one job to the next, and is replaced when it has ended."""

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
        self._told = frozenset(algorithm.given)
        self._performing: Process | None = None
        try:
            self._process: Process | None = self._started()
        except OSError as error:
            raise absent(algorithm, f": {described(error)}") from error

    def await_ready(self) -> None:
        """Wait until the process has imported the function.

        Raises:
            CallError: if there is none.
        """
        if self._process is not None:
            try:
                self._import(self._process)
            except ToldError as error:
                raise absent(self._algorithm, error) from error

    def perform(self, job: RunningJob, given: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return what the function returns, as far as a decision could need it."""
        try:
            process = self._usable()
        except OSError as error:
            raise ToldError(f"its process cannot be started: {described(error)}") from error
        remote = {name: handle for name, handle in handles.items() if not is_copied(handle)}
        copied = {**given, **{name: handle for name, handle in handles.items() if name not in remote}}
        asked = {"given": copied, "handles": list(remote), "index": job.index, "chance": job.chance}
        talk = _Talk(process, job, remote)
        try:
            self._prepare(talk, {**asked, "given": {name: copied[name] for name in copied if name not in self._told}})
            if job.cancelled:
                raise Cancelled
            self._performing = process
            return talk.result("perceive", asked, max(SETUP_S, self._algorithm.timeout_s))
        except (ToldError, Cancelled):
            raise
        except TimeoutError as error:  # only simulated time is too patient to have ended it before
            self._drop(process)
            job.sleep(math.inf)
            raise ToldError("its process says nothing any more") from error
        except (EOFError, GarbageError, OSError) as error:
            raise self._lost(process, error) from error
        except BaseException:  # an interrupt of the program, in the midst of the conversation
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

    # Within

    def _started(self) -> Process:
        self._is_imported = self._is_set_up = False
        return Process(self._algorithm.name, self._algorithm.call)

    def _usable(self) -> Process:
        """Return the process, or another if it has ended since its last job."""
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

    def _lost(self, process: Process, error: Exception) -> ToldError:
        """Return what to tell about a process with which no conversation is possible any more."""
        if isinstance(error, GarbageError):
            self._drop(process)
            return ToldError(str(error))
        self._process = None
        return ToldError(f"its process {process.ended()}")

    def _import(self, process: Process) -> None:
        if self._is_imported:
            return
        talk = _Talk(process, None, {})
        try:
            kind, *details = talk.heard(SETUP_S)
        except (TimeoutError, GarbageError) as error:
            self._drop(process)
            raise ToldError(f": not imported within {SETUP_S:g} s") from error
        except (EOFError, OSError) as error:
            raise ToldError(f": {self._lost(process, error)}") from error
        if kind != "here":
            self._drop(process)
            raise ToldError("".join(str(detail)[:1000] for detail in details))
        self._is_imported = True

    def _prepare(self, talk: _Talk, asked: Mapping[str, object]) -> None:
        try:
            self._import(talk.process)
        except ToldError as error:
            raise ToldError(f"calls {self._algorithm.call!r}{error}") from error
        if not self._is_set_up:
            talk.result("setup", asked, SETUP_S)
            self._is_set_up = True


class _Talk:
    """A conversation about one job: what the process asks is answered until it tells the outcome."""

    def __init__(self, process: Process, job: RunningJob | None, handles: Mapping[str, object]) -> None:
        self.process = process
        self._job = job
        self._handles = handles

    def heard(self, limit_s: float) -> list[Any]:
        """Return what the process says next."""
        self.process.line.connection.settimeout(limit_s)
        return self.process.line.hear()

    def result(self, what: str, asked: Mapping[str, object], limit_s: float) -> object:
        """Let the process do something and return what came of it."""
        self.process.line.connection.settimeout(limit_s)
        try:
            self.process.line.give((what, asked))
        except (TypeError, ValueError) as error:
            raise ToldError(f"what it is given {error}") from error
        while True:
            message = self.heard(limit_s)
            match message:
                case ["ready"]:
                    return None
                case ["returned", told]:
                    return heard_result(told)
                case ["raised", str(text)]:
                    raise ToldError(text[:1000])
                case ["cancelled"]:
                    raise Cancelled
                case _:
                    self._give(*self._answer(message))

    def _give(self, kind: str, content: object) -> None:
        try:
            self.process.line.give((kind, content))
        except (TypeError, ValueError) as error:
            self.process.line.give(("raised", type(error)(f"what the handle holds {error}")))

    def _answer(self, question: list[Any]) -> tuple[str, object]:
        try:
            match question:
                case ["job", str(name), list(arguments)] if name in _ASKED_OF_JOBS:
                    asked = getattr(self._job, name)
                    return "value", asked(*arguments) if callable(asked) else asked
                case ["get", list(path)]:
                    return self._attribute(path)
                case ["call", list(path), list(arguments), dict(named)]:
                    return "value", self._found(path)(*arguments, **named)
                case _:
                    raise GarbageError("its process asked what no process asks")
        except (Cancelled, GarbageError) as error:
            if isinstance(error, GarbageError):
                raise
            return "cancelled", None
        except Exception as error:  # noqa: BLE001 - a handle's error is its caller's
            return "raised", _copyable(error)

    def _attribute(self, path: list[Any]) -> tuple[str, object]:
        """Return a copy of an attribute of a handle; what cannot be copied is asked in turn."""
        value = self._found(path)
        if callable(value) or not (is_copied(value) or _can_be_copied(value)):
            return "remote", None
        return "value", value

    def _found(self, path: list[Any]) -> Any:
        if not path or path[0] not in self._handles:
            raise GarbageError("its process asked for what is no handle of it")
        found: Any = self._handles[path[0]]
        for name in path[1:]:
            if not isinstance(name, str) or name.startswith("_"):
                raise GarbageError("its process asked for what is hidden")
            found = getattr(found, name)
        return found


def check_handles(algorithm: Algorithm, handles: Mapping[str, object]) -> None:
    """Refuse handles that a process can neither copy nor ask.

    Raises:
        CallError: if there is one.
    """
    for name in algorithm.handles:
        handle = handles[name]
        if is_copied(handle) and not _can_be_copied(handle):
            why = f"holds a {type(handle).__name__} of what cannot be copied: give an object with a method instead"
        elif isinstance(handle, (type, ModuleType, GeneratorType)):
            why = f"is a {type(handle).__name__}: give an object with methods, or let `call` name a class with `setup`"
        elif not is_copied(handle) and not callable(handle) and not _offers(dir(handle)):
            why = f"is a {type(handle).__name__} without methods: give an object with one"
        else:
            continue
        where = f"perception {algorithm.name!r} runs in a process of its own"
        raise CallError(f"{where}, where {name!r} is of no use: it {why}")


def is_copied(handle: object) -> bool:
    """Return whether a handle is a plain value, which a process gets a copy of, and no object that it asks."""
    is_array = type(handle).__module__.partition(".")[0] == "numpy"
    return is_array or type(handle) in _COPIED or isinstance(handle, (Enum, PurePath))


def _can_be_copied(value: object) -> bool:
    try:
        pickle.dumps(value, protocol=5)
    except Exception:  # noqa: BLE001 - whatever the reason
        return False
    return True


def _offers(names: Iterable[str]) -> bool:
    return any(not name.startswith("_") for name in names)


def _copyable(error: Exception) -> Exception:
    """Return an error as a process can raise it."""
    try:
        again = pickle.loads(pickle.dumps(error))
        return error if type(again) is type(error) else RuntimeError(described(error))
    except Exception:  # noqa: BLE001 - an error with arguments of its own
        return RuntimeError(described(error))
