"""Validators of the published schema of messages."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import jsonschema_rs

from codra_dsl.runtime.remote import SCHEMA_FILE
from codra_dsl.runtime.remote.json_lines import line_of

SCHEMA: dict[str, Any] = json.loads(SCHEMA_FILE.read_text("utf-8"))


@cache
def validator(definition: str) -> jsonschema_rs.Draft202012Validator:
    """Return the validator of a definition of the schema, such as `request` or `answer.get`."""
    part = {"$schema": SCHEMA["$schema"], "$ref": f"#/$defs/{definition}", "$defs": SCHEMA["$defs"]}
    return jsonschema_rs.Draft202012Validator(part)


def is_valid(definition: str, message: object) -> bool:
    """Return whether the JSON text of a message has the form of a definition."""
    return validator(definition).is_valid(json.loads(line_of(message)))  # type: ignore[arg-type]
