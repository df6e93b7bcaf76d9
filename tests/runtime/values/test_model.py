"""What a value of each type is, and what it is not."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum, IntEnum, StrEnum

import numpy as np
import pytest

from codra_dsl.runtime.values.model import (
    MAX_TEXT,
    MAX_WHOLE,
    NotOfTypeError,
    ValueType,
    boolean,
    integer,
    member,
    real,
    text,
)


class Door(StrEnum):
    OPEN = "open"


class Level(IntEnum):
    HIGH = 3


class Named(str, Enum):  # noqa: UP042 - robots have such enums
    OPEN = "open"


@pytest.mark.parametrize(
    ("expected", "given", "value"),
    [
        (boolean(), True, True),
        (boolean(), np.bool_(False), False),
        (integer(), 7, 7),
        (integer(), np.int64(7), 7),
        (integer(), Level.HIGH, 3),
        (integer(0, 12), 12, 12),
        (real(), 7, 7.0),
        (real(), np.float32(0.5), 0.5),
        (real(), math.inf, math.inf),
        (text(), "", ""),
        (text(), Door.OPEN, "open"),
        (member("open", "shut"), Named.OPEN, "open"),
    ],
    ids=repr,
)
def test_a_value_becomes_plain(expected: ValueType, given: object, value: object) -> None:
    converted = expected.convert(given)
    assert converted == value
    assert type(converted) is type(value)


class Hostile:
    def __repr__(self) -> str:
        raise RuntimeError("no text of me")

    @property
    def item(self) -> object:
        raise RuntimeError("no item of me")


REFUSED = {
    "1 is no bool": (boolean(), 1),
    "'yes' is no bool": (boolean(), "yes"),
    "None is no bool": (boolean(), None),
    "a Hostile is no bool": (boolean(), Hostile()),
    "True is no int": (integer(), True),
    "1.0 is no int": (integer(), 1.0),
    f"'{'x' * 60}...' is no int": (integer(), "x" * 1000),
    "a number of 16610 bits is too large": (integer(), 10**5000),
    "a number of 64 bits is too large": (integer(), MAX_WHOLE + 1),
    "a number of 1329 bits is too large": (real(), 10**400),
    "True is no float": (real(), True),
    "'1' is no float": (real(), "1"),
    "a complex is no float": (real(), 1j),
    "a list is no float": (real(), [1.0]),
    "a ndarray is no float": (real(), np.zeros(3)),
    "1.5 lies outside [0, 1]": (real(0, 1), 1.5),
    "-0.5 lies outside [0, inf]": (real(low=0), -0.5),
    "13 lies outside [0, 12]": (integer(0, 12), 13),
    "a bytes is no str": (text(), b"x" * 10**8),
    "a text of 10001 characters is too long: 10000 are enough for a decision": (text(), "x" * (MAX_TEXT + 1)),
    "a text with half a character (a lone surrogate) is no str that can be written down": (text(), "\ud800"),
    "'ajar' is none of open, shut": (member("open", "shut"), "ajar"),
    "1 is no enum": (member("open", "shut"), 1),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_is_no_value_of_a_type_is_told_in_short(message: str) -> None:
    expected, given = REFUSED[message]
    with pytest.raises(NotOfTypeError) as raised:
        expected.convert(given)
    assert str(raised.value) == message


@pytest.mark.parametrize("convert", [real().convert, real(0, 1).convert], ids=["free", "within a range"])
def test_nan_is_unknown(convert: Callable[[object], object]) -> None:
    assert convert(math.nan) is None
    assert convert(np.float64("nan")) is None
