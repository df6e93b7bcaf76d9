"""Where a project begins: the nearest folder upwards whose `pyproject.toml` has a table `[tool.codra]`."""

from __future__ import annotations

import tomllib
from pathlib import Path


def project_of(path: Path) -> Path | None:
    """Return the root of the project that a file or folder belongs to, or None where there is no project."""
    start = path.absolute()
    return next((folder for folder in (start, *start.parents) if _is_project(folder)), None)


def root_of(path: Path) -> Path:
    """Return the folder that the paths of specs are relative to: the project's root, else the folder of the spec."""
    return project_of(path) or (path.absolute() if path.is_dir() else path.absolute().parent)


def _is_project(folder: Path) -> bool:
    try:
        settings = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))
    except (OSError, ValueError):
        return False
    tool = settings.get("tool")
    return isinstance(tool, dict) and isinstance(tool.get("codra"), dict)
