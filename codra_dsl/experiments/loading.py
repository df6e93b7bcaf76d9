"""Generated code, taken from where it was written."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from codra_dsl.runtime import ContextManager


def load_start(files: Mapping[str, str], name: str, folder: Path) -> Callable[..., ContextManager[Any, Any]]:
    """Write generated files into a folder and return the `start` of the package `name` among them.

    The arguments are those of `load_emitted`.
    """
    return cast("Callable[..., ContextManager[Any, Any]]", load_emitted(files, name, folder).start)


def load_emitted(files: Mapping[str, str], name: str, folder: Path) -> ModuleType:
    """Write generated files into a folder and return the package `name` among them.

    Args:
        files: texts by path relative to the folder, as the compiler emits them.
        name: the spec's name.
        folder: an empty folder of this run; its path keeps packages of several runs apart.
    """
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    return load_package(folder / name)


def load_package(place: Path) -> ModuleType:
    """Return the generated package that stands in a folder, wherever that is.

    Raises:
        ImportError: if there is none; and whatever running it raises.
    """
    package = f"_codra_{sha256(str(place.absolute()).encode()).hexdigest()[:16]}_{place.name}"
    spec = importlib.util.spec_from_file_location(
        package, place / "__init__.py", submodule_search_locations=[str(place)]
    )
    if spec is None or spec.loader is None:
        raise ImportError(f"{place} cannot be imported")
    module = importlib.util.module_from_spec(spec)
    sys.modules[package] = module
    spec.loader.exec_module(module)
    return module
