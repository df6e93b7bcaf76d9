"""The dependency graph of compiled specs, as JSON, as text for Graphviz, and as a picture.

In JSON and for Graphviz an edge reads as a sentence: a skill decides on a variable, an observer runs an algorithm, an
algorithm requires one variable and identifies another. The picture follows what is known instead, from left to right:
from the variables that perception needs, through what it identifies, to the decisions.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.build_plan import BuildPlan, Edge, EdgeKind, Node, NodeKind
from codra_dsl.emit.records import graph_edge, graph_nodes, list_of, node_id, object_of, places
from codra_dsl.report.findings import visible

# The picture is laid out with a wide font, so that labels fit whichever of these a browser has.
_FONT = "DejaVu Sans,Verdana,Arial,sans-serif"


@dataclass(frozen=True, slots=True, kw_only=True)
class _NodeLook:
    shape: str
    fill: str
    style: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _EdgeLook:
    colour: str
    style: str
    arrow: str
    border: str
    meaning: str


_NODES: Mapping[NodeKind, _NodeLook] = {
    NodeKind.CONTEXT: _NodeLook(shape="box", fill="#d6e6f5", style="filled,rounded", meaning="context-variable"),
    NodeKind.PERCEPTION: _NodeLook(shape="box", fill="#fff3c4", style="filled", meaning="perception algorithm"),
    NodeKind.OBSERVER: _NodeLook(shape="hexagon", fill="#d8efd3", style="filled", meaning="observer"),
    NodeKind.SKILL: _NodeLook(shape="cds", fill="#f6d5c0", style="filled", meaning="skill of the main execution"),
}
_GIVEN = _NodeLook(
    shape="box", fill="#ffffff", style="filled,rounded,dashed", meaning="context-variable that no observer identifies"
)

_EDGES: Mapping[EdgeKind, _EdgeLook] = {
    EdgeKind.REQUIRES: _EdgeLook(
        colour="#1f5fa8", style="solid", border="solid", arrow="normal", meaning="must be known first: required by"
    ),
    EdgeKind.IDENTIFIES: _EdgeLook(
        colour="#2e7d32", style="bold", border="solid", arrow="normal", meaning="identifies"
    ),
    EdgeKind.RUNS: _EdgeLook(colour="#777777", style="dotted", border="dotted", arrow="open", meaning="runs"),
    EdgeKind.DECIDES_ON: _EdgeLook(
        colour="#b5541c", style="dashed", border="dashed", arrow="vee", meaning="is decided on by"
    ),
    EdgeKind.FEEDBACK: _EdgeLook(
        colour="#c2185b", style="dashed", border="dashed", arrow="empty", meaning="feeds back to, without a wait"
    ),
}

_LABEL_PT = 11
_LETTER_EM = 0.62
_ENTITY = re.compile(r"&(?=#?[A-Za-z0-9]+;)")
_SIZE = re.compile(r'width="([0-9]+)pt" height="[0-9]+pt"')

_AGAINST_THE_FLOW = frozenset({EdgeKind.REQUIRES, EdgeKind.DECIDES_ON, EdgeKind.FEEDBACK})
"""Edges whose sentence ends where knowledge comes from; in the picture they point the other way."""


def render_json(plans: Sequence[BuildPlan]) -> str:
    """Return the graph with the place of each node in the spec; it is that of `graph.json` otherwise."""
    nodes: list[object] = []
    for plan in plans:
        where = dict(places(plan))
        for node, about in graph_nodes(plan):
            name = node_id(plan, node)
            span = where[name].span
            nodes.append({"id": name, "kind": node.kind.value, **about, "file": span.file, "line": span.line})
    edges = (graph_edge(plan, edge) for plan in plans for edge in plan.edges)
    return object_of(nodes=list_of(nodes), edges=list_of(edges))


def render_dot(plans: Sequence[BuildPlan]) -> str:
    """Return the graph in the language of Graphviz: the nodes and edges of the JSON, each with its `kind`."""
    return _digraph([line for plan in plans for line in (*_nodes(plan), *(_edge(plan, edge) for edge in plan.edges))])


def render_svg(plans: Sequence[BuildPlan]) -> str:
    """Return the graph as a picture with a legend; several specs stand in a frame each.

    Raises:
        DrawingError: if Graphviz is not installed or cannot draw.
    """
    lines: list[str] = []
    for plan in plans:
        inside = [*_boxes(plan), *(_flow(plan, edge) for edge in plan.edges)]
        lines += _framed(plan.name, inside) if len(plans) > 1 else inside
    return _drawn(_digraph(lines, label=_Markup(_legend()), labelloc="b", labeljust="l"))


def _framed(name: str, lines: Iterable[str]) -> list[str]:
    frame = _attributes({"label": name, "labelloc": "t", "style": "rounded", "color": "#888888"})
    return [f"subgraph {_quoted(f'cluster {name}')} {{", f"graph {frame};", *lines, "}"]


class DrawingError(Exception):
    """A picture cannot be drawn here; the message says what to do."""


_CURE = (
    "pip install 'codra-dsl[viz]', and on Debian "
    "apt-get install --no-install-recommends libglib2.0-0 libx11-6 libxext6 libxrender1"
)


class _Markup(str):
    """A label in Graphviz' own markup, which stands between angle brackets instead of quotes."""

    __slots__ = ()


