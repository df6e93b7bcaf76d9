"""Hard rules whose condition must hold for some time, and actions with a hold of their own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime import ContextManager, Journal
from codra_dsl.runtime.loops.declarations import HardRuleModel, RateKind, RateModel
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import value
from tests.runtime.journal.journals import read
from tests.runtime.loops.shop import BUMPED, COURSE, EMPTY, KNOWLEDGE, MAPE, MODEL, UNFILTERED, Shop

FOR_S = 3.0
BUMPED_FOR = replace(BUMPED, for_s=FOR_S)


def shop_with(*rules: HardRuleModel, record: Journal | None = None) -> Shop:
    return Shop(replace(MAPE, courses=(replace(COURSE, always=rules),)), record=record)


def switches(shop: Shop) -> list[tuple[float, str, str]]:
    return [(event.instant_s, event.details["action"], event.details["because"]) for event in shop.events("chosen")]


def test_a_rule_decides_as_soon_as_its_condition_has_held_for_the_required_time() -> None:
    shop = shop_with(BUMPED_FOR)
    shop.begin()
    bumped_s = shop.clock.now_s()
    shop.write(bumped=True)
    shop.pass_s(10.0)
    assert switches(shop)[1:] == [(bumped_s + FOR_S, "start", "hard_rule")]
    assert "by the hard rule: bumped for 3 s then start" in str(shop.codra.why("course"))


def test_a_condition_that_is_interrupted_or_unknown_for_a_moment_begins_again() -> None:
    person = HardRuleModel(condition=value("person_distance") < 8.0, action="dock", text="near", for_s=7.0)
    shop = shop_with(person)
    shop.write(person=6.0, battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.pass_s(4.0, person=6.0)
    shop.clock.sleep(2.5)  # the distance is unknown from its expiry on
    known_again_s = shop.clock.now_s()
    shop.pass_s(8.0, person=6.0)
    docked_s = [at_s for at_s, action, _ in switches(shop) if action == "dock"]
    assert docked_s == [known_again_s + 7.0]


def test_a_rule_that_waits_does_not_hide_a_later_rule_that_decides() -> None:
    shop = shop_with(BUMPED_FOR, EMPTY)
    shop.begin()
    shop.write(bumped=True, battery=4.0)
    shop.clock.sleep(0.1)
    assert shop.course() == "dock"
    shop.pass_s(FOR_S, battery=4.0)
    assert shop.course() == "start"


def test_a_stop_of_the_loop_interrupts_a_condition() -> None:
    shop = shop_with(BUMPED_FOR)
    shop.begin()
    shop.write(bumped=True)
    shop.pass_s(2.0)
    shop.mape.stop()
    shop.pass_s(10.0)
    shop.mape.start()
    started_s = shop.clock.now_s()
    shop.pass_s(5.0)
    assert switches(shop)[-1][:2] == (started_s + FOR_S, "start")


@settings(max_examples=25)
@given(st.lists(st.tuples(st.booleans(), st.integers(1, 12)), min_size=1, max_size=8))
def test_a_rule_with_a_time_decides_when_a_plain_model_of_it_does(phases: list[tuple[bool, int]]) -> None:
    """The condition changes at quarters of a second; the loop itself analyses once a second."""
    rule = HardRuleModel(condition=value("bumped"), action="dock", text="bumped", for_s=1.0)
    shop = Shop(replace(MAPE, courses=(replace(UNFILTERED, always=(rule,)),), trees=(), loops=(_LOOP_WITHOUT_TREES,)))
    shop.write(person=6.0, battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.clock.sleep(0.125)
    expected, held_s = [], 0.0
    for is_bumped, quarters in phases:
        shop.write(bumped=is_bumped, person=6.0)
        for _ in range(quarters):
            shop.write(person=6.0)
            shop.clock.sleep(0.25)
            held_s = held_s + 0.25 if is_bumped else 0.0
            expected.append(held_s >= 1.0)
            assert (shop.course() == "dock") == expected[-1]


_LOOP_WITHOUT_TREES = replace(MAPE.loops[0], execute=())


def test_a_replay_of_rules_with_times_makes_the_same_journal(tmp_path: Path) -> None:
    shop = shop_with(BUMPED_FOR, record=Journal(tmp_path / "run.mcap"))
    shop.begin()
    shop.write(bumped=True)
    shop.pass_s(5.0)
    shop.mape.close()
    shop.codra.close()
    head, events = read(tmp_path / "run.mcap")
    result = replay(head, events, MODEL, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert result.difference is None
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


@pytest.mark.parametrize(("holds_s", "hold_s"), [({}, 1.0), ({"start": 4.0}, 4.0), ({"dock": 4.0}, 1.0)])
def test_an_action_with_a_hold_of_its_own_must_lead_for_this_time(holds_s: dict[str, float], hold_s: float) -> None:
    course = replace(COURSE, always=(), smooth_s=0.0, dwell_s=0.0, hold_s=1.0, holds_s=holds_s)
    shop = Shop(replace(MAPE, courses=(course,)))
    shop.begin()
    close_s = shop.clock.now_s()
    shop.pass_s(8.0, person=1.0)
    ((switched_s, action, _),) = switches(shop)[1:]
    assert action == "start"
    assert close_s + hold_s <= switched_s <= close_s + hold_s + 0.01


def test_a_share_of_time_is_written_by_its_loop_and_read_by_its_rules(tmp_path: Path) -> None:
    """The truck is bumped for 5 of the last 20 s; before it was known for 10 s, the share is unknown."""
    bumps = RateModel(variable="battery_drain", of="bumped", over_s=20.0, kind=RateKind.SHARE)
    loop = replace(MAPE.loops[0], adapt=("course",))
    rule = HardRuleModel(condition=value("battery_drain") >= 0.25, action="dock", text="rough", for_s=0.0)
    course = replace(COURSE, always=(rule,))
    model = replace(MAPE, rates=(bumps,), courses=(course,), loops=(loop,))
    shop = Shop(model, record=Journal(tmp_path / "run.mcap"))
    shop.begin()
    assert shop.codra.get("battery_drain").value == 0.0
    shop.pass_s(8.0)
    shop.write(bumped=True)
    shop.pass_s(4.0)
    assert shop.course() == "deliver"
    shop.pass_s(2.0)
    assert shop.course() == "dock"
    assert 0.25 <= shop.codra.get("battery_drain").value <= 0.3
    shop.mape.close()
    shop.codra.close()
    head, events = read(tmp_path / "run.mcap")
    assert replay(head, events, MODEL, ContextManager[str, str], None, KNOWLEDGE).difference is None
