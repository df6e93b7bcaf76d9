"""What a program and the process of a perception algorithm say to each other: frames of bounded size.

Towards the process a frame is a pickle, so that handles can answer with whatever can be copied. What comes back is
JSON of a few shapes, never a pickle: a process cannot run code in the program, or fill its memory.
"""

from __future__ import annotations

import json
import pickle
import socket
import struct
from collections.abc import Mapping
from typing import Any

MAX_TOLD_BYTES = 2**20
"""The longest frame that a process may send: its results are for decisions, not for payload."""

MAX_GIVEN_BYTES = 64 * 2**20
"""The longest frame that a process is sent: the image of a large camera has 36 MB."""

MAX_SHOWN = 200
"""Characters of a foreign text that a reason shows."""

_HEAD = struct.Struct("!I")
_MAX_ENTRIES = 1000
_MAX_NAME = 60
_MAX_WHOLE = 2**63 - 1
_MAX_BITS = 2**16
_MAX_TEXT = 10_000


class GarbageError(ValueError):
    """A process sent what none of ours sends."""


class Line:
    """One end of the connection between a program and a process."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection

    def give(self, thing: object) -> None:
        """Send an object towards a process.

        Raises:
            TypeError: if it cannot be copied.
            ValueError: if it is too large.
            OSError: if nobody is there any more.
        """
        try:
            data = pickle.dumps(thing, protocol=5)
        except Exception as error:
            raise TypeError(f"cannot be copied to another process: {described(error)}") from error
        if len(data) > MAX_GIVEN_BYTES:
            raise ValueError(f"{len(data)} bytes are more than the {MAX_GIVEN_BYTES} that a process is sent")
        self.connection.sendall(_HEAD.pack(len(data)))
        self.connection.sendall(data)

    def take(self) -> Any:
        """Receive, in a process, what the program gives; it is trusted.

        Raises:
            EOFError: if the program is gone.
        """
        return pickle.loads(self._read(MAX_GIVEN_BYTES))

    def tell(self, *message: object) -> None:
        """Send a message of plain values towards the program.

        Raises:
            ValueError: if it is too long.
        """
        data = json.dumps(message).encode()
        if len(data) > MAX_TOLD_BYTES:
            raise ValueError(f"{len(data)} bytes are more than the {MAX_TOLD_BYTES} that a process may send")
        self.connection.sendall(_HEAD.pack(len(data)) + data)

    def hear(self) -> list[Any]:
        """Receive a message of a process; nothing in it is trusted.

        Raises:
            EOFError: if the process is gone.
            TimeoutError: if the time of the connection is over.
            GarbageError: if it is no message, or too long.
        """
        data = self._read(MAX_TOLD_BYTES)
        try:
            message = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise GarbageError("its process sent what is no message") from error
        if not isinstance(message, list) or not message or not isinstance(message[0], str):
            raise GarbageError("its process sent what is no message")
        return message

    def _read(self, most: int) -> bytearray:
        (length,) = _HEAD.unpack(self._read_all(_HEAD.size))
        if length > most:
            raise GarbageError(f"its process sent more than {most} bytes")
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
                raise EOFError("nobody is there any more")
            left = left[count:]
        return data


class _LongText(str):
    """The beginning of a text that was too long to send, which says how long it was."""

    def __new__(cls, beginning: str, length: int) -> _LongText:
        made = super().__new__(cls, beginning)
        made._length = length
        return made

    def __len__(self) -> int:
        return self._length

    _length: int


# What a function returned, as a message


def told_result(returned: object) -> object:
    """Return what a perception function returned as plain values, in which anything foreign has but its type's name."""
    if not isinstance(returned, Mapping):
        return _told_value(returned)
    pairs: list[object] = []
    for name in returned:
        if len(pairs) == _MAX_ENTRIES:
            break
        pairs.append([_told_value(name), _told_value(returned[name])])
    return {"mapping": pairs}


def heard_result(told: object) -> object:
    """Return what `told_result` told: values of other types are stand-ins that have nothing but their type's name.

    Raises:
        GarbageError: if it told nothing of the kind.
    """
    if not isinstance(told, dict) or "mapping" not in told:
        return _heard_value(told)
    try:
        return {_heard_value(name): _heard_value(value) for name, value in told["mapping"]}
    except (TypeError, ValueError) as error:
        raise GarbageError("its process sent what is no result") from error


def _told_value(value: object) -> object:
    plain = _plain(value)
    if isinstance(plain, int) and abs(plain) > _MAX_WHOLE:
        return {"bits": int(plain).bit_length()}
    if isinstance(plain, str):
        is_long = len(plain) > _MAX_TEXT
        return {"text": plain[:_MAX_TEXT], "length": len(plain)} if is_long else str.__str__(plain)
    return plain if isinstance(plain, (bool, int, float)) else {"foreign": type(plain).__name__}


def _heard_value(told: object) -> Any:
    match told:
        case {"bits": int(bits)}:
            return 1 << (min(max(bits, 1), _MAX_BITS) - 1)
        case {"text": str(text), "length": int(length)}:
            return _LongText(text, length)
        case {"foreign": "NoneType"}:
            return None
        case {"foreign": str(name)}:
            return type(name[:_MAX_NAME].encode("ascii", "replace").decode().replace("\0", "?"), (), {})()
        case bool() | int() | float() | str():
            return told
        case _:
            raise GarbageError("its process sent what is no value")


# What a handle is given, as a message


def told_argument(value: object) -> object:
    """Return what a process gives to a method of a handle: numbers, texts, lists and mappings of them.

    Raises:
        TypeError: if it is something else.
    """
    plain = _plain(value)
    if plain is None or isinstance(plain, (bool, int, float, str)):
        return plain
    if isinstance(plain, (list, tuple)):
        return [told_argument(part) for part in plain]
    if isinstance(plain, dict) and all(isinstance(name, str) for name in plain):
        return {name: told_argument(part) for name, part in plain.items()}
    raise TypeError(f"a handle takes numbers, texts, lists and mappings from a process, not a {type(plain).__name__}")


def _plain(given: object) -> object:
    """Return the number that one of numpy's scalars stands for, and anything else as it is."""
    try:
        item = getattr(given, "item", None)
        return item() if callable(item) else given
    except Exception:  # noqa: BLE001 - an array of several values, or a foreign object
        return given


def described(error: BaseException) -> str:
    """Return an error as a short text that can be written down, whatever the error is."""
    try:
        message = str(error)
    except Exception:  # noqa: BLE001 - even that may fail
        message = "its message cannot be shown"
    shown = message if len(message) <= MAX_SHOWN else f"{message[:MAX_SHOWN]}..."
    return f"{type(error).__name__}: {shown}".encode(errors="replace").decode()
