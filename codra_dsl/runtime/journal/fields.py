"""JSON schemas of the fields of journal events; each field has one type, because viewers support no unions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from codra_dsl.runtime.values.cell import Reason

JsonSchema = dict[str, Any]

_JSON_TYPES = {"bool": "boolean", "int": "integer", "float": "number", "str": "string", "enum": "string"}

BOUND_FIELDS: Mapping[str, JsonSchema] = {
    "low": {"type": "number", "description": "The lowest possible value; left out when unknown."},
    "high": {"type": "number", "description": "The highest possible value."},
}
"""The fields of a range of values."""

METRIC_AND_WEIGHT_FIELDS: Mapping[str, JsonSchema] = {
    "name": {"type": "string", "description": "The metric or action."},
    **BOUND_FIELDS,
    "value": {"type": "number", "description": "The resulting value; left out when unknown."},
    "evidence_s": {"type": "number", "description": "When the evidence of the oldest input was taken."},
    "variable": {"type": "string", "description": "For an analysis, the variable that holds the value."},
    "reads": {
        "type": "array",
        "items": {"type": "string"},
        "description": "For an analysis, the variables from which the value was computed.",
    },
}
"""The fields of a metric or of the weight of an action."""


def object_list_schema(description: str, **properties: JsonSchema) -> JsonSchema:
    """Return the schema of a list of objects with some properties."""
    item_schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {"type": "array", "items": item_schema, "description": description}


def event_schema(
    description: str, name_description: str, meanings: Mapping[str, str], **details: JsonSchema
) -> JsonSchema:
    """Return the schema of an event: its instant, its name, what happened (a key of `meanings`), and details."""
    meanings_text = ", ".join(f"{what}: {meaning}" for what, meaning in meanings.items())
    return {
        "type": "object",
        "description": description,
        "properties": {
            "instant_s": field_schema(
                "number",
                "The instant in seconds of the run's clock. The message's log_time is the same instant in nanoseconds.",
            ),
            "name": field_schema("string", name_description),
            "what": {"type": "string", "enum": list(meanings), "description": f"What happened ({meanings_text})."},
            **details,
        },
        "required": ["instant_s", "name", "what"],
        "additionalProperties": False,
    }


def field_schema(json_type: str, description: str) -> JsonSchema:
    """Return the schema of a field of one JSON type."""
    return {"type": json_type, "description": description}


def list_schema(json_type: str, description: str) -> JsonSchema:
    """Return the schema of a list of values of one JSON type."""
    return {"type": "array", "items": {"type": json_type}, "description": description}


def reason_schema(description: str) -> JsonSchema:
    """Return the schema of the reason why a variable is unknown."""
    return {"type": "string", "enum": [str(reason) for reason in Reason], "description": description}


def value_fields(name: str, value_kind: str, description: str) -> dict[str, JsonSchema]:
    """Return the schema of a field that holds a value of a type of the spec language, and of its infinite values."""
    value_schema = field_schema(_JSON_TYPES[value_kind], description)
    return {name: value_schema, **(infinite_fields(name) if value_kind == "float" else {})}


def infinite_fields(*names: str) -> dict[str, JsonSchema]:
    """Return the schemas of the fields that replace numbers if they are infinite."""
    keys = {name: "infinite" if name == "value" else f"infinite_{name}" for name in names}
    text = "1 if `{}` is infinite, -1 if it is negative infinity; then `{}` is left out."
    return {key: field_schema("integer", text.format(name, name)) for name, key in keys.items()}


def result_fields(returns: Mapping[str, tuple[str, str | None]]) -> dict[str, JsonSchema]:
    """Return the schemas of the fields for the result of a job, from the kind and the unit of each quantity."""
    quantities = {name: field_schema(_JSON_TYPES[kind], unit_sentence(unit)) for name, (kind, unit) in returns.items()}
    signs = {
        name: field_schema("integer", "1 or -1: the sign.") for name, (kind, _) in returns.items() if kind == "float"
    }
    fields = {"values": ("The result, without quantities that were not measured or are infinite.", quantities)}
    if signs:
        fields["infinite"] = ("The infinite quantities of the result.", signs)
    return {
        key: {"type": "object", "description": description, "properties": properties, "additionalProperties": False}
        for key, (description, properties) in fields.items()
    }


def unit_sentence(unit: str | None) -> str:
    """Return the sentence about the unit of a number."""
    return f"In {unit}." if unit else "Declared under `returns` in the spec."
