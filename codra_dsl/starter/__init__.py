"""What `codra init` writes: a project that lints, compiles, type-checks and runs its tests at once."""

from __future__ import annotations

from codra_dsl.starter.names import ImproperNameError, name_from_folder, require_name
from codra_dsl.starter.place import conflicts, write_new
from codra_dsl.starter.requirement import installed_requirement
from codra_dsl.starter.schema import SCHEMA_PATH
from codra_dsl.starter.texts import starter_texts

__all__ = [
    "SCHEMA_PATH",
    "ImproperNameError",
    "conflicts",
    "installed_requirement",
    "name_from_folder",
    "require_name",
    "starter_texts",
    "write_new",
]
