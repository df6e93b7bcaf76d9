"""The dependency graph as a Mermaid flowchart, for pages that draw Mermaid.

Renderers of Mermaid refuse long texts and many edges. A larger graph is condensed to one box for each use of a template
and for each file. So the entire graph is shown, and `--select` shows parts of it in full.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from codra_dsl.generation.build_plan import EdgeKind
from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.report.graphs import Element, Graph
from codra_dsl.tooling.report.looks import (
    EDGE_LOOKS,
    NODE_LOOKS,
    WORST_CASE_TEXT,
    ShownKind,
    edge_kinds_of,
    label_of,
    latency_text,
    node_kinds_of,
    shown_kind,
)
from codra_dsl.tooling.report.overview import Overview, overview

MAX_EDGES = 499
"""The largest number of edges that Mermaid draws by default (`maxEdges`)."""

MAX_LETTERS = 50_000
"""The largest number of letters that Mermaid draws by default (`maxTextSize`)."""

_SHAPES: Mapping[ShownKind, tuple[str, str]] = {
    ShownKind.CONTEXT: ("(", ")"),
    ShownKind.GIVEN: ("(", ")"),
    ShownKind.PERCEPTION: ("[", "]"),
    ShownKind.OBSERVER: ("{{", "}}"),
    ShownKind.SKILL: ("([", "])"),
    ShownKind.AGENT: ("[/", "\\]"),
    ShownKind.TYPE: ("(", ")"),
    ShownKind.EDGE: ("((", "))"),
    ShownKind.TASK: ("[[", "]]"),
    ShownKind.METRIC: ("[", "]"),
    ShownKind.ACTION: ("([", "])"),
    ShownKind.ADAPTATION: ("{", "}"),
    ShownKind.TREE: ("[(", ")]"),
    ShownKind.LOOP: ("(((", ")))"),
}
_ARROWS: Mapping[EdgeKind, str] = {
    EdgeKind.REQUIRES: "-->",
    EdgeKind.IDENTIFIES: "==>",
    EdgeKind.RUNS: "-.->",
    EdgeKind.DECIDES_ON: "-.->",
    EdgeKind.FEEDBACK: "-.-o",
    EdgeKind.OWNS: "==>",
    EdgeKind.READS: "-.->",
    EdgeKind.REQUESTS: "-->",
    EdgeKind.EXECUTES: "==>",
    EdgeKind.LEADS_FROM: "---",
    EdgeKind.LEADS_TO: "-->",
    EdgeKind.WEIGHS: "-->",
    EdgeKind.SWITCHES: "==>",
    EdgeKind.SETS: "-->",
    EdgeKind.ANALYSES: "-.->",
    EdgeKind.ADAPTS: "-.->",
    EdgeKind.DERIVES: "-->",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Flowchart:
    """A graph as a Mermaid flowchart.

    Attributes:
        is_complete: whether the flowchart shows every element of the graph.
        edge_count: the number of edges in the flowchart.
    """

    text: str
    is_complete: bool
    edge_count: int

    @property
    def is_within_limits(self) -> bool:
        """Return whether Mermaid draws the flowchart with its default limits."""
        return self.edge_count <= MAX_EDGES and len(self.text) <= MAX_LETTERS


def flowchart(graph: Graph) -> Flowchart:
    """Return the graph as a flowchart: complete if Mermaid draws the complete graph, otherwise condensed."""
    complete_chart = Flowchart(
        text=_chart(graph), is_complete=True, edge_count=len(graph.links) + len(edge_kinds_of(graph))
    )
    if complete_chart.is_within_limits:
        return complete_chart
    condensed_graph = overview(graph)
    return Flowchart(
        text=_overview_chart(condensed_graph), is_complete=False, edge_count=len(condensed_graph.link_counts)
    )


def _chart(graph: Graph) -> str:
    number_by_id = {element.id: number for number, element in enumerate(graph.elements)}
    lines = ["flowchart LR"]
    for spec in graph.specs:
        spec_lines = [*_element_lines([element for element in graph.elements if element.spec == spec], number_by_id)]
        lines += _subgraph(f"spec_{spec}", spec, spec_lines) if len(graph.specs) > 1 else spec_lines
    for link in graph.links:
        need, user = link.flow
        lines.append(f"n{number_by_id[need]} {_ARROWS[link.kind]} n{number_by_id[user]}")
    lines += _legend(graph)
    lines += (_style(kind) for kind in node_kinds_of(graph))
    kinds = [link.kind for link in graph.links] + list(edge_kinds_of(graph))
    lines += (_link_style(kind, kinds) for kind in edge_kinds_of(graph))
    return "\n  ".join(lines) + "\n"


def _element_lines(elements: Iterable[Element], number_by_id: Mapping[str, int]) -> Iterator[str]:
    """Yield all elements. The elements of a use of a template are in a subgraph."""
    lines_by_use: dict[str, list[str]] = {}
    for element in elements:
        lines_by_use.setdefault(element.use, []).append(_node(element, number_by_id[element.id]))
        spec = element.spec
    for use, lines in lines_by_use.items():
        yield from _subgraph(f"use_{spec}_{use}", use, lines) if use else lines


def _subgraph(name: str, label: str, lines: Iterable[str]) -> list[str]:
    return [f'subgraph {name}["{_escape_label(label)}"]', *(f"  {line}" for line in lines), "end"]


def _node(element: Element, number: int) -> str:
    opening_bracket, closing_bracket = _SHAPES[shown_kind(element)]
    label = "<br/>".join(filter(None, [_escape_label(label_of(element)), latency_text(element)]))
    return f'n{number}{opening_bracket}"{label}"{closing_bracket}:::{shown_kind(element)}'


def _escape_label(label: str) -> str:
    """Return text that Mermaid shows unchanged: codes replace all characters but letters, digits, `_` and blanks."""
    return "".join(letter if letter.isalnum() or letter in "_ " else f"#{ord(letter)};" for letter in label)


def _legend(graph: Graph) -> list[str]:
    """Return the legend: for each kind of arrow, an arrow from A to B with its meaning."""
    lines = []
    for number, kind in enumerate(edge_kinds_of(graph)):
        sentence = _escape_label(EDGE_LOOKS[kind].sentence)
        lines.append(f'a{number}(("A")) {_ARROWS[kind]}|"{sentence}"| b{number}(("B"))')
    lines += (f'k_{kind}["{_escape_label(NODE_LOOKS[kind].meaning)}"]:::{kind}' for kind in node_kinds_of(graph))
    if any(latency_text(element) for element in graph.elements):
        lines.append(f'worst_case["≤ 1 s{_escape_label(": " + WORST_CASE_TEXT)}"]:::plain')
    return _subgraph("legend", "how to read it", lines)


def _style(kind: ShownKind) -> str:
    dashes = ",stroke-dasharray:4 2" if "dashed" in NODE_LOOKS[kind].style else ""
    return f"classDef {kind} fill:{NODE_LOOKS[kind].fill},stroke:#333333,color:#000000{dashes}"


def _link_style(kind: EdgeKind, kinds: Sequence[EdgeKind]) -> str:
    numbers_text = ",".join(str(number) for number, link_kind in enumerate(kinds) if link_kind is kind)
    return f"linkStyle {numbers_text} stroke:{EDGE_LOOKS[kind].colour}"


def _overview_chart(overview_graph: Overview) -> str:
    """Return a flowchart of boxes."""
    lines = [
        "flowchart LR",
        "%% Too large for Mermaid: each box has all nodes of a use of a template, of a file or of an observer.",
        "%% Each arrow leads from a box to a box that needs it. `codra graph --select` shows a part in full.",
    ]
    for spec in overview_graph.specs:
        box_lines = [
            f'b{number}["{_escape_label(box.label)}<br/>'
            f'{box.element_count} node{"" if box.element_count == 1 else "s"}"]'
            for number, box in enumerate(overview_graph.boxes)
            if box.spec == spec
        ]
        lines += _subgraph(f"spec_{spec}", spec, box_lines) if len(overview_graph.specs) > 1 else box_lines
    lines += (f"b{need} --> b{user}" for need, user in overview_graph.link_counts)
    return "\n  ".join(lines) + "\n"
