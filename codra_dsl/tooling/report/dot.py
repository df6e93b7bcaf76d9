"""The dependency graph as text for Graphviz, and as the picture that Graphviz draws."""

from __future__ import annotations

import io
import os
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from contextlib import redirect_stderr
from xml.sax.saxutils import escape

from codra_dsl.generation.build_plan import EdgeKind, NodeKind
from codra_dsl.tooling.installation import DSL, pip_install
from codra_dsl.tooling.report.graphs import Element, Graph, Link
from codra_dsl.tooling.report.looks import (
    EDGE_LOOKS,
    FRAME_TEXT,
    NODE_LOOKS,
    WORST_CASE_TEXT,
    EdgeLook,
    NodeLook,
    ShownKind,
    edge_kinds_of,
    is_folded,
    look_of,
    node_kinds_of,
    shown_kind,
    shows_latencies,
    text_lines,
)

# The picture is laid out with a wide font, so that labels fit in any of the fonts that a browser may have.
_FONT = "DejaVu Sans,Verdana,Arial,sans-serif"
_LABEL_PT = 12
_LETTER_EM = 0.62
_ENTITY = re.compile(r"&(?=#?[A-Za-z0-9]+;)")
_SVG_ELEMENT = re.compile(
    r'<svg width="(?P<width>[0-9]+)pt" height="(?P<height>[0-9]+)pt"\s+viewBox="[^"]*"(?P<rest>[^>]*)>'
    r"(?P<inside>.*)</svg>",
    re.DOTALL,
)
_SMALLEST_SCALE = 0.85
"""The smallest scale to which a picture shrinks with its window. At this scale, labels are still legible."""


MAX_QUICK_NODES = 1500
"""The number of nodes that Graphviz lays out in seconds; the time grows faster than the number."""


class DrawingError(Exception):
    """Raised if a picture cannot be drawn on this machine. The message states what to do."""


_DEBIAN_HINT = "on Debian apt-get install --no-install-recommends libglib2.0-0 libx11-6 libxext6 libxrender1"


def render_dot(graph: Graph) -> str:
    """Return the picture in Graphviz's language: arrows follow the flow of knowledge, and each observer has a frame.

    Nodes and edges have their `kind`. Arrows of some kinds lead against the edges in JSON: see `Link.flow`.
    """
    lines: list[str] = []
    number_by_id = {element.id: number for number, element in enumerate(graph.elements)}
    for spec in graph.specs:
        elements = [element for element in graph.elements if element.spec == spec]
        spec_lines = list(_element_lines(elements, number_by_id))
        lines += _frame_lines(spec, spec_lines) if len(graph.specs) > 1 else spec_lines
    lines += (_edge_line(link, f"e{number}") for number, link in enumerate(graph.links))
    return digraph(lines, "TB" if is_folded(graph) else "LR")


def render_svg(graph: Graph) -> str:
    """Return the graph as a picture with a legend. If there are several specs, each has a frame.

    Raises:
        DrawingError: if Graphviz is not installed or cannot draw.
    """
    return _add_legend(_parse_picture(_draw(render_dot(graph))), graph)


def render_drawing(graph: Graph) -> str:
    """Return the picture for a page with its own style, as `draw_dot` does.

    Nodes and edges are numbered from 0. The drawing of node 3 has the id `n3`, and the drawing of edge 3 the id `e3`.

    Raises:
        DrawingError: if Graphviz is not installed or cannot draw.
    """
    return draw_dot(render_dot(graph))


def draw_dot(dot: str) -> str:
    """Return the drawing of a text in Graphviz's language: only the `svg` element, without legend and title.

    Raises:
        DrawingError: if Graphviz is not installed or cannot draw.
    """
    picture = _parse_picture(_draw(dot))
    size_attributes = f'viewBox="0 0 {picture["width"]} {picture["height"]}"'
    picture_content = re.sub(r"<!--.*?-->\s*|<title>.*?</title>\s*", "", picture["inside"], flags=re.DOTALL)
    return f'<svg {size_attributes} xmlns="http://www.w3.org/2000/svg">{picture_content}</svg>'


