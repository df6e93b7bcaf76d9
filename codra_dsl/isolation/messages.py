"""Messages between a program and the process of a perception algorithm, in frames of bounded size.

A frame to the process is a pickle, so that handles can answer with any object that can be copied. A frame from the
process is JSON of a few shapes, never a pickle. So a process can neither run code in the program nor fill the program's
memory.
"""

from __future__ import annotations

import json
import pickle
import socket
import struct
from collections.abc import Mapping
from typing import Any

from codra_dsl.isolation.error_text import described

MAX_BYTES_FROM_PROCESS = 2**20
"""The maximum size of a frame from a process. The results of a process are for decisions; they are not payload."""

MAX_BYTES_TO_PROCESS = 64 * 2**20
"""The maximum size of a frame to a process. For comparison: the image of a large camera has 36 MB."""

_FRAME_HEADER = struct.Struct("!I")
_MAX_ENTRIES = 1000
_MAX_NAME_CHARACTERS = 60
_MAX_INTEGER = 2**63 - 1
_MAX_BITS = 2**16
_MAX_TEXT_CHARACTERS = 10_000


class GarbageError(ValueError):
    """A process sent an invalid message."""


class Connection:
    """One end of the connection between a program and a process."""

    def __init__(self, message_socket: socket.socket) -> None:
        self.socket = message_socket

    def send_pickle(self, content: object) -> None:
        """Send an object towards a process.

        Raises:
            TypeError: if the object cannot be copied.
            ValueError: if the object is too large.
            OSError: if the process is gone.
        """
        try:
            data = pickle.dumps(content, protocol=5)
        except Exception as error:
            raise TypeError(f"cannot be copied to another process: {described(error)}") from error
        if len(data) > MAX_BYTES_TO_PROCESS:
            raise ValueError(f"{len(data)} bytes are more than the {MAX_BYTES_TO_PROCESS} that a process can receive")
        self.socket.sendall(_FRAME_HEADER.pack(len(data)))
        self.socket.sendall(data)

    def receive_pickle(self) -> Any:
        """Receive an object from the program. A process calls this method; it trusts the program.

        Raises:
            EOFError: if the program is gone.
        """
        return pickle.loads(self._read_frame(MAX_BYTES_TO_PROCESS))

    def send_json(self, *message: object) -> None:
        """Send a message of plain values towards the program.

        Raises:
            ValueError: if the message is too long.
        """
        data = json.dumps(message).encode()
        if len(data) > MAX_BYTES_FROM_PROCESS:
            raise ValueError(f"{len(data)} bytes are more than the {MAX_BYTES_FROM_PROCESS} that a process may send")
        self.socket.sendall(_FRAME_HEADER.pack(len(data)) + data)

    def receive_json(self) -> list[Any]:
        """Receive a message from a process. The process is not trusted.

        Raises:
            EOFError: if the process is gone.
            TimeoutError: if the time limit of the connection has passed.
            GarbageError: if the message is invalid or too long.
        """
        data = self._read_frame(MAX_BYTES_FROM_PROCESS)
        try:
            message = json.loads(data)
        except (ValueError, RecursionError) as error:
            raise GarbageError("its process sent an invalid message") from error
        if not isinstance(message, list) or not message or not isinstance(message[0], str):
            raise GarbageError("its process sent an invalid message")
        return message

    def _read_frame(self, max_bytes: int) -> bytearray:
        (length,) = _FRAME_HEADER.unpack(self._read_exactly(_FRAME_HEADER.size))
        if length > max_bytes:
            raise GarbageError(f"its process sent more than {max_bytes} bytes")
        return self._read_exactly(length)

    def _read_exactly(self, length: int) -> bytearray:
        data = bytearray(length)
        unfilled_buffer = memoryview(data)
        while unfilled_buffer:
            try:
                received_byte_count = self.socket.recv_into(unfilled_buffer)
            except ConnectionError:
                received_byte_count = 0
            if not received_byte_count:
                raise EOFError("the other end is closed")
            unfilled_buffer = unfilled_buffer[received_byte_count:]
        return data


class _LongText(str):
    """The beginning of a text that was too long to send. `len` returns the length of the complete text."""

    def __new__(cls, beginning: str, length: int) -> _LongText:
        text = super().__new__(cls, beginning)
        text._length = length
        return text

    def __len__(self) -> int:
        return self._length

    _length: int


# Messages for a function's result


def encode_result(result: object) -> object:
    """Return a perception function's result as plain values; the name of the type replaces any other value."""
    if not isinstance(result, Mapping):
        return _encode_value(result)
    pairs: list[object] = []
    for name in result:
        if len(pairs) == _MAX_ENTRIES:
            break
        pairs.append([_encode_value(name), _encode_value(result[name])])
    return {"mapping": pairs}


def decode_result(encoded_result: object) -> object:
    """Return the result that `encode_result` encoded. A placeholder with its type's name replaces any other value.

    Raises:
        GarbageError: if the message is not an encoded result.
    """
    if not isinstance(encoded_result, dict) or "mapping" not in encoded_result:
        return _decode_value(encoded_result)
    try:
        return {_decode_value(name): _decode_value(value) for name, value in encoded_result["mapping"]}
    except (TypeError, ValueError) as error:
        raise GarbageError("its process sent an invalid result") from error


def _encode_value(value: object) -> object:
    plain_value = _unbox_numpy(value)
    if isinstance(plain_value, int) and abs(plain_value) > _MAX_INTEGER:
        return {"bits": int(plain_value).bit_length()}
    if isinstance(plain_value, str):
        is_long = len(plain_value) > _MAX_TEXT_CHARACTERS
        return (
            {"text": plain_value[:_MAX_TEXT_CHARACTERS], "length": len(plain_value)}
            if is_long
            else str.__str__(plain_value)
        )
    return plain_value if isinstance(plain_value, (bool, int, float)) else {"foreign": type(plain_value).__name__}


def _decode_value(encoded_value: object) -> Any:
    match encoded_value:
        case {"bits": int(bits)}:
            return 1 << (min(max(bits, 1), _MAX_BITS) - 1)
        case {"text": str(text), "length": int(length)}:
            return _LongText(text, length)
        case {"foreign": "NoneType"}:
            return None
        case {"foreign": str(name)}:
            return type(name[:_MAX_NAME_CHARACTERS].encode("ascii", "replace").decode().replace("\0", "?"), (), {})()
        case bool() | int() | float() | str():
            return encoded_value
        case _:
            raise GarbageError("its process sent an invalid value")


# Messages for arguments of a handle's methods


def encode_argument(value: object) -> object:
    """Return an argument for a method of a handle: a number, a text, None, or a list or mapping of such values.

    Raises:
        TypeError: if the argument is something else.
    """
    plain_value = _unbox_numpy(value)
    if plain_value is None or isinstance(plain_value, (bool, int, float, str)):
        return plain_value
    if isinstance(plain_value, (list, tuple)):
        return [encode_argument(element) for element in plain_value]
    if isinstance(plain_value, dict) and all(isinstance(name, str) for name in plain_value):
        return {name: encode_argument(element) for name, element in plain_value.items()}
    raise TypeError(
        f"a handle accepts numbers, texts, lists and mappings from a process, not a {type(plain_value).__name__}"
    )


def _unbox_numpy(value: object) -> object:
    """Return the number of a numpy scalar, and any other value unchanged."""
    try:
        item = getattr(value, "item", None)
        return item() if callable(item) else value
    except Exception:  # noqa: BLE001 - an array of several values, or a foreign object
        return value
