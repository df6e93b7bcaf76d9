"""A message of a process reaches the program unchanged or is refused as garbage; it never becomes code that runs."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.isolation.messages import (
    MAX_BYTES_FROM_PROCESS,
    Connection,
    GarbageError,
    decode_result,
    encode_argument,
    encode_result,
)

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda parts: st.lists(parts) | st.dictionaries(st.text(), parts),
    max_leaves=20,
)
SCALARS = st.booleans() | st.integers(1 - 2**63, 2**63 - 1) | st.floats(allow_nan=False) | st.text(max_size=50)


def through(data: bytes) -> Connection:
    """Return the program's end of a connection whose other end has sent data and was closed."""
    ours, theirs = socket.socketpair()
    theirs.sendall(data)
    theirs.close()
    return Connection(ours)


def sent(returned: object) -> Any:
    """Send a message through a connection, and return what arrives."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        Connection(theirs).send_json("returned", returned)
        return Connection(ours).receive_json()[1]


@given(st.dictionaries(st.text(max_size=20), SCALARS | st.none(), max_size=20))
def test_a_result_arrives_as_it_was_returned(returned: Mapping[str, object]) -> None:
    assert decode_result(sent(encode_result(returned))) == returned


@pytest.mark.parametrize("value", [[1], (1,), {"a": 1}, b"x", {1}, np.zeros(3), object(), Exception])
def test_a_value_of_a_foreign_type_arrives_as_the_name_of_its_type(value: object) -> None:
    arrived: Any = decode_result(sent(encode_result({"a": value})))
    assert type(arrived["a"]).__name__ == type(value).__name__
    assert vars(type(arrived["a"])).keys() <= vars(type("", (), {})).keys()


def test_numpy_numbers_arrive_as_numbers_and_large_values_as_large_placeholders() -> None:
    result = {"a": np.int32(3), "b": np.float32(0.5), "c": 2**70, "d": "x" * 20_000}
    arrived: Any = decode_result(sent(encode_result(result)))
    assert (arrived["a"], arrived["b"]) == (3, 0.5)
    assert arrived["c"].bit_length() == 71
    assert len(arrived["d"]) == 20_000


@given(JSON)
def test_an_arbitrary_result_is_decoded_as_garbage_or_plain(encoded_result: Any) -> None:
    try:
        arrived = decode_result(encoded_result)
    except GarbageError:
        return
    assert arrived is None or isinstance(arrived, (bool, int, float, str, dict)) or not vars(arrived)


@given(st.binary(max_size=200))
def test_any_bytes_from_a_process_are_a_message_or_garbage_or_an_end(data: bytes) -> None:
    connection = through(data)
    with connection.socket:
        try:
            message = connection.receive_json()
        except (GarbageError, EOFError):
            return
    assert isinstance(message[0], str)


def test_a_message_that_is_announced_as_too_long_is_refused_before_it_is_read() -> None:
    connection = through((MAX_BYTES_FROM_PROCESS + 1).to_bytes(4, "big"))
    with connection.socket, pytest.raises(GarbageError, match="sent more than 1048576 bytes"):
        connection.receive_json()


@given(JSON)
def test_a_handle_is_given_plain_values(value: object) -> None:
    assert sent(encode_argument(value)) == value


@pytest.mark.parametrize("value", [b"x", {1}, {1: 2}, np.zeros(3), [object()]])
def test_a_handle_is_given_nothing_else(value: object) -> None:
    with pytest.raises(TypeError, match="a handle accepts numbers, texts, lists and mappings from a process"):
        encode_argument(value)