def _frame_lines(name: str, lines: Iterable[str]) -> list[str]:
    frame = {"label": name, "labelloc": "t", "style": "rounded", "color": "#888888", "class": "spec"}
    return [f"subgraph {quote(f'cluster {name}')} {{", f"graph {attributes_text(frame)};", *lines, "}"]


def digraph(lines: Iterable[str], direction: str) -> str:
    """Return a graph in Graphviz's language, with the fonts and distances of all pictures."""
    graph_attributes = {"rankdir": direction, "fontname": _FONT, "nodesep": 0.16, "ranksep": 0.5, "newrank": "true"}
    node_attributes = {"fontname": _FONT, "fontsize": _LABEL_PT, "margin": "0.1,0.05", "height": 0.36, "penwidth": 0.8}
    edge_attributes = {"arrowsize": 0.7}
    defaults = (("graph", graph_attributes), ("node", node_attributes), ("edge", edge_attributes))
    default_lines = (f"{kind} {attributes_text(attributes)};" for kind, attributes in defaults)
    body = "".join(f"  {line}\n" for line in (*default_lines, *lines))
    return f"digraph codra {{\n{body}}}\n"


def _node_line(element: Element, number: int) -> str:
    look, kind, lines = look_of(element), shown_kind(element), text_lines(element)
    label = label_text("\n".join(lines))
    attributes = {
        "kind": "group" if element.members else element.kind.value,
        "label": _html_label(*lines) if element.members else label,
        "shape": look.shape,
        "style": look.style,
        "fillcolor": look.fill,
        "width": width_text(label, look.shape),
        **({"peripheries": 2} if element.members else {}),
        "id": f"n{number}",
        "class": kind.value,
    }
    return f"{quote(element.id)} {attributes_text(attributes)};"


def label_text(label: str) -> str:
    """Return a label that Graphviz shows unchanged, although Graphviz decodes entities."""
    return _ENTITY.sub("&amp;", label)


_WIDTH_FACTOR_BY_SHAPE: Mapping[str, float] = {"hexagon": 1.25, "house": 1.15, "octagon": 1.2, "ellipse": 1.35}
"""The ratio of a shape's width to the width of its label."""


def width_text(label: str, shape: str) -> str:
    """Return the minimum width of a node in inches, in which its label fits even if no font can be measured."""
    max_column_count = max(map(_column_count, label.split("\n")))
    width_in = 0.2 + max_column_count * _LETTER_EM * _LABEL_PT / 72
    return f"{width_in * _WIDTH_FACTOR_BY_SHAPE.get(shape, 1.0):.2f}"


def _column_count(text: str) -> int:
    return sum(2 if unicodedata.east_asian_width(letter) in ("W", "F") else 1 for letter in text)


def _edge_line(link: Link, edge_id: str) -> str:
    look = EDGE_LOOKS[link.kind]
    attributes = {
        "kind": link.kind.value,
        "color": look.colour,
        "style": look.style,
        "arrowhead": look.head,
        "id": edge_id,
        "class": link.kind.value,
    }
    if link.kind is EdgeKind.FEEDBACK:
        attributes["constraint"] = "false"  # the edge closes a cycle, which has no order from left to right
    source, target = link.flow
    return f"{quote(source)} -> {quote(target)} {attributes_text(attributes)};"


def _element_lines(elements: Iterable[Element], number_by_id: Mapping[str, int]) -> Iterator[str]:
    """Yield all nodes; each observer has a frame with its algorithms and the variables that they identify."""
    frames: dict[str, list[Element]] = {}
    for element in elements:
        frames.setdefault(element.observer, []).append(element)
    for observer, frame_elements in frames.items():
        lines = [_node_line(element, number_by_id[element.id]) for element in frame_elements]
        if not observer or len(frame_elements) == 1:
            yield from lines
            continue
        yield f"subgraph {quote(f'cluster {observer}')} {{"
        yield '  graph [label="", style="rounded,filled", fillcolor="#f7f7f7", color="#bbbbbb", class="frame"];'
        yield from (f"  {line}" for line in lines)
        variable_elements = [element for element in frame_elements if element.kind is NodeKind.CONTEXT]
        perception_elements = [element for element in frame_elements if element.kind is not NodeKind.CONTEXT]
        yield from (
            _same_rank_line(rank_elements)
            for rank_elements in (perception_elements, variable_elements)
            if rank_elements
        )
        yield "}"


