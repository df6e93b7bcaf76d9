"""The robot's body for agents in other processes: sensor readings, commands, and the ends of commands."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection, Listener
from pathlib import Path
from typing import Any, Self

from codra_dsl.runtime.clock import Clock
from codra_papers.store.body import Body, Outcome, StopFunction

COMMANDS = frozenset({"drive", "turn", "lift"})
"""The methods of a body that begin a command, whose end is reported later."""


class BodyServer:
    """Serves a body at a Unix socket. If an agent's process is lost, its commands are stopped.

    All calls run as events of the body's clock, so the body is used by one thread.
    """

    def __init__(self, body: Body, clock: Clock, path: Path, key: bytes) -> None:
        """Begin to listen.

        Args:
            body: the body.
            clock: the clock on which the body runs.
            path: the Unix socket.
            key: the key that a process must know, because messages are pickles.

        Raises:
            OSError: if the socket cannot be used.
        """
        self._body = body
        self._clock = clock
        self._listener = Listener(str(path), "AF_UNIX", authkey=key)
        self._is_closed = False
        threading.Thread(target=self._accept, name="body-server", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._is_closed = True
        self._listener.close()

    def _accept(self) -> None:
        while not self._is_closed:
            try:
                connection = self._listener.accept()
            except Exception:  # noqa: BLE001 - a process without the key, one that was killed meanwhile, or the end
                continue
            threading.Thread(target=self._receive, args=(connection,), name="body-server", daemon=True).start()

    def _receive(self, connection: Connection) -> None:
        client = _Client(self._body, connection)
        with contextlib.suppress(EOFError, OSError):
            while True:
                message = connection.recv()
                self._clock.call_at(self._clock.now_s(), partial(client.handle, *message))
        self._clock.call_at(self._clock.now_s(), client.stop_all)


class _Client:
    """The process of one agent."""

    def __init__(self, body: Body, connection: Connection) -> None:
        self._body = body
        self._connection = connection
        self._stop_functions: dict[int, StopFunction] = {}

    def handle(self, number: int, name: str, arguments: tuple[Any, ...]) -> None:
        """Call a method of the body, or stop a command; send the result."""
        result: object = None
        if name == "stop":
            self._stop_functions.pop(arguments[0], _do_nothing)()
        elif name in COMMANDS:
            command: Callable[..., StopFunction] = getattr(self._body, name)
            self._stop_functions[number] = command(*arguments, partial(self._end, number))
        else:
            result = getattr(self._body, name)(*arguments)
        self._send("result", number, result)

    def stop_all(self) -> None:
        """Stop all commands, because the process is lost."""
        for number in tuple(self._stop_functions):
            self._stop_functions.pop(number)()

    def _end(self, number: int, outcome: Outcome) -> None:
        self._stop_functions.pop(number, None)
        self._send("ended", number, outcome)

    def _send(self, *message: object) -> None:
        with contextlib.suppress(OSError):  # the process is lost; its commands are stopped
            self._connection.send(message)


def _do_nothing() -> None:
    """Do nothing: the command has been stopped already."""
