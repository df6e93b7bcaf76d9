"""`codra coverage`: which decisions of a main execution a spec covers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    FailOn,
    Format,
    View,
    choose_format,
    existing,
    is_failure,
    say,
    say_findings,
    write_result,
)
from codra_dsl.cli.files.imports import ModelsOption, read_decisions
from codra_dsl.cli.options import ColourOption, FindingsFormat, OutputOption, check_writable

if TYPE_CHECKING:
    from codra_dsl.generation.build_plan import BuildPlan
    from codra_dsl.tooling.main_execution.coverage import Coverage

_PICTURE_ENDINGS = (".dot", ".svg")


def _check_picture(file: Path | None) -> Path | None:
    if file is not None and file.suffix not in _PICTURE_ENDINGS:
        raise typer.BadParameter(f"no graph has the ending '{file.suffix}': use one of {', '.join(_PICTURE_ENDINGS)}")
    return check_writable(file)


def coverage_command(
    spec: Annotated[Path, typer.Argument(metavar="SPEC", help="A spec file.", show_default=False)],
    *,
    of: Annotated[
        Path,
        typer.Option(
            "--of",
            metavar="SOURCE",
            help="The main execution: a source of codra import.",
            show_default=False,
        ),
    ],
    models: ModelsOption = None,
    format_: FindingsFormat = None,
    output: OutputOption = None,
    graph: Annotated[
        Path | None,
        typer.Option(
            "--graph",
            metavar="FILE",
            help="Draw the decisions to this file, .dot or .svg.",
            show_default=False,
            callback=_check_picture,
        ),
    ] = None,
    fail_under: Annotated[
        float | None,
        typer.Option(
            "--fail-under",
            metavar="PERCENT",
            help="Fail if a smaller share of the decisions is covered.",
            show_default=False,
            min=0,
            max=100,
        ),
    ] = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Show which decisions of a main execution a spec covers. Nothing of either is imported or run."""
    from codra_dsl.language.project import root_of
    from codra_dsl.tooling.main_execution.coverage import coverage_of

    (spec,) = existing([spec])
    root = root_of(spec)
    plan = _plan(spec, root, color)
    coverage = coverage_of(plan, read_decisions(of, models or (), color, root))
    view = View(root=root, format=choose_format(format_, output), colour=color, title="codra coverage")
    if view.format is Format.JSON:
        write_result(_json_text(coverage), output)
    else:
        files = sorted({judged.decision.place.span.file for judged in coverage.decisions})
        view.show(coverage.findings(), files, output)
    if graph is not None:
        write_result(_picture(coverage, graph.suffix), graph)
    say(
        f"{coverage.spec}: {coverage.covered_count} of {len(coverage.decisions)} decisions are covered "
        f"({coverage.covered_percent:.4g} %); variables without a decision: {len(coverage.unused_variables)}"
    )
    is_too_low = fail_under is not None and coverage.covered_percent < fail_under
    if is_too_low:
        say(f"less than {fail_under:g} % (--fail-under)")
    raise typer.Exit(ExitCode.FAILED if is_too_low else ExitCode.CLEAN)


def _plan(spec: Path, root: Path, colour: Colour) -> BuildPlan:
    """Return the plan of the only spec at a path. Errors of the spec, and several specs, end the command."""
    from codra_dsl.compiler import plan_paths

    planned = plan_paths([spec], root)
    if is_failure(planned.diagnostics, FailOn.ERROR):
        say_findings(planned.diagnostics, root, colour)
        raise typer.Exit(ExitCode.FAILED)
    if len(planned.plans) != 1:
        raise typer.BadParameter(f"'{spec}' has {len(planned.plans)} specs: name one spec", param_hint="SPEC")
    return planned.plans[0]


def _json_text(coverage: Coverage) -> str:
    from codra_dsl.tooling.main_execution.coverage import coverage_object
    from codra_dsl.tooling.report.findings import as_json

    return as_json(coverage_object(coverage), indent=2) + "\n"


def _picture(coverage: Coverage, ending: str) -> str:
    from codra_dsl.tooling.main_execution.coverage_picture import coverage_dot
    from codra_dsl.tooling.report.dot import DrawingError, draw_dot

    text = coverage_dot(coverage)
    try:
        return text if ending == ".dot" else draw_dot(text)
    except DrawingError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
