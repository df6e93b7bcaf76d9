"""`codra graph`: how skills, variables, algorithms and observers depend on each other."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from enum import StrEnum
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
from codra_dsl.cli.options import ColourOption, Output, Specs

if TYPE_CHECKING:
    from codra_dsl.build_plan import BuildPlan


class GraphFormat(StrEnum):
    """How a graph is shown."""

    DOT = "dot"
    JSON = "json"
    SVG = "svg"


GraphFormatOption = Annotated[GraphFormat, typer.Option("--format", help="How the graph is shown.")]


def graph_command(
    paths: Specs,
    *,
    format_: GraphFormatOption = GraphFormat.DOT,
    output: Output = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Show the dependency graph of specs; findings go to standard error."""
    from codra_dsl.compiler import plan_paths

    existing(paths)
    root = common_root(paths)
    planned = plan_paths(paths, root)
    if planned.diagnostics:
        view = View(root=root, format=Format.FULL, colour=color)
        say(f"{view.rendered(planned.diagnostics, sys.stderr)}{counted(planned.diagnostics)}")
    if fails(planned.diagnostics, FailOn.ERROR):
        raise typer.Exit(ExitCode.FAILED)
    write_result(_drawn(planned.plans, format_), output)


def _drawn(plans: Sequence[BuildPlan], how: GraphFormat) -> str:
    from codra_dsl.report import graphs

    render = {
        GraphFormat.DOT: graphs.render_dot,
        GraphFormat.JSON: graphs.render_json,
        GraphFormat.SVG: graphs.render_svg,
    }
    try:
        return render[how](plans)
    except graphs.DrawingError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
