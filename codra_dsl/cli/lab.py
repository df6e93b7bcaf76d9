"""What commands share that run a spec in a simulated world."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from codra_dsl.cli.console import Colour, ExitCode, Format, View, counted, say, write_result

if TYPE_CHECKING:
    from codra_dsl.build_plan import BuildPlan
    from codra_dsl.model import Spec


def lab_spec(path: Path, root: Path, color: Colour) -> Spec:
    """Return a spec without errors that has what the lab needs; show on standard output what is found about it."""
    from codra_dsl.experiments.spec_run import lacks

    spec = one_plan(path, root, color).checked.spec
    if missing := lacks(spec):
        say("\n  ".join((f"codra: '{spec.name}' does not run in the lab, whose main execution needs:", *missing)))
        raise typer.Exit(ExitCode.FAILED)
    return spec


def one_plan(path: Path, root: Path, color: Colour) -> BuildPlan:
    """Return the plan of the one spec of a file; show on standard output what is found about it."""
    from codra_dsl.compiler import plan_paths

    planned = plan_paths([path], root)
    if planned.diagnostics:
        write_result(View(root=root, format=Format.FULL, colour=color).rendered(planned.diagnostics, sys.stdout))
        say(counted(planned.diagnostics))
    if len(planned.plans) > 1:
        raise typer.BadParameter(f"'{path}' holds {len(planned.plans)} specs: name one", param_hint="SPEC")
    if not planned.plans:
        raise typer.Exit(ExitCode.FAILED)
    return planned.plans[0]


def made_folder(folder: Path) -> Path:
    """Return the folder for what a run writes, made before the run lest it be in vain."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(f"cannot write to '{folder}': {error.strerror}", param_hint="--out") from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise typer.BadParameter(f"cannot write to '{folder}'", param_hint="--out")
    return folder
