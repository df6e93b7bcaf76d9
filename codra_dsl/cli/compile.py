"""`codra compile`: generate packages from specs, or, with `--check`, report whether the packages are up to date."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    Format,
    View,
    choose_failure_threshold,
    choose_format,
    common_root,
    counts_text,
    existing,
    is_failure,
    make_timings,
    say,
    text_for_log,
    write_result,
)
from codra_dsl.cli.options import (
    ColourOption,
    FailOnOption,
    FindingsFormat,
    NoCacheOption,
    OutputOption,
    SitesOption,
    Specs,
    TimingsOption,
)
from codra_dsl.language.frozen import dataclass

if TYPE_CHECKING:
    from codra_dsl.compiler import Compilation
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.workspace.cache import Cache, Run
    from codra_dsl.workspace.timings import Timings

OutOption = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="The folder for the packages.  [default: generated, or generated_SITE, in the project's root]",
        show_default=False,
    ),
]
CheckOption = Annotated[bool, typer.Option("--check", help="Write nothing; show where the output is not up to date.")]


def compile_command(
    paths: Specs,
    *,
    site: SitesOption = None,
    out: OutOption = None,
    check: CheckOption = False,
    format_: FindingsFormat = None,
    output: OutputOption = None,
    fail_on: FailOnOption = None,
    no_cache: NoCacheOption = False,
    timings: TimingsOption = False,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Compile specs to readable Python packages, each with its observers, the types of the context, and the graph."""
    from codra_dsl.tooling.report.findings import visible_lines
    from codra_dsl.workspace.cache import cache_of

    paths, sites = existing(paths), existing(site or ())
    root = common_root([*paths, *sites])
    folder = (out if out is not None else _default_output_folder(paths[0], sites, root)).absolute()
    stage_timings = make_timings(timings)
    cache = None if no_cache or timings else cache_of(root, "compile", paths, sites)
    run, output_result = _compile_or_recall(
        paths, root, folder, sites=sites, check=check, cache=cache, timings=stage_timings
    )
    failure_threshold = choose_failure_threshold(fail_on, run.fail_on)
    view = View(
        root=root, format=choose_format(format_, output), colour=color, fail_on=failure_threshold, title="codra compile"
    )
    output_findings = (
        _diagnostic_relative_to_root(diagnostic, folder, root) for diagnostic in output_result.diagnostics
    )
    findings = (*run.diagnostics, *output_findings, *_check_or_renew_schema(run, root, check))
    with stage_timings.stage("show"):
        view.show(findings, run.specs, output)
    if view.format is Format.FULL:
        write_result(text_for_log(visible_lines(output_result.diff)))
    if findings:
        say(counts_text(findings))
        view.suggest_explain_command(findings)
    if output_result.summary:
        say(output_result.summary)
    if timings:
        say(stage_timings.table())
    raise typer.Exit(
        ExitCode.FAILED if not run.output_digests or is_failure(findings, failure_threshold) else ExitCode.CLEAN
    )


def _default_output_folder(path: Path, sites: Sequence[Path], root: Path) -> Path:
    """Return the folder `generated`, or `generated_SITE`, whose name programs can import.

    Sites with the same name in different folders would replace the packages of each other. This is a usage error.
    """
    from codra_dsl.generation.output import sites_in
    from codra_dsl.language.project import project_of, relative_path

    site_names = (re.sub(r"\W", "_", site.stem) for site in sites)
    folder = (project_of(path) or Path.cwd()) / "_".join(["generated", *site_names])
    others = sites_in(folder) - {relative_path(site, root) for site in sites} if sites else ()
    other = next((site for site in sorted(others) if (root / site).is_file()), None)
    if other is not None:
        message = f"{folder.name} has the packages of the site '{other}': choose another folder with --out"
        raise typer.BadParameter(message, param_hint="--site")
    return folder


@dataclass(frozen=True, slots=True, kw_only=True)
class _OutputResult:
    """The result of comparing or writing the output folder.

    Attributes:
        diff: the difference between the files in the folder and the output of the specs.
        summary: the number of files that were written and removed, as text.
    """

    diagnostics: tuple[Diagnostic, ...] = ()
    diff: str = ""
    summary: str = ""


