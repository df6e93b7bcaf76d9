"""`codra compile`: specs to generated packages, or with `--check` whether these are fresh."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    FailOn,
    Format,
    View,
    common_root,
    counted,
    existing,
    fails,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, Specs

if TYPE_CHECKING:
    from codra_dsl.compiler import Compilation

Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Where packages go.  [default: generated, in the project's root or else here]",
        show_default=False,
    ),
]
Check = Annotated[bool, typer.Option("--check", help="Write nothing; show how the output differs from the specs.")]


def compile_command(
    paths: Specs,
    *,
    out: Out = None,
    check: Check = False,
    format_: FindingsFormat = Format.FULL,
    fail_on: FailOnOption = FailOn.ERROR,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Compile specs to packages of readable Python: observers, the context's types, and the dependency graph."""
    from codra_dsl.compiler import compile_paths

    existing(paths)
    root = common_root(paths)
    view = View(root=root, format=format_, colour=color)
    compilation = compile_paths(paths, root)
    found = compilation.planned.diagnostics
    write_result(view.rendered(found, sys.stdout))
    if found:
        say(counted(found))
    folder = (out if out is not None else _default_out(paths[0])).absolute()
    renew = _check if check else _write
    renewed = bool(compilation.files) and renew(compilation, folder, view)
    raise typer.Exit(ExitCode.CLEAN if renewed and not fails(found, fail_on) else ExitCode.FAILED)


def _default_out(path: Path) -> Path:
    from codra_dsl.project import project_of

    return (project_of(path) or Path.cwd()) / "generated"


def _check(compilation: Compilation, folder: Path, view: View) -> bool:
    """Show how the output folder differs; return whether it is fresh."""
    from codra_dsl.output import freshness, stale

    compared = freshness(compilation.files, folder, compilation.covered)
    write_result(view.rendered(compared.diagnostics, sys.stdout))
    if view.format is Format.JSON:
        write_result(view.rendered([stale(drift) for drift in compared.drifts], sys.stdout))
    else:
        write_result("".join(drift.diff for drift in compared.drifts))
    for drift in compared.drifts:
        say(f"{drift.path}: {drift.change.value}")
    return not compared.drifts and not compared.diagnostics


def _write(compilation: Compilation, folder: Path, view: View) -> bool:
    """Bring the output folder up to date; return whether that was possible."""
    from codra_dsl.output import write

    written = write(compilation.files, folder, compilation.covered)
    write_result(view.rendered(written.diagnostics, sys.stdout))
    if not written.diagnostics:
        changes = f"{len(written.changed)} written, {len(written.removed)} removed"
        say(f"{folder.name}: {len(compilation.files)} files, {changes}")
    return not written.diagnostics
