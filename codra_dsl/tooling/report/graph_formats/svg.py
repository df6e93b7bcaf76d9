"""A picture that Graphviz draws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from codra_dsl.tooling.report.graph_formats import GraphFormat, ShowMessage

if TYPE_CHECKING:
    from codra_dsl.tooling.report.graphs import Graph


def _render(_graph: Graph, picture: Graph, say: ShowMessage) -> str:
    """Return the picture. If drawing may take minutes, show a message first."""
    from codra_dsl.tooling.report.dot import MAX_QUICK_NODES, render_svg

    if len(picture.elements) > MAX_QUICK_NODES:
        say(f"drawing {len(picture.elements)} nodes may take minutes: --select draws a part, --format html is faster")
    return render_svg(picture)


FORMAT = GraphFormat(name="svg", endings=(".svg",), render=_render)
