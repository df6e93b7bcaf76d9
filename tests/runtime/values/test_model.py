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


class _SmallNumber(int):
    """A number that states that it is small."""

    def __abs__(self) -> int:
        return 0


class _MeasuredNumber(float):
    """A number that states that it is not NaN, and in every range."""

    def __ne__(self, other: object) -> bool:
        return False

    def __le__(self, other: object) -> bool:
        return True

    __ge__ = __le__


class _OneOfTheMembers(str):
    """A text that states that it equals every other text, and is short."""

    __hash__ = str.__hash__

    def __eq__(self, other: object) -> bool:
        return True

    def __len__(self) -> int:
        return 1


class _Pretender:
    """An object that states that it is a number."""

    __class__ = property(lambda _: float)  # type: ignore[assignment]

    def __float__(self) -> float:
        return 5.0


def test_a_number_cannot_hide_its_value_by_methods_of_its_own() -> None:
    with pytest.raises(NotOfTypeError, match="a number of 6644 bits is too large"):
        integer().convert(_SmallNumber(10**2000))
    with pytest.raises(NotOfTypeError, match=r"9\.0 lies outside"):
        real(0, 1).convert(_MeasuredNumber(9.0))
    assert real(0, 1).convert(_MeasuredNumber(math.nan)) is None


def test_a_text_cannot_hide_its_value_by_methods_of_its_own() -> None:
    with pytest.raises(NotOfTypeError, match="'ajar' is not one of open, shut"):
        member("open", "shut").convert(_OneOfTheMembers("ajar"))
    with pytest.raises(NotOfTypeError, match="a text of 10001 characters"):
        text().convert(_OneOfTheMembers("a" * (MAX_TEXT_CHARACTERS + 1)))


@pytest.mark.parametrize("value_type", [boolean(), integer(), real(), text()], ids=lambda value_type: value_type.kind)
def test_an_object_that_pretends_to_be_a_number_is_refused(value_type: ValueType) -> None:
    for convert in (value_type.convert, value_type.converter()):
        with pytest.raises(NotOfTypeError, match="a _Pretender is not of type"):
            convert(_Pretender())
