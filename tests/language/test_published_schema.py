"""The texts of schema.json that editors show: one for every key, with defaults and the words of the reference."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import jsonschema_rs
import pytest

from codra_dsl.language.expression import SyntaxProblem, parse
from codra_dsl.language.load.schema.schema import has_shape
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.units import UNITS, parse_duration, parse_unit

ROOT = Path(__file__).parents[2]
REFERENCE = (ROOT / "docs/reference/language.md").read_text("utf-8")
DEFINITIONS: dict[str, dict[str, Any]] = schema()["$defs"]
OBJECTS = {"": schema(), **DEFINITIONS}
KEYS = {
    f"{name}.{key}": part
    for name, definition in OBJECTS.items()
    for key, part in definition.get("properties", {}).items()
}
TABLES = {
    "context_variable": "## `context`: context-variables",
    "perception_algorithm": "## `perception`: perception algorithms",
    "ros_topic": "### Topics of ROS 2",
}


def resolve(subschema: dict[str, Any]) -> dict[str, Any]:
    """Return a part as an editor sees it, with its reference resolved."""
    return DEFINITIONS.get(subschema.get("$ref", "").rpartition("/")[2], {}) | subschema


def annotated(part: object) -> Iterator[dict[str, Any]]:
    """Yield all schemas within a part; names of keys are not schemas."""
    if not isinstance(part, dict):
        return
    yield part
    for keyword in ("properties", "$defs"):
        for inner in part.get(keyword, {}).values():
            yield from annotated(inner)
    for keyword in ("items", "additionalProperties"):
        yield from annotated(part.get(keyword))
    for inner in part.get("anyOf", ()):
        yield from annotated(inner)


def validator(part: dict[str, Any]) -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator({**part, "$defs": DEFINITIONS})


def sections() -> dict[str, str]:
    return {
        heading: text
        for heading, _, text in (section.partition("\n") for section in re.split(r"^(?=##+ )", REFERENCE, flags=re.M))
    }


def table(heading: str) -> dict[str, list[str]]:
    """Return the rows of a section's table in the reference, by key."""
    rows = [line.strip("| ").split(" | ") for line in sections()[heading].splitlines() if line.startswith("| `")]
    assert rows
    return {cells[0].strip("`"): [cell.strip() for cell in cells[1:]] for cells in rows}


@pytest.mark.parametrize("key", KEYS)
def test_every_key_has_a_title_and_a_text_that_is_more_than_the_key(key: str) -> None:
    seen = resolve(KEYS[key])

    assert seen["title"]
    assert len(seen["description"].split()) >= 3
    assert seen["description"].casefold().strip(".") != key.rpartition(".")[2].replace("_", " ")
    assert seen["description"][0].isupper() or seen["markdownDescription"][0] == "`"
    assert seen["description"].endswith(".")


@pytest.mark.parametrize("name", DEFINITIONS)
def test_every_definition_has_a_text(name: str) -> None:
    assert {"title", "description", "markdownDescription"} <= DEFINITIONS[name].keys()


def test_every_text_exists_with_and_without_markdown() -> None:
    """With only one of the two, an editor would show the other one from the referenced definition."""
    for part in annotated(schema()):
        assert ("description" in part) == ("markdownDescription" in part), part
        assert part.get("markdownDescription", "").replace("`", "") == part.get("description", "")
        assert "`" not in part.get("description", "")


@pytest.mark.parametrize("key", [key for key, part in KEYS.items() if "default" in part])
def test_a_default_fits_its_key_and_is_in_its_text(key: str) -> None:
    default = KEYS[key]["default"]
    written = str(default).lower() if isinstance(default, bool) else default

    assert validator(KEYS[key]).is_valid(default)
    assert KEYS[key]["markdownDescription"].endswith(f"Default: `{written}`.")


def test_all_examples_are_valid() -> None:
    assert [
        (part.get("title"), example)
        for part in annotated(schema())
        for example in part.get("examples", ())
        if part is not schema() and not validator(part).is_valid(example)
    ] == []


def test_every_word_of_a_choice_is_explained() -> None:
    choices = [part for part in annotated(schema()) if "enum" in part and "propertyNames" not in part]

    assert len(choices) >= 6
    for choice in choices:
        assert len(choice["markdownEnumDescriptions"]) == len(choice["enum"])
        assert all(choice["markdownEnumDescriptions"])


def test_examples_of_conditions_units_and_durations_can_be_parsed() -> None:
    conditions = [*DEFINITIONS["condition"]["examples"], *DEFINITIONS["hysteresis"]["examples"][0].values()]

    assert [text for text in conditions if isinstance(parse(text), SyntaxProblem)] == []
    assert all(parse_unit(text) for text in DEFINITIONS["unit"]["examples"])
    assert {*re.findall(r"`([A-Za-z]+)`", DEFINITIONS["unit"]["markdownDescription"])} == UNITS.keys()
    assert all(parse_duration(text) for text in DEFINITIONS["duration"]["examples"])


# Refused data


@pytest.mark.parametrize("name", [name for name, part in OBJECTS.items() if part.get("additionalProperties") is False])
def test_an_unknown_key_is_refused_at_every_level(name: str) -> None:
    example = OBJECTS[name].get("examples", [{"codra": 1}])[0]
    part = OBJECTS[name] if name else {key: value for key, value in schema().items() if not key.startswith("$")}

    assert validator(part).is_valid(example)
    assert not validator(part).is_valid(example | {"no_such_key": 1})
    assert not jsonschema_rs.Draft202012Validator({**part, "$defs": DEFINITIONS}).is_valid(example | {"no_such_key": 1})


@pytest.mark.parametrize("name", [name for name in DEFINITIONS if name != "parameter"])
def test_the_compiler_accepts_the_same_data_as_the_published_schema(name: str) -> None:
    anything: list[object] = [None, 1, "", "a", [], [1], {}, {"type": "bool"}, {"type": "bool", "description": 3}]
    anything += [{"type": "int", "default": []}, *DEFINITIONS[name]["examples"]]

    assert [has_shape(name, data) for data in anything] == [
        validator(DEFINITIONS[name]).is_valid(data) for data in anything
    ]


# The reference


@pytest.mark.parametrize("name", TABLES)
def test_the_reference_has_the_keys_and_defaults_of_the_schema(name: str) -> None:
    rows = table(TABLES[name])
    properties = DEFINITIONS[name]["properties"]

    assert rows.keys() == properties.keys()
    for key, (default, *_) in rows.items():
        literal = re.fullmatch(r"`(.+)`", default)
        stated_default = None if literal is None or key == "source" else literal[1]
        assert stated_default == (str(properties[key]["default"]) if "default" in properties[key] else None), key
        assert (default == "needed") == (key in DEFINITIONS[name]["required"]), key


def test_the_reference_has_the_keys_of_skills_and_files() -> None:
    assert table("## `skills`").keys() == DEFINITIONS["skill"]["properties"].keys()
    assert table("## Files").keys() == schema()["properties"].keys()


@pytest.mark.parametrize("name", ["context_variable", "perception_algorithm", "returned_value", "parameter_object"])
def test_the_reference_names_every_word_of_a_choice(name: str) -> None:
    for key, part in DEFINITIONS[name]["properties"].items():
        for form in (resolve(part), *resolve(part).get("anyOf", ())):
            assert [word for word in form.get("enum", ()) if f"`{word}`" not in REFERENCE] == [], key
