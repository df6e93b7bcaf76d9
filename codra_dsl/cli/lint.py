"""`codra lint`: report all findings about specs, and apply safe fixes."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    STANDARD_INPUT,
    Colour,
    ExitCode,
    View,
    choose_fail_limit,
    choose_format,
    counts_text,
    is_failure,
    make_timings,
    say,
    text_for_log,
    write_result,
)
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, NoCache, Output, ShowTimings, SpecsOrText

if TYPE_CHECKING:
    from codra_dsl.cli.fixes import LintInput
    from codra_dsl.workspace.cache import Cache, Run

Fix = Annotated[
    bool,
    typer.Option("--fix", help="Apply safe fixes, then show the rest; with -, write the text to standard output."),
]
Diff = Annotated[bool, typer.Option("--diff", help="Show what --fix would change, and write nothing.")]


def lint_command(
    paths: SpecsOrText,
    *,
    fix: Fix = False,
    diff: Diff = False,
    format_: FindingsFormat = None,
    output: Output = None,
    fail_on: FailOnOption = None,
    no_cache: NoCache = False,
    timings: ShowTimings = False,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Check specs. The code that they name is not imported or run. Only fixes, FILE and the cache are written."""
    from codra_dsl.cli.fixes import input_from_files, input_from_standard_input
    from codra_dsl.workspace.cache import cache_of

    measured = make_timings(timings)
    is_text = paths == [Path(STANDARD_INPUT)]
    work = input_from_standard_input(measured) if is_text else input_from_files(paths, measured)
    text = None if work.data is None else work.data.decode("utf-8", errors="replace")
    view = View(root=work.root, format=choose_format(format_, output), colour=color, text=text, title="codra lint")
    if diff:
        raise typer.Exit(_show_diff(work, output))
    if fix:
        raise typer.Exit(_fix(work, view, fail_on, output))
    run = _run(work, None if no_cache or timings or is_text else cache_of(work.root, "lint", paths))
    limit = choose_fail_limit(fail_on, run.fail_on)
    with measured.stage("show"):
        replace(view, fail_on=limit).show(run.diagnostics, run.specs, output)
    number, more = work.fixable(run.diagnostics)
    say(f"{counts_text(run.diagnostics)}{f'; --fix can fix {number}' if number else ''}{more}")
    if timings:
        say(measured.table())
    view.point_to_pages(run.diagnostics)
    raise typer.Exit(ExitCode.FAILED if is_failure(run.diagnostics, limit) else ExitCode.CLEAN)


def _run(work: LintInput, cache: Cache | None) -> Run:
    """Return the findings about the specs, from the cache if nothing has changed since an earlier run."""
    run = None if cache is None else cache.recall()
    if run is None:
        run = work.plan({}).as_run()
        if cache is not None:
            cache.remember(run)
    return run


def _show_diff(work: LintInput, output: Path | None) -> ExitCode:
    """Show the changes that fixes would make. If there are any, the exit code is that of a failure, for use in CI."""
    from codra_dsl.cli.fixes import fix

    result = fix(work, write=False)
    diff = result.diff()
    shown = diff if output is not None else text_for_log(diff)
    write_result(shown.encode(), output)  # a patch is bytes, independent of the terminal's encoding
    say(f"would fix {result.number}; {counts_text(result.diagnostics)} left{work.fixable(result.diagnostics)[1]}")
    return ExitCode.FAILED if diff else ExitCode.CLEAN


def _fix(work: LintInput, view: View, fail_on: FailOnOption, output: Path | None) -> ExitCode:
    """Apply all safe fixes, and show the other findings.

    For a text from standard input, standard output gets the fixed text, and standard error gets the findings.
    """
    from codra_dsl.cli.fixes import fix

    result = fix(work, write=True)
    findings, limit = result.diagnostics, choose_fail_limit(fail_on, result.planned.settings.fail_on)
    view = replace(view, fail_on=limit)
    if work.data is None:
        view.show(findings, result.planned.specs, output)
    else:
        data = result.after.get(STANDARD_INPUT, work.data)
        write_result(data, output)
        left = replace(view, text=data.decode("utf-8", errors="replace")).rendered(findings, sys.stderr)
        sys.stderr.write(left)
    say(f"fixed {result.number}; {counts_text(findings)} left{work.fixable(findings)[1]}")
    view.point_to_pages(findings)
    return ExitCode.FAILED if is_failure(findings, limit) else ExitCode.CLEAN
