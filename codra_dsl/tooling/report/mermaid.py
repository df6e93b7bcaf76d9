"""The dependency graph as a Mermaid flowchart, for pages that draw Mermaid."""

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
    is_folded,
    node_kinds_of,
    shown_kind,
    shows_latencies,
    text_lines,
)

MAX_EDGES = 499
"""The largest number of edges that Mermaid draws by default (`maxEdges`)."""

MAX_LETTERS = 50_000
"""The largest number of letters that Mermaid draws by default (`maxTextSize`)."""

_SETTINGS = (
    '%%{init: {"flowchart": {"wrappingWidth": 500, "nodeSpacing": 20, "rankSpacing": 30, '
    '"padding": 8, "subGraphTitleMargin": {"bottom": 10}}}}%%'
)
"""Without them, Mermaid breaks names that are longer than 200 pixels, and folded graphs become twice as large."""

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
    ShownKind.GROUP: ("[", "]"),
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
        edge_count: the number of edges in the flowchart.
    """

    text: str
    edge_count: int

    @property
    def is_within_limits(self) -> bool:
        """Return whether Mermaid draws the flowchart with its default limits."""
        return self.edge_count <= MAX_EDGES and len(self.text) <= MAX_LETTERS


def flowchart(graph: Graph) -> Flowchart:
    """Return the graph as a flowchart."""
    return Flowchart(text=_chart(graph), edge_count=len(graph.links) + len(edge_kinds_of(graph)))


def _chart(graph: Graph) -> str:
    number_by_id = {element.id: number for number, element in enumerate(graph.elements)}
    lines = [f"{_SETTINGS}\nflowchart TB" if is_folded(graph) else "flowchart LR"]
    for spec in graph.specs:
        spec_lines = [*_element_lines([element for element in graph.elements if element.spec == spec], number_by_id)]
        lines += _subgraph(f"spec_{spec}", spec, spec_lines) if len(graph.specs) > 1 else spec_lines
    for link in graph.links:
        need, user = link.flow
        lines.append(f"n{number_by_id[need]} {_ARROWS[link.kind]} n{number_by_id[user]}")
    lines += _legend(graph)
    if is_folded(graph):  # invisible links put the legend below the boxes, where no arrow crosses it
        needed = {link.flow[0] for link in graph.links}
        lines += (f"n{number} ~~~ legend" for element_id, number in number_by_id.items() if element_id not in needed)
    lines += map(_style, dict.fromkeys([*node_kinds_of(graph), *map(shown_kind, graph.elements)]))
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
    return [f'subgraph {name}["{escape_label(label)}"]', *(f"  {line}" for line in lines), "end"]


def _node(element: Element, number: int) -> str:
    opening_bracket, closing_bracket = _SHAPES[shown_kind(element)]
    if element.members:
        opening_bracket, closing_bracket = "[", "]"
    title, *lines = map(escape_label, text_lines(element))
    label = "<br/>".join([f"<b>{title}</b>" if element.members else title, *lines])
    return f'n{number}{opening_bracket}"{label}"{closing_bracket}:::{shown_kind(element)}'


def escape_label(label: str) -> str:
    """Return text that Mermaid shows unchanged: codes replace all but letters, digits, blanks, `_` and `≤`."""
    return "".join(
        letter if letter.isalnum() or letter in "_ ≤\N{NO-BREAK SPACE}" else f"#{ord(letter)};" for letter in label
    )


def _legend(graph: Graph) -> list[str]:
    """Return the legend: for each kind of arrow, an arrow from A to B with its meaning."""
    lines = []
    for number, kind in enumerate(edge_kinds_of(graph)):
        sentence = escape_label(EDGE_LOOKS[kind].sentence)
        lines.append(f'a{number}(("A")) {_ARROWS[kind]}|"{sentence}"| b{number}(("B"))')
    lines += (f'k_{kind}["{escape_label(NODE_LOOKS[kind].meaning)}"]:::{kind}' for kind in node_kinds_of(graph))
    if shows_latencies(graph):
        lines.append(f'worst_case["≤ 1 s{escape_label(": " + WORST_CASE_TEXT)}"]:::plain')
    return _subgraph("legend", "how to read it", lines)


def _style(kind: ShownKind) -> str:
    dashes = ",stroke-dasharray:4 2" if "dashed" in NODE_LOOKS[kind].style else ""
    return f"classDef {kind} fill:{NODE_LOOKS[kind].fill},stroke:#333333,color:#000000{dashes}"


def _link_style(kind: EdgeKind, kinds: Sequence[EdgeKind]) -> str:
    numbers_text = ",".join(str(number) for number, link_kind in enumerate(kinds) if link_kind is kind)
    width = ",stroke-width:2px" if _ARROWS[kind].startswith("-.") else ""  # Mermaid's dots are hard to see
    return f"linkStyle {numbers_text} stroke:{EDGE_LOOKS[kind].colour}{width}"
