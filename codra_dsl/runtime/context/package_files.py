"""The files beside generated code: the manifest of a package, and where all of it stands in the spec."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from codra_dsl.runtime.journal.spec_summary import Place, place_of

MANIFEST = "manifest.json"
SOURCES = "sources.json"
_MANIFEST_FORMAT = "codra-manifest"


def package_folder(manager: object) -> Path | None:
    """Return the folder of the generated package whose context manager this is; None if it was put together by hand."""
    for cls in type(manager).__mro__:
        file = getattr(sys.modules.get(cls.__module__), "__file__", None)
        if file is not None and manifest_of(Path(file).parent):
            return Path(file).parent
    return None


def manifest_of(folder: Path | None) -> Mapping[str, Any]:
    """Return the manifest of a generated package, empty if the folder is none."""
    if folder is None:
        return {}
    manifest = _json(folder / MANIFEST)
    return manifest if manifest.get("format") == _MANIFEST_FORMAT else {}


def _json(path: Path) -> Mapping[str, Any]:
    try:
        found = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def places_in(folder: Path | None, name: str) -> Mapping[str, Place]:
    """Return where all of a spec stands, by what it is and its name; nothing if there is no generated package.

    Args:
        folder: of the package.
        name: of the spec.
    """
    found = {} if folder is None else _json(folder / SOURCES)
    return {key.removeprefix(f"{name}/"): place for key, about in found.items() if (place := place_of(about))}
