"""A mistake that several elements repeat is examined once, and reported at each of them."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_text
from codra_dsl.language.load.schema.schema import FILE_DEFINITION, errors_of
from codra_dsl.language.load.schema_file import schema
from tests.language.load.texts import NOWHERE


def findings(context: str) -> tuple[Diagnostic, ...]:
    return load_text(f"codra: 1\nname: kitchen\ncontext:\n{context}", "kitchen.yaml", NOWHERE)[1]


def test_equal_mistakes_are_reported_at_each_element() -> None:
    lines = "".join(f"  v{number}: {{typ: bol, source: 3}}\n" for number in range(5))

    reported = [(finding.code, finding.place.span.line) for finding in findings(lines)]

    alone = [finding.code for finding in findings("  v0: {typ: bol, source: 3}\n")]
    assert sorted(reported) == sorted((code, line) for code in alone for line in range(4, 9))


def test_values_that_are_equal_in_python_but_of_different_types_have_different_errors() -> None:
    assert errors_of("resource", {"slots": 1}) == ()
    assert [error.path for error in errors_of("resource", {"slots": True})] == [("slots",)]
    assert errors_of("resource", {"slots": 1}) == ()


def test_errors_of_equal_data_are_computed_once() -> None:
    data = {"typ": "bol", "number": 17}

    assert errors_of("context_variable", dict(data)) is errors_of("context_variable", dict(data))
    assert errors_of("context_variable", {**data, "typ": "float"})[0].data["typ"] == "float"


CLOSED_DEFINITIONS = [name for name, part in schema()["$defs"].items() if part.get("additionalProperties") is False]


@settings(max_examples=150)
@given(st.sampled_from([*CLOSED_DEFINITIONS, FILE_DEFINITION]), st.data())
def test_errors_of_data_with_unknown_keys_are_those_of_the_schema(definition: str, data: st.DataObject) -> None:
    """Each element has some of the known keys, with values that the schema shows as examples, and unknown keys."""
    part = schema()["$defs"][definition] if definition else schema()
    examples = {key: value["examples"][0] for key, value in part.get("properties", {}).items() if "examples" in value}
    keys = data.draw(st.lists(st.sampled_from(sorted(examples)), unique=True)) if examples else []
    unknown_keys = data.draw(st.lists(st.sampled_from(["typ", "colour", "9"]), unique=True))
    element: dict[str, Any] = {key: examples[key] for key in keys} | dict.fromkeys(unknown_keys, 1)
    whole = {"$ref": f"#/$defs/{definition}", "$defs": schema()["$defs"]} if definition else schema()

    errors = [(error.path, error.keyword, error.limit, error.schema) for error in errors_of(definition, element)]

    assert [error for error in errors if not error[0]] == [
        ((), error.validator, error.validator_value, error.schema)
        for error in Draft202012Validator(whole).iter_errors(element)
        if not error.absolute_path and error.validator != "anyOf"
    ]
