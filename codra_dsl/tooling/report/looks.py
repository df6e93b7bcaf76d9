"""The look of each kind of node and edge in all pictures, and its meaning in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum

from codra_dsl.generation.build_plan import EdgeKind
from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.graphs import Element, Graph


class ShownKind(StrEnum):
    """The kinds that a picture distinguishes: the kinds of nodes, and in addition variables without an observer."""

    CONTEXT = "context"
    GIVEN = "given"
    PERCEPTION = "perception"
    OBSERVER = "observer"
    SKILL = "skill"
    AGENT = "agent"
    TYPE = "type"
    EDGE = "edge"
    TASK = "task"
    METRIC = "metric"
    ACTION = "action"
    ADAPTATION = "adaptation"
    TREE = "tree"
    LOOP = "loop"
    GROUP = "group"


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeLook:
    """The look of a node.

    Attributes:
        shape: the name of the shape in Graphviz.
        meaning: the meaning of the node, in words.
    """

    shape: str
    fill: str
    style: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeLook:
    """The look of an arrow from A to B.

    Attributes:
        style: solid, bold, dotted or dashed.
        sentence: the meaning of an arrow from A to B.
    """

    colour: str
    style: str
    head: str
    sentence: str


FOLDED_TEXT = "folded: an observer with its variables, or several nodes"
FRAME_TEXT = "an observer with its algorithms and variables"
WORST_CASE_TEXT = "the longest time from declared to known"

# The colours of Okabe and Ito, which readers with any colour vision can distinguish; nodes have light tints of them.
# Shapes and styles of lines tell the kinds apart in print without colours.
NODE_LOOKS: Mapping[ShownKind, NodeLook] = {
    ShownKind.CONTEXT: NodeLook(
        shape="box", fill="#c5e5f8", style="filled,rounded", meaning="context-variable that an observer identifies"
    ),
    ShownKind.GIVEN: NodeLook(
        shape="box", fill="#ffffff", style="filled,rounded,dashed", meaning="context-variable from another source"
    ),
    ShownKind.PERCEPTION: NodeLook(shape="box", fill="#f9f4ae", style="filled", meaning="perception algorithm"),
    ShownKind.OBSERVER: NodeLook(shape="hexagon", fill="#b3e2d5", style="filled", meaning="observer"),
    ShownKind.SKILL: NodeLook(shape="cds", fill="#f2cfb3", style="filled", meaning="skill of the main execution"),
    ShownKind.AGENT: NodeLook(shape="house", fill="#f0d7e5", style="filled", meaning="agent that writes knowledge"),
    ShownKind.TYPE: NodeLook(shape="box", fill="#e4e4e4", style="filled,rounded", meaning="type of nodes"),
    ShownKind.EDGE: NodeLook(shape="ellipse", fill="#ffffff", style="filled", meaning="type of edges between nodes"),
    ShownKind.TASK: NodeLook(shape="octagon", fill="#f6dea6", style="filled", meaning="task that agents hand over"),
    ShownKind.METRIC: NodeLook(shape="box", fill="#9ad2f2", style="filled", meaning="metric"),
    ShownKind.ACTION: NodeLook(shape="cds", fill="#9ad2f2", style="filled", meaning="action with a weight"),
    ShownKind.ADAPTATION: NodeLook(shape="diamond", fill="#f2cfb3", style="filled", meaning="adaptation"),
    ShownKind.TREE: NodeLook(shape="folder", fill="#b3e2d5", style="filled", meaning="behaviour tree"),
    ShownKind.LOOP: NodeLook(shape="doublecircle", fill="#ffffff", style="filled", meaning="loop"),
    ShownKind.GROUP: NodeLook(shape="box", fill="#f0f0f0", style="filled", meaning=FOLDED_TEXT),
}

EDGE_LOOKS: Mapping[EdgeKind, EdgeLook] = {
    EdgeKind.REQUIRES: EdgeLook(
        colour="#0072b2", style="solid", head="normal", sentence="A must be known before B looks"
    ),
    EdgeKind.IDENTIFIES: EdgeLook(colour="#009e73", style="bold", head="normal", sentence="A identifies B"),
    EdgeKind.RUNS: EdgeLook(colour="#555555", style="dotted", head="open", sentence="A runs B"),
    EdgeKind.DECIDES_ON: EdgeLook(colour="#d55e00", style="dashed", head="vee", sentence="B decides on A"),
    EdgeKind.FEEDBACK: EdgeLook(
        colour="#cc79a7", style="dashed", head="empty", sentence="B reads A, but does not wait for it"
    ),
    EdgeKind.OWNS: EdgeLook(colour="#cc79a7", style="bold", head="normal", sentence="A may write B"),
    EdgeKind.READS: EdgeLook(colour="#cc79a7", style="dashed", head="vee", sentence="A is read by B"),
    EdgeKind.REQUESTS: EdgeLook(colour="#000000", style="solid", head="normal", sentence="A may request task B"),
    EdgeKind.EXECUTES: EdgeLook(colour="#000000", style="bold", head="normal", sentence="A is done by B"),
    EdgeKind.LEADS_FROM: EdgeLook(colour="#555555", style="solid", head="none", sentence="edges B lead from nodes A"),
    EdgeKind.LEADS_TO: EdgeLook(colour="#555555", style="solid", head="open", sentence="edges A lead to nodes B"),
    EdgeKind.WEIGHS: EdgeLook(colour="#009e73", style="solid", head="normal", sentence="A is weighed by B"),
    EdgeKind.SWITCHES: EdgeLook(colour="#d55e00", style="bold", head="normal", sentence="A chooses the branch of B"),
    EdgeKind.SETS: EdgeLook(colour="#d55e00", style="solid", head="normal", sentence="A sets B"),
    EdgeKind.ANALYSES: EdgeLook(colour="#555555", style="dotted", head="open", sentence="A computes B"),
    EdgeKind.ADAPTS: EdgeLook(colour="#555555", style="dashed", head="open", sentence="A carries out B"),
    EdgeKind.DERIVES: EdgeLook(colour="#0072b2", style="bold", head="open", sentence="B is derived from A"),
}


def shown_kind(element: Element) -> ShownKind:
    """Return the kind of an element in pictures."""
    if len({member.kind for member in element.members}) > 1:
        return ShownKind.GROUP
    return ShownKind.GIVEN if element.is_given else ShownKind(element.kind.value)


def look_of(element: Element) -> NodeLook:
    """Return the look of an element. A folded element is a box, because other shapes waste room on several lines."""
    look = NODE_LOOKS[shown_kind(element)]
    return replace(look, shape="box") if element.members else look


def label_of(element: Element) -> str:
    """Return the label of an element on one line; if the label has no visible characters, return the name."""
    return visible_text(element.label).strip() or element.name


def latency_text(element: Element) -> str:
    """Return the worst case of a variable as a short text, or an empty text."""
    return "" if element.worst_case_s is None else f"≤ {_seconds_text(element.worst_case_s)}"


def text_lines(element: Element) -> list[str]:
    """Return the lines of an element in a picture: its label, then its worst case or the names that are folded."""
    return [label_of(element), *filter(None, [latency_text(element)]), *element.lines]


def _seconds_text(duration_s: float) -> str:
    return f"{round(duration_s, 3):g} s" if duration_s < 1000 else f"{duration_s:.0f} s"


def shows_latencies(graph: Graph) -> bool:
    """Return whether a picture of the graph has worst cases."""
    return any("≤" in line for element in graph.elements for line in text_lines(element)[1:])


def is_folded(graph: Graph) -> bool:
    """Return whether some elements represent several."""
    return any(element.members for element in graph.elements)


def node_kinds_of(graph: Graph) -> tuple[ShownKind, ...]:
    """Return the kinds of nodes that a legend explains, in its order. The title of a folded element states its kind."""
    kinds = ((shown_kind(element), element) for element in graph.elements)
    present_kinds = {ShownKind.GROUP if element.members else kind for kind, element in kinds}
    return tuple(kind for kind in NODE_LOOKS if kind in present_kinds)


def edge_kinds_of(graph: Graph) -> tuple[EdgeKind, ...]:
    """Return the kinds of edges that a graph has, in the order of the legend."""
    present_kinds = {link.kind for link in graph.links}
    return tuple(kind for kind in EDGE_LOOKS if kind in present_kinds)
