"""Read the published schema, `schema.json`."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from codra_dsl.language.project import SCHEMA_FILE


@cache
def schema() -> dict[str, Any]:
    """Return the published schema."""
    content: dict[str, Any] = json.loads(SCHEMA_FILE.read_text(encoding="utf-8"))
    return content
