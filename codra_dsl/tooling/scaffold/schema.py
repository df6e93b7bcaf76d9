"""The copy of the schema in a project. Editors read this copy.

The copy is checked in, so an editor needs no installation of codra. If a project has a copy, `codra compile` renews it
like any other output, and `codra compile --check` reports a stale copy.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from codra_dsl.generation.output import output_finding
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.project import SCHEMA_COPY, SCHEMA_FILE, has_stale_schema


def check_schema(root: Path) -> tuple[Diagnostic, ...]:
    """Return a finding if a project's copy of the schema differs from the schema of this version. Write nothing."""
    if not has_stale_schema(root):
        return ()
    message = f"'{SCHEMA_COPY}' is not the schema of this version of codra"
    return (output_finding("stale-output", SCHEMA_COPY, message, help="renew it with 'codra compile'"),)


def renew_schema(root: Path) -> tuple[Diagnostic, ...]:
    """Replace a stale copy of the schema in a project, and return a finding if this fails."""
    schema_copy = root / SCHEMA_COPY
    if not has_stale_schema(root):
        return ()
    try:
        with tempfile.TemporaryDirectory(prefix=".codra-", dir=schema_copy.parent) as staging_folder:
            staged_file = Path(staging_folder) / schema_copy.name
            staged_file.write_bytes(SCHEMA_FILE.read_bytes())
            staged_file.replace(schema_copy)
    except OSError as error:
        message = f"cannot write '{SCHEMA_COPY}': {error.strerror}"
        return (output_finding("cannot-write", SCHEMA_COPY, message, help="check the permissions, or remove it"),)
    return ()
