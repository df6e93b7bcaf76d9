"""Decisions in the journal: closed schemas, replay, and `why` the morning after."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
from mcap.reader import make_reader

from codra_dsl.runtime import ContextManager, Journal, Kind, Reading
from codra_dsl.runtime.journal.ledger import Ledger
from codra_dsl.runtime.mape.analysis import assess
from codra_dsl.runtime.mape.observations import Observation
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.why import explain
from tests.runtime.journals import read
from tests.runtime.mape.shop import KNOWLEDGE, MAPE, MODEL, Shop


def run(path: Path) -> Shop:
    """A shop in which somebody comes close, the battery empties, a distance is lost, and an action fails."""
    shop = Shop(record=Journal(path))
    shop.begin()
    shop.driver.close()  # nobody drives: what is asked for is aborted as unacknowledged, or by the loop
    shop.pass_s(4.0, person=1.0)
    shop.pass_s(6.0, battery=25.0)
    shop.tell(bumped=True)
    shop.clock.sleep(3.0)
    shop.tell(bumped=False)
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
    assert seen == {"started", "chosen", "explained", "ended", "set", "stopped"}


def test_a_replay_makes_the_same_journal_byte_for_byte(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    found = replay(head, events, MODEL, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert found.difference is None
    assert found.derived[Kind.ADAPTATION] > 10
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_why_says_the_same_of_a_journal_as_of_the_run(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    for name in ("course_now", "max_speed", "course", "speed"):
        for at_s in (10.0, 14.5, 22.5, 25.0, 32.0):
            told = explain(head.outline, lambda until_s: Ledger.of(events, until_s), name, at_s)
            assert str(told) == str(shop.codra.why(name, at_s=at_s))


def test_the_chain_of_each_decision_gives_that_decision_again(tmp_path: Path) -> None:
    """From the readings that the journal holds of a decision, its metrics and weights follow."""
    run(tmp_path / "run.mcap")
    chosen = [event for event in read(tmp_path / "run.mcap")[1] if event.what == "chosen"]
    assert [event.details["action"] for event in chosen] == ["deliver", "start", "deliver", "start", "dock"]
    for event in chosen:
        scene = {
            each["variable"]: Observation(
                variable=each["variable"], value=json.loads(each["value"]) if "value" in each else None
            )
            for each in event.details["readings"]
        }
        found = assess(MAPE, scene)
        assert {each["name"]: each.get("value") for each in event.details["weights"]} == found.weights()
        metrics = {each.name: each.value for each in found.metrics.outputs}
        assert {each["name"]: each.get("value") for each in event.details["metrics"]} == metrics


def test_the_stamps_in_a_chain_are_those_of_the_readings(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    _, events = read(tmp_path / "run.mcap")
    known: dict[str, Reading[object]] = {}
    (chosen, *_) = [event for event in events if event.what == "chosen" and event.details["action"] == "start"]
    for name in ("person_distance", "battery_level", "container_load"):
        past = [each for each in shop.codra.history(name) if each.identified_s <= chosen.instant_s]
        known[name] = past[-1]
    told = {each["variable"]: each for each in chosen.details["readings"]}
    for name, reading in known.items():
        assert told[name]["evidence_s"] == reading.evidence_s
        assert json.loads(told[name]["value"]) == reading.value


def test_why_of_a_course_tells_what_was_known_what_it_came_to_and_what_would_have_kept_it(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    told = str(shop.codra.why("course_now", at_s=15.0))
    for part in (
        "start was chosen at 13.959 s, in the place of deliver: it weighed more for as long as is to be held",
        "weight of start: 0.783312, smoothed 0.708379, leading since 12.959 s",
        "if safety is medium then start is high: acts with 1  [specs/shop.yaml:3]",
        "metric safety: 0.5",
        "person_distance was 1, from evidence taken at 13.5 s (close 1)",
        "the branch deliver ended (halted) after 0 s",
        "deliver would have been kept by person_distance = 1.89934 instead of 1",
    ):
        assert part in told


def test_why_of_a_parameter_tells_what_set_it(tmp_path: Path) -> None:
    shop = run(tmp_path / "run.mcap")
    told = str(shop.codra.why("max_speed", at_s=13.0))
    assert "set at 12 s to 0.3: 0.3 m/s if safety < 0.6 else 1.2 m/s" in told
    assert "metric safety: 0.5" in told
