"""The process of a perception algorithm, from inside: it executes one job after the other until the program is gone."""

from __future__ import annotations

import random
import socket
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from codra_dsl.isolation.function_host import AbsentError, FunctionHost, resolved
from codra_dsl.isolation.messages import Connection, described, encode_argument, encode_result


class Cancelled(Exception):  # noqa: N818 - it is an outcome, not an error
    """The job has been cancelled, or the program is gone."""


class _Asking:
    """Sends requests to the program, one at a time, from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._turn = threading.Lock()

    def ask(self, *request: object) -> tuple[str, Any]:
        """Return the program's answer: its kind and content.

        Raises:
            Cancelled: if the job has been cancelled, or the program is gone.
        """
        try:
            with self._turn:
                self._connection.reply(*request)
                kind, content = self._connection.receive()
        except (EOFError, OSError):
            raise Cancelled from None
        if kind == "cancelled":
            raise Cancelled
        if kind == "raised":
            raise content
        return kind, content


class RemoteJob:
    """The `job` of one call; it asks the program, so that it behaves as in a thread."""

    def __init__(self, asking: _Asking, index: int, chance: str) -> None:
        self.index = index
        self.random = random.Random(chance)
        self._asking = asking

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been cancelled."""
        return bool(self._asking.ask("job", "cancelled", [])[1])

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return float(self._asking.ask("job", "now_s", [])[1])

    def sleep(self, duration_s: float) -> None:
        """Sleep; raise `Cancelled` once the job has been cancelled."""
        self._asking.ask("job", "sleep", [encode_argument(duration_s)])

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken."""
        self._asking.ask("job", "evidence", [encode_argument(start_s), encode_argument(stamp_s)])


class RemoteHandle:
    """A handle that stays in the program: its attributes are copied, its methods run there."""

    __slots__ = ("_asking", "_path")

    def __init__(self, asking: _Asking, path: Sequence[str]) -> None:
        object.__setattr__(self, "_asking", asking)
        object.__setattr__(self, "_path", list(path))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(
                f"a process cannot access private attribute {name!r} of handle {'.'.join(self._path)!r}"
            )
        kind, content = self._asking.ask("get", [*self._path, name])
        return content if kind == "value" else RemoteHandle(self._asking, [*self._path, name])

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an observer is passive: it cannot set {name!r} of handle {'.'.join(self._path)!r}")

    def __call__(self, *arguments: object, **named: object) -> Any:
        """Call a method, or the handle itself, in the program."""
        encoded = [encode_argument(argument) for argument in arguments]
        return self._asking.ask("call", self._path, encoded, encode_argument(named))[1]


def work(stream: socket.socket, call: str) -> None:
    """Import the target of a `call`, and serve the program's requests until the program is gone."""
    connection = Connection(stream)
    try:
        host = FunctionHost(resolved(call))
    except AbsentError as error:
        connection.reply("absent", str(error))
        return
    except BaseException as error:  # noqa: BLE001 - a module may raise anything while it is imported
        connection.reply("absent", f": {described(error)}")
        return
    connection.reply("here")
    try:
        _serve(connection, host)
    finally:
        host.close()


def _serve(connection: Connection, host: FunctionHost) -> None:
    asking = _Asking(connection)
    while True:
        try:
            step, details = connection.receive()
        except (EOFError, OSError):
            return
        try:
            answer = _execute(asking, host, step, details)
        except Cancelled:
            answer = ("cancelled",)
        except BaseException as error:  # noqa: BLE001 - every error of a user's function is reported
            answer = ("raised", f"{'setup: ' if step == 'setup' else ''}{described(error)}")
        try:
            _reply(connection, answer)
        except OSError:
            return


def _reply(connection: Connection, answer: tuple[object, ...]) -> None:
    try:
        connection.reply(*answer)
    except ValueError as error:
        connection.reply("raised", f"returned too much: {error}")


def _execute(asking: _Asking, host: FunctionHost, step: str, details: Mapping[str, Any]) -> tuple[object, ...]:
    remote = {name: RemoteHandle(asking, [name]) for name in details["handles"]}
    if step == "setup":
        host.setup({**details["given"], **remote})
        return ("ready",)
    job = RemoteJob(asking, details["index"], details["chance"])
    returned = host.perceive(**details["given"], **remote, job=job)
    return ("returned", encode_result(returned))