def _same_rank_line(elements: Iterable[Element]) -> str:
    return f"  {{ rank=same; {' '.join(quote(element.id) for element in elements)} }}"


def attributes_text(values: Mapping[str, object]) -> str:
    """Return the attributes of a node or an edge in Graphviz's language."""
    texts = ((name, value if isinstance(value, _Html) else quote(str(value))) for name, value in values.items())
    return f"[{', '.join(f'{name}={text}' for name, text in texts)}]"


class _Html(str):
    """A label in the form of HTML that Graphviz reads. It has no quotes around it."""

    __slots__ = ()


def _html_label(*lines: str) -> _Html:
    title, *names = (
        escape(line.replace("\\", "\\\\")) for line in lines
    )  # Graphviz replaces `\N` by the name of the node
    listing = "".join(f'<br align="left"/>{name}' for name in names)
    return _Html(f'<<b>{title}</b>{listing}<br align="left"/>>')


def quote(text: str) -> str:
    r"""Return a quoted string in Graphviz's language. Backslashes are escaped, because `\N` or `\G` have a meaning."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def _draw(dot: str) -> str:
    """Return Graphviz's drawing. Graphviz comes with pygraphviz as a library, so no program is started."""
    try:
        import pygraphviz  # noqa: PLC0415 - an extra, with shared libraries that a machine may not have
    except ImportError as error:
        raise DrawingError(f"cannot draw: {error}; {pip_install(DSL, 'viz')}, and {_DEBIAN_HINT}") from error
    try:
        with os.fdopen(os.memfd_create("dot"), "w+b") as stream:  # pygraphviz would write a file to /tmp
            stream.write(dot.encode())
            stream.seek(0)
            graph = pygraphviz.AGraph()
            graph.read(stream)
        with redirect_stderr(io.StringIO()):  # Graphviz prints warnings about large graphs
            picture = graph.draw(None, format="svg", prog="dot")
    except (OSError, ValueError) as error:
        raise DrawingError(f"cannot draw: {error}") from error
    return str(picture.decode())


def _parse_picture(picture: str) -> re.Match[str]:
    match = _SVG_ELEMENT.search(picture)
    if match is None:
        raise DrawingError("cannot draw: Graphviz returned no picture")
    return match


# The legend, below the picture

_ROW_HEIGHT_PT = 24
_SAMPLE_WIDTH_PT = 64
_COLUMN_WIDTH_PT = 440


def _add_legend(picture: re.Match[str], graph: Graph) -> str:
    """Return a picture with its legend below. The picture shrinks with its window, but not below a legible size."""
    legend_entries = list(_legend_entries(graph))
    legend_top = int(picture["height"]) + 20
    height = legend_top + _ROW_HEIGHT_PT * max((row for _, row, _ in legend_entries), default=0) + _ROW_HEIGHT_PT
    width = max(
        int(picture["width"]), 16 + _COLUMN_WIDTH_PT * (1 + max((column for column, _, _ in legend_entries), default=0))
    )
    size_attributes = (
        f'width="100%" style="min-width: {width * _SMALLEST_SCALE:.0f}pt; max-width: {width}pt; height: auto"'
    )
    legend = "".join(
        f'<g transform="translate({16 + _COLUMN_WIDTH_PT * column} {legend_top + _ROW_HEIGHT_PT * row})">{text}</g>\n'
        for column, row, text in legend_entries
    )
    return (
        '<?xml version="1.0" encoding="UTF-8" standalone="no"?>\n'
        f'<svg {size_attributes} viewBox="0 0 {width} {height}"{picture["rest"]}>\n'
        f'<rect width="{width}" height="{height}" fill="white"/>\n{picture["inside"]}'
        f'<g class="legend" font-family="{_FONT}" font-size="{_LABEL_PT}">\n{legend}</g>\n</svg>\n'
    )


