"""The main function of a perception algorithm's process. It executes jobs one by one until the program is gone."""

from __future__ import annotations

import random
import socket
import threading
from collections.abc import Mapping
from functools import partial
from typing import Any

from codra_dsl.isolation.error_text import described
from codra_dsl.isolation.function_host import AbsentError, FunctionHost, resolve_call
from codra_dsl.isolation.messages import Connection, encode_argument, encode_result


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
                self._connection.send_json(*request)
                kind, content = self._connection.receive_pickle()
        except (EOFError, OSError):
            raise Cancelled from None
        if kind == "cancelled":
            raise Cancelled
        if kind == "raised":
            raise content
        return kind, content


class RemoteJob:
    """The `job` of one call. It asks the program for everything, so that it behaves like the `job` in a thread."""

    def __init__(self, request_sender: _RequestSender, index: int, random_seed: str) -> None:
        self.index = index
        self.random = random.Random(random_seed)
        self._request_sender = request_sender

    @property
    def cancelled(self) -> bool:
        """Return whether the job has been cancelled."""
        return bool(self._request_sender.ask("job", "cancelled", [])[1])

    def now_s(self) -> float:
        """Return the instant that the job has reached."""
        return float(self._request_sender.ask("job", "now_s", [])[1])

    def sleep(self, duration_s: float) -> None:
        """Sleep; raise `Cancelled` once the job has been cancelled."""
        self._request_sender.ask("job", "sleep", [encode_argument(duration_s)])

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Report when the evidence was taken."""
        self._request_sender.ask("job", "evidence", [encode_argument(start_s), encode_argument(stamp_s)])


class RemoteHandle:
    """A handle that stays in the program: its values are copied to the process, its methods run in the program."""

    __slots__ = ("_name", "_request_sender")

    def __init__(self, request_sender: _RequestSender, name: str) -> None:
        object.__setattr__(self, "_request_sender", request_sender)
        object.__setattr__(self, "_name", name)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"a process cannot access private attribute {name!r} of handle {self._name!r}")
        kind, content = self._request_sender.ask("get", self._name, name)
        return content if kind == "value" else partial(self._call, name)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"an observer is passive: it cannot set {name!r} of handle {self._name!r}")

    def __call__(self, *arguments: object, **keyword_arguments: object) -> Any:
        """Call the handle itself in the program."""
        return self._call(None, *arguments, **keyword_arguments)

    def _call(self, method: str | None, /, *arguments: object, **keyword_arguments: object) -> Any:
        encoded_arguments = [encode_argument(argument) for argument in arguments]
        encoded_keyword_arguments = encode_argument(keyword_arguments)
        return self._request_sender.ask("call", self._name, method, encoded_arguments, encoded_keyword_arguments)[1]


def run_worker(message_socket: socket.socket, call: str) -> None:
    """Import the target of a `call`, and serve the program's requests until the program is gone."""
    connection = Connection(message_socket)
    try:
        function_host = FunctionHost(resolve_call(call))
    except AbsentError as error:
        connection.send_json("absent", str(error))
        return
    except BaseException as error:  # noqa: BLE001 - a module may raise anything while it is imported
        connection.send_json("absent", f": {described(error)}")
        return
    connection.send_json("here")
    try:
        _serve(connection, function_host)
    finally:
        function_host.close()


def _serve(connection: Connection, function_host: FunctionHost) -> None:
    request_sender = _RequestSender(connection)
    while True:
        try:
            method, request = connection.receive_pickle()
        except (EOFError, OSError):
            return
        try:
            answer = _execute_request(request_sender, function_host, method, request)
        except Cancelled:
            answer = ("cancelled",)
        except BaseException as error:  # noqa: BLE001 - every error of a user's function is reported
            answer = ("raised", f"{'setup: ' if method == 'setup' else ''}{described(error)}")
        try:
            _send_answer(connection, answer)
        except OSError:
            return


def _send_answer(connection: Connection, answer: tuple[object, ...]) -> None:
    try:
        connection.send_json(*answer)
    except ValueError as error:
        connection.send_json("raised", f"returned too much: {error}")


def _execute_request(
    request_sender: _RequestSender, function_host: FunctionHost, method: str, request: Mapping[str, Any]
) -> tuple[object, ...]:
    remote_handles = {name: RemoteHandle(request_sender, name) for name in request["handles"]}
    if method == "setup":
        function_host.setup({**request["arguments"], **remote_handles})
        return ("ready",)
    job = RemoteJob(request_sender, request["index"], request["random_seed"])
    perception_result = function_host.perceive(**request["arguments"], **remote_handles, job=job)
    return ("returned", encode_result(perception_result))
