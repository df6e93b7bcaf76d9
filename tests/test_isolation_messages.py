"""What a process tells reaches the program as it was meant, or as garbage: never as anything that runs."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.isolation.messages import MAX_TOLD_BYTES, GarbageError, Line, heard_result, told_argument, told_result

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda parts: st.lists(parts) | st.dictionaries(st.text(), parts),
    max_leaves=20,
)
SCALARS = st.booleans() | st.integers(1 - 2**63, 2**63 - 1) | st.floats(allow_nan=False) | st.text(max_size=50)


def through(data: bytes) -> Line:
    """The program's end of a connection on which a process has sent something and gone."""
    ours, theirs = socket.socketpair()
    theirs.sendall(data)
    theirs.close()
    return Line(ours)


def sent(told: object) -> Any:
    """What of a result comes through the wire."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        Line(theirs).tell("returned", told)
        return Line(ours).hear()[1]


@given(st.dictionaries(st.text(max_size=20), SCALARS | st.none(), max_size=20))
def test_a_result_arrives_as_it_was_returned(returned: Mapping[str, object]) -> None:
    assert heard_result(sent(told_result(returned))) == returned


@pytest.mark.parametrize("value", [[1], (1,), {"a": 1}, b"x", {1}, np.zeros(3), object(), Exception])
def test_of_what_no_decision_needs_only_the_name_of_its_type_arrives(value: object) -> None:
    arrived: Any = heard_result(sent(told_result({"a": value})))
    assert type(arrived["a"]).__name__ == type(value).__name__
    assert vars(type(arrived["a"])).keys() <= vars(type("", (), {})).keys()


def test_numbers_of_numpy_arrive_as_numbers_and_what_is_too_large_as_large() -> None:
    given_ = {"a": np.int32(3), "b": np.float32(0.5), "c": 2**70, "d": "x" * 20_000}
    arrived: Any = heard_result(sent(told_result(given_)))
    assert (arrived["a"], arrived["b"]) == (3, 0.5)
    assert arrived["c"].bit_length() == 71
    assert len(arrived["d"]) == 20_000


@given(JSON)
def test_a_result_that_no_process_of_ours_tells_is_garbage_or_plain(told: Any) -> None:
    try:
        arrived = heard_result(told)
    except GarbageError:
        return
    assert arrived is None or isinstance(arrived, (bool, int, float, str, dict)) or not vars(arrived)


@given(st.binary(max_size=200))
def test_whatever_a_process_sends_is_a_message_or_garbage_or_an_end(data: bytes) -> None:
    line = through(data)
    with line.connection:
        try:
            message = line.hear()
        except (GarbageError, EOFError):
            return
    assert isinstance(message[0], str)


def test_a_message_that_is_announced_as_too_long_is_refused_before_it_is_read() -> None:
    line = through((MAX_TOLD_BYTES + 1).to_bytes(4, "big"))
    with line.connection, pytest.raises(GarbageError, match="sent more than 1048576 bytes"):
        line.hear()


@given(JSON)
def test_a_handle_is_given_plain_values(value: object) -> None:
    assert sent(told_argument(value)) == value


@pytest.mark.parametrize("value", [b"x", {1}, {1: 2}, np.zeros(3), [object()]])
def test_a_handle_is_given_nothing_else(value: object) -> None:
    with pytest.raises(TypeError, match="a handle takes numbers, texts, lists and mappings from a process"):
        told_argument(value)
