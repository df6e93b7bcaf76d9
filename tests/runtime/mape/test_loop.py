"""The loop as an agent in a shop: what it analyses, chooses, aborts and sets."""

from __future__ import annotations

from tests.runtime.mape.shop import Shop


def test_a_calm_shop_delivers() -> None:
    shop = Shop()
    shop.begin()
    assert shop.course() == "deliver"
    assert shop.codra.get("course_now").value == "deliver"
    assert shop.codra.get("max_speed").value == 1.2
    print(shop.codra.get("safety"), shop.codra.get("weight_of_deliver"), shop.codra.get("battery_drain"))
    for e in shop.codra.record.of(__import__("codra_dsl.runtime").runtime.Kind.ADAPTATION):
        print(e.instant_s, e.name, e.what, {k: v for k, v in e.details.items() if k not in ("rules", "degrees")})
    shop.pass_s(10, person=1.0)
    print(shop.course(), shop.codra.get("safety"))
    for e in shop.codra.record.of(__import__("codra_dsl.runtime").runtime.Kind.ADAPTATION):
        print(e.instant_s, e.name, e.what, {k: v for k, v in e.details.items() if k not in ("rules", "degrees")})
    assert 0
