"""The process of a perception algorithm, from within: it does one job after the other until the program is gone."""

from __future__ import annotations

import random
import socket
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from codra_dsl.isolation.messages import Line, described, told_argument, told_result
from codra_dsl.isolation.perceiver import AbsentError, Perceiver, found


class Cancelled(Exception):  # noqa: N818 - it is an outcome, not an error
    """Nobody waits for the result of the job any more."""


class _Asking:
    """Asks the program, one question at a time, whichever thread asks."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._turn = threading.Lock()

    def ask(self, *question: object) -> tuple[str, Any]:
        """Return what the program answers: its kind and content.

        Raises:
            Cancelled: if nobody waits for the job any more, or the program is gone.
        """
        try:
            with self._turn:
                self._line.tell(*question)
                kind, content = self._line.take()
        except (EOFError, OSError):
            raise Cancelled from None
        if kind == "cancelled":
            raise Cancelled
        if kind == "raised":
            raise content
        return kind, content


class RemoteJob:
    """The `job` of one call; the program answers, so that it means the same as in a thread."""

    def __init__(self, asking: _Asking, index: int, chance: str) -> None:
        self.index = index
        self.random = random.Random(chance)
        self._asking = asking

    @property
    def cancelled(self) -> bool:
        """Return whether nobody waits for the result any more."""
        return bool(self._asking.ask("job", "cancelled", [])[1])

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return float(self._asking.ask("job", "now_s", [])[1])

    def sleep(self, duration_s: float) -> None:
        """Spend time; raises `Cancelled` when nobody waits for the result any more."""
        self._asking.ask("job", "sleep", [told_argument(duration_s)])

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Say when the evidence was taken."""
        self._asking.ask("job", "evidence", [told_argument(start_s), told_argument(stamp_s)])


class RemoteHandle:
    """A handle that stays in the program: its attributes are copied, its methods run there."""

    __slots__ = ("_asking", "_path")

    def __init__(self, asking: _Asking, path: Sequence[str]) -> None:
        object.__setattr__(self, "_asking", asking)
        object.__setattr__(self, "_path", list(path))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"a process does not see {name!r} of handle {'.'.join(self._path)!r}")
        kind, content = self._asking.ask("get", [*self._path, name])
        return content if kind == "value" else RemoteHandle(self._asking, [*self._path, name])

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an observer is passive: it does not set {name!r} of handle {'.'.join(self._path)!r}")

    def __call__(self, *arguments: object, **named: object) -> Any:
        """Call a method, or the handle itself, in the program."""
        told = [told_argument(each) for each in arguments]
        return self._asking.ask("call", self._path, told, told_argument(named))[1]


def work(connection: socket.socket, call: str) -> None:
    """Import what a `call` names, and do what the program asks for until it is gone."""
    line = Line(connection)
    try:
        perceiver = Perceiver(found(call))
    except AbsentError as error:
        line.tell("absent", str(error))
        return
    except BaseException as error:  # noqa: BLE001 - a module may do anything while it is imported
        line.tell("absent", f": {described(error)}")
        return
    line.tell("here")
    try:
        _serve(line, perceiver)
    finally:
        perceiver.close()


def _serve(line: Line, perceiver: Perceiver) -> None:
    asking = _Asking(line)
    while True:
        try:
            what, details = line.take()
        except (EOFError, OSError):
            return
        try:
            answer = _done(asking, perceiver, what, details)
        except Cancelled:
            answer = ("cancelled",)
        except BaseException as error:  # noqa: BLE001 - whatever a user's function raises is told
            answer = ("raised", f"{'setup: ' if what == 'setup' else ''}{described(error)}")
        try:
            _tell(line, answer)
        except OSError:
            return


def _tell(line: Line, answer: tuple[object, ...]) -> None:
    try:
        line.tell(*answer)
    except ValueError as error:
        line.tell("raised", f"returned too much: {error}")


def _done(asking: _Asking, perceiver: Perceiver, what: str, details: Mapping[str, Any]) -> tuple[object, ...]:
    remote = {name: RemoteHandle(asking, [name]) for name in details["handles"]}
    if what == "setup":
        perceiver.setup({**details["given"], **remote})
        return ("ready",)
    job = RemoteJob(asking, details["index"], details["chance"])
    returned = perceiver.perceive(**details["given"], **remote, job=job)
    return ("returned", told_result(returned))