def _compile_or_recall(
    paths: list[Path],
    root: Path,
    folder: Path,
    *,
    sites: list[Path],
    check: bool,
    cache: Cache | None,
    timings: Timings,
) -> tuple[Run, _OutputResult]:
    """Compile the specs, and compare or write the output folder.

    If neither the inputs nor the output have changed since an earlier run, return that run from the cache.
    """
    from codra_dsl.generation.output import is_as_made

    run = None if cache is None else cache.load()
    if run is not None and not run.output_digests:
        return run, _OutputResult()
    if run is not None and is_as_made(run.output_digests, folder, run.covered_paths):
        return run, _OutputResult(
            summary="" if check else f"{folder.name}: {len(run.output_digests)} files, 0 written, 0 removed"
        )
    from codra_dsl.compiler import compile_paths

    results = {} if cache is None else cache.load_results()
    compilation = compile_paths(paths, root, timings, results, folder, sites=sites)
    run = compilation.as_run()
    if check:
        _verify(compilation)  # before the run is kept: a kept run is not verified again
    if cache is not None:
        cache.store(run, results)
    with timings.stage("write"):
        if not run.output_digests:
            return run, _OutputResult()
        return run, _compare_output(compilation, folder) if check else _write_output(compilation, folder)


def _verify(compilation: Compilation) -> None:
    """Verify the plans and the output of the compiler itself. `--check` does this, because it is for CI."""
    from codra_dsl.generation.build_plan import verify
    from codra_dsl.generation.emit.self_check import prove

    for build_plan in compilation.planned.plans:
        verify(build_plan, build_plan.checked)
    prove(compilation.files)


def _compare_output(compilation: Compilation, folder: Path) -> _OutputResult:
    """Return the difference between the output folder and the compiled files. Write nothing."""
    from codra_dsl.generation.output import drift_finding, freshness

    comparison = freshness(compilation.files, folder, compilation.covered, compilation.output_digests)
    findings = (*comparison.diagnostics, *map(drift_finding, comparison.drifts))
    return _OutputResult(diagnostics=findings, diff="".join(drift.diff for drift in comparison.drifts))


def _write_output(compilation: Compilation, folder: Path) -> _OutputResult:
    """Bring the output folder up to date."""
    from codra_dsl.generation.output import write

    write_report = write(compilation.files, folder, compilation.covered, compilation.output_digests)
    if write_report.diagnostics:
        return _OutputResult(diagnostics=write_report.diagnostics)
    changes_text = f"{len(write_report.changed)} written, {len(write_report.removed)} removed"
    return _OutputResult(summary=f"{folder.name}: {len(compilation.output_digests)} files, {changes_text}")


def _check_or_renew_schema(run: Run, root: Path, check: bool) -> tuple[Diagnostic, ...]:
    """Renew a stale copy of the schema in the project, or, if `check` is true, only report it as a finding.

    Editors read this copy. A project without a copy gets none.
    """
    from codra_dsl.language.project import has_stale_schema

    if not run.output_digests or not has_stale_schema(root):
        return ()
    from codra_dsl.tooling.scaffold.schema import check_schema, renew_schema

    return check_schema(root) if check else renew_schema(root)


def _diagnostic_relative_to_root(diagnostic: Diagnostic, folder: Path, root: Path) -> Diagnostic:
    """Return a finding about the output folder, with its file relative to the root.

    In `diagnostic`, the file is relative to the parent of the output folder. If this parent is outside of the root,
    return the finding unchanged.
    """
    from codra_dsl.language.diagnostics import Place

    parent_folder = folder.parent
    if parent_folder == root or not parent_folder.is_relative_to(root):
        return diagnostic
    span = replace(
        diagnostic.place.span, file=f"{parent_folder.relative_to(root).as_posix()}/{diagnostic.place.span.file}"
    )
    return replace(diagnostic, place=Place(span))
