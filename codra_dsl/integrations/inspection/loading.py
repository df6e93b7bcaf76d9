"""Compile a spec and import the generated package from any folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, cast

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.emit import emit
from codra_dsl.language.check import check
from codra_dsl.language.diagnostics import Diagnostic, has_errors
from codra_dsl.language.load import load_spec
from codra_dsl.language.model import Spec
from codra_dsl.language.project import root_of
from codra_dsl.runtime import ContextManager
from codra_dsl.runtime.context.package_files import load_package
from codra_dsl.runtime.loops import Mape

__all__ = [
    "CompiledSpec",
    "SpecError",
    "compile_and_load",
    "load_emitted",
    "load_package",
    "load_start",
    "read_spec",
    "source_files",
]

StartFunction = Callable[..., ContextManager[Any, Any]]


class SpecError(Exception):
    """A spec has errors, so it cannot be compiled. The message lists them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledSpec:
    """A spec and the package that was generated from it.

    Attributes:
        spec: the spec, with its templates expanded.
        package: the imported package.
    """

    spec: Spec
    package: ModuleType

    @property
    def start(self) -> StartFunction:
        """Return the package's `start`, which starts the observers and returns the context manager.

        Functions of algorithms with a host run in this program, because worlds simulate all machines.
        """
        start = cast("StartFunction", self.package.start)
        has_hosts = any(algorithm.host for algorithm in self.spec.perception)
        return partial(start, hosts_here=True) if has_hosts else start

    @property
    def loops(self) -> Callable[..., Mape] | None:
        """Return the package's `loops`, which makes the MAPE-K loops; None if the spec declares none."""
        return getattr(self.package, "loops", None)


def compile_and_load(source: Path | Spec | BuildPlan, folder: Path) -> CompiledSpec:
    """Compile a spec, write the generated package into a folder, and import it from there.

    Args:
        source: a file that holds one spec, a `Spec` (without behaviour trees of its own), or a build plan.
        folder: an empty or missing folder for the package. Packages with the same name need different folders.

    Raises:
        SpecError: if the spec has errors, or the file does not hold exactly one spec.
    """
    build_plan = source if isinstance(source, BuildPlan) else _plan_of(source)
    spec = build_plan.checked.spec
    return CompiledSpec(spec=spec, package=load_emitted(emit(build_plan), spec.name, folder))


def read_spec(path: Path) -> Spec:
    """Return the spec of a file. Only the shape of the spec is checked.

    Raises:
        SpecError: if the file cannot be read as a spec.
    """
    spec, diagnostics = load_spec(path.absolute(), path.absolute().parent)
    if spec is None:
        raise _spec_error(diagnostics)
    return spec


def source_files(spec: Path) -> tuple[Path, ...]:
    """Return the files that a spec is compiled from: its own file, included parts, behaviour trees and Python modules.

    Files that the spec names are listed even if they do not exist.

    Raises:
        SpecError: if the spec has errors.
    """
    planned_specs = plan_paths([spec.absolute()], root_of(spec))
    if has_errors(planned_specs.diagnostics):
        raise _spec_error(planned_specs.diagnostics)
    return tuple(planned_specs.root / name for name in (*planned_specs.files, *planned_specs.modules))


def _plan_of(source: Path | Spec) -> BuildPlan:
    if isinstance(source, Spec):
        checked_spec, diagnostics = check(source)
        if checked_spec is None:
            raise _spec_error(diagnostics)
        return plan(checked_spec)
    planned_specs = plan_paths([source.absolute()], root_of(source))
    if len(planned_specs.plans) != 1:
        raise _spec_error(planned_specs.diagnostics, f"'{source}' does not hold exactly one spec")
    return planned_specs.plans[0]


def _spec_error(diagnostics: Iterable[Diagnostic], fallback_message: str = "") -> SpecError:
    return SpecError(", ".join(diagnostic.message for diagnostic in diagnostics) or fallback_message)


def load_start(file_texts: Mapping[str, str], name: str, folder: Path) -> StartFunction:
    """Write generated files into a folder, import the package `name` from this folder, and return its `start`.

    The arguments are those of `load_emitted`.
    """
    return cast("StartFunction", load_emitted(file_texts, name, folder).start)


def load_emitted(file_texts: Mapping[str, str], name: str, folder: Path) -> ModuleType:
    """Write generated files into a folder, import the package `name` from this folder, and return the package.

    Args:
        file_texts: a mapping from paths relative to the folder to the texts of the files, as the compiler emits them.
        name: the spec's name.
        folder: an empty folder for this run; packages of different runs need different folders.
    """
    for path, text in file_texts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    return load_package(folder / name)
