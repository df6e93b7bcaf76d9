"""Parameters while their values are unknown, the renewal of their evidence, and inputs that were never known."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from codra_dsl.runtime import ContextManager, Journal, Kind, Reason
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.loops import Planning
from codra_dsl.runtime.loops.declarations import MapeModel, ParameterModel
from codra_dsl.runtime.loops.never_known import PATIENCE_PERIODS
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import choose, literal, value
from codra_dsl.runtime.why import explain
from tests.runtime.journal.journals import read
from tests.runtime.loops import shop as shop_module
from tests.runtime.loops.shop import COURSE, KNOWLEDGE, MAPE, MODEL, SPEED, Shop

VALID_FOR_S = 4.0
PERSON_VALID_FOR_S = 2.0
DIRECT = replace(
    SPEED,
    value=choose(0.3, value("person_distance") < 1.5, 1.2),
    text="0.3 m/s if person_distance < 1.5 m else 1.2 m/s",
    otherwise=literal(0.1),
)
VALID_MODEL = replace(
    MODEL,
    variables=tuple(
        replace(variable, valid_for_s=VALID_FOR_S) if variable.name == "max_speed" else variable
        for variable in MODEL.variables
    ),
)


@pytest.fixture(autouse=True)
def max_speed_expires(monkeypatch: pytest.MonkeyPatch) -> None:
    """The evidence of `max_speed` is valid for 4 s in all tests of this module."""
    monkeypatch.setattr(shop_module, "MODEL", VALID_MODEL)


def mape(parameter: ParameterModel = DIRECT) -> MapeModel:
    return replace(MAPE, parameters=(parameter,))


def settings(shop: Shop) -> list[tuple[float, object, str]]:
    """Return when the parameter was set, to which value, and why."""
    return [(event.instant_s, event.details["value"], event.details["because"]) for event in shop.events("set")]


def writes(shop: Shop) -> list[float]:
    """Return the instants at which `max_speed` was written."""
    return [
        event.instant_s
        for event in shop.codra.record.of(Kind.VARIABLE, "max_speed")
        if event.what == "identified" and event.details["present"]
    ]


def test_a_parameter_takes_otherwise_at_the_instant_at_which_its_value_becomes_unknown() -> None:
    """The sensor fails for 30 s: `otherwise` does not wait for the next period, nor for the end of the dwell."""
    shop = Shop(mape(replace(DIRECT, dwell_s=20.0)))
    shop.begin()
    last_report_s = shop.clock.now_s()
    shop.write(person=6.0)
    shop.clock.sleep(30.0)
    unknown_s = last_report_s + PERSON_VALID_FOR_S
    assert settings(shop)[1:] == [(unknown_s, 0.1, "unknown")]
    assert shop.codra.get("max_speed").value == 0.1


def test_after_otherwise_the_dwell_holds_until_the_value_is_set_again() -> None:
    shop = Shop(mape(replace(DIRECT, dwell_s=5.0)))
    shop.begin()
    shop.clock.sleep(3.0)
    otherwise_s = settings(shop)[-1][0]
    shop.pass_s(10.0)
    (set_s, content, because) = settings(shop)[-1]
    assert (content, because) == (1.2, "changed")
    assert otherwise_s + 5.0 <= set_s <= otherwise_s + 5.1


def test_a_metric_that_became_worse_ends_the_dwell_of_otherwise() -> None:
    value_ = choose(0.3, (value("safety") < 0.6) & (value("battery_level") < 101.0), 1.2)
    shop = Shop(mape(replace(SPEED, value=value_, dwell_s=100.0, otherwise=literal(1.0))))
    shop.write(person=6.0)
    shop.mape.start()
    shop.pass_s(2.0, person=6.0)
    shop.write(person=1.0)
    shop.clock.sleep(0.1)
    assert [setting[1:] for setting in settings(shop)] == [(1.2, "first"), (0.3, "worse")]


def test_without_otherwise_the_last_value_is_no_longer_confirmed_and_becomes_stale() -> None:
    shop = Shop(mape(replace(DIRECT, otherwise=None)))
    shop.begin()
    shop.clock.sleep(PERSON_VALID_FOR_S + VALID_FOR_S)
    assert shop.codra.get("max_speed").reason is Reason.STALE
    shop.pass_s(0.5)
    assert shop.codra.get("max_speed").value == 1.2


def test_a_running_loop_keeps_its_parameter_valid_with_few_writes() -> None:
    shop = Shop(mape())
    shop.begin()
    for _ in range(200):
        shop.pass_s(0.5)
        assert shop.codra.get("max_speed").known
    written = writes(shop)
    gaps_s = {round(later - earlier, 6) for earlier, later in pairwise(written)}
    assert gaps_s == {VALID_FOR_S / 2}
    assert len(settings(shop)) == 1


def test_a_validity_shorter_than_the_period_of_the_loop_is_kept_as_well() -> None:
    loop = replace(MAPE.loops[0], period_s=60.0)
    shop = Shop(replace(mape(), loops=(loop,)))
    shop.begin()
    shop.write(person=6.0)
    for _ in range(20):
        shop.clock.sleep(0.1)
        assert shop.codra.get("max_speed").known


def test_a_stopped_loop_is_noticed_within_the_validity_of_its_parameter() -> None:
    shop = Shop(mape())
    shop.begin()
    shop.mape.stop()
    stopped_s = shop.clock.now_s()
    shop.pass_s(VALID_FOR_S)
    reading = shop.codra.get("max_speed")
    assert reading.reason is Reason.STALE
    assert stopped_s < reading.identified_s <= stopped_s + VALID_FOR_S


def test_a_loop_that_starts_again_confirms_the_same_value_at_once() -> None:
    shop = Shop(mape())
    shop.begin()
    shop.mape.stop()
    shop.pass_s(10.0)
    shop.mape.start()
    shop.pass_s(0.5)
    assert shop.codra.get("max_speed").value == 1.2
    assert len(settings(shop)) == 1


@pytest.mark.parametrize("speed", [0.5, None])
def test_a_parameter_stays_valid_beneath_an_override(speed: float | None) -> None:
    shop = Shop(mape())
    shop.begin()
    shop.codra.override("max_speed", speed, for_s=60.0, reason="a test drive")
    shop.pass_s(10.5)
    why = shop.codra.why("max_speed")
    assert why.beneath is not None
    assert [line.startswith("set at") for line in (*why.story, *why.beneath.story)].index(True) >= len(why.story)
    shop.codra.clear_override("max_speed")
    assert shop.codra.get("max_speed").value == 1.2
    assert all(later_s - earlier_s >= VALID_FOR_S / 2 for earlier_s, later_s in pairwise(writes(shop)))


def journaled_shop(path: Path) -> Shop:
    shop = Shop(mape(), record=Journal(path))
    shop.begin()
    shop.clock.sleep(30.0)
    shop.pass_s(6.0, person=1.0)
    shop.mape.close()
    shop.codra.close()
    return shop


def test_replay_and_why_agree_with_the_run(tmp_path: Path) -> None:
    shop = journaled_shop(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    result = replay(head, events, VALID_MODEL, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert result.difference is None
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()
    for at_s in (5.0, 13.0, 14.0, 30.0, 45.0, shop.clock.now_s()):
        for name in ("max_speed", "speed", "person_distance"):
            explanation = explain(head.summary, lambda until_s: LatestEvents.of(events, until_s), name, at_s)
            assert str(explanation) == str(shop.codra.why(name, at_s=at_s))


def test_why_names_the_inputs_that_are_unknown_now_and_since_when() -> None:
    shop = Shop(mape())
    shop.begin()
    shop.write(person=6.0)
    shop.clock.sleep(5.0)
    story = shop.codra.why("max_speed").story
    assert "the value of this expression became unknown, so 'otherwise' determines the value" in story
    assert "person_distance has been unknown since 14 s (stale)" in story
    assert "battery_drain has never been known (never_observed)" not in story
    assert [line for line in shop.codra.why("speed").story if "unknown since" in line] == [
        line for line in story if "unknown since" in line
    ]


def test_why_names_inputs_that_became_unknown_after_the_last_change_even_if_the_value_is_known() -> None:
    shop = Shop(mape(replace(DIRECT, value=choose(0.3, value("bumped") | (value("person_distance") < 1.5), 1.2))))
    shop.begin()
    shop.write(bumped=True)
    shop.clock.sleep(5.0)
    assert shop.codra.get("max_speed").value == 0.3
    assert any("person_distance has been unknown since" in line for line in shop.codra.why("max_speed").story)


def test_why_states_since_when_a_rate_is_unknown_although_every_analysis_computes_it() -> None:
    shop = Shop(mape(replace(DIRECT, value=choose(0.3, value("battery_drain") > 1.0, 1.2))))
    shop.mape.start()
    shop.pass_s(5.0)
    assert "battery_drain has been unknown since 0 s (rejected)" in shop.codra.why("max_speed").story
    assert shop.codra.why("battery_drain").story[0].endswith(" s (analysis)")


# Inputs that were never known


def never_known(shop: Shop) -> Iterator[tuple[float, str]]:
    return ((event.instant_s, event.details["message"]) for event in shop.events("never_known"))


def test_an_input_that_was_never_known_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    shop = Shop(mape())
    with caplog.at_level(logging.WARNING):
        shop.mape.start()
        for _ in range(200):
            shop.write(person=6.0, load="empty", bumped=False)
            shop.clock.sleep(0.5)
    reported_s = PATIENCE_PERIODS * MAPE.loops[0].period_s
    assert list(never_known(shop)) == [
        (reported_s, f"'battery_level' was not known during {reported_s:g} s: never_observed")
    ]
    assert sum("never known" in record.message for record in caplog.records) == 1
    assert any("'battery_level' was not known" in line for line in shop.codra.why("battery_level").story)


def test_a_rate_that_its_history_does_not_cover_is_reported_with_the_time_that_it_covers() -> None:
    """With one reading every 5 s, 2 readings span 5 s, and a rate over 20 s needs 10 s."""
    model = replace(
        VALID_MODEL,
        variables=tuple(
            replace(variable, history=2) if variable.name == "battery_level" else variable
            for variable in VALID_MODEL.variables
        ),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shop_module, "MODEL", model)
        shop = Shop(mape())
    shop.mape.start()
    shop.clock.sleep(50.0)
    shop.write(load="empty", bumped=False, person=6.0)
    for _ in range(20):
        shop.write(battery=80.0)
        shop.clock.sleep(5.0)
    messages = [message for _, message in never_known(shop)]
    reason = "battery_level is known for 5 s, but must be for 10 s"
    assert messages[-1] == f"'battery_drain' was not known during 30 s: {reason}"
    assert len([message for message in messages if "battery_drain" in message]) == 1


def test_the_time_in_which_a_loop_does_not_run_does_not_count() -> None:
    shop = Shop(mape())
    shop.mape.start()
    shop.clock.sleep(20.0)
    shop.mape.stop()
    shop.clock.sleep(100.0)
    shop.mape.start()
    shop.clock.sleep(20.0)
    assert list(never_known(shop)) == []


def test_the_report_about_an_input_is_explained_from_the_journal_and_replayed(tmp_path: Path) -> None:
    shop = Shop(mape(), record=Journal(tmp_path / "run.mcap"))
    shop.mape.start()
    shop.clock.sleep(40.0)
    shop.mape.close()
    shop.codra.close()
    head, events = read(tmp_path / "run.mcap")
    explanation = explain(head.summary, lambda until_s: LatestEvents.of(events, until_s), "bumped", 35.0)
    assert "at 30 s: 'bumped' was not known during 30 s: never_observed" in explanation.story
    result = replay(head, events, VALID_MODEL, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert result.difference is None
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_inputs_that_are_known_in_time_are_not_reported() -> None:
    shop = Shop()
    shop.begin()
    shop.pass_s(100.0)
    assert list(never_known(shop)) == []


def test_the_inputs_of_a_custom_planner_are_those_of_its_own_model() -> None:
    without_bumper = replace(MAPE, courses=(replace(COURSE, always=()),))
    shop = Shop(planner=lambda _, loop, types: Planning(without_bumper, loop, types))
    shop.mape.start()
    shop.clock.sleep(40.0)
    reported_inputs = [message.split("'")[1] for _, message in never_known(shop)]
    assert sorted(reported_inputs) == ["battery_level", "container_load", "person_distance"]
    assert list(shop.events("failed")) == []
