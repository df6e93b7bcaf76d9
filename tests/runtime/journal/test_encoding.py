"""The JSON of events: every JSON reader accepts it, and decoding returns the same event."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import example, settings
from hypothesis import given as drawn
from hypothesis import strategies as st
from mcap.reader import make_reader

from codra_dsl.logic import value
from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.encoding import event_of, json_text, message_of, parse_json
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import integer, real
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, variable

INF = math.inf

SCALARS = st.one_of(
    st.booleans(), st.integers(), st.floats(allow_nan=False, allow_infinity=False), st.text(), st.sampled_from(Reason)
)
ENTRIES = st.one_of(st.none(), SCALARS, st.lists(SCALARS, max_size=3))
DETAILS = st.dictionaries(
    st.text(min_size=1), st.one_of(ENTRIES, st.dictionaries(st.text(), ENTRIES, max_size=3)), max_size=5
)


def refuse(number: str) -> float:
    """Refuse the numbers that strict readers refuse, such as nlohmann::json."""
    if math.isinf(float(number)):
        raise ValueError(f"{number} is out of range")
    return float(number)


@pytest.mark.parametrize(
    ("kind", "details", "signs"),
    [
        (Kind.VARIABLE, {"value": INF, "present": True}, {"infinite": 1}),
        (Kind.VARIABLE, {"value": -INF, "evidence_s": -INF}, {"infinite": -1, "infinite_evidence_s": -1}),
        (Kind.DECISION, {"value": -INF, "found": INF, "agrees": False}, {"infinite": -1, "infinite_found": 1}),
        (Kind.JOB, {"values": {"far": INF, "edges": 3, "near": -INF}}, {"infinite": {"far": 1, "near": -1}}),
        (Kind.JOB, {"values": {"infinite": 1, "value": INF}}, {"infinite": {"value": 1}}),
        (Kind.JOB, {"values": {"infinite": 1}}, {}),
        (Kind.INPUT, {"step": 0, "value": INF, "evidence_s": [-INF]}, {"infinite": 1}),
        (Kind.INPUT, {"wait_up_to_s": INF, "max_age_s": -INF}, {"infinite_wait_up_to_s": 1, "infinite_max_age_s": -1}),
        (Kind.KNOWLEDGE, {"value": -INF}, {"infinite": -1}),
    ],
)
def test_infinite_numbers_are_kept_in_json_that_every_reader_accepts(
    kind: Kind, details: Mapping[str, Any], signs: Mapping[str, Any]
) -> None:
    event = Event(1.0, kind, "far", "changed", details)
    message = message_of(event)

    fields = json.loads(message, parse_float=refuse)
    assert "value" not in fields
    assert {key: field for key, field in fields.items() if key.startswith("infinite")} == signs
    assert event_of(kind, message) == event
    assert message_of(event_of(kind, message)) == message


@drawn(instant_s=st.floats(allow_nan=False, allow_infinity=False), name=st.text(), details=DETAILS)
@example(instant_s=-0.0, name="0.0 is equal to -0.0", details={"a": 0.0, "b": -0.0, "c": [0.0, -0.0]})
@settings(deadline=None)
def test_a_message_is_the_json_that_the_standard_library_writes(
    instant_s: float, name: str, details: dict[str, Any]
) -> None:
    details = {key: detail for key, detail in details.items() if key not in ("instant_s", "name", "what")}
    fields = {"instant_s": instant_s, "name": name, "what": "returned"} | {
        key: {name: entry for name, entry in detail.items() if entry is not None} if type(detail) is dict else detail
        for key, detail in details.items()
        if detail is not None
    }
    text = json.dumps(fields, ensure_ascii=False, separators=(",", ":"))

    assert message_of(Event(instant_s, Kind.JOB, name, "returned", details)) == text.encode("utf-8", "backslashreplace")


class Instant(float):
    """An instant whose text is not a number of JSON, as that of numpy's `float64`."""

    def __repr__(self) -> str:
        return f"Instant({float.__repr__(self)})"


@pytest.mark.parametrize("number", [0.0, 5.5])
def test_an_instant_of_a_derived_type_is_a_number(number: float) -> None:
    message = b'{"instant_s":%b,"name":"eye","what":"returned","told_s":%b}'
    text = str(number).encode()
    for instant_s in (Instant(number), number):
        event = Event(instant_s, Kind.JOB, "eye", "returned", {"told_s": number})
        assert message_of(event) == message % (text, text)


@pytest.mark.parametrize("data", [INF, [1.0, -INF, [INF]], {"value": 1, "other": -INF}, [{"name": "a", "value": INF}]])
def test_infinite_numbers_in_texts_are_kept(data: object) -> None:
    assert "999" not in json_text(data)
    assert parse_json(json_text(data)) == data


def test_an_event_of_an_earlier_version_is_decoded_with_its_infinite_number() -> None:
    event = event_of(Kind.VARIABLE, b'{"instant_s":0.0,"name":"far","what":"identified","value":-1e999}')

    assert event.details["value"] == -INF


def test_messages_with_infinite_numbers_fit_their_closed_schemas(tmp_path: Path) -> None:
    model = forest(
        [variable("far", type=real()), given("size", type=real())],
        observer("o", Look(algorithm("eye", {"far": real(), "count": integer()}), {"far": value("far")})),
    )
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    world = World({"eye": {"far": INF, "count": 2}})
    with ContextManager[str, str](model, clock=clock, resources={"world": world}, record=journal) as manager:
        manager.declare("far", -INF)
        manager.set("size", INF)
        manager.decide("size", lambda: -INF, since_s=5.0, wait_up_to_s=1.0)
        clock.sleep(2.0)
    with journal.path.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            assert schema is not None
            fields = json.loads(message.data, parse_float=refuse)
            jsonschema.Draft202012Validator(json.loads(schema.data)).validate(fields)
