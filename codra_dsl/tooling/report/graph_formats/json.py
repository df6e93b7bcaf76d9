"""JSON with a node and an edge on each line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from codra_dsl.tooling.report.graph_formats import GraphFormat, ShowMessage

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph


def _render(graph: Graph, _picture: Graph, _say: ShowMessage) -> str:
    from codra_dsl.tooling.report.graphs import render_json

    return render_json(graph)


FORMAT = GraphFormat(name="json", endings=(".json",), render=_render, is_picture=False)
