"""The copy of the schema that a project's editors read.

It is checked in, so that an editor needs nothing that is installed. `codra compile` keeps it fresh wherever it is, and
`codra compile --check` finds it stale.
"""

from __future__ import annotations

from codra_dsl.project import SCHEMA_COPY, SCHEMA_FILE

SCHEMA_PATH = SCHEMA_COPY
"""Where the copy is, from the project's root."""


def published_schema() -> str:
    """Return the schema of a spec as this version publishes it."""
    return SCHEMA_FILE.read_text(encoding="utf-8")
