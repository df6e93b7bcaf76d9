"""Text for Graphviz."""

from __future__ import annotations

from typing import TYPE_CHECKING

from codra_dsl.tooling.report.graph_formats import GraphFormat, ShowMessage

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph


def _render(_graph: Graph, picture: Graph, _say: ShowMessage) -> str:
    from codra_dsl.tooling.report.dot import render_dot

    return render_dot(picture)


FORMAT = GraphFormat(name="dot", endings=(".dot", ".gv", ".txt"), render=_render)
