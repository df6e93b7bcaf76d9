"""The compiled spec that a timeline is about: names and types to check it by, and what runs."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.emit.records import model_digest
from codra_dsl.language.diagnostics import suggest
from codra_dsl.runtime import ContextManager, ContextModel, SimClock
from codra_dsl.runtime.context.package_files import manifest_of
from codra_dsl.runtime.knowledge import KnowledgeModel
from codra_dsl.runtime.values.model import Algorithm, VariableModel

FOLDER = "generated"
_OWN_SOURCES = ("main_execution", "observer")


class PackageError(Exception):
    """There is no compiled spec of that name, or it cannot be imported.

    Attributes:
        message: what is wrong.
        help: what to do.
    """

    def __init__(self, message: str, help: str) -> None:
        super().__init__(f"{message}: {help}")
        self.message = message
        self.help = help


@dataclass(frozen=True, slots=True, kw_only=True)
class Package:
    """A compiled spec.

    Attributes:
        build: makes its context manager.
        algorithms: that its observers run, by name.
        knowledge: what the spec says of a graph, if it does.
    """

    model: ContextModel
    build: Callable[..., ContextManager[Any, Any]]
    algorithms: Mapping[str, Algorithm]
    knowledge: KnowledgeModel | None = None

    @property
    def variables(self) -> Mapping[str, VariableModel]:
        """Return the context-variables by name."""
        return {variable.name: variable for variable in self.model.variables}

    @property
    def agents(self) -> tuple[str, ...]:
        """Return the names of outside writers, sorted."""
        sources = {source for variable in self.model.variables for source in variable.sources}
        return tuple(sorted(sources.difference(_OWN_SOURCES)))

    @property
    def handles(self) -> tuple[str, ...]:
        """Return the names of the resources that have handles."""
        return tuple(resource.name for resource in self.model.resources if resource.slots is None)


@cache
def load_package(root: Path, name: str) -> Package:
    """Import a compiled spec as programs in the project's root do: `from generated import NAME`.

    It is done once in a process, and the spec is compiled for it once more: what is tested is what the spec says.

    Args:
        root: of the project; from here on Python looks for modules there, too.
        name: of the spec.

    Raises:
        PackageError: if that is not possible.
    """
    _require(root, name)
    _require_fresh(root, name)
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    try:
        module = importlib.import_module(f"{FOLDER}.{name}")
    except Exception as error:
        message = f"'{FOLDER}/{name}' cannot be imported: {type(error).__name__}: {error}"
        raise PackageError(message, "compile it anew: codra compile") from error
    if not Path(str(module.__file__)).resolve().is_relative_to(root.resolve()):
        raise PackageError(f"Python finds '{FOLDER}.{name}' in another project", "run pytest in each project by itself")
    return _package(module)


def _require(root: Path, name: str) -> None:
    present = sorted(each.parent.name for each in (root / FOLDER).glob("*/manifest.json"))
    if name not in present:
        near = suggest(name, present)
        help = f"did you mean '{near}'?" if near else "compile the spec first: codra compile"
        raise PackageError(f"there is no compiled spec '{FOLDER}/{name}'", help)


def _require_fresh(root: Path, name: str) -> None:
    """Require that the spec, if it is there, says what was compiled."""
    manifest = manifest_of(root / FOLDER / name)
    file = root / str(manifest.get("spec", ""))
    if not file.is_file():
        return
    plans = plan_paths([file], root).plans
    if not plans:
        raise PackageError(f"'{manifest['spec']}' has errors", f"see: codra lint {manifest['spec']}")
    if model_digest(plans[0]) != manifest.get("model"):
        message = f"'{FOLDER}/{name}' is not what '{manifest['spec']}' says any more"
        raise PackageError(message, f"compile it: codra compile {manifest['spec']}")


def _package(module: ModuleType) -> Package:
    """Build a forest of it once, which tells its algorithms; nothing of it runs."""
    model: ContextModel = module.MODEL
    classes = [each for each in vars(module).values() if isinstance(each, type) and issubclass(each, ContextManager)]
    build = next(each for each in classes if each is not ContextManager)
    algorithms: dict[str, Algorithm] = {}

    def note(algorithm: Algorithm) -> Callable[..., object]:
        algorithms[algorithm.name] = algorithm
        return note

    handles = {resource.name: None for resource in model.resources if resource.slots is None}
    build(model, clock=SimClock(), resources=handles, find=note).close()
    knowledge: KnowledgeModel | None = getattr(module, "KNOWLEDGE", None)
    return Package(model=model, build=build, algorithms=algorithms, knowledge=knowledge)
