"""Decisions in the journal: closed schemas, replay, and `why` after the run."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from mcap.reader import make_reader

from codra_dsl.runtime import ContextManager, Journal, Kind, Reading, UnknownNameError
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.loops.analysis import assess, infer
from codra_dsl.runtime.loops.observations import Observation
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.why import explain
from tests.runtime.journal.journals import read
from tests.runtime.loops.shop import ACTIONS, KNOWLEDGE, LOADS, MAPE, MODEL, SPEED, Shop
from tests.runtime.loops.shop import stage as stage_of

RULES = re.compile(r"(RuleBlock: (\w+)\n(?:  (?!rule).*\n)+)(?:  rule: .*\n)+")


def run(path: Path) -> Shop:
    """Return a shop in which a person comes close, the battery empties, a distance is lost, and an action fails."""
    shop = Shop(record=Journal(path))
    shop.begin()
    shop.driver.close()  # without a driver, tasks are aborted as unacknowledged, or by the loop
    shop.pass_s(4.0, person=1.0)
    shop.pass_s(6.0, battery=25.0)
    shop.write(bumped=True)
    shop.clock.sleep(3.0)
    shop.write(bumped=False)
    shop.pass_s(8.0, battery=4.0)
    shop.mape.close()
    shop.codra.close()
    return shop


def test_every_message_of_a_journal_fits_its_closed_schema(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    seen, validators = set(), {}
    with (tmp_path / "run.mcap").open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            assert schema is not None
            if schema.id not in validators:
                validators[schema.id] = jsonschema.Draft202012Validator(json.loads(schema.data))
            validators[schema.id].validate(json.loads(message.data))
            if channel.topic == "/codra/adaptation":
                seen.add(json.loads(message.data)["what"])
    assert seen == {"started", "computed", "analysed", "chosen", "explained", "ended", "set", "stopped"}


def test_a_replay_makes_the_same_journal_byte_for_byte(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    replay_result = replay(head, events, MODEL, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert replay_result.difference is None
    assert replay_result.derived[Kind.ADAPTATION] > 10
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_why_gives_the_same_explanation_from_a_journal_as_from_the_run(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    for name in ("course_now", "max_speed", "course", "speed", "safety", "weight_of_start"):
        for at_s in (10.0, 14.5, 22.5, 25.0, 32.0):
            explanation = explain(head.summary, lambda until_s: LatestEvents.of(events, until_s), name, at_s)
            assert str(explanation) == str(shop.codra.why(name, at_s=at_s))


def test_every_decision_can_be_recomputed_from_its_chain(tmp_path: Path) -> None:
    """The readings of a decision in the journal determine its metrics and weights."""
    run(tmp_path / "run.mcap")
    chosen = [event for event in read(tmp_path / "run.mcap")[1] if event.what == "chosen"]
    assert [event.details["action"] for event in chosen] == ["deliver", "start", "deliver", "start", "dock"]
    for event in chosen:
        scene = {
            recorded_reading["variable"]: Observation(
                variable=recorded_reading["variable"],
                value=json.loads(recorded_reading["value"]) if "value" in recorded_reading else None,
            )
            for recorded_reading in event.details["readings"]
        }
        assessment = assess(MAPE, scene)
        assert {weight["name"]: weight.get("value") for weight in event.details["weights"]} == assessment.weights()
        metrics = {metric.name: metric.value for metric in assessment.metrics.outputs}
        assert {metric["name"]: metric.get("value") for metric in event.details["metrics"]} == metrics


def test_the_stamps_in_a_chain_are_those_of_the_readings(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    _, events = read(tmp_path / "run.mcap")
    known: dict[str, Reading[object]] = {}
    (chosen, *_) = [event for event in events if event.what == "chosen" and event.details["action"] == "start"]
    for name in ("person_distance", "battery_level", "container_load"):
        past = [
            past_reading for past_reading in shop.codra.history(name) if past_reading.identified_s <= chosen.instant_s
        ]
        known[name] = past[-1]
    recorded_readings = {detail["variable"]: detail for detail in chosen.details["readings"]}
    for name, reading in known.items():
        assert recorded_readings[name]["evidence_s"] == reading.evidence_s
        assert json.loads(recorded_readings[name]["value"]) == reading.value


def test_why_of_a_course_shows_readings_results_and_counterfactuals(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    explanation = str(shop.codra.why("course_now", at_s=15.0))
    for part in (
        "start was chosen at 13.959 s instead of deliver: its weight was higher for the required time",
        ", smoothed 0.708379, leading since 12.959 s",
        "if safety is medium then start is high: activation 1  [specs/shop.yaml:3]",
        "metric safety: 0.5",
        "person_distance was 1, from evidence taken at 13.5 s (close 1)",
        "the branch deliver ended (halted) after 0 s",
        "deliver would have been kept by person_distance = 1.89934 instead of 1",
    ):
        assert part in explanation
    weight = re.search(r"weight of start: (0\.\d+), smoothed 0\.708379, leading", explanation)
    assert weight
    assert float(weight[1]) == pytest.approx(0.7833125, abs=1e-6)  # which six digits can show in two ways


def test_why_of_a_switch_after_a_first_choice_without_weights_states_no_dwell_time() -> None:
    """No rule of an action fires before the load is known, so no weight is known."""
    fll = RULES.sub(r"\1  rule: if container_load is empty then \2 is low\n", ACTIONS)
    actions = stage_of(fll.replace("deliver is low", "deliver is high"), {}, {"container_load": LOADS})
    shop = Shop(replace(MAPE, actions=actions))
    shop.mape.start()
    shop.pass_s(1.0)
    shop.write(load="empty")
    shop.pass_s(12.0)
    first, switch = shop.events("chosen")

    assert (first.details["because"], switch.details["before"]) == ("nothing_known", "start")
    assert f"deliver was chosen at {switch.instant_s:g} s instead of start: " in str(shop.codra.why("course_now"))
    assert "had been the course" not in str(shop.codra.why("course_now"))


def test_why_of_a_metric_and_of_a_weight_shows_readings_rules_and_strengths() -> None:
    shop = Shop()
    shop.begin()
    shop.pass_s(4.0, person=2.1)
    chain = """\
  safety has been 0.665377 since 12 s:
    if person_distance is close then safety is medium: activation 0.4  [specs/shop.yaml:1]
    if person_distance is not close then safety is high: activation 0.6  [specs/shop.yaml:2]
    person_distance was 2.1, from evidence taken at 12 s (close 0.4)"""

    assert (
        str(shop.codra.why("safety"))
        == f"""\
