"""JSON schemas of the fields of journal events; each field has one type, because viewers support no unions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from codra_dsl.runtime.values.cell import Reason

Field = dict[str, Any]

BOUNDS: Mapping[str, Field] = {
    "low": {"type": "number", "description": "The lowest possible value; left out when unknown."},
    "high": {"type": "number", "description": "The highest possible value."},
}
"""The fields of a range of values."""

JUDGED: Mapping[str, Field] = {
    "name": {"type": "string", "description": "The metric or action."},
    **BOUNDS,
    "value": {"type": "number", "description": "The resulting value; left out when unknown."},
    "evidence_s": {"type": "number", "description": "When the evidence of the oldest input was taken."},
    "variable": {"type": "string", "description": "For an analysis, the variable that holds the value."},
    "reads": {
        "type": "array",
        "items": {"type": "string"},
        "description": "For an analysis, its input variables.",
    },
}
"""The fields of a metric or of the weight of an action."""


def parts_schema(description: str, **properties: Field) -> Field:
    """Return the schema of a list of objects with some properties."""
    item = {"type": "object", "properties": properties, "additionalProperties": False}
    return {"type": "array", "items": item, "description": description}


def event_schema(description: str, name: str, whats: Mapping[str, str], **details: Field) -> Field:
    """Return the schema of an event: its instant, its name, one of the listed changes (`what`), and details."""
    meanings = ", ".join(f"{what}: {meaning}" for what, meaning in whats.items())
    return {
        "type": "object",
        "description": description,
        "properties": {
            "instant_s": field_schema(
                "number", "When, in seconds of the run's clock; log_time is the same in nanoseconds."
            ),
            "name": field_schema("string", name),
            "what": {"type": "string", "enum": list(whats), "description": f"What happened ({meanings})."},
            **details,
        },
        "required": ["instant_s", "name", "what"],
        "additionalProperties": False,
    }


def field_schema(kind: str, description: str) -> Field:
    """Return the schema of a field of one JSON type."""
    return {"type": kind, "description": description}


def list_schema(kind: str, description: str) -> Field:
    """Return the schema of a list of values of one JSON type."""
    return {"type": "array", "items": {"type": kind}, "description": description}


def reason_schema(description: str) -> Field:
    """Return the schema of the reason why a variable is unknown."""
    return {"type": "string", "enum": [str(reason) for reason in Reason], "description": description}


def unit_text(unit: str | None) -> str:
    """Return the sentence about the unit of a number."""
    return f"In {unit}." if unit else "As the spec's `returns` declares it."
