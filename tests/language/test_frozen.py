"""The compiler's dataclasses behave as Python's frozen dataclasses, except that nothing refuses assignments."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import pytest

from codra_dsl.language.frozen import dataclass


def _classes(decorator: Callable[..., Any]) -> tuple[type, type, type]:
    @decorator(frozen=True, slots=True)
    class Empty:
        pass

    @decorator(frozen=True, slots=True, kw_only=True)
    class One:
        value: float

    @decorator(frozen=True)
    class Several:
        name: str
        source: str = dataclasses.field(default="", repr=False)
        note: str = dataclasses.field(default="", compare=False)

    return Empty, One, Several


def _values(decorator: Callable[..., Any]) -> list[Any]:
    empty, one, several = _classes(decorator)
    return [
        *(empty(), empty()),
        *(one(value=1.0), one(value=1), one(value=2.0), one(value=math.nan)),
        *(several("a"), several("a", note="other"), several("a", "b"), several("b")),
    ]


def test_values_are_written_compared_and_hashed_as_those_of_python_dataclasses() -> None:
    ours, expected = _values(dataclass), _values(dataclasses.dataclass)
    assert list(map(repr, ours)) == list(map(repr, expected))
    equal_pairs = [[one == other for other in ours] for one in ours]
    assert equal_pairs == [[one == other for other in expected] for one in expected]
    assert [[hash(one) == hash(other) for other in ours] for one in ours] == equal_pairs
    assert ours[2] != 1.0


def test_a_value_is_changed_by_replace_alone() -> None:
    _, _, several = _classes(dataclass)
    value = several("a", note="n")
    assert dataclasses.replace(value, name="b") == several("b")
    assert value == several("a")


def test_classes_with_an_order_and_classes_without_equality_keep_their_methods() -> None:
    @dataclass(frozen=True, slots=True, order=True)
    class Ordered:
        number: int

    @dataclass(frozen=True, slots=True, eq=False)
    class Unequal:
        number: int

    @dataclass(slots=True)
    class Changing:
        number: int

    assert Ordered(1) < Ordered(2)
    assert len({Ordered(1), Ordered(1)}) == 1
    assert Unequal(1) != Unequal(1)
    with pytest.raises(TypeError):
        hash(Changing(1))