def _digraph(lines: Iterable[str], **attributes: str) -> str:
    graph = {"rankdir": "LR", "fontname": _FONT, "nodesep": 0.14, "ranksep": 0.5, "newrank": "true", **attributes}
    node = {"fontname": _FONT, "fontsize": _LABEL_PT, "margin": "0.1,0.05", "height": 0.34, "penwidth": 0.8}
    edge = {"arrowsize": 0.7}
    defaults = (f"{kind} {_attributes(each)};" for kind, each in (("graph", graph), ("node", node), ("edge", edge)))
    body = "".join(f"  {line}\n" for line in (*defaults, *lines))
    return f"digraph codra {{\n{body}}}\n"


def _nodes(plan: BuildPlan) -> Iterator[str]:
    for node, about in graph_nodes(plan):
        is_given = node.kind is NodeKind.CONTEXT and node.name not in plan.checked.producers
        look = _GIVEN if is_given else _NODES[node.kind]
        label = _label(str(about["label"]), node)
        shown = {"label": label, "shape": look.shape, "style": look.style, "fillcolor": look.fill}
        width = {"width": f"{_width_in(label, look):.2f}"}
        yield f"{_quoted(node_id(plan, node))} {_attributes({'kind': node.kind.value, **shown, **width})};"


def _label(text: str, node: Node) -> str:
    """Return a label that Graphviz shows as it is: it reads entities, and falls over one of nothing but space."""
    return _ENTITY.sub("&amp;", visible(text).strip()) or node.name


def _width_in(label: str, look: _NodeLook) -> float:
    """Return the least width of a node in inches, in which its label fits even where no font can be measured."""
    letters = sum(2 if unicodedata.east_asian_width(letter) in ("W", "F") else 1 for letter in label)
    width_in = 0.2 + letters * _LETTER_EM * _LABEL_PT / 72
    return width_in * (1.25 if look.shape == "hexagon" else 1.0)


def _edge(plan: BuildPlan, edge: Edge) -> str:
    return _arrow(node_id(plan, edge.source), node_id(plan, edge.target), edge.kind)


def _flow(plan: BuildPlan, edge: Edge) -> str:
    """Return an edge that points where knowledge goes."""
    ends = (node_id(plan, edge.source), node_id(plan, edge.target))
    source, target = reversed(ends) if edge.kind in _AGAINST_THE_FLOW else ends
    return _arrow(source, target, edge.kind)


