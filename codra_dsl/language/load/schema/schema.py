"""Compare data with the definitions of the published schema, `schema.json`, and list the errors of invalid data.

`jsonschema_rs` accepts valid data very fast; only data that it refuses are given to `jsonschema`, which lists the
errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import field, replace
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import jsonschema_rs

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema_file import schema

if TYPE_CHECKING:
    from jsonschema.exceptions import ValidationError

FILE_DEFINITION = ""
"""The definition of a complete file."""


_FORMS = {
    "identification": ("cases", "condition"),
    "node": ("node_object", "name"),
    "writers": ("priorities", "sources"),
    "parameter_declaration": ("parameter_object", "parameter_type"),
    "saying": ("said_values", "silence"),
    "behaviour": ("behaviour_object", "behaviour_word"),
    "override": ("override_object", "cleared"),
    "placement": ("pose", "placement_word"),
    "leaf_behaviour": ("leaf_behaviour_object", "leaf_behaviour_word"),
    "belief": ("belief_object", "literal"),
    "preview_outcome": ("preview_outcome_object", "preview_outcome_word"),
}
"""For values that may or may not be a mapping: the definition of a mapping, and the definition of any other value."""

_ANNOTATIONS = {"title", "description", "markdownDescription", "markdownEnumDescriptions", "default", "examples"}


_MAX_KEPT_LENGTH = 1000
"""The maximum length of the text of data whose errors are kept."""


def has_shape(definition: str, data: object) -> bool:
    """Return whether data have the shape of a definition of the schema."""
    return _acceptor(definition).is_valid(data)


def keys_of(definition: str) -> frozenset[str]:
    """Return the keys that an element of a definition can have."""
    mapping, _ = _FORMS.get(definition, (definition, definition))
    return frozenset(schema()["$defs"][mapping].get("properties", ()))


@cache
def _acceptor(definition: str) -> jsonschema_rs.Draft202012Validator:
    return jsonschema_rs.Draft202012Validator(_definition(definition, _bare_schema()))


@cache
def _explainer(definition: str) -> Any:
    from jsonschema import Draft202012Validator  # noqa: PLC0415  slow to import; a sound spec never needs it

    return Draft202012Validator(_definition(definition, schema()))


def _definition(name: str, full_schema: dict[str, Any]) -> dict[str, Any]:
    if name == FILE_DEFINITION:
        return full_schema
    return {"$ref": f"#/$defs/{name}", "$defs": full_schema["$defs"]}


@cache
def _bare_schema() -> dict[str, Any]:
    return _without_annotations(schema())


def _without_annotations(part: dict[str, Any]) -> dict[str, Any]:
    """Return a schema without descriptions and examples: creating an acceptor then takes a third of the time."""
    bare_part: dict[str, Any] = {}
    for keyword, value in part.items():
        if keyword in ("properties", "$defs"):
            bare_part[keyword] = {name: _without_annotations(inner) for name, inner in value.items()}
        elif keyword in ("anyOf", "allOf"):
            bare_part[keyword] = [_without_annotations(inner) for inner in value]
        elif keyword not in _ANNOTATIONS:
            bare_part[keyword] = _without_annotations(value) if isinstance(value, dict) else value
    return bare_part


@dataclass(frozen=True, slots=True)
class Error:
    """A difference between data and the schema.

    Attributes:
        path: the way from the element to the wrong value.
        mapping_example: if the value can be a word or a mapping, and is neither: an example of a mapping; otherwise
            None.
    """

    path: tuple[str | int, ...]
    keyword: str
    limit: Any
    schema: dict[str, Any]
    data: Any
    mapping_example: Any = None


def errors_of(definition: str, data: object) -> tuple[Error, ...]:
    """Return the differences between the data of an element and a definition.

    A mistake is often repeated in many elements. So the errors of small data are kept and used for equal data.
    """
    text = repr(data)
    if len(text) > _MAX_KEPT_LENGTH:
        return _errors_of_element(definition, data)
    return _kept_errors(definition, _Data(text, data))


@dataclass(frozen=True, slots=True)
class _Data:
    """Data that are equal if their texts are equal; `1`, `1.0` and `true` are different."""

    text: str
    value: object = field(compare=False)


@lru_cache(maxsize=256)
def _kept_errors(definition: str, data: _Data) -> tuple[Error, ...]:
    return _errors_of_element(definition, deepcopy(data.value))  # a copy, because misspelt keys are corrected later


def _errors_of_element(definition: str, data: object) -> tuple[Error, ...]:
    """Return the differences between the data of an element and a definition.

    Unknown keys are the most frequent mistake. If they are the only one, they are found without `jsonschema`, which
    needs a millisecond for each element.
    """
    schema_here = schema() if definition == FILE_DEFINITION else schema()["$defs"][definition]
    if isinstance(data, dict) and schema_here.get("additionalProperties") is False:
        known_data = {key: value for key, value in data.items() if key in schema_here["properties"]}
        if len(known_data) < len(data) and has_shape(definition, known_data):
            return (Error((), "additionalProperties", False, schema_here, data),)
    return tuple(_errors_of(definition, data, ()))


def _errors_of(definition: str, data: object, path: tuple[str | int, ...]) -> Iterator[Error]:
    """Yield the differences between data and a definition; `path` leads from the element to these data."""
    error: ValidationError
    for error in _explainer(definition).iter_errors(data):
        error_path = (*path, *error.absolute_path)
        schema_here = error.schema if isinstance(error.schema, dict) else {}
        anchor = str(schema_here.get("$anchor"))
        branch = _branch(anchor, error.instance) if error.validator == "anyOf" else None
        if branch is None:
            yield Error(error_path, str(error.validator), error.validator_value, schema_here, error.instance)
            continue
        for inner_error in _errors_of(branch, error.instance, error_path):
            is_word = anchor in _FORMS and inner_error.path == error_path and allowed_words(inner_error.schema)
            mapping = schema()["$defs"][_FORMS[anchor][0]] if is_word else {}
            yield replace(inner_error, mapping_example=mapping.get("examples", [None])[0])


def _branch(anchor: str, data: object) -> str | None:
    """Return the definition that applies to a value with several possible forms."""
    if anchor == "identification" and isinstance(data, dict) and {"enter", "leave", "confirm"} & data.keys():
        return "hysteresis"
    if anchor == "pattern_or_patterns":
        return "some_patterns" if isinstance(data, list) else "pattern"
    forms = _FORMS.get(anchor)
    return None if forms is None else forms[0 if isinstance(data, dict) else 1]


def allowed_words(schema_here: dict[str, Any]) -> list[str]:
    """Return the words that a schema allows, if it is a choice among words."""
    for form in (schema_here, *schema_here.get("anyOf", ())):
        if "enum" in form:
            return list(form["enum"])
    return []


def resolve(subschema: dict[str, Any]) -> dict[str, Any]:
    """Return a part of the schema with its reference resolved."""
    reference = subschema.get("$ref", "")
    definition: dict[str, Any] = schema()["$defs"].get(reference.rpartition("/")[2], {})
    return definition | subschema
