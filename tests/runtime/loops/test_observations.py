"""The numbers of an engine for the values of its inputs, and possible values of unknown inputs."""

from __future__ import annotations

import math

from codra_dsl.runtime.loops.declarations import InputModel
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds
from codra_dsl.runtime.loops.observations import number_of, possible_values, value_of


def test_members_count_from_zero_and_an_unknown_one_is_one_of_them() -> None:
    load = InputModel(variable="load", range=Bounds(0.0, 2.0), members=("empty", "loading", "full"))
    assert [number_of(load, member) for member in load.members] == [0.0, 1.0, 2.0]
    assert [value_of(load, number) for number in (0.0, 1.0, 2.0)] == list(load.members)
    assert possible_values(load, math.nan) == (Bounds(0.0, 0.0), Bounds(1.0, 1.0), Bounds(2.0, 2.0))
    bumped = InputModel(variable="bumped", range=Bounds(0.0, 1.0), members=("false", "true"))
    assert [value_of(bumped, number_of(bumped, value)) for value in (False, True)] == [False, True]
