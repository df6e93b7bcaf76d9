"""Sweeps over the inputs of a loop: monotone metrics, and a rule that explains each switch."""

from __future__ import annotations

import itertools

import pytest

from codra_dsl.logic import Value
from codra_dsl.runtime import UnknownNameError
from codra_dsl.runtime.loops.sweep import Sweep, sweep
from tests.runtime.loops.shop import COURSE, LOADS, MAPE

CALM: dict[str, Value | None] = {
    "person_distance": 6.0,
    "battery_level": 80.0,
    "battery_drain": 0.5,
    "container_load": "empty",
    "bumped": False,
}
DISTANCES = [0.3 + 0.1 * index for index in range(58)]
LEVELS = [float(level) for level in range(101)]


def swept(variable: str, values: list[Value], **known: Value | None) -> Sweep:
    """Return a sweep of the shop."""
    return sweep(MAPE, COURSE, {**CALM, **known}, variable, values)


@pytest.mark.parametrize("level", [0.0, 8.0, 20.0, 50.0, 100.0])
@pytest.mark.parametrize("load", LOADS)
def test_safety_never_falls_as_people_go_away(level: float, load: str) -> None:
    rows = swept("person_distance", [*DISTANCES], battery_level=level, container_load=load).rows
    safeties = [row.metrics["safety"] or 0.0 for row in rows]
    assert all(one <= other for one, other in itertools.pairwise(safeties))
    assert safeties[0] < safeties[-1]


@pytest.mark.parametrize("distance", [0.5, 2.0, 6.0])
def test_autonomy_never_falls_as_the_battery_fills(distance: float) -> None:
    rows = swept("battery_level", [*LEVELS], person_distance=distance).rows
    autonomies = [row.metrics["power_autonomy"] or 0.0 for row in rows]
    assert all(one <= other + 1e-9 for one, other in itertools.pairwise(autonomies))


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("level", [3.0, 12.0, 18.0, 80.0])
def test_every_switch_over_distance_is_explained_by_a_rule_about_the_distance(load: str, level: float) -> None:
    sweep_result = swept("person_distance", [*DISTANCES], container_load=load, battery_level=level)
    for switch in sweep_result.switches:
        assert float(switch.high) - float(switch.low) < 1e-6
        *_, of_metrics = switch.rules
        assert "person_distance" in of_metrics.text
        assert all(rule.place.startswith("specs/shop.yaml:") for rule in switch.rules)
        assert all(rule.text in str(sweep_result) for rule in switch.rules)


def test_the_switch_over_distance_is_where_both_weights_are_equal() -> None:
    (switch,) = swept("person_distance", [*DISTANCES]).switches
    assert (switch.before, switch.after) == ("start", "deliver")
    (row,) = swept("person_distance", [switch.low]).rows
    assert row.weights["start"] == pytest.approx(row.weights["deliver"], abs=1e-6)


@pytest.mark.parametrize("distances", [[0, 10], [10, 0], [0, 1, 2, 3, 4]])
def test_an_input_with_whole_numbers_switches_between_two_of_them(distances: list[Value]) -> None:
    sweep_result = swept("person_distance", distances)
    (switch,) = sweep_result.switches
    assert {repr(switch.low), repr(switch.high)} == {"2", "3"}
    assert {round(switch.rules[-1].before, 3), round(switch.rules[-1].after, 3)} == {0.5, 0.0}
    assert f"between {switch.low} and {switch.high}:" in str(sweep_result)


def test_a_switch_at_the_limit_of_a_hard_rule_is_explained_by_that_rule() -> None:
    result = swept("battery_level", [3.0, 7.0], person_distance=1.0)
    (switch,) = result.switches
    assert (switch.before, switch.after) == ("dock", "start")
    assert [(rule.text, rule.before, rule.after) for rule in switch.rules] == [("battery_level < 5 percent", 1.0, 0.0)]
    assert float(switch.high) == pytest.approx(5.0)


def test_members_switch_between_two_of_them() -> None:
    (switch,) = swept("container_load", [*LOADS]).switches
    assert (switch.low, switch.high, switch.before, switch.after) == ("loading", "full", "deliver", "start")
    assert "container_load is not full" in switch.rules[0].text


def test_a_variable_that_no_rule_reads_cannot_be_swept() -> None:
    with pytest.raises(UnknownNameError):
        swept("weather", [0.0])
