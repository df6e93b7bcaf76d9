"""The dependency graph as a page for a browser: a single file that needs no network.

The template escapes all text. Text from a spec is data in the page and is never run. The security policy of the page
contains the digest of the page's own script, and allows only this script to run.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined

from codra_dsl.tooling.report.dot import MAX_QUICK_NODES, DrawingError, render_drawing
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.graphs import Element, Graph
from codra_dsl.tooling.report.looks import (
    EDGE_LOOKS,
    NODE_LOOKS,
    WORST_CASE_TEXT,
    edge_kinds_of,
    is_folded,
    label_of,
    latency_text,
    node_kinds_of,
    shown_kind,
    text_lines,
)


def render_html(graph: Graph, picture: Graph | None = None) -> str:
    """Return the graph as a page to explore: search, pan and zoom, and the needs and dependents of each node.

    Args:
        graph: all nodes of the page.
        picture: the folded graph, with which the page opens. Without it, the page opens with the complete graph.
    """
    overview = picture if picture is not None and is_folded(picture) else None
    folder = files("codra_dsl.tooling.report") / "viewer"
    style, *scripts = ((folder / name).read_text("utf-8") for name in ("style.css", "graph.js", "script.js"))
    script = "".join(scripts)
    digest = base64.b64encode(hashlib.sha256(f"\n{script}".encode()).digest()).decode()
    template = _environment().get_template("page.html.j2")
    return template.render(
        title=f"{', '.join(graph.specs)}: dependency graph",
        digest=f"sha256-{digest}",
        style=style,
        script=script,
        drawing=_drawing(graph),
        overview="" if overview is None else _drawing(overview),
        data={**_page_data(graph), "boxes": [] if overview is None else _boxes(graph, overview)},
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("codra_dsl.tooling.report", "viewer"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=True,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    return environment


def _drawing(graph: Graph) -> str:
    """Return Graphviz's drawing; empty if the graph is too large for Graphviz, or if Graphviz is missing.

    Without a drawing, the page lays out the graph itself.
    """
    if len(graph.elements) > MAX_QUICK_NODES:
        return ""
    try:
        return render_drawing(graph)
    except DrawingError:
        return ""


def _page_data(graph: Graph) -> Mapping[str, object]:
    number_by_id = {element.id: number for number, element in enumerate(graph.elements)}
    return {
        "title": ", ".join(graph.specs),
        "specs": graph.specs,
        "nodes": [_node(element) for element in graph.elements],
        "edges": [(*(number_by_id[end] for end in link.flow), link.kind.value) for link in graph.links],
        "kinds": {kind.value: NODE_LOOKS[kind].meaning for kind in node_kinds_of(graph)},
        "arrows": {kind.value: EDGE_LOOKS[kind].sentence for kind in edge_kinds_of(graph)},
        "latency": WORST_CASE_TEXT if any(element.worst_case_s is not None for element in graph.elements) else "",
    }


def _boxes(graph: Graph, overview: Graph) -> list[Mapping[str, object]]:
    number_by_id = {element.id: number for number, element in enumerate(graph.elements)}
    return [
        {
            "key": element.id,
            "label": label_of(element),
            "lines": text_lines(element),
            "members": [number_by_id[member.id] for member in element.members or (element,)],
        }
        for element in overview.elements
    ]


_FACT_LABELS = {
    "type": "Type",
    "call": "Calls",
    "period_s": "Looks every",
    "phase": "Phase",
    "wakes": "Wakes",
    "attributes": "Attributes",
    "carries": "Label",
    "results": "Results",
}


def _fact_text(value: object) -> object:
    return ", ".join(map(str, value)) if isinstance(value, list) else value


def _node(element: Element) -> Mapping[str, object]:
    facts = {
        _FACT_LABELS[name]: _fact_text(value)
        for name, value in element.json_entry.items()
        if name in _FACT_LABELS and value != []
    }
    if "Looks every" in facts:
        facts["Looks every"] = f"{facts['Looks every']:g} s"
    return {
        "id": element.id,
        "kind": shown_kind(element).value,
        "name": element.name,
        "label": label_of(element),
        "spec": element.spec,
        "group": element.group,
        "place": f"{element.file}:{element.line}",
        "description": visible_text(element.description),
        "worst_case_s": element.worst_case_s,
        "latency": latency_text(element),
        "facts": facts,
    }
