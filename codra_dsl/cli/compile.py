"""`codra compile`: specs to generated packages; with `--check`, whether the packages are up to date."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    Format,
    View,
    asked_format,
    common_root,
    counted,
    existing,
    failing,
    fails,
    for_log,
    measuring,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, NoCache, Output, ShowTimings, Specs

if TYPE_CHECKING:
    from codra_dsl.compiler import Compilation
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.workspace.cache import Cache, Run
    from codra_dsl.workspace.timings import Timings

Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="The folder for the packages.  [default: generated, in the project's root or else in the current folder]",
        show_default=False,
    ),
]
Check = Annotated[bool, typer.Option("--check", help="Write nothing; show how the output differs from the specs.")]


def compile_command(
    paths: Specs,
    *,
    out: Out = None,
    check: Check = False,
    format_: FindingsFormat = None,
    output: Output = None,
    fail_on: FailOnOption = None,
    no_cache: NoCache = False,
    timings: ShowTimings = False,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Compile specs to packages of readable Python. Each has observers, the types of the context, and the graph."""
    from codra_dsl.tooling.report.findings import visible_lines
    from codra_dsl.workspace.cache import cache_of

    paths = existing(paths)
    root = common_root(paths)
    folder = (out if out is not None else _default_out(paths[0])).absolute()
    measured = measuring(timings)
    cache = None if no_cache or timings else cache_of(root, "compile", paths)
    run, renewed = _made(paths, root, folder, check=check, cache=cache, timings=measured)
    limit = failing(fail_on, run.fail_on)
    view = View(root=root, format=asked_format(format_, output), colour=color, fail_on=limit, title="codra compile")
    about_output = (_in_root(diagnostic, folder, root) for diagnostic in renewed.diagnostics)
    findings = (*run.diagnostics, *about_output, *_about_schema(run, root, check))
    with measured.stage("show"):
        view.show(findings, run.specs, output)
    if view.format is Format.FULL:
        write_result(for_log(visible_lines(renewed.diff)))
    if findings:
        say(counted(findings))
        view.point_to_pages(findings)
    if renewed.done:
        say(renewed.done)
    if timings:
        say(measured.table())
    raise typer.Exit(ExitCode.FAILED if not run.outputs or fails(findings, limit) else ExitCode.CLEAN)


def _default_out(path: Path) -> Path:
    from codra_dsl.language.project import project_of

    return (project_of(path) or Path.cwd()) / "generated"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Renewed:
    """The result of renewing the output folder.

    Attributes:
        diff: how it differs from the text that the specs define.
        done: the changes that were made, in a sentence.
    """

    diagnostics: tuple[Diagnostic, ...] = ()
    diff: str = ""
    done: str = ""


def _made(
    paths: list[Path], root: Path, folder: Path, *, check: bool, cache: Cache | None, timings: Timings
) -> tuple[Run, _Renewed]:
    """Return a run and the state of the output; if nothing has changed, output included, an earlier run."""
    from codra_dsl.generation.output import is_as_made

    run = None if cache is None else cache.recall()
    if run is not None and is_as_made(run.outputs, folder, run.covered):
        return run, _Renewed(done="" if check else f"{folder.name}: {len(run.outputs)} files, 0 written, 0 removed")
    from codra_dsl.compiler import compile_paths

    compilation = compile_paths(paths, root, timings)
    run = compilation.as_run()
    if cache is not None:
        cache.remember(run)
    with timings.stage("write"):
        return run, _renewed(compilation, folder, check)


def _renewed(compilation: Compilation, folder: Path, check: bool) -> _Renewed:
    if not compilation.files:
        return _Renewed()
    return _compared(compilation, folder) if check else _written(compilation, folder)


def _compared(compilation: Compilation, folder: Path) -> _Renewed:
    """Return how the output folder differs; nothing is written."""
    from codra_dsl.generation.output import freshness, stale_finding

    compared = freshness(compilation.files, folder, compilation.covered)
    findings = (*compared.diagnostics, *map(stale_finding, compared.drifts))
    return _Renewed(diagnostics=findings, diff="".join(drift.diff for drift in compared.drifts))


def _written(compilation: Compilation, folder: Path) -> _Renewed:
    """Bring the output folder up to date."""
    from codra_dsl.generation.output import write

    written = write(compilation.files, folder, compilation.covered)
    if written.diagnostics:
        return _Renewed(diagnostics=written.diagnostics)
    changes = f"{len(written.changed)} written, {len(written.removed)} removed"
    return _Renewed(done=f"{folder.name}: {len(compilation.files)} files, {changes}")


def _about_schema(run: Run, root: Path, check: bool) -> tuple[Diagnostic, ...]:
    """Keep the project's copy of the schema, which its editors read, up to date; a project may have none."""
    from codra_dsl.language.project import has_stale_schema

    if not run.outputs or not has_stale_schema(root):
        return ()
    from codra_dsl.tooling.scaffold.schema import judge_schema, renew_schema

    return judge_schema(root) if check else renew_schema(root)


def _in_root(diagnostic: Diagnostic, folder: Path, root: Path) -> Diagnostic:
    """Return a finding about the output folder with its file relative to the root, not to the folder's parent."""
    from codra_dsl.language.diagnostics import Place

    around = folder.parent
    if around == root or not around.is_relative_to(root):
        return diagnostic
    span = replace(diagnostic.place.span, file=f"{around.relative_to(root).as_posix()}/{diagnostic.place.span.file}")
    return replace(diagnostic, place=Place(span))
