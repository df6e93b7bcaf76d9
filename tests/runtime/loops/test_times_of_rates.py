"""Rates, shares and held bools change at the instant at which they do, not at the next period of their loop."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from codra_dsl.runtime import ContextManager, EventLog, Journal, Kind
from codra_dsl.runtime.loops.declarations import HardRuleModel, RateKind, RateModel
from codra_dsl.runtime.loops.rates import MIN_SPAN_SHARE
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.values.model import VariableModel, boolean, real
from tests.runtime.journal.journals import read
from tests.runtime.loops.shop import COURSE, KNOWLEDGE, LOOP, MAPE, MODEL, Shop

LONG = RateModel(variable="bumped_long", of="bumped", over_s=5.0, kind=RateKind.HELD)
ROUGH = RateModel(variable="rough", of="bumped", over_s=20.0, kind=RateKind.SHARE)
DRAIN = RateModel(variable="drain", of="battery_level", over_s=20.0, factor=-60.0)
CONTEXT = replace(
    MODEL,
    variables=(
        *MODEL.variables,
        VariableModel(name="bumped_long", type=boolean(), sources=("analysis",)),
        VariableModel(name="rough", type=real(0.0, 1.0), sources=("analysis",)),
        VariableModel(name="drain", type=real(-9e9, 9e9, unit="percent/min"), sources=("analysis",)),
    ),
)
PHASE_S = 0.3
"""The loop analyses once a second, and the first time at this instant."""


def shop_with(
    rate: RateModel, *rules: HardRuleModel, valid_for_s: float = 600.0, record: EventLog | None = None
) -> Shop:
    """Return a shop whose only loop computes a rate and follows hard rules."""
    variables = (
        replace(variable, valid_for_s=valid_for_s) if variable.name == rate.variable else variable
        for variable in CONTEXT.variables
    )
    loop = replace(LOOP, rates=(rate.variable,), adapt=("course",), execute=())
    model = replace(
        MAPE,
        rates=(replace(rate, valid_for_s=valid_for_s),),
        courses=(replace(COURSE, always=rules),),
        parameters=(),
        trees=(),
        loops=(loop,),
    )
    shop = Shop(model, context=replace(CONTEXT, variables=tuple(variables)), record=record)
    shop.clock.sleep(PHASE_S)
    shop.mape.start()
    return shop


def changes(shop: Shop, name: str) -> list[tuple[float, object]]:
    """Return the instants at which a variable got another value, with this value; None if it became unknown."""
    events = [
        (round(event.instant_s, 3), event.details["value"]) for event in shop.codra.record.of(Kind.VARIABLE, name)
    ]
    return [event for before, event in zip([(0.0, None), *events], events, strict=False) if event[1] != before[1]]


def test_a_held_bool_is_true_when_its_time_is_over_and_false_at_once(tmp_path: Path) -> None:
    rule = HardRuleModel(condition=value("bumped_long"), action="dock", text="bumped_long")
    shop = shop_with(LONG, rule, record=Journal(tmp_path / "run.mcap"))
    shop.write(bumped=False)
    shop.clock.sleep(1.5)
    shop.write(bumped=True)
    shop.clock.sleep(7.0)
    shop.write(bumped=False)
    shop.clock.sleep(1.0)
    assert changes(shop, "bumped_long") == [(0.3, False), (6.8, True), (8.8, False)]
    docked_s = [event.instant_s for event in shop.events("chosen") if event.details["action"] == "dock"]
    assert docked_s == [pytest.approx(6.8)]
    shop.mape.close()
    shop.codra.close()
    head, events = read(tmp_path / "run.mcap")
    assert replay(head, events, shop.codra.model, ContextManager[str, str], None, KNOWLEDGE).difference is None


def test_a_held_bool_is_unknown_until_enough_is_known_and_while_its_bool_is_unknown() -> None:
    shop = shop_with(LONG)
    shop.write(bumped=True)
    shop.clock.sleep(6.0)
    shop.codra.override("bumped", None, for_s=2.0, reason="the bumper is being cleaned")
    shop.clock.sleep(3.0)
    assert changes(shop, "bumped_long") == [(5.3, True), (6.3, None), (8.3, True)]


def test_a_rate_runs_out_when_its_readings_leave_the_window() -> None:
    shop = shop_with(DRAIN)
    for _ in range(30):
        shop.clock.sleep(0.53)
        shop.write(battery=50.0)
    shop.clock.sleep(30.0)
    written_s = [PHASE_S + 0.53 * (index + 1) for index in range(30)]
    last_needed_s = max(at_s for at_s in written_s if written_s[-1] - at_s >= MIN_SPAN_SHARE * 20.0)
    assert changes(shop, "drain")[-1] == (pytest.approx(last_needed_s + 20.0, abs=1e-3), None)


def test_a_share_is_known_when_its_bool_was_known_for_half_of_the_window() -> None:
    shop = shop_with(ROUGH)
    shop.clock.sleep(0.25)
    shop.write(bumped=True)
    shop.clock.sleep(12.0)
    assert changes(shop, "rough") == [(10.55, 1.0)]


def test_a_share_without_valid_evidence_is_stale_for_its_loop_and_for_its_readers() -> None:
    rule = HardRuleModel(condition=value("rough") > 0.5, action="dock", text="rough")
    shop = shop_with(ROUGH, rule, valid_for_s=4.0)
    for _ in range(8):
        shop.write(bumped=True)
        shop.clock.sleep(2.0)
    assert shop.course() == "dock"
    shop.clock.sleep(20.0)
    assert changes(shop, "rough")[-1] == (18.3, None)
    assert str(shop.codra.get("rough").reason) == "stale"
    assert not shop.mape.decisions("course")[-1].assessment.scene["rough"].because
    rough = shop.mape.loop("store").planning.plan(shop.codra, shop.clock.now_s()).assessment.scene["rough"]
    assert (rough.value, rough.because) == (None, "stale")


@pytest.mark.parametrize("valid_for_s", [0.5, 1.0])
def test_a_share_with_new_evidence_is_not_stale_even_if_it_is_valid_for_a_short_time(
    valid_for_s: float,
) -> None:
    shop = shop_with(ROUGH, valid_for_s=valid_for_s)
    for _ in range(40):
        shop.write(bumped=True)
        shop.clock.sleep(0.4)
    assert changes(shop, "rough") == [(10.3, 1.0)]


def test_an_override_begins_the_time_of_a_hard_rule_anew_and_so_does_its_end() -> None:
    """The value stays the same, so the loop notices the override and its end at its next analyses, at 3.3 and 6.3 s."""
    rule = HardRuleModel(condition=value("bumped"), action="dock", text="bumped", for_s=4.0)
    shop = shop_with(LONG, rule)
    shop.write(bumped=True)
    shop.clock.sleep(2.9)
    shop.codra.override("bumped", True, for_s=3.0, reason="the bumper is broken")
    shop.clock.sleep(7.0)
    docked_s = [event.instant_s for event in shop.events("chosen") if event.details["action"] == "dock"]
    assert docked_s == []
    shop.clock.sleep(1.0)
    docked_s = [event.instant_s for event in shop.events("chosen") if event.details["action"] == "dock"]
    assert docked_s == [pytest.approx(PHASE_S + 6.0 + 4.0)]


def test_a_hard_rule_decides_when_an_override_alone_has_lasted_for_its_time() -> None:
    rule = HardRuleModel(condition=value("bumped"), action="dock", text="bumped", for_s=4.0)
    shop = shop_with(LONG, rule)
    shop.write(bumped=False)
    shop.codra.override("bumped", True, for_s=60.0, reason="the bumper is broken")
    shop.clock.sleep(4.5)
    docked_s = [event.instant_s for event in shop.events("chosen") if event.details["action"] == "dock"]
    assert docked_s == [pytest.approx(PHASE_S + 4.0)]


def test_why_states_the_reason_of_an_unknown_rate_and_the_state_of_its_input() -> None:
    shop = shop_with(ROUGH)
    shop.clock.sleep(0.25)
    shop.write(bumped=True)
    shop.clock.sleep(4.0)
    assert str(shop.codra.why("rough")).splitlines()[-4:] == [
        "  it is the share of time at which bumped was true, over 20 s",
        "  unknown since 0.55 s: bumped is known for 0 s, but must be for 10 s",
        "  known from 10.55 s on, if bumped stays as it is",
        "  bumped is true, from evidence taken at 0.55 s",
    ]
    shop.clock.sleep(8.0)
    assert str(shop.codra.why("rough")).splitlines()[-2:] == [
        "  known since 10.55 s",
        "  bumped is true, from evidence taken at 0.55 s",
    ]
    shop.codra.override("bumped", None, for_s=60.0, reason="the bumper is being cleaned")
    shop.clock.sleep(1.0)
    assert str(shop.codra.why("rough")).splitlines()[-2:] == [
        "  unknown since 12.55 s: bumped is unknown",
        "  bumped has been unknown since 12.55 s (overridden: the bumper is being cleaned)",
    ]


@pytest.mark.parametrize(("rate", "message"), [(LONG, "must be for 5 s"), (DRAIN, "must be for 10 s")])
def test_why_states_since_when_the_readings_of_a_rate_count(rate: RateModel, message: str) -> None:
    shop = shop_with(rate)
    for _ in range(8):
        shop.write(bumped=True, battery=80.0)
        shop.clock.sleep(0.5)
    lines = str(shop.codra.why(rate.variable)).splitlines()
    (unknown_line,) = (line for line in lines if line.startswith("  unknown since 0.3 s: "))
    assert unknown_line.endswith(f"{message}, counted since 0.3 s")
    assert len([event for event in shop.events("computed") if event.details["variable"] == rate.variable]) <= 2
