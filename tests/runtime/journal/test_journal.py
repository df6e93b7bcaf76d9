"""The event log of a run, as lines of JSON."""

from __future__ import annotations

import json
import math

from codra_dsl.runtime import EventLog, SimClock
from codra_dsl.runtime.journal import Event, EventWriter, Kind
from codra_dsl.runtime.values.cell import Reason
from tests.runtime.door import Door, started


def test_an_event_is_one_line_and_numbers_that_are_not_finite_are_null() -> None:
    event = Event(
        1.5, Kind.VARIABLE, "Tür", "identified", {"value": math.nan, "evidence_s": [0, math.inf], "text": "a\nb"}
    )
    assert event.as_json() == (
        '{"instant_s": 1.5, "kind": "variable", "name": "Tür", "what": "identified",'
        ' "value": null, "evidence_s": [0, null], "text": "a\\nb"}'
    )


def test_nested_values_are_written_too() -> None:
    event = Event(0.0, Kind.JOB, "eye", "returned", {"values": {"angle": math.inf, "why": Reason.FAILED}})
    assert json.loads(event.as_json())["values"] == {"angle": None, "why": "failed"}


def test_an_event_writer_adds_events_at_the_instant_of_its_clock() -> None:
    clock, record = SimClock(), EventLog()
    event_writer = EventWriter(record, clock)
    clock.sleep(2)
    event_writer.write(Kind.OBSERVER, "lid", "started", name="a detail may have any name")
    assert [(event.instant_s, event.name, event.details) for event in record] == [
        (2, "lid", {"name": "a detail may have any name"})
    ]


def test_an_event_log_holds_all_events_in_order() -> None:
    with started(Door(angle_rad=1.0)) as (manager, clock):
        manager.expect("open_door")
        clock.sleep(1.2)
        with manager.skill("open_door") as skill:
            manager.decide("open", lambda: None)
            with skill.acting():
                clock.sleep(0.1)
    lines = [json.loads(line) for line in manager.record.text().splitlines()]
    assert len(lines) == len(manager.record)
    assert [line["instant_s"] for line in lines] == sorted(line["instant_s"] for line in lines)
    unused_kinds = {Kind.INPUT, Kind.HOST, Kind.PREVIEW, Kind.OVERRIDE, Kind.KNOWLEDGE, Kind.ADAPTATION}
    assert {line["kind"] for line in lines} == set(Kind) - unused_kinds
    assert [(line["kind"], line["name"], line["what"]) for line in lines[:8]] == [
        ("variable", "localized", "identified"),
        ("declaration", "open", "declared"),
        ("observer", "door_lid", "started"),
        ("observer", "door_distance", "started"),
        ("job", "measure_distance", "started"),
        ("job", "measure_distance", "returned"),
        ("variable", "near", "identified"),
        ("job", "look", "started"),
    ]


def test_the_event_log_of_a_long_run_keeps_the_newest_events() -> None:
    record = EventLog(limit=10)
    for number in range(1000):
        record.add(Event(float(number), Kind.OBSERVER, f"o{number}", "started"))
        assert [event.name for event in record] == [f"o{kept}" for kept in range(number + 1 - len(record), number + 1)]
        assert min(10, number + 1) <= len(record) < 20


def test_an_event_log_without_a_limit_keeps_all_events() -> None:
    record = EventLog(math.inf)
    for number in range(1000):
        record.add(Event(float(number), Kind.OBSERVER, "o", "started"))
    assert len(record) == 1000
