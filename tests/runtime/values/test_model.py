"""Values that each type accepts, and values that it refuses."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum, IntEnum, StrEnum

import numpy as np
import pytest

from codra_dsl.runtime.values.model import (
    MAX_INTEGER,
    MAX_TEXT_CHARACTERS,
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
    "1 is not of type bool": (boolean(), 1),
    "'yes' is not of type bool": (boolean(), "yes"),
    "None is not of type bool": (boolean(), None),
    "a Hostile is not of type bool": (boolean(), Hostile()),
    "True is not of type int": (integer(), True),
    "1.0 is not of type int": (integer(), 1.0),
    f"'{'x' * 60}...' is not of type int": (integer(), "x" * 1000),
    "a number of 16610 bits is too large": (integer(), 10**5000),
    "a number of 64 bits is too large": (integer(), MAX_INTEGER + 1),
    "a number of 1329 bits is too large": (real(), 10**400),
    "True is not of type float": (real(), True),
    "'1' is not of type float": (real(), "1"),
    "a complex is not of type float": (real(), 1j),
    "a list is not of type float": (real(), [1.0]),
    "a ndarray is not of type float": (real(), np.zeros(3)),
    "1.5 lies outside [0, 1]": (real(0, 1), 1.5),
    "-0.5 lies outside [0, inf]": (real(low=0), -0.5),
    "13 lies outside [0, 12]": (integer(0, 12), 13),
    "a bytes is not of type str": (text(), b"x" * 10**8),
    "a text of 10001 characters is too long: the limit is 10000": (text(), "x" * (MAX_TEXT_CHARACTERS + 1)),
    "a text with half a character (a lone surrogate) cannot be written to a file": (text(), "\ud800"),
    "'ajar' is not one of open, shut": (member("open", "shut"), "ajar"),
    "1 is not of type enum": (member("open", "shut"), 1),
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_value_of_another_type_is_refused_with_a_short_message(message: str) -> None:
    expected, given = REFUSED[message]
    with pytest.raises(NotOfTypeError) as raised:
        expected.convert(given)
    assert str(raised.value) == message


@pytest.mark.parametrize("convert", [real().convert, real(0, 1).convert], ids=["free", "within a range"])
def test_nan_is_unknown(convert: Callable[[object], object]) -> None:
    assert convert(math.nan) is None
    assert convert(np.float64("nan")) is None
