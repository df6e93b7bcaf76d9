"""A loop reads overridden inputs like any readings, and goes on with its sources when the override ends."""

from __future__ import annotations

from tests.runtime.loops.shop import Shop
from tests.runtime.loops.test_loop import CLOSE_M


def test_a_loop_adapts_to_an_overridden_input_and_back_at_its_end() -> None:
    shop = Shop()
    shop.begin()
    assert (shop.codra.get("max_speed").value, shop.course()) == (1.2, "deliver")
    shop.codra.override("person_distance", CLOSE_M, for_s=20.0, reason="a visitor whom the lidar does not see")
    shop.pass_s(10.0)
    assert (shop.codra.get("max_speed").value, shop.course()) == (0.3, "start")
    shop.pass_s(25.0)
    assert (shop.codra.get("max_speed").value, shop.course()) == (1.2, "deliver")


def test_a_rate_begins_anew_with_an_override() -> None:
    shop = Shop()
    shop.begin()
    assert shop.codra.get("battery_drain").value == 0.0
    shop.codra.override("battery_level", 20.0, for_s=3_600.0, reason="the gauge is wrong")
    shop.pass_s(120.0)
    assert not shop.codra.get("battery_drain").known
