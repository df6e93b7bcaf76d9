"""`codra graph`: the dependencies between skills, variables, algorithms and observers."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.console import (
    Colour,
    ExitCode,
    FailOn,
    common_root,
    existing,
    is_failure,
    say,
    say_findings,
    write_result,
)
from codra_dsl.cli.options import ColourOption, OutputOption, SitesOption, Specs
from codra_dsl.tooling.report.graph_formats import DEFAULT_FORMAT, FORMATS, GraphFormat, format_by_ending

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph


if TYPE_CHECKING:
    FormatName = str
else:  # typer shows the members of an enum as choices; type checkers do not support enums with computed members
    FormatName = StrEnum("FormatName", {name: name for name in FORMATS})

GraphFormatOption = Annotated[
    FormatName | None,
    typer.Option(
        "--format",
        help=f"The format of the graph.  [default: chosen by the ending of FILE, else {DEFAULT_FORMAT.name}]",
        show_default=False,
    ),
]
SelectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--select",
        "-s",
        metavar="SELECTOR",
        help="Show only these nodes: x, +x, x+, 2+x+1, @x, kind:observer, 'a b' (either), 'a,b' (both); * in names.",
        show_default=False,
    ),
]
ExcludeOption = Annotated[
    list[str] | None,
    typer.Option("--exclude", metavar="SELECTOR", help="Do not show these nodes.", show_default=False),
]
AllOption = Annotated[bool, typer.Option("--all", help="Draw every node of a large graph.")]
UnfoldOption = Annotated[
    list[str] | None,
    typer.Option(
        "--unfold",
        metavar="SELECTOR",
        help="Draw these nodes of a large graph one by one, with those that are folded with them.",
        show_default=False,
    ),
]


def graph_command(
    paths: Specs,
    *,
    site: SitesOption = None,
    format_: GraphFormatOption = None,
    select: SelectOption = None,
    exclude: ExcludeOption = None,
    unfold: UnfoldOption = None,
    all_: AllOption = False,
    output: OutputOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Show the dependency graph of specs. Pictures of large graphs are folded. Findings go to standard error."""
    from codra_dsl.compiler import plan_paths
    from codra_dsl.tooling.report.folding import fold
    from codra_dsl.tooling.report.graphs import graph_of

    paths, sites = existing(paths), existing(site or ())
    graph_format = FORMATS[format_] if format_ is not None else _choose_format(output)
    root = common_root([*paths, *sites])
    planning_result = plan_paths(paths, root, sites=sites)
    say_findings(planning_result.diagnostics, root, color)
    if is_failure(planning_result.diagnostics, FailOn.ERROR):
        raise typer.Exit(ExitCode.FAILED)
    graph = _select_part(graph_of(planning_result.plans), select or (), exclude or ())
    unfolded_ids = _select_ids(graph, "--unfold", unfold or ())
    picture = fold(graph, unfolded_ids) if graph_format.is_picture and not all_ else graph
    if picture is not graph:
        boxes = f"{len(graph.elements)} nodes are drawn as {len(picture.elements)}"
        say(f"{boxes}: --all draws every node, --unfold NAME those of one box, --select +NAME what NAME needs")
    write_result(_render(graph, picture, graph_format), output)


def _choose_format(output: Path | None) -> GraphFormat:
    """Return the format for the ending of a file name. An unknown ending is a usage error."""
    if output is None or not output.suffix:
        return DEFAULT_FORMAT
    known_formats = format_by_ending()
    graph_format = known_formats.get(output.suffix.lower())
    if graph_format is None:
        message = (
            f"no graph format has the ending '{output.suffix}': use --format, or one of {', '.join(known_formats)}"
        )
        raise typer.BadParameter(message, param_hint="--output")
    return graph_format


def _select_part(graph: Graph, include_selectors: Sequence[str], exclude_selectors: Sequence[str]) -> Graph:
    """Return the part of a graph that selectors match.

    A selector is a usage error if it cannot be parsed, or has a name, pattern, kind or method that does not exist.
    """
    from codra_dsl.tooling.selection import select

    if not include_selectors and not exclude_selectors:
        return graph
    _select_ids(graph, "--select", include_selectors)
    _select_ids(graph, "--exclude", exclude_selectors)
    selected_graph = graph.select_part(select(graph.choices(), include_selectors, exclude_selectors))
    say(f"{len(selected_graph.elements)} of {len(graph.elements)} nodes")
    return selected_graph


def _select_ids(graph: Graph, option: str, selectors: Sequence[str]) -> frozenset[str]:
    """Return the ids of the elements that at least one selector of an option matches."""
    from codra_dsl.tooling.selection import SelectorError, select

    try:
        return frozenset().union(*(select(graph.choices(), [selector]) for selector in selectors))
    except SelectorError as error:
        raise typer.BadParameter(str(error), param_hint=option) from error


def _render(graph: Graph, picture: Graph, graph_format: GraphFormat) -> str:
    from codra_dsl.tooling.report.dot import DrawingError

    try:
        return graph_format.render(graph, picture, say)
    except DrawingError as error:
        say(f"codra: {error}")
        raise typer.Exit(ExitCode.FAILED) from error
