"""Messages as lines of JSON over a stream of bytes, in UTF-8. Each line is one message."""

from __future__ import annotations

import contextlib
import errno
import json
import math
import socket
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

from codra_dsl.runtime.journal.encoding import bytes_of, json_text, restore_infinite
from codra_dsl.runtime.remote.protocol import MessageError, PlainData

MAX_LINE_BYTES = 1 << 18
"""The maximum size of a request in bytes."""

OWNER_ONLY = 0o600
"""The permissions of the Unix socket and of the token file: only the user of the manager may use them."""

LOOPBACK = "127.0.0.1"

_BACKLOG = 1_024
"""How many connections may wait until they are accepted."""

RESPONSE_TIMEOUT_S = 5.0
"""How long the other side may take to read, and how long the manager may take to answer.

The time for which a decision waits for observers is added.
"""

Address = Path | str | int
"""Where a manager listens: the path of a Unix socket, or a port of this machine."""


def line_of(message: PlainData) -> bytes:
    """Return the line that carries a message; an infinite `value` becomes `infinite: 1` or `-1`, and NaN becomes null.

    Raises:
        TypeError: if the message holds anything but plain data.
    """
    return bytes_of(json_text(message)) + b"\n"


def read_line(stream: BinaryIO) -> bytes | None:
    """Return the next line of a manager without its line end; None after the last line.

    Raises:
        OSError: if the stream cannot be read.
    """
    line = stream.readline()
    return line.rstrip(b"\r\n") if line.endswith(b"\n") else None


def request_of_line(line: bytes) -> object:
    """Return the request that a line carries. Only its own fields, and its `values`, can be infinite.

    Raises:
        MessageError: if the line is not JSON, or holds a number that is not finite.
    """
    request = message_of(line, object_hook=None)
    restored = restore_infinite(request) if isinstance(request, dict) else request
    if isinstance(restored, dict) and isinstance(restored.get("values"), list):
        entries = restored["values"]
        restored["values"] = [restore_infinite(entry) if isinstance(entry, dict) else entry for entry in entries]
    return restored


def message_of(line: bytes, object_hook: Callable[[PlainData], Any] | None = restore_infinite) -> object:
    """Return the message that a line carries, by default with its infinite numbers.

    Raises:
        MessageError: if the line is not JSON, or holds a number that is not finite.
    """
    try:
        return json.loads(line, parse_constant=_refuse, parse_float=_finite_number, object_hook=object_hook)
    except MessageError:
        raise
    except (ValueError, RecursionError) as error:
        raise MessageError(f"this line is not JSON: {error}") from None


def open_listener(address: Address) -> socket.socket:
    """Return a listening socket; a Unix socket that a process has left behind is replaced.

    Raises:
        OSError: if the address is taken or cannot be used.
    """
    if not isinstance(address, int):
        _remove_stale_socket(Path(address))
    listener, endpoint = _create_socket(address)
    try:
        if isinstance(address, int):
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(endpoint)
        if not isinstance(address, int):
            Path(address).chmod(OWNER_ONLY)  # regardless of the umask; before `listen`, no client can connect
        listener.listen(_BACKLOG)
    except (OSError, OverflowError) as error:
        listener.close()
        number = getattr(error, "errno", None) or errno.EADDRNOTAVAIL
        raise OSError(number, f"cannot listen at {address}: {getattr(error, 'strerror', None) or error}") from None
    return listener


def _remove_stale_socket(path: Path) -> None:
    """Remove a Unix socket on which no process listens."""
    if path.is_socket():
        try:
            connect(path, 1.0).close()
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)


def connect(address: Address, timeout_s: float) -> socket.socket:
    """Return a connected socket.

    Raises:
        OSError: if no process listens at the address.
    """
    client, endpoint = _create_socket(address)
    try:
        client.settimeout(timeout_s)
        client.connect(endpoint)
        client.settimeout(None)
    except (OSError, OverflowError) as error:
        client.close()
        raise error if isinstance(error, OSError) else OSError(errno.EADDRNOTAVAIL, str(error)) from None
    return client


def _create_socket(address: Address) -> tuple[socket.socket, str | tuple[str, int]]:
    if isinstance(address, int):
        return socket.socket(socket.AF_INET, socket.SOCK_STREAM), (LOOPBACK, address)
    return socket.socket(socket.AF_UNIX, socket.SOCK_STREAM), str(address)


def _refuse(constant: str) -> object:
    raise MessageError(f"{constant} is not a JSON number: the numbers in a message are finite")


def _finite_number(text: str) -> float:
    number = float(text)
    if math.isinf(number):
        raise MessageError(f"the number {text[:20]} is too large: the numbers in a message are finite")
    return number


def with_send_timeout(connection: socket.socket) -> socket.socket:
    """Return a connection on which sending fails if the other side does not read for `RESPONSE_TIMEOUT_S`."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, struct.pack("ll", int(RESPONSE_TIMEOUT_S), 0))
    return connection


def shut_down(connection: socket.socket) -> None:
    """Close a socket, and wake other threads that wait on it."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)
    connection.close()
