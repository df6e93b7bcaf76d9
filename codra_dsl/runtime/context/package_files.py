"""Generated packages: importing them, their manifests, and the places of their elements in the spec."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.regular_files import read_regular_file
from codra_dsl.runtime.journal.spec_summary import Place, place_from_data

MANIFEST_FILE = "manifest.json"
SOURCES_FILE = "sources.json"
_MANIFEST_FORMAT = "codra-manifest"
_MAX_BYTES = 64 * 1024 * 1024


def load_package(folder: Path) -> ModuleType:
    """Import the generated package in a folder, and return it. The folder need not be on Python's path.

    Raises:
        ImportError: if there is no package. Exceptions of the package itself are not changed.
    """
    module_name = f"_codra_{sha256(str(folder.absolute()).encode()).hexdigest()[:16]}_{folder.name}"
    spec = importlib.util.spec_from_file_location(
        module_name, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"{folder} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    spec.loader.exec_module(module)
    return module


def package_folder(manager: object) -> Path | None:
    """Return the folder of the generated package that a context manager comes from; None if there is no package."""
    for cls in type(manager).__mro__:
        module_file = getattr(sys.modules.get(cls.__module__), "__file__", None)
        if module_file is not None and manifest_of(Path(module_file).parent):
            return Path(module_file).parent
    return None


def manifest_of(folder: Path | None) -> Mapping[str, Any]:
    """Return the manifest of a generated package; empty if the folder is not a generated package."""
    if folder is None:
        return {}
    manifest = _read_json(folder / MANIFEST_FILE)
    return manifest if manifest.get("format") == _MANIFEST_FORMAT else {}


def _read_json(path: Path) -> Mapping[str, Any]:
    try:
        content = json.loads(read_regular_file(path, _MAX_BYTES).decode("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def places_in(folder: Path | None, name: str) -> Mapping[str, Place]:
    """Return the places of the elements of a spec, by kind and name; empty if there is no generated package.

    Args:
        folder: the folder of the package.
        name: the name of the spec.
    """
    sources = {} if folder is None else _read_json(folder / SOURCES_FILE)
    return {
        key.removeprefix(f"{name}/"): place
        for key, place_data in sources.items()
        if (place := place_from_data(place_data))
    }
