"""Messages between a program and the process of a perception algorithm, in frames of bounded size.

A frame to the process is a pickle, so that handles can answer with any object that can be copied. A frame from the
process is JSON of a few shapes, never a pickle: a process cannot run code in the program, or fill its memory.
"""

from __future__ import annotations

import json
import pickle
import socket
import struct
from collections.abc import Mapping
from typing import Any

MAX_REPLY_BYTES = 2**20
"""The maximum size of a frame from a process; its results are meant for decisions, not as payload."""

MAX_REQUEST_BYTES = 64 * 2**20
"""The maximum size of a frame to a process; for comparison, the image of a large camera has 36 MB."""

MAX_SHOWN = 200
"""The maximum number of characters of a foreign text that a message shows."""

_HEAD = struct.Struct("!I")
_MAX_ENTRIES = 1000
_MAX_NAME = 60
_MAX_INTEGER = 2**63 - 1
_MAX_BITS = 2**16
_MAX_TEXT = 10_000


class GarbageError(ValueError):
    """A process sent an invalid message."""


class Connection:
    """One end of the connection between a program and a process."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection

    def send(self, content: object) -> None:
        """Send an object towards a process.

        Raises:
            TypeError: if it cannot be copied.
            ValueError: if it is too large.
            OSError: if the process is gone.
        """
        try:
            data = pickle.dumps(content, protocol=5)
        except Exception as error:
            raise TypeError(f"cannot be copied to another process: {described(error)}") from error
        if len(data) > MAX_REQUEST_BYTES:
            raise ValueError(f"{len(data)} bytes are more than the {MAX_REQUEST_BYTES} that a process is sent")
        self.connection.sendall(_HEAD.pack(len(data)))
        self.connection.sendall(data)

    def receive(self) -> Any:
        """Receive, in a process, an object from the program, which is trusted.

        Raises:
            EOFError: if the program is gone.
        """
        return pickle.loads(self._read(MAX_REQUEST_BYTES))

    def reply(self, *message: object) -> None:
        """Send a message of plain values towards the program.

        Raises:
            ValueError: if it is too long.
        """
        data = json.dumps(message).encode()
        if len(data) > MAX_REPLY_BYTES:
            raise ValueError(f"{len(data)} bytes are more than the {MAX_REPLY_BYTES} that a process may send")
        self.connection.sendall(_HEAD.pack(len(data)) + data)

    def receive_reply(self) -> list[Any]:
        """Receive a message of a process, which is not trusted.

        Raises:
            EOFError: if the process is gone.
            TimeoutError: if the time limit of the connection has passed.
            GarbageError: if it is not a valid message, or too long.
        """
        data = self._read(MAX_REPLY_BYTES)
        try:
            message = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise GarbageError("its process sent an invalid message") from error
        if not isinstance(message, list) or not message or not isinstance(message[0], str):
            raise GarbageError("its process sent an invalid message")
        return message

    def _read(self, limit: int) -> bytearray:
        (length,) = _HEAD.unpack(self._read_all(_HEAD.size))
        if length > limit:
            raise GarbageError(f"its process sent more than {limit} bytes")
        return self._read_all(length)

    def _read_all(self, length: int) -> bytearray:
        data = bytearray(length)
        left = memoryview(data)
        while left:
            try:
                count = self.connection.recv_into(left)
            except ConnectionError:
                count = 0
            if not count:
                raise EOFError("the other end is closed")
            left = left[count:]
        return data


class _LongText(str):
    """The beginning of a text that was too long to send; `len` returns the length of the full text."""

    def __new__(cls, beginning: str, length: int) -> _LongText:
        made = super().__new__(cls, beginning)
        made._length = length
        return made

    def __len__(self) -> int:
        return self._length

    _length: int


# Messages for a function's result


def encode_result(returned: object) -> object:
    """Return a perception function's result as plain values; for foreign values, only the type's name is kept."""
    if not isinstance(returned, Mapping):
        return _encode_value(returned)
    pairs: list[object] = []
    for name in returned:
        if len(pairs) == _MAX_ENTRIES:
            break
        pairs.append([_encode_value(name), _encode_value(returned[name])])
    return {"mapping": pairs}


def decode_result(encoded: object) -> object:
    """Return the result that `encode_result` encoded; foreign values become placeholders with the name of their type.

    Raises:
        GarbageError: if the message is not an encoded result.
    """
    if not isinstance(encoded, dict) or "mapping" not in encoded:
        return _decode_value(encoded)
    try:
        return {_decode_value(name): _decode_value(value) for name, value in encoded["mapping"]}
    except (TypeError, ValueError) as error:
        raise GarbageError("its process sent an invalid result") from error


def _encode_value(value: object) -> object:
    plain = _plain(value)
    if isinstance(plain, int) and abs(plain) > _MAX_INTEGER:
        return {"bits": int(plain).bit_length()}
    if isinstance(plain, str):
        is_long = len(plain) > _MAX_TEXT
        return {"text": plain[:_MAX_TEXT], "length": len(plain)} if is_long else str.__str__(plain)
    return plain if isinstance(plain, (bool, int, float)) else {"foreign": type(plain).__name__}


def _decode_value(encoded: object) -> Any:
    match encoded:
        case {"bits": int(bits)}:
            return 1 << (min(max(bits, 1), _MAX_BITS) - 1)
        case {"text": str(text), "length": int(length)}:
            return _LongText(text, length)
        case {"foreign": "NoneType"}:
            return None
        case {"foreign": str(name)}:
            return type(name[:_MAX_NAME].encode("ascii", "replace").decode().replace("\0", "?"), (), {})()
        case bool() | int() | float() | str():
            return encoded
        case _:
            raise GarbageError("its process sent an invalid value")


# Messages for arguments of a handle's methods


def encode_argument(value: object) -> object:
    """Return an argument for a method of a handle: a number, a text, or a list or mapping of them.

    Raises:
        TypeError: if the argument is something else.
    """
    plain = _plain(value)
    if plain is None or isinstance(plain, (bool, int, float, str)):
        return plain
    if isinstance(plain, (list, tuple)):
        return [encode_argument(part) for part in plain]
    if isinstance(plain, dict) and all(isinstance(name, str) for name in plain):
        return {name: encode_argument(part) for name, part in plain.items()}
    raise TypeError(f"a handle takes numbers, texts, lists and mappings from a process, not a {type(plain).__name__}")


def _plain(given: object) -> object:
    """Return the number of a numpy scalar, and any other value unchanged."""
    try:
        item = getattr(given, "item", None)
        return item() if callable(item) else given
    except Exception:  # noqa: BLE001 - an array of several values, or a foreign object
        return given


def described(error: BaseException) -> str:
    """Return a short, encodable text for any error."""
    try:
        message = str(error)
    except Exception:  # noqa: BLE001 - even that may fail
        message = "its message cannot be shown"
    shown = message if len(message) <= MAX_SHOWN else f"{message[:MAX_SHOWN]}..."
    return f"{type(error).__name__}: {shown}".encode(errors="replace").decode()
