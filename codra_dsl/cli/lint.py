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
    choose_failure_threshold,
    choose_format,
    counts_text,
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
    SpecsOrText,
    TimingsOption,
)

if TYPE_CHECKING:
    from codra_dsl.cli.fixes import LintInput
    from codra_dsl.workspace.cache import Cache, Run

FixOption = Annotated[
    bool,
    typer.Option("--fix", help="Apply safe fixes, then show the rest; with -, write the text to standard output."),
]
DiffOption = Annotated[bool, typer.Option("--diff", help="Show what --fix would change, and write nothing.")]


def lint_command(
    paths: SpecsOrText,
    *,
    site: SitesOption = None,
    fix: FixOption = False,
    diff: DiffOption = False,
    format_: FindingsFormat = None,
    output: OutputOption = None,
    fail_on: FailOnOption = None,
    no_cache: NoCacheOption = False,
    timings: TimingsOption = False,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Check specs. Python code that they name is not imported or run. Only fixes, FILE and the cache are written."""
    from codra_dsl.cli.fixes import input_from_files, input_from_standard_input
    from codra_dsl.workspace.cache import cache_of

    stage_timings = make_timings(timings)
    is_text = paths == [Path(STANDARD_INPUT)]
    if is_text and site:
        raise typer.BadParameter("a site cannot be combined with a spec from standard input", param_hint="--site")
    lint_input = (
        input_from_standard_input(stage_timings) if is_text else input_from_files(paths, stage_timings, site or ())
    )
    text = None if lint_input.stdin_data is None else lint_input.stdin_data.decode("utf-8", errors="replace")
    view = View(
        root=lint_input.root, format=choose_format(format_, output), colour=color, text=text, title="codra lint"
    )
    if diff:
        raise typer.Exit(_show_diff(lint_input, output))
    if fix:
        raise typer.Exit(_apply_fixes(lint_input, view, fail_on, output))
    cache = None if no_cache or timings or is_text else cache_of(lint_input.root, "lint", paths, site or ())
    run = _lint_or_recall(lint_input, cache)
    failure_threshold = choose_failure_threshold(fail_on, run.fail_on)
    with stage_timings.stage("show"):
        replace(view, fail_on=failure_threshold).show(run.diagnostics, run.specs, output)
    fixable_count, hint = lint_input.count_fixable(run.diagnostics)
    say(f"{counts_text(run.diagnostics)}{f'; --fix can fix {fixable_count}' if fixable_count else ''}{hint}")
    if timings:
        say(stage_timings.table())
    view.suggest_explain_command(run.diagnostics)
    raise typer.Exit(ExitCode.FAILED if is_failure(run.diagnostics, failure_threshold) else ExitCode.CLEAN)


def _lint_or_recall(lint_input: LintInput, cache: Cache | None) -> Run:
    """Return the findings about the specs, from the cache if nothing has changed since an earlier run."""
    run = None if cache is None else cache.load()
    if run is None:
        results = {} if cache is None else cache.load_results()
        run = lint_input.lint({}, results).as_run()
        if cache is not None:
            cache.store(run, results)
    return run


def _show_diff(lint_input: LintInput, output: Path | None) -> ExitCode:
    """Show the changes that fixes would make. If there are changes, the command fails, for use in CI."""
    from codra_dsl.cli.fixes import fix

    fix_result = fix(lint_input, write=False)
    diff = fix_result.diff()
    patch_text = diff if output is not None else text_for_log(diff)
    write_result(patch_text.encode(), output)  # a patch is bytes, independent of the terminal's encoding
    _, hint = lint_input.count_fixable(fix_result.diagnostics)
    say(f"would fix {fix_result.fixed_count}; {counts_text(fix_result.diagnostics)} left{hint}")
    return ExitCode.FAILED if diff else ExitCode.CLEAN


def _apply_fixes(lint_input: LintInput, view: View, fail_on: FailOnOption, output: Path | None) -> ExitCode:
    """Apply all safe fixes, and show the other findings.

    For a text from standard input, the fixed text is the result of the command, and standard error gets the findings.
    """
    from codra_dsl.cli.fixes import fix

    fix_result = fix(lint_input, write=True)
    findings, failure_threshold = (
        fix_result.diagnostics,
        choose_failure_threshold(fail_on, fix_result.planning_result.settings.fail_on),
    )
    view = replace(view, fail_on=failure_threshold)
    if lint_input.stdin_data is None:
        view.show(findings, fix_result.planning_result.specs, output)
    else:
        fixed_data = fix_result.after.get(STANDARD_INPUT, lint_input.stdin_data)
        write_result(fixed_data, output)
        findings_text = replace(view, text=fixed_data.decode("utf-8", errors="replace")).render(findings, sys.stderr)
        sys.stderr.write(findings_text)
    _, hint = lint_input.count_fixable(findings)
    say(f"fixed {fix_result.fixed_count}; {counts_text(findings)} left{hint}")
    view.suggest_explain_command(findings)
    return ExitCode.FAILED if is_failure(findings, failure_threshold) else ExitCode.CLEAN