def _legend_entries(graph: Graph) -> Iterator[tuple[int, int, str]]:
    """Yield column, row and drawing of each legend entry. The legend has only the kinds that occur in the picture."""
    node_samples = [_node_sample(NODE_LOOKS[kind], NODE_LOOKS[kind].meaning) for kind in node_kinds_of(graph)]
    observers = [element.observer for element in graph.elements if element.observer]
    if len(observers) > len(set(observers)):
        node_samples.append(_box("#f7f7f7", "#bbbbbb", 6, "") + _legend_text(FRAME_TEXT))
    arrow_samples = [_arrow_sample(EDGE_LOOKS[kind]) for kind in edge_kinds_of(graph)]
    if shows_latencies(graph):
        arrow_samples.append(
            f'<text x="{_SAMPLE_WIDTH_PT / 2}" y="4" text-anchor="middle">≤ 1 s</text>{_legend_text(WORST_CASE_TEXT)}'
        )
    for column, samples in enumerate((node_samples, arrow_samples)):
        yield from ((column, row, text) for row, text in enumerate(samples))


def _node_sample(look: NodeLook, meaning: str) -> str:
    rounding = 6 if "rounded" in look.style else 0
    dashes = ' stroke-dasharray="4 2"' if "dashed" in look.style else ""
    if look.shape == "hexagon":
        shape_svg = f'<polygon points="0,0 9,-8 55,-8 64,0 55,8 9,8" fill="{look.fill}" stroke="black"/>'
    elif look.shape == "house":
        shape_svg = f'<polygon points="0,8 0,-4 32,-10 64,-4 64,8" fill="{look.fill}" stroke="black"/>'
    elif look.shape == "octagon":
        shape_svg = f'<polygon points="8,-8 56,-8 64,-3 64,3 56,8 8,8 0,3 0,-3" fill="{look.fill}" stroke="black"/>'
    elif look.shape == "ellipse":
        shape_svg = f'<ellipse cx="32" rx="32" ry="9" fill="{look.fill}" stroke="black"/>'
    elif look.shape == "cds":
        shape_svg = f'<polygon points="0,-8 56,-8 64,0 56,8 0,8" fill="{look.fill}" stroke="black"/>'
    else:
        shape_svg = _box(look.fill, "black", rounding, dashes)
        if look is NODE_LOOKS[ShownKind.GROUP]:
            shape_svg += f'<rect x="3" y="-5" width="{_SAMPLE_WIDTH_PT - 6}" height="10" fill="none" stroke="black"/>'
    return shape_svg + _legend_text(meaning)


def _box(fill: str, stroke: str, rounding: int, dashes: str) -> str:
    return (
        f'<rect y="-8" width="{_SAMPLE_WIDTH_PT}" height="16" rx="{rounding}" fill="{fill}" stroke="{stroke}"{dashes}/>'
    )


_DASHES: Mapping[str, str] = {"dashed": ' stroke-dasharray="5 2"', "dotted": ' stroke-dasharray="1 4"'}


def _arrow_sample(look: EdgeLook) -> str:
    """Return an arrow from A to B with its meaning."""
    width = 2 if look.style == "bold" else 1
    line = f'<path d="M12,0H46" stroke="{look.colour}" stroke-width="{width}"{_DASHES.get(look.style, "")}/>'
    fill = "white" if look.head == "empty" else look.colour if look.head in ("normal", "vee") else "none"
    head = f'<polygon points="44,-4 52,0 44,4" fill="{fill}" stroke="{look.colour}"/>' if look.head != "none" else ""
    end_letters = '<text x="0" y="4">A</text><text x="55" y="4">B</text>'
    return end_letters + line + head + _legend_text(look.sentence)


def _legend_text(text: str) -> str:
    return f'<text x="{_SAMPLE_WIDTH_PT + 12}" y="4">{escape(text)}</text>'
