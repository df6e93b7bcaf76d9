from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import jsonschema_rs
import pytest

from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.templates.templates import ParameterKind
from codra_dsl.language.load.yaml.compose import compose
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.source import accept
from codra_dsl.language.model import Access, Isolation, Kind, Refresh, WhenUnobservable
from codra_dsl.language.project import SCHEMA_FILE

ROOT = Path(__file__).parents[3]
DEFINITIONS: dict[str, dict[str, Any]] = schema()["$defs"]
SPECS = [*sorted((ROOT / "specs").rglob("*.yaml")), *sorted((ROOT / "tests" / "cases" / "valid").rglob("*.yaml"))]


def parts(part: object) -> Iterator[dict[str, Any]]:
    if isinstance(part, dict):
        yield part
        for inner in part.values():
            yield from parts(inner)
    elif isinstance(part, list):
        for inner in part:
            yield from parts(inner)


def test_the_schema_is_one_of_draft_2020_12() -> None:
    assert schema()["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    jsonschema.Draft202012Validator.check_schema(schema())


@pytest.mark.parametrize("path", SPECS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_both_validators_accept_every_valid_spec_part_and_site(path: Path) -> None:
    source = accept(path.read_text("utf-8"), path.name, Findings())
    assert source is not None
    root = compose(source, Findings())
    assert root is not None
    data = root.data
    is_site = isinstance(data, dict) and "overlays" in data
    definition = {"$ref": "#/$defs/site", "$defs": DEFINITIONS} if is_site else schema()

    assert list(jsonschema.Draft202012Validator(definition).iter_errors(data)) == []
    assert jsonschema_rs.Draft202012Validator(definition).is_valid(data)


def test_definitions_are_not_recursive() -> None:
    refers = {
        name: {part["$ref"].rpartition("/")[2] for part in parts(definition) if "$ref" in part}
        for name, definition in DEFINITIONS.items()
    }
    reached: set[str] = set()
    while refers.keys() - reached:
        ready = {name for name, others in refers.items() if others <= reached} - reached
        assert ready, f"recursive definitions: {sorted(refers.keys() - reached)}"
        reached |= ready


def test_every_key_is_described_and_every_definition_has_a_title_and_an_example() -> None:
    undescribed = [
        f"{name}.{key}"
        for name, definition in {"": schema(), **DEFINITIONS}.items()
        for key, part in definition.get("properties", {}).items()
        if not ({"description"} & part.keys() or "description" in DEFINITIONS[part["$ref"].rpartition("/")[2]])
    ]

    assert undescribed == []
    assert [name for name, definition in DEFINITIONS.items() if "title" not in definition] == []
    assert [
        name for name, definition in DEFINITIONS.items() if "examples" not in definition and name != "parameter"
    ] == []


@pytest.mark.parametrize("name", [name for name in DEFINITIONS if name != "parameter"])
def test_the_examples_of_a_definition_have_its_shape(name: str) -> None:
    validator = jsonschema.Draft202012Validator({"$ref": f"#/$defs/{name}", "$defs": DEFINITIONS})

    for example in DEFINITIONS[name]["examples"]:
        assert list(validator.iter_errors(example)) == []


@pytest.mark.parametrize(
    ("definition", "key", "members"),
    [
        ("context_variable", "when_unobservable", WhenUnobservable),
        ("context_variable", "refresh", Refresh),
        ("perception_algorithm", "isolate", Isolation),
    ],
)
def test_the_words_of_the_schema_are_those_of_the_model(definition: str, key: str, members: type[Any]) -> None:
    assert DEFINITIONS[definition]["properties"][key]["anyOf"][0]["enum"] == [member.value for member in members]


def test_the_types_of_the_schema_are_those_of_the_model() -> None:
    assert DEFINITIONS["kind"]["anyOf"][0]["enum"] == [kind.value for kind in Kind]
    assert DEFINITIONS["access"]["anyOf"][0]["enum"] == [access.value for access in Access]
    assert DEFINITIONS["parameter_type"]["enum"] == [kind.value for kind in ParameterKind]


def test_the_schema_is_formatted_like_the_output_of_json() -> None:
    text = SCHEMA_FILE.read_text("utf-8")

    assert text == json.dumps(json.loads(text), indent=2, ensure_ascii=False) + "\n"
