"""A Mermaid flowchart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from codra_dsl.tooling.report.graph_formats import GraphFormat, ShowMessage

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph


def _render(_graph: Graph, picture: Graph, say: ShowMessage) -> str:
    """Return the flowchart. Show a message if it exceeds the default limits of Mermaid."""
    from codra_dsl.tooling.report.mermaid import MAX_EDGES, flowchart

    chart = flowchart(picture)
    if not chart.is_within_limits:
        message = f"the flowchart has {chart.edge_count} edges: Mermaid draws at most {MAX_EDGES}"
        say(f"{message} unless its page sets maxEdges")
    return chart.text


FORMAT = GraphFormat(name="mermaid", endings=(".mmd", ".mermaid"), render=_render)
