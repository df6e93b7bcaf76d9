"""A manager that other processes of this machine can ask: each connection is a session."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from codra_dsl.runtime.messages.lines import Address, line_of, listening, message_of, read_line
from codra_dsl.runtime.messages.protocol import MessageError, Plain, error_to

if TYPE_CHECKING:
    from codra_dsl.runtime.context import ContextManager

MOST_UNSENT = 10_000
"""Messages that wait for a main execution that does not read; then its session ends."""


class Server:
    """Listens until it is closed. Use it in real time: a simulated clock belongs to one thread.

    Attributes:
        address: where it listens; the port that was found, if it was asked to find one.
    """

    def __init__(self, codra: ContextManager[Any, Any], address: Address = 0) -> None:
        """Listen.

        Args:
            codra: is asked.
            address: the path of a Unix socket, or a port of 127.0.0.1; 0 finds one that is free.

        Raises:
            OSError: if the address is taken or cannot be used.
        """
        self._codra = codra
        self._socket = listening(address)
        self.address: Address = self._socket.getsockname()[1] if isinstance(address, int) else address
        self._connections: set[_Connection] = set()
        self._lock = threading.Lock()
        self._closed = False
        threading.Thread(target=self._accept, name="codra-server", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all sessions and listen no more."""
        with self._lock:
            if self._closed:
                return  # by now the path may be that of another
            self._closed = True
            connections = tuple(self._connections)
        if not isinstance(self.address, int):
            Path(self.address).unlink(missing_ok=True)
        _shut(self._socket)
        for connection in connections:
            connection.close("the manager has closed")

    def _accept(self) -> None:
        while True:
            try:
                peer, _ = self._socket.accept()
            except OSError:
                return
            connection = _Connection(self._codra, peer, self._forget)
            with self._lock:
                if not self._closed:
                    self._connections.add(connection)
                    connection.begin()
                    continue
            connection.close("the manager has closed")

    def _forget(self, connection: _Connection) -> None:
        with self._lock:
            self._connections.discard(connection)


class _Connection:
    """One main execution at the other end: one thread reads what it says, another writes what it is told."""

    def __init__(self, codra: ContextManager[Any, Any], peer: socket.socket, forget: Any) -> None:
        self._peer = peer
        self._forget = forget
        self._unsent: queue.Queue[Plain | None] = queue.Queue(MOST_UNSENT)
        self._session = codra.session(self._send)

    def begin(self) -> None:
        for body in (self._read, self._write):
            threading.Thread(target=body, name="codra-session", daemon=True).start()

    def close(self, because: str) -> None:
        """End the session and the connection; harmless when they have ended."""
        self._session.close(because)
        with contextlib.suppress(queue.Full):
            self._unsent.put_nowait(None)
        _shut(self._peer, socket.SHUT_RD)
        self._forget(self)

    def _send(self, message: Plain) -> None:
        try:
            self._unsent.put_nowait(message)
        except queue.Full:
            self.close("it does not read what it is told")
            _shut(self._peer)

    def _read(self) -> None:
        try:
            with self._peer.makefile("rb") as stream:
                while (line := read_line(stream)) is not None:
                    self._take(line)
        except MessageError as error:
            self._send(error_to(None, error))
        except OSError:
            pass
        finally:
            self.close("the connection was lost")

    def _take(self, line: bytes) -> None:
        try:
            message = message_of(line)
        except MessageError as error:
            self._send(error_to(None, error))
        else:
            self._session.receive(message)

    def _write(self) -> None:
        with contextlib.suppress(OSError):
            while (message := self._unsent.get()) is not None:
                self._peer.sendall(line_of(message))
        self._session.close("the connection was lost")
        _shut(self._peer)


def _shut(ended: socket.socket, how: int = socket.SHUT_RDWR) -> None:
    with contextlib.suppress(OSError):
        ended.shutdown(how)
    if how == socket.SHUT_RDWR:
        ended.close()