def _arrow(source: str, target: str, kind: EdgeKind) -> str:
    look = _EDGES[kind]
    shown = {"kind": kind.value, "color": look.colour, "style": look.style, "arrowhead": look.arrow}
    if kind is EdgeKind.FEEDBACK:
        shown["constraint"] = "false"  # it closes a circle, which has no left and right
    return f"{_quoted(source)} -> {_quoted(target)} {_attributes(shown)};"


def _boxes(plan: BuildPlan) -> Iterator[str]:
    """Yield all nodes, those of one observer in a box: its algorithms and what they identify."""
    lines = dict(zip((node for node, _ in graph_nodes(plan)), _nodes(plan), strict=True))
    for tree in plan.forest:
        inside = [Node(NodeKind.OBSERVER, tree.name), *(Node(NodeKind.PERCEPTION, each.name) for each in tree.branches)]
        inside += [Node(NodeKind.CONTEXT, name) for name in tree.identifies]
        yield f"subgraph {_quoted(f'cluster {plan.name} {tree.name}')} {{"
        yield '  graph [label="", style="rounded,filled", fillcolor="#f7f7f7", color="#bbbbbb"];'
        yield from (f"  {lines.pop(node)}" for node in inside)
        made = len(tree.identifies)
        yield from (_side_by_side(plan, nodes) for nodes in (inside[:-made], inside[-made:]))
        yield "}"
    yield from lines.values()


def _side_by_side(plan: BuildPlan, nodes: Iterable[Node]) -> str:
    return f"  {{ rank=same; {' '.join(_quoted(node_id(plan, node)) for node in nodes)} }}"


def _legend() -> str:
    """Return the legend as Graphviz' markup: a swatch for each kind of node, a sample for each kind of edge."""
    boxes = (
        f'<td bgcolor="{look.fill}" border="1" style="{"dashed" if "dashed" in look.style else "solid"}">'
        f"{look.meaning}</td>"
        for look in (*_NODES.values(), _GIVEN)
    )
    arrows = (
        f'<td border="2" color="{look.colour}" style="{look.border}">{look.meaning}</td>' for look in _EDGES.values()
    )
    rows = (("boxes", boxes), ("arrows", arrows))
    text = "".join(f'<tr><td align="left">{name}</td>{"".join(cells)}</tr>' for name, cells in rows)
    return f'<table border="0" cellspacing="6" cellpadding="4">{text}</table>'


def _attributes(values: Mapping[str, object]) -> str:
    return f"[{', '.join(f'{name}={_value(value)}' for name, value in values.items())}]"


def _value(value: object) -> str:
    return f"<{value}>" if isinstance(value, _Markup) else _quoted(str(value))


def _quoted(text: str) -> str:
    r"""Return a quoted string in the language of Graphviz, in which `\N`, `\G` and the like would mean something."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _drawn(dot: str) -> str:
    """Return what Graphviz draws; it comes with pygraphviz as a library, so that no program is started."""
    try:
        import pygraphviz  # noqa: PLC0415 - an extra, with shared libraries that a machine may not have
    except ImportError as error:
        raise DrawingError(f"cannot draw: {error}; {_CURE}") from error
    try:
        with os.fdopen(os.memfd_create("dot"), "w+b") as stream:  # pygraphviz itself would write a file to /tmp
            stream.write(dot.encode())
            stream.seek(0)
            graph = pygraphviz.AGraph()
            graph.read(stream)
        picture = graph.draw(None, format="svg", prog="dot")
    except (OSError, ValueError) as error:
        raise DrawingError(f"cannot draw: {error}") from error
    return _SIZE.sub(_scaling, picture.decode(), count=1)


def _scaling(size: re.Match[str]) -> str:
    """Return the size of a picture that shrinks with its window, down to where it can still be read."""
    width_pt = int(size[1])
    return f'width="100%" style="min-width: {width_pt // 2}pt; max-width: {width_pt}pt; height: auto"'
