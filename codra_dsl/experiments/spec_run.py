"""From a spec file to what starts its observers, and what the laboratory asks of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from codra_dsl.check import check
from codra_dsl.emit import emit
from codra_dsl.experiments.loading import load_start
from codra_dsl.load import load_spec
from codra_dsl.model import Kind, Spec
from codra_dsl.plan import plan
from codra_dsl.runtime import ContextManager
from codra_dsl.worlds.lab.eyes import VISION
from codra_dsl.worlds.lab.mission import DECIDES_ON, SKILLS

Start = Callable[..., ContextManager[Any, Any]]


class SpecError(Exception):
    """A spec has errors: it cannot be run."""


def lacks(spec: Spec) -> tuple[str, ...]:
    """Return what the laboratory's main execution needs and a spec does not declare, in words."""
    skills = {skill.name for skill in spec.skills}
    true_or_false = {variable.name for variable in spec.context if variable.type.kind is Kind.BOOL}
    shared = {resource.name for resource in spec.resources if resource.slots is not None}
    return (
        *(f"skill '{name}'" for name in SKILLS if name not in skills),
        *(f"context-variable '{name}' of type bool" for name in DECIDES_ON if name not in true_or_false),
        *(f"resource '{name}' with slots" for name in (VISION,) if name not in shared),
    )


def start_of(spec: Spec, folder: Path) -> Start:
    """Compile a spec and return what starts its observers.

    Args:
        spec: without errors.
        folder: a folder for the generated code of this run; is made.

    Raises:
        SpecError: if it has errors.
    """
    checked, diagnostics = check(spec)
    if checked is None:
        raise SpecError(", ".join(found.message for found in diagnostics))
    folder.mkdir(parents=True, exist_ok=True)
    return load_start(emit(plan(checked)), spec.name, folder)


def loaded(path: Path) -> Spec:
    """Return a spec file's content.

    Raises:
        SpecError: if it has errors.
    """
    spec, diagnostics = load_spec(path.absolute(), path.absolute().parent)
    if spec is None:
        raise SpecError(", ".join(found.message for found in diagnostics))
    return spec
