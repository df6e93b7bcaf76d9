"""A page to explore in a browser."""

from __future__ import annotations

from typing import TYPE_CHECKING

from codra_dsl.tooling.report.graph_formats import GraphFormat, ShowMessage

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph


def _render(graph: Graph, picture: Graph, _say: ShowMessage) -> str:
    from codra_dsl.tooling.report.page import render_html

    return render_html(graph, picture)


FORMAT = GraphFormat(name="html", endings=(".html", ".htm"), render=_render)
