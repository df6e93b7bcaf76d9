"""`codra lint`: all findings about some specs, and the fixes that a tool may make by itself."""

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
    asked_format,
    counted,
    failing,
    fails,
    for_log,
    measuring,
    say,
    write_result,
)
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, NoCache, Output, ShowTimings, SpecsOrText

if TYPE_CHECKING:
    from codra_dsl.cli.fixes import Work
    from codra_dsl.workspace.cache import Cache, Run

Fix = Annotated[
    bool,
    typer.Option("--fix", help="Apply safe fixes, then show what is left; with - write the text to standard output."),
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
    """Check specs. Nothing that they name is imported or run, and nothing is written but fixes, FILE and the cache."""
    from codra_dsl.cli.fixes import work_on_files, work_on_standard_input
    from codra_dsl.workspace.cache import cache_of

    measured = measuring(timings)
    is_text = paths == [Path(STANDARD_INPUT)]
    work = work_on_standard_input(measured) if is_text else work_on_files(paths, measured)
    text = None if work.data is None else work.data.decode("utf-8", errors="replace")
    view = View(root=work.root, format=asked_format(format_, output), colour=color, text=text, title="codra lint")
    if diff:
        raise typer.Exit(_show_diff(work, output))
    if fix:
        raise typer.Exit(_fix(work, view, fail_on, output))
    run = _run(work, None if no_cache or timings or is_text else cache_of(work.root, "lint", paths))
    limit = failing(fail_on, run.fail_on)
    with measured.stage("show"):
        replace(view, fail_on=limit).show(run.diagnostics, run.specs, output)
    number, more = work.fixable(run.diagnostics)
    say(f"{counted(run.diagnostics)}{f'; --fix can fix {number}' if number else ''}{more}")
    if timings:
        say(measured.table())
    view.point_to_pages(run.diagnostics)
    raise typer.Exit(ExitCode.FAILED if fails(run.diagnostics, limit) else ExitCode.CLEAN)


def _run(work: Work, cache: Cache | None) -> Run:
    """Return what is found in the specs: as an earlier run found it, if nothing has changed since."""
    run = None if cache is None else cache.recall()
    if run is None:
        run = work.plan({}).as_run()
        if cache is not None:
            cache.remember(run)
    return run


def _show_diff(work: Work, output: Path | None) -> ExitCode:
    """Show what would be fixed; that something would be is a failure, so that CI can ask."""
    from codra_dsl.cli.fixes import fix

    outcome = fix(work, write=False)
    diff = outcome.diff()
    shown = diff if output is not None else for_log(diff)
    write_result(shown.encode(), output)  # whatever the terminal's encoding is: a patch is bytes
    say(f"would fix {outcome.number}; {counted(outcome.diagnostics)} left{work.fixable(outcome.diagnostics)[1]}")
    return ExitCode.FAILED if diff else ExitCode.CLEAN


def _fix(work: Work, view: View, fail_on: FailOnOption, output: Path | None) -> ExitCode:
    """Fix what can be fixed and show what is left: on standard error where standard output gets the fixed text."""
    from codra_dsl.cli.fixes import fix

    outcome = fix(work, write=True)
    found, limit = outcome.diagnostics, failing(fail_on, outcome.planned.settings.fail_on)
    view = replace(view, fail_on=limit)
    if work.data is None:
        view.show(found, outcome.planned.specs, output)
    else:
        data = outcome.after.get(STANDARD_INPUT, work.data)
        write_result(data, output)
        left = replace(view, text=data.decode("utf-8", errors="replace")).rendered(found, sys.stderr)
        sys.stderr.write(left)
    say(f"fixed {outcome.number}; {counted(found)} left{work.fixable(found)[1]}")
    view.point_to_pages(found)
    return ExitCode.FAILED if fails(found, limit) else ExitCode.CLEAN
