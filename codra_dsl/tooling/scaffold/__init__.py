"""The project that `codra init` creates: it passes lint, compiles, type-checks and passes its tests without changes."""

from __future__ import annotations

from codra_dsl.tooling.scaffold.files import conflicts, starter_texts, write_new_files
from codra_dsl.tooling.scaffold.names import ImproperNameError, name_from_folder, require_name

__all__ = [
    "ImproperNameError",
    "conflicts",
    "name_from_folder",
    "require_name",
    "starter_texts",
    "write_new_files",
]