safety is 0.665377 at 16 s
  written by agent analysis at 16 s, from evidence taken at 15.5 s
{chain}"""
    )
    assert (
        str(shop.codra.why("weight_of_start"))
        == f"""\
weight_of_start is 0.474062 at 16 s
  written by agent analysis at 16 s, from evidence taken at 15.5 s
  weight_of_start has been 0.474062 since 12 s:
    if safety is medium then start is high: activation 0.448744  [specs/shop.yaml:3]
    if safety is not medium then start is low: activation 0.551256  [specs/shop.yaml:4]
    safety was 0.665377, from evidence taken at 12 s
{chain}"""
    )


def test_the_name_of_an_action_is_its_weight_unless_another_element_has_this_name() -> None:
    shop = Shop()
    shop.begin()

    assert str(shop.codra.why("deliver")) == str(shop.codra.why("weight_of_deliver"))
    assert "has been" not in str(shop.codra.why("to_deliver"))
    with pytest.raises(UnknownNameError, match="delivr"):
        shop.codra.why("delivr")


def test_why_of_an_unknown_metric_shows_the_missing_input() -> None:
    shop = Shop()
    shop.write(battery=80.0, load="empty", bumped=False)
    shop.mape.start()
    shop.clock.sleep(1.0)
    explanation = str(shop.codra.why("safety"))

    assert re.search(r"safety has been (0\.\d+), the worse bound of \1 to 0\.\d+ since 0 s:", explanation)
    assert "  person_distance was unknown: never_observed (close 0 to 1)" in explanation


def test_an_analysis_can_be_recomputed_from_its_event(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    analysed = [event for event in read(tmp_path / "run.mcap")[1] if event.what == "analysed"]
    assert len(analysed) > 5
    for event in analysed:
        for stage, parts in ((MAPE.metrics, event.details["metrics"]), (MAPE.actions, event.details["weights"])):
            assert stage is not None
            read_from = {
                recorded_reading["variable"]: json.loads(recorded_reading.get("value", "null"))
                for recorded_reading in event.details["readings"]
            }
            scene = {
                model_input.variable: Observation(
                    variable=model_input.variable, value=read_from.get(model_input.variable)
                )
                for model_input in stage.inputs
            }
            inference = infer(stage, scene)
            strengths = {rule.text: rule.high for rule in inference.rules}
            for part in parts:
                assert part.get("value") == inference.value(part["name"])
                acting = {
                    rule["text"]: rule["high"] for rule in event.details["rules"] if part["name"] in rule["concludes"]
                }
                assert acting.items() <= strengths.items()


def test_an_analysis_with_the_same_result_is_not_recorded_again() -> None:
    shop = Shop()
    shop.begin()
    before = len(shop.events("analysed"))
    shop.pass_s(5.0)

    assert len(shop.events("analysed")) == before


def test_why_of_a_parameter_shows_the_rule_that_set_it(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    explanation = str(shop.codra.why("max_speed", at_s=13.0))
    assert "set at 12 s to 0.3: 0.3 m/s if safety < 0.6 else 1.2 m/s" in explanation
    assert "metric safety: 0.5" in explanation


def test_a_variable_with_the_name_of_a_parameter_is_not_confused_with_it() -> None:
    loop = replace(MAPE.loops[0], adapt=("course", "person_distance"))
    shop = Shop(replace(MAPE, loops=(loop,), parameters=(replace(SPEED, name="person_distance"),)))
    shop.begin()
    assert "set at" not in str(shop.codra.why("person_distance"))
    assert "set at 0 s to 1.2" in str(shop.codra.why("max_speed"))


def test_why_of_a_parameter_that_was_not_set_yet_shows_its_loop_and_the_refused_value() -> None:
    shop = Shop(replace(MAPE, parameters=(replace(SPEED, value=value("person_distance")),)))
    shop.mape.start()
    shop.clock.sleep(1.0)
    why = str(shop.codra.why("speed"))
    assert "speed is unknown" in why
    assert "loop store has been running since 0 s and has not decided it yet" in why
    shop.write(person=6.0)
    shop.clock.sleep(1.0)
    refused = "at 1 s: 'max_speed' is not set: 6.0 lies outside [0, 1.5]; limit the value, or state a wider range"
    assert refused in str(shop.codra.why("speed"))
    assert refused in str(shop.codra.why("max_speed"))
    shop.write(person=1.0)
    shop.clock.sleep(1.0)
    assert refused not in str(shop.codra.why("speed"))
    with pytest.raises(UnknownNameError):
        shop.codra.why("store")
