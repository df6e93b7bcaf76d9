"""The published schema of messages states the same shapes as the manager's own checks."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as some

from codra_dsl.runtime import PreviewOutcome, Reason
from codra_dsl.runtime.remote import SCHEMA_FILE, VERSION, MessageError
from codra_dsl.runtime.remote.json_lines import line_of, message_of, request_of_line
from codra_dsl.runtime.remote.protocol import ERRORS, REQUESTS, plain_type, request_of
from codra_dsl.runtime.values.model import ValueType, boolean, integer, member, real, text
from tests.runtime.remote.published_schema import SCHEMA, is_valid, validator
from tests.runtime.remote.test_messages import anything, requests

PAGE = (Path(__file__).parents[3] / "docs/reference/messages.md").read_text("utf-8")
DEFINITIONS = SCHEMA["$defs"]
FIELDS = sorted({name for shape in REQUESTS.values() for name in (*shape.required, *shape.optional)})
KEYS = ["codra", "id", "ask", *FIELDS, "infinite", *(f"infinite_{name}" for name in ("value", *FIELDS)), "x"]
EXAMPLES = {"variable": "open", "skill": "drive", "skills": [], "variables": [], "number": 1, "decision": 1}
EXAMPLES |= {"subscription": 1, "value": True, "for_s": 1.0, "reason": "test", "name": "open"}
EXAMPLES |= {"host": "arm_pc", "algorithm": "look", "index": 1, "start_s": 1.0, "stamp_s": 2.0, "earliest_s": 1.5}
EXAMPLES |= {"host_s": [1.0, 2.0], "agent": "fork", "type": "person", "attribute": "full", "origin": "a", "target": "b"}
EXAMPLES |= {"pose": [0.0] * 7, "task": "lifting", "result": "lifted", "change": 1, "rule": "lift", "state": "begun"}
LARGEST = 1.7976931348623157e308


def is_accepted(line: bytes) -> bool:
    """Return whether the manager accepts the shape of a request."""
    try:
        request_of(request_of_line(line))
    except MessageError:
        return False
    return True


def is_whole(_checker: object, instance: object) -> bool:
    return isinstance(instance, int) and not isinstance(instance, bool)


STRICT_TYPES = jsonschema.validators.extend(
    jsonschema.Draft202012Validator,
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine("integer", is_whole),
)
"""It does not count numbers such as 1.0 as integers: a schema cannot state this difference, but the page does."""


def strict_validator(definition: str) -> Any:
    return STRICT_TYPES({"$ref": f"#/$defs/{definition}", "$defs": DEFINITIONS})


REQUEST_VALIDATOR = strict_validator("request")


def is_published(line: bytes, validator: Any = REQUEST_VALIDATOR) -> bool:
    """Return whether a line is JSON, and a request of the published schema."""
    try:
        return bool(validator.is_valid(message_of(line, object_hook=None)))
    except MessageError:
        return False


VALUES: list[object] = [0, 1, -1, 1.0, 1.5, -0.5, 3600, 3600.5, LARGEST, -LARGEST, 10**400, True, False, None]
VALUES += [2**63 - 1, 2**63, 1 - 2**63, -(2**63), "", "open", "x" * 128, "x" * 129, "ä" * 1000, "x" * 1001, "\ud800"]
VALUES += [[], ["open"], [1], ["x" * 1001], {}, {"infinite": 1}, {"value": 1}]
scalars = some.sampled_from(VALUES) | some.sampled_from(sorted(REQUESTS))


@some.composite
def mutated_requests(draw: some.DrawFn) -> dict[str, Any]:
    request: dict[str, Any] = draw(requests())
    for _ in range(draw(some.integers(0, 3))):
        key = draw(some.sampled_from(KEYS) | some.sampled_from(sorted(request) or KEYS))
        match draw(some.sampled_from(["set", "set", "drop", "rename"])):
            case "set":
                request[key] = draw(scalars | anything)
            case "drop":
                request.pop(key, None)
            case "rename" if key in request:
                request[draw(some.sampled_from(KEYS))] = request.pop(key)
    return request


def test_the_schema_is_one_and_has_the_version_of_the_messages() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$id"] == f"urn:codra-dsl:messages:{VERSION}"
    assert f"`{SCHEMA_FILE.name}`" in PAGE
    assert f"`{SCHEMA['$id']}`" in PAGE


def test_the_schema_describes_every_request_answer_error_and_reason() -> None:
    for part in ("request", "answer"):
        assert [name.partition(".")[2] for name in DEFINITIONS if name.startswith(f"{part}.")] == list(REQUESTS)
    assert sorted(DEFINITIONS["error"]["properties"]["error"]["properties"]["kind"]["enum"]) == sorted(ERRORS)
    assert DEFINITIONS["reading"]["properties"]["reason"]["enum"] == [None, *Reason]
    assert DEFINITIONS["preview"]["properties"]["outcome"]["enum"] == [*PreviewOutcome]


def test_no_definition_of_the_schema_is_unused() -> None:
    references = re.findall(r'"#/\$defs/([^"]+)"', SCHEMA_FILE.read_text("utf-8"))

    assert DEFINITIONS.keys() - {*references} - {f"answer.{ask}" for ask in REQUESTS} == set()
    assert {*references} <= DEFINITIONS.keys()


def test_the_page_lists_the_fields_of_every_answer_and_the_types_of_all_fields() -> None:
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in PAGE.splitlines() if line[:3] == "| `"]
    answers = {row[0].strip("`"): re.findall(r"`(\w+)`", row[2]) for row in rows if len(row) == 3}
    for ask in (ask for ask in REQUESTS if ask != "found"):
        fields = DEFINITIONS[f"answer.{ask}"].get("properties", {}).keys()
        assert fields <= {*answers[ask]}, ask
    first_cells = {name for row in rows for name in re.findall(r"`(\w+)`", row[0])}
    assert {*FIELDS, *DEFINITIONS["reading"]["properties"], *DEFINITIONS["preview"]["properties"]} <= first_cells


def test_the_messages_on_the_page_are_valid() -> None:
    messages = [json.loads(text) for text in re.findall(r"^```json\n(.+?)^```", PAGE, flags=re.M | re.S)]
    definitions = [key for message in messages for key in message if key in ("ask", "answer", "error", "notice")]

    assert definitions == ["ask", "answer", "error", "notice"]
    for definition, message in zip(["request", *definitions[1:]], messages, strict=True):
        assert is_valid(definition, message), message


@pytest.mark.parametrize(
    "value_type", [boolean(), integer(0, 4), real(), real(0.0, math.inf, unit="m"), text(), member("a", "b")]
)
def test_the_type_of_every_variable_is_valid(value_type: ValueType) -> None:
    assert is_valid("answer.describe", {"type": plain_type(value_type)})


def objects(part: object) -> Iterator[dict[str, Any]]:
    """Yield the schemas of objects within a part of the schema."""
    if isinstance(part, list):
        part = dict(enumerate(part))
    if isinstance(part, dict):
        if part.get("type") == "object":
            yield part
        for inner in part.values():
            yield from objects(inner)


@pytest.mark.parametrize("name", [name for name in DEFINITIONS if not name.startswith("request")])
def test_the_manager_sends_all_fields_that_the_schema_describes_and_no_others(name: str) -> None:
    for part in objects(DEFINITIONS[name]):
        optional_fields = {"value", "infinite"} if name in ("reading", "named_values", "attributes") else set()
        assert {*part.get("required", ())} == part.get("properties", {}).keys() - optional_fields
        assert part["additionalProperties"] is False
        assert part.get("properties", {}).get("codra", {"const": VERSION}) == {"const": VERSION}


@pytest.mark.parametrize("ask", REQUESTS)
def test_each_field_of_a_request_has_the_values_that_the_manager_accepts(ask: str) -> None:
    validator = strict_validator(f"request.{ask}")
    request = {"codra": VERSION, "ask": ask, **{name: EXAMPLES[name] for name in REQUESTS[ask].required}}

    def check(changed: dict[str, Any]) -> None:
        line = line_of(changed)
        assert is_published(line, validator) == is_accepted(line), line

    check(request)
    for key in request:
        check({name: field for name, field in request.items() if name != key})
    fields = [*REQUESTS[ask].required, *REQUESTS[ask].optional]
    for key in ["codra", "id", "ask", "x", "infinite", *fields, *(f"infinite_{name}" for name in fields)]:
        finite_key = "value" if key == "infinite" else key.removeprefix("infinite_")
        for value in VALUES:
            check({name: field for name, field in request.items() if name != finite_key} | {key: value})
        check(request | {key: 1})


def reading(**fields: object) -> dict[str, object]:
    instants = dict.fromkeys(("evidence_s", "start_s", "identified_s", "expires_s"))
    return {"variable": "x", "detail": "", "source": "", **instants, **fields}


def test_a_reading_has_either_a_value_or_a_reason() -> None:
    known: dict[str, object] = {"known": True, "reason": None}
    unknown: dict[str, object] = {"known": False, "reason": "stale"}

    for fields in ({**known, "value": 1}, {**known, "infinite": -1}, {**unknown, "value": None}):
        message = {"codra": VERSION, "notice": "reading", "subscription": 1, "reading": reading(**fields)}
        assert is_valid("notice", message), fields
        assert not is_valid("notice", message | {"notice": "closed"})
    for value in ({}, {"value": None}, {"value": 1, "infinite": 1}):
        assert not validator("reading").is_valid(reading(**known, **value))
    for value in ({}, {"value": 1}, {"infinite": 1}, {"value": None, "infinite": 1}):
        assert not validator("reading").is_valid(reading(**unknown, **value))
    assert not validator("reading").is_valid(reading(known=True, reason="stale", value=1))
    assert not validator("reading").is_valid(reading(known=False, reason=None, value=1))
    assert not validator("reading").is_valid(reading(known=False, reason=None, value=None))


def test_a_request_names_at_most_ten_thousand_variables_or_skills() -> None:
    for ask, key in (("expect", "skills"), ("subscribe", "variables")):
        for count, is_allowed in ((10_000, True), (10_001, False)):
            line = line_of({"codra": VERSION, "ask": ask, key: ["x"] * count})
            assert (validator(f"request.{ask}").is_valid(json.loads(line)), is_accepted(line)) == (is_allowed,) * 2


def test_a_whole_number_with_a_fraction_is_valid_for_the_schema_only() -> None:
    line = b'{"codra": 1, "ask": "act", "number": 1.0}'

    assert validator("request").is_valid(json.loads(line))
    assert not is_accepted(line)


@settings(max_examples=600)
@given(request=mutated_requests())
@example({"codra": VERSION, "ask": "set", "variable": "open", "infinite_value": 1})
@example({"codra": VERSION, "ask": "set", "variable": "open", "value": {"infinite": 1}})
@example({"codra": VERSION, "ask": "set", "variable": "open", "value": 1, "infinite": 1})
@example({"codra": VERSION, "ask": "set", "variable": "open", "infinite": True})
@example({"codra": VERSION, "ask": "decide", "variable": "open", "infinite_max_age_s": -1})
@example({"codra": VERSION, "ask": "hello", "infinite_lease_s": 1})
@example({"codra": 1.0, "ask": "keep", "id": None})
@example({"codra": VERSION, "ask": "keep", "id": 1.0})
@example({"codra": VERSION, "ask": "set", "variable": "open", "infinite": 1.0})
def test_the_schema_refuses_a_request_exactly_if_the_manager_calls_it_malformed(request: dict[str, Any]) -> None:
    line = line_of(request)

    assert is_published(line) == is_accepted(line), line
