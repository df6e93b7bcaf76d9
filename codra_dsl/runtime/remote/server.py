"""Serve a context manager to other processes of this machine, with one session per connection.

One thread serves all connections in turns. In its turn, a connection handles at most one request. So a main execution
that sends many requests, or does not read its messages, delays the others only a little.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import socket
import threading
from collections.abc import Sequence
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from typing import Any, Self

from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.remote.connection import Connection
from codra_dsl.runtime.remote.json_lines import Address, open_listener
from codra_dsl.runtime.remote.session import Send, Session, open_session
from codra_dsl.runtime.remote.token import check_token, create_token, token_file

_LOGGER = logging.getLogger(__name__)

ACCEPT_PAUSE_S = 1.0
"""How long the server waits after a failure to accept a connection."""

MAX_CONNECTIONS = 64
"""The maximum number of connections. A connection without a session gives its place to a new connection."""

MAX_CLOSED_CONNECTIONS = 64
"""The maximum number of closed connections that still send their last messages."""

_MAX_ACCEPTED = 16
"""The maximum number of connections that are accepted in one turn."""


class Server:
    """Listens until it is closed. Use it in real time, because a simulated clock belongs to one thread.

    Attributes:
        address: where the server listens; for port 0, this is the free port that was found.
        token_file: the file with the token that a program must send to a port; None for a Unix socket.
    """

    def __init__(self, codra: ContextManager[Any, Any], address: Address = 0) -> None:
        """Listen.

        Args:
            codra: the context manager.
            address: the path of a Unix socket, or a port of 127.0.0.1; 0 finds a free port.

        Raises:
            OSError: if the address is taken or cannot be used, or the token cannot be written.
        """
        self._codra = codra
        self._socket = open_listener(address)
        self._file_identity = None if isinstance(address, int) else _file_identity(Path(address))
        self._program_id = os.getpid()
        self.address: Address = self._socket.getsockname()[1] if isinstance(address, int) else address
        self.token_file = token_file(self.address) if isinstance(self.address, int) else None
        try:
            self._token = "" if self.token_file is None else create_token(self.token_file)
        except OSError:
            self._socket.close()
            raise
        self._connections: list[Connection] = []
        self._lock = new_lock()
        self._is_closed = False
        self._is_woken = False
        self._accept_from_s = -math.inf
        self._selector = DefaultSelector()
        self._waker, self._wake_receiver = socket.socketpair()
        for own_socket in (self._socket, self._waker, self._wake_receiver):
            own_socket.setblocking(False)
        for own_socket in (self._socket, self._wake_receiver):
            self._selector.register(own_socket, EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="codra-server", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all sessions, and stop listening. In a fork of the program, only close the sockets of this process."""
        if os.getpid() != self._program_id:
            for inherited_socket in (self._socket, *(connection.peer for connection in self._connections)):
                inherited_socket.close()
            return
        with self._lock:
            if self._is_closed:
                return  # by now the path may belong to another server
            self._is_closed = True
            connections = tuple(self._connections)
        self._remove_file()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # the server's thread closes it
        for connection in connections:
            connection.close("the manager has closed")
        self._wake()

    def _remove_file(self) -> None:
        """Remove the token, or the Unix socket unless another file has taken its place."""
        if self.token_file is not None:
            self.token_file.unlink(missing_ok=True)
        elif not isinstance(self.address, int) and _file_identity(Path(self.address)) == self._file_identity:
            Path(self.address).unlink(missing_ok=True)

    def _wake(self) -> None:
        if threading.current_thread() is self._thread:
            self._is_woken = True  # a request of one program can cause a message to another one
        else:
            with contextlib.suppress(OSError):  # the server has ended, or it has not yet noticed that it was woken
                self._waker.send(b"\0")

    def _serve(self) -> None:
        while not self._is_closed or self._connections:
            self._take_turns()
        for own_socket in (self._socket, self._waker, self._wake_receiver):
            own_socket.close()
        self._selector.close()

    def _take_turns(self) -> None:
        wait_s, self._is_woken = self._wait_s(), False
        events = {key.fileobj: event for key, event in self._selector.select(wait_s)}
        if self._wake_receiver in events:
            self._wake_receiver.recv(4096)
        for connection in tuple(self._connections):
            self._take_turn(connection, events.get(connection.peer, 0))
        if self._socket in events:
            self._accept()  # after the turns: a first request that has arrived keeps the place of its connection
        may_accept = not self._is_closed and self._codra.clock.now_s() >= self._accept_from_s
        self._watch(self._socket, EVENT_READ if may_accept else 0)

    def _take_turn(self, connection: Connection, events: int) -> None:
        connection.take_turn(events)
        if connection.is_over:
            self._drop(connection)
        else:
            self._watch(connection.peer, connection.interest)

    def _wait_s(self) -> float | None:
        """Return how long no connection needs a turn, unless its socket is ready; None for any time."""
        if self._is_woken or any(connection.has_request for connection in self._connections):
            return 0.0
        now_s = self._codra.clock.now_s()
        instants_s = [connection.deadline_s for connection in self._connections]
        if self._accept_from_s > now_s:
            instants_s.append(self._accept_from_s)
        next_s = min(instants_s, default=math.inf)
        return None if next_s == math.inf else max(0.0, next_s - now_s)

    def _watch(self, watched: socket.socket, interest: int) -> None:
        """Wait for the events of a socket in `interest`, which may be empty."""
        key = self._selector.get_map().get(watched.fileno())
        if key is None and interest:
            self._selector.register(watched, interest)
        elif key is not None and not interest:
            self._selector.unregister(watched)
        elif key is not None and key.events != interest:
            self._selector.modify(watched, interest)

    def _accept(self) -> None:
        for _ in range(_MAX_ACCEPTED):
            try:
                peer, _address = self._socket.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if not self._is_closed:
                    _LOGGER.warning("the server waits, because it could not accept a connection: %s", error)
                self._accept_from_s = self._codra.clock.now_s() + ACCEPT_PAUSE_S
                return
            self._add_connection(peer)

    def _add_connection(self, peer: socket.socket) -> None:
        peer.setblocking(False)
        connection = Connection(peer, self._codra.clock, self._open_session, self._wake)
        with self._lock:
            if self._is_closed:
                peer.close()
                return
            self._connections.append(connection)
        self._watch(peer, EVENT_READ)
        open_connections = [connection for connection in self._connections if not connection.is_closed]
        if len(open_connections) > MAX_CONNECTIONS:
            self._take_turn(_closed_for_room(open_connections), 0)
        closed_connections = [connection for connection in self._connections if connection.is_closed]
        if len(closed_connections) > MAX_CLOSED_CONNECTIONS:
            self._drop(closed_connections[0])

    def _open_session(self, first_message: object, send: Send) -> Session:
        if self.token_file is not None:
            check_token(first_message, self._token, self.token_file)
        return open_session(self._codra, send)

    def _drop(self, connection: Connection) -> None:
        self._watch(connection.peer, 0)
        connection.peer.close()
        with self._lock:
            self._connections.remove(connection)


def _file_identity(path: Path) -> tuple[int, int] | None:
    """Return the device and the inode of a file, but not those of the target of a link; None if there is no file."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _closed_for_room(connections: Sequence[Connection]) -> Connection:
    """Close the oldest connection without a session, or else the newest connection, and return it."""
    silent_connection = next(connection for connection in connections if not connection.has_session)
    if silent_connection is connections[-1]:
        silent_connection.close(f"{MAX_CONNECTIONS} programs are connected already: connect again when one has left")
    else:
        silent_connection.close("a new connection has taken the place of this one, which sent no request")
    return silent_connection
