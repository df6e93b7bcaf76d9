"""`codra graph`: how skills, variables, algorithms and observers depend on each other."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from enum import StrEnum
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
from codra_dsl.cli.options import ColourOption, Output, Specs

if TYPE_CHECKING:
    from codra_dsl.report.graphs import Graph


class GraphFormat(StrEnum):
    """How a graph is shown."""

    DOT = "dot"
    JSON = "json"
    MERMAID = "mermaid"
    SVG = "svg"
    HTML = "html"


_BY_ENDING = {
    ".dot": GraphFormat.DOT,
    ".gv": GraphFormat.DOT,
    ".txt": GraphFormat.DOT,
    ".json": GraphFormat.JSON,
    ".mmd": GraphFormat.MERMAID,
    ".mermaid": GraphFormat.MERMAID,
    ".svg": GraphFormat.SVG,
    ".html": GraphFormat.HTML,
    ".htm": GraphFormat.HTML,
}

GraphFormatOption = Annotated[
    GraphFormat | None,
    typer.Option(
        "--format",
        help="How the graph is shown.  [default: what the ending of FILE says, else dot]",
        show_default=False,
    ),
]
SelectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--select",
        "-s",
        metavar="SELECTOR",
        help="Only these nodes: x, +x, x+, 2+x+1, @x, kind:observer, 'a b' (any), 'a,b' (both), and * in names.",
        show_default=False,
    ),
]
ExcludeOption = Annotated[
    list[str] | None,
    typer.Option("--exclude", metavar="SELECTOR", help="Without these nodes.", show_default=False),
]


def graph_command(
    paths: Specs,
    *,
    format_: GraphFormatOption = None,
    select: SelectOption = None,
    exclude: ExcludeOption = None,
    output: Output = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Show the dependency graph of specs. Findings go to standard error."""
    from codra_dsl.compiler import plan_paths
    from codra_dsl.report.graphs import graph_of

    paths = existing(paths)
    how = format_ or _asked_by(output)
    root = common_root(paths)
    planned = plan_paths(paths, root)
    if planned.diagnostics:
        view = View(root=root, format=Format.FULL, colour=color)
        say(f"{view.rendered(planned.diagnostics, sys.stderr)}{counted(planned.diagnostics)}")
    if fails(planned.diagnostics, FailOn.ERROR):
        raise typer.Exit(ExitCode.FAILED)
    graph = _selected(graph_of(planned.plans), select or (), exclude or ())
    write_result(_drawn(graph, how), output)


def _asked_by(output: Path | None) -> GraphFormat:
    """Return the form that the name of a file asks for; an ending that says another one is a mistake of usage."""
    if output is None or not output.suffix:
        return GraphFormat.DOT
    asked = _BY_ENDING.get(output.suffix.lower())
    if asked is None:
        message = f"no form of a graph ends in '{output.suffix}': say --format, or take one of {', '.join(_BY_ENDING)}"
        raise typer.BadParameter(message, param_hint="--output")
    return asked


def _selected(graph: Graph, wanted: Sequence[str], unwanted: Sequence[str]) -> Graph:
    """Return the part of a graph that selectors mean; one that means nothing is a mistake of usage."""
    from codra_dsl.selection import SelectorError, select

    if not wanted and not unwanted:
        return graph
    choices = graph.choices()
    for option, selectors in (("--select", wanted), ("--exclude", unwanted)):
        for selector in selectors:
            try:
                select(choices, [selector])
            except SelectorError as error:
                raise typer.BadParameter(str(error), param_hint=option) from error
    part = graph.part(select(choices, wanted, unwanted))
    say(f"{len(part.elements)} of {len(graph.elements)} nodes")
    return part


def _drawn(graph: Graph, how: GraphFormat) -> str:
    from codra_dsl.report.dot import DrawingError

    try:
        return _rendered(graph, how)
    except DrawingError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error


def _rendered(graph: Graph, how: GraphFormat) -> str:
    match how:
        case GraphFormat.JSON:
            from codra_dsl.report.graphs import render_json

            return render_json(graph)
        case GraphFormat.MERMAID:
            return _as_mermaid(graph)
        case GraphFormat.SVG:
            return _as_svg(graph)
        case GraphFormat.HTML:
            from codra_dsl.report.page import render_html

            return render_html(graph)
        case GraphFormat.DOT:
            from codra_dsl.report.dot import render_dot

            return render_dot(graph)


def _as_mermaid(graph: Graph) -> str:
    from codra_dsl.report.mermaid import MAX_EDGES, flowchart

    chart = flowchart(graph)
    if not chart.is_whole:
        say("the graph is too large for Mermaid and was drawn together: --select shows a part in full")
    if not chart.fits:
        say(f"even so it has {chart.edges} edges: Mermaid draws {MAX_EDGES} unless its page sets maxEdges")
    return chart.text


def _as_svg(graph: Graph) -> str:
    from codra_dsl.report.dot import MAX_QUICK, render_svg

    if len(graph.elements) > MAX_QUICK:
        say(f"to lay out {len(graph.elements)} nodes may take minutes: --select takes a part, --format html is quicker")
    return render_svg(graph)
