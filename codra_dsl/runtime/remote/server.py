"""Serve a context manager to other processes of this machine, with one session per connection."""

from __future__ import annotations

import contextlib
import logging
import queue
import socket
import threading
from pathlib import Path
from typing import Any, Self

from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.remote.json_lines import (
    Address,
    is_http_request,
    line_of,
    message_of,
    open_listener,
    read_line,
    shut_down,
    with_send_timeout,
)
from codra_dsl.runtime.remote.protocol import MessageError, PlainData, error_to
from codra_dsl.runtime.remote.session import open_session

_LOGGER = logging.getLogger(__name__)

ACCEPT_PAUSE_S = 1.0
"""How long the server waits after a failure to accept a connection."""

MAX_UNSENT_MESSAGES = 10_000
"""The maximum number of messages that a main execution has not read. If there are more, the session ends."""


class Server:
    """Listens until it is closed. Use it in real time, because a simulated clock belongs to one thread.

    Attributes:
        address: where the server listens; for port 0, this is the free port that was found.
    """

    def __init__(self, codra: ContextManager[Any, Any], address: Address = 0) -> None:
        """Listen.

        Args:
            codra: the context manager.
            address: the path of a Unix socket, or a port of 127.0.0.1; 0 finds a free port.

        Raises:
            OSError: if the address is taken or cannot be used.
        """
        self._codra = codra
        self._socket = open_listener(address)
        self.address: Address = self._socket.getsockname()[1] if isinstance(address, int) else address
        self._connections: set[_Connection] = set()
        self._lock = threading.Lock()
        self._close_event = threading.Event()
        threading.Thread(target=self._accept, name="codra-server", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all sessions, and stop listening."""
        with self._lock:
            if self._close_event.is_set():
                return  # by now the path may belong to another server
            self._close_event.set()
            connections = tuple(self._connections)
        if not isinstance(self.address, int):
            Path(self.address).unlink(missing_ok=True)
        shut_down(self._socket)
        for connection in connections:
            connection.close("the manager has closed")

    def _accept(self) -> None:
        while not self._close_event.is_set():
            try:
                peer, _ = self._socket.accept()
            except OSError as error:
                if not self._close_event.is_set():
                    _LOGGER.warning("the server waits, because it could not accept a connection: %s", error)
                self._close_event.wait(ACCEPT_PAUSE_S)
            else:
                self._add_connection(peer)

    def _add_connection(self, peer: socket.socket) -> None:
        with self._lock:
            if self._close_event.is_set():
                shut_down(peer)
                return
            connection = _Connection(self._codra, peer, self._forget)
            self._connections.add(connection)
        try:
            connection.begin()
        except RuntimeError:  # no thread could be started
            connection.close("the machine can start no more threads")
            shut_down(peer)

    def _forget(self, connection: _Connection) -> None:
        with self._lock:
            self._connections.discard(connection)


class _Connection:
    """The connection of one main execution: one thread reads its requests, another writes its messages."""

    def __init__(self, codra: ContextManager[Any, Any], peer: socket.socket, forget: Any) -> None:
        self._peer = with_send_timeout(peer)
        self._forget = forget
        self._unsent_messages: queue.SimpleQueue[PlainData | None] = queue.SimpleQueue()
        self._session = open_session(codra, self._send)

    def begin(self) -> None:
        for target in (self._read, self._write):
            threading.Thread(target=target, name="codra-session", daemon=True).start()

    def close(self, because: str) -> None:
        """End the session and the connection; do nothing if they have already ended."""
        self._session.close(because)
        self._unsent_messages.put(None)
        with contextlib.suppress(OSError):
            self._peer.shutdown(socket.SHUT_RD)
        self._forget(self)

    def _send(self, message: PlainData) -> None:
        if self._unsent_messages.qsize() < MAX_UNSENT_MESSAGES:
            self._unsent_messages.put(message)
        else:
            self.close("the main execution does not read its messages")
            shut_down(self._peer)

    def _read(self) -> None:
        try:
            with self._peer.makefile("rb") as stream:
                while (line := read_line(stream)) is not None:
                    self._handle_line(line)
        except MessageError as error:
            self._send(error_to(None, error))
        except OSError:
            pass
        finally:
            self.close("the connection was lost")

    def _handle_line(self, line: bytes) -> None:
        try:
            message = message_of(line)
        except MessageError as error:
            if is_http_request(line):
                raise  # a web page can make a browser send this, and the next lines may look like messages
            self._send(error_to(None, error))
        else:
            self._session.receive(message)

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while (message := self._unsent_messages.get()) is not None:
                self._peer.sendall(line_of(message))
        self._session.close("the connection was lost")
        shut_down(self._peer)
