"""`codra knowledge`: check files of knowledge graphs, without a spec."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from codra_dsl.cli.arguments import QuickCommand
from codra_dsl.cli.console import Colour, existing
from codra_dsl.cli.files.checking import Report, command_group, count_text, root_of_files
from codra_dsl.cli.options import ColourOption, FailOnOption, FindingsFormat, OutputOption

if TYPE_CHECKING:
    from codra_dsl.language.diagnostics import Diagnostic
    from codra_dsl.runtime.knowledge.exchange import DsrGraph

GraphFiles = Annotated[
    list[Path], typer.Argument(metavar="FILE", help="Files of DSR (JSON) or GraphML.", show_default=False)
]
BothWaysOption = Annotated[
    bool, typer.Option("--both-ways", help="Read each undirected edge of GraphML as two edges, one in each direction.")
]

knowledge_commands = command_group()


@knowledge_commands.callback()
def _knowledge() -> None:
    """Check files of knowledge graphs in the JSON of RoboComp's DSR or in GraphML, without a spec."""


@knowledge_commands.command("check", cls=QuickCommand)
def check_command(
    files: GraphFiles,
    *,
    both_ways: BothWaysOption = False,
    format_: FindingsFormat = None,
    output: OutputOption = None,
    fail_on: FailOnOption = None,
    color: ColourOption = Colour.AUTO,
) -> None:
    """Check files of knowledge graphs."""
    from codra_dsl.integrations.knowledge_files import check_knowledge_file
    from codra_dsl.language.project import relative_path, root_of

    paths = list(dict.fromkeys(existing(files)))
    root = root_of_files(paths)
    graphs: list[DsrGraph] = []
    diagnostics: list[Diagnostic] = []
    for path in paths:
        graph, findings = check_knowledge_file(path, relative_path(path, root), root_of(path), both_ways=both_ways)
        graphs += [] if graph is None else [graph]
        diagnostics += findings
    report = Report(
        command="codra knowledge",
        paths=paths,
        root=root,
        format=format_,
        output=output,
        fail_on=fail_on,
        colour=color,
    )
    node_count, edge_count = sum(len(graph.nodes) for graph in graphs), sum(len(graph.edges) for graph in graphs)
    content = f"{count_text(node_count, 'node')} and {count_text(edge_count, 'edge')}"
    report.finish(diagnostics, sorted(relative_path(path, root) for path in paths), content)
