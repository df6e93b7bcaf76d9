"""The main function of a perception algorithm's process. It executes jobs one by one until the program is gone."""

from __future__ import annotations

import random
import socket
import threading
from collections.abc import Mapping, Sequence
from typing import Any

from codra_dsl.isolation.function_host import AbsentError, FunctionHost, resolve_call
from codra_dsl.isolation.messages import Connection, described, encode_argument, encode_result


class Cancelled(Exception):  # noqa: N818 - it is an outcome, not an error
    """The job has been cancelled, or the program is gone."""


class _RequestSender:
    """Sends requests to the program, one at a time, from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._lock = threading.Lock()

    def ask(self, *request: object) -> tuple[str, Any]:
        """Return the program's answer: its kind and content.

        Raises:
            Cancelled: if the job has been cancelled, or the program is gone.
        """
        try:
            with self._lock:
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
    """The `job` of one call. It asks the program for everything, so that it behaves like the `job` in a thread."""

    def __init__(self, sender: _RequestSender, index: int, chance: str) -> None:
        self.index = index
        self.random = random.Random(chance)
        self._sender = sender

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been cancelled."""
        return bool(self._sender.ask("job", "cancelled", [])[1])

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return float(self._sender.ask("job", "now_s", [])[1])

    def sleep(self, duration_s: float) -> None:
        """Sleep; raise `Cancelled` once the job has been cancelled."""
        self._sender.ask("job", "sleep", [encode_argument(duration_s)])

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken."""
        self._sender.ask("job", "evidence", [encode_argument(start_s), encode_argument(stamp_s)])


class RemoteHandle:
    """A handle that stays in the program: its attributes are copied to the process, its methods run in the program."""

    __slots__ = ("_path", "_sender")

    def __init__(self, sender: _RequestSender, path: Sequence[str]) -> None:
        object.__setattr__(self, "_sender", sender)
        object.__setattr__(self, "_path", list(path))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(
                f"a process cannot access private attribute {name!r} of handle {'.'.join(self._path)!r}"
            )
        kind, content = self._sender.ask("get", [*self._path, name])
        return content if kind == "value" else RemoteHandle(self._sender, [*self._path, name])

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an observer is passive: it cannot set {name!r} of handle {'.'.join(self._path)!r}")

    def __call__(self, *arguments: object, **keyword_arguments: object) -> Any:
        """Call a method, or the handle itself, in the program."""
        encoded_arguments = [encode_argument(argument) for argument in arguments]
        return self._sender.ask("call", self._path, encoded_arguments, encode_argument(keyword_arguments))[1]


def work(stream: socket.socket, call: str) -> None:
    """Import the target of a `call`, and serve the program's requests until the program is gone."""
    connection = Connection(stream)
    try:
        host = FunctionHost(resolve_call(call))
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
    sender = _RequestSender(connection)
    while True:
        try:
            step, details = connection.receive()
        except (EOFError, OSError):
            return
        try:
            answer = _execute(sender, host, step, details)
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


def _execute(sender: _RequestSender, host: FunctionHost, step: str, details: Mapping[str, Any]) -> tuple[object, ...]:
    remote_handles = {name: RemoteHandle(sender, [name]) for name in details["handles"]}
    if step == "setup":
        host.setup({**details["given"], **remote_handles})
        return ("ready",)
    job = RemoteJob(sender, details["index"], details["chance"])
    result = host.perceive(**details["given"], **remote_handles, job=job)
    return ("returned", encode_result(result))
