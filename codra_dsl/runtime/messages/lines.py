"""Messages as lines of JSON over a stream of bytes: UTF-8, one message a line."""

from __future__ import annotations

import contextlib
import errno
import json
import socket
import struct
from pathlib import Path
from typing import BinaryIO

from codra_dsl.runtime.journal.encoding import bytes_of, json_text
from codra_dsl.runtime.messages.protocol import MessageError, Plain

LONGEST_LINE = 1 << 20
"""Bytes of the longest message."""

LOOPBACK = "127.0.0.1"

PATIENCE_S = 5.0
"""How long the other side may take to read, or the manager for an answer that need not wait for observers."""

Address = Path | str | int
"""Where a manager listens: the path of a Unix socket, or a port of this machine."""


def line_of(message: Plain) -> bytes:
    """Return the line that carries a message; an infinite number is `1e999`, and NaN null.

    Raises:
        TypeError: if it holds what is no plain data.
    """
    return bytes_of(json_text(message)) + b"\n"


def read_line(stream: BinaryIO) -> bytes | None:
    """Return the next line, without its end; None after the last.

    Raises:
        MessageError: if it is too long; then the stream is of no more use.
        OSError: if the stream cannot be read.
    """
    line = stream.readline(LONGEST_LINE + 1)
    if len(line) > LONGEST_LINE:
        raise MessageError(f"a message has {LONGEST_LINE} bytes at most")
    return line.rstrip(b"\r\n") if line.endswith(b"\n") else None


def message_of(line: bytes) -> object:
    """Return the message that a line carries.

    Raises:
        MessageError: if it is not JSON.
    """
    try:
        return json.loads(line, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise MessageError(f"this line is no JSON: {error}") from None


def listening(address: Address) -> socket.socket:
    """Return a socket that listens; a Unix socket that a process has left behind is replaced.

    Raises:
        OSError: if the address is taken or cannot be used.
    """
    if not isinstance(address, int):
        _clear_away(Path(address))
    server, place = _socket(address)
    try:
        if isinstance(address, int):
            server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind(place)
        server.listen()
    except (OSError, OverflowError) as error:
        server.close()
        number = getattr(error, "errno", None) or errno.EADDRNOTAVAIL
        raise OSError(number, f"nobody can listen at {address}: {getattr(error, 'strerror', None) or error}") from None
    return server


def _clear_away(path: Path) -> None:
    """Remove a Unix socket at which nobody listens any more."""
    if path.is_socket():
        try:
            connected(path, 1.0).close()
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)


def connected(address: Address, timeout_s: float) -> socket.socket:
    """Return a socket that is connected.

    Raises:
        OSError: if nobody listens.
    """
    client, place = _socket(address)
    try:
        client.settimeout(timeout_s)
        client.connect(place)
        client.settimeout(None)
    except (OSError, OverflowError) as error:
        client.close()
        raise error if isinstance(error, OSError) else OSError(errno.EADDRNOTAVAIL, str(error)) from None
    return client


def _socket(address: Address) -> tuple[socket.socket, str | tuple[str, int]]:
    if isinstance(address, int):
        return socket.socket(socket.AF_INET, socket.SOCK_STREAM), (LOOPBACK, address)
    return socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), str(address)


def _refuse(constant: str) -> object:
    raise ValueError(f"{constant} is no number of JSON")


def limited(connection: socket.socket) -> socket.socket:
    """Return a connection whose sending fails when the other side has read nothing for a while."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", int(PATIENCE_S), 0))
    return connection


def shut(ended: socket.socket) -> None:
    """Close a socket, and end what other threads wait for on it."""
    with contextlib.suppress(OSError):
        ended.shutdown(socket.SHUT_RDWR)
    ended.close()


def is_of_the_web(line: bytes) -> bool:
    """Return whether a line that is no JSON begins a request of HTTP."""
    return b" HTTP/" in line
