"""The graph as a Mermaid flowchart, read back by a strict grammar of the part of Mermaid that it uses."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import EdgeKind
from codra_dsl.tooling.report.folding import fold
from codra_dsl.tooling.report.graphs import Graph, graph_of
from codra_dsl.tooling.report.looks import EDGE_LOOKS, label_of
from codra_dsl.tooling.report.mermaid import flowchart
from codra_dsl.tooling.selection import select
from tests.language.check.checked_specs import ShortAlgorithm, checked_spec, skill, variable

ROOT = Path(__file__).parents[3]
NAME = r"[A-Za-z][A-Za-z0-9_]*"
LABEL = r'"(?P<label>(?:[^"#<>&`\\]|#[0-9]+;|</?b>|<br/>)*)"'
LINES = {
    "comment": re.compile(r"%% .*"),
    "subgraph": re.compile(rf"subgraph (?P<name>{NAME})\[{LABEL}\]"),
    "end": re.compile(r"end"),
    "legend": re.compile(
        rf'(?P<a>{NAME})\(\("A"\)\) (?P<arrow>-->|==>|-\.->|-\.-o|---)\|{LABEL}\| (?P<b>{NAME})\(\("B"\)\)'
    ),
    "node": re.compile(
        rf"(?P<name>{NAME})(?P<shape>\(\(\(|\(\(|\(\[|\{{\{{|\[\[|\[\(|\[/|\{{|\(|\[){LABEL}"
        rf"(?P<closing>\)\)\)|\)\)|\]\)|\}}\}}|\]\]|\)\]|\\\]|\}}|\)|\])(?::::(?P<style>{NAME}))?"
    ),
    "placing": re.compile(rf"(?P<source>{NAME}) (?P<arrow>~~~) legend"),
    "edge": re.compile(rf"(?P<source>{NAME}) (?P<arrow>-->|==>|-\.->|-\.-o|---) (?P<target>{NAME})"),
    "classDef": re.compile(
        rf"classDef (?P<name>{NAME}) fill:#[0-9a-f]{{6}},stroke:#[0-9a-f]{{6}},color:#000000(,stroke-dasharray:4 2)?"
    ),
    "linkStyle": re.compile(
        r"linkStyle (?P<numbers>[0-9]+(,[0-9]+)*) stroke:(?P<colour>#[0-9a-f]{6})(,stroke-width:2px)?"
    ),
}
SHAPES = {
    *(("(", ")"), ("[", "]"), ("{{", "}}"), ("([", "])"), ("[/", "\\]"), ("((", "))"), ("[[", "]]")),
    *(("{", "}"), ("[(", ")]"), ("(((", ")))")),
}
RESERVED = {"end", "graph", "flowchart", "subgraph", "style", "class", "click", "default", "call", "href"}


@dataclass
class Chart:
    """A flowchart as Mermaid would read it."""

    nodes: dict[str, str] = field(default_factory=dict)
    inside: dict[str, str] = field(default_factory=dict)
    edges: list[tuple[str, str, str]] = field(default_factory=list)
    colours: dict[int, str] = field(default_factory=dict)
    styles: set[str] = field(default_factory=set)


def read(text: str) -> Chart:
    """Read a flowchart strictly: every line has a known form, and every name is declared once, before its use."""
    first, *lines = text.removesuffix("\n").split("\n")
    if first.startswith("%%{init: "):
        assert json.loads(first[len("%%{init: ") : -len("}%%")]).keys() == {"flowchart"}
        first = lines.pop(0)
    assert first in ("flowchart LR", "flowchart TB")
    chart, frames, used = Chart(), [], set()
    for line in map(str.strip, lines):
        ((form, line_match),) = [
            (form, match) for form, line_pattern in LINES.items() if (match := line_pattern.fullmatch(line))
        ] or [("?", line)]
        assert not isinstance(line_match, str), line
        fields = {key: value for key, value in line_match.groupdict().items() if value is not None}
        label = next((shown(value) for key, value in fields.items() if key.startswith("label")), "")
        if form == "subgraph":
            frames.append(label)
            assert fields["name"] not in chart.nodes
        elif form == "end":
            frames.pop()
        elif form == "node":
            assert (fields["shape"], fields["closing"]) in SHAPES
            assert fields["name"] not in chart.nodes
            chart.nodes[fields["name"]], chart.inside[fields["name"]] = label, "/".join(frames)
            used.add(fields.get("style", "plain"))
        elif form == "legend":
            chart.edges.append((label, fields["arrow"], ""))
        elif form == "placing":
            chart.edges.append((fields["source"], fields["arrow"], "legend"))
        elif form == "edge":
            assert {fields["source"], fields["target"]} <= chart.nodes.keys()
            chart.edges.append((fields["source"], fields["arrow"], fields["target"]))
        elif form == "classDef":
            chart.styles.add(fields["name"])
        elif form == "linkStyle":
            numbers = [int(number) for number in fields["numbers"].split(",")]
            assert not chart.colours.keys() & set(numbers)
            chart.colours |= dict.fromkeys(numbers, fields["colour"])
    assert frames == []
    assert used <= chart.styles | {"plain"}
    assert not RESERVED & {name.lower() for name in chart.nodes}
    return chart


def shown(label: str) -> str:
    return unescape(re.sub(r"#([0-9]+);", r"&#\1;", re.sub("</?b>", "", label).replace("<br/>", "\n")))


@pytest.fixture(scope="module")
def lab() -> Graph:
    return graph_of(plan_paths([ROOT / "specs/lab.yaml"], ROOT).plans)


def test_the_flowchart_has_every_node_and_every_edge_of_the_graph(lab: Graph) -> None:
    chart = read(flowchart(lab).text)

    labels = {name: label.split("\n")[0] for name, label in chart.nodes.items()}
    edges = {(labels[source], labels[target]) for source, _, target in chart.edges if target}
    label_by_id = {element.id: label_of(element) for element in lab.elements}
    assert {label_of(element) for element in lab.elements} <= set(labels.values())
    assert edges == {tuple(label_by_id[end] for end in link.flow) for link in lab.links}
    assert sum(bool(target) for _, _, target in chart.edges) == len(lab.links)


def test_a_use_of_a_template_is_a_frame_around_its_elements(lab: Graph) -> None:
    chart = read(flowchart(lab).text)
    frame_of = {label.split("\n")[0]: chart.inside[name] for name, label in chart.nodes.items()}

    assert frame_of["PCR-cycler_open"] == frame_of["find_pcr_cycler_in_view"] == "pcr_cycler"
    assert frame_of["open_centrifuge"] == "centrifuge"
    assert frame_of["robot_is_localized"] == ""
    assert "PCR-cycler_open\n\u2264 12 s" in chart.nodes.values()


def test_every_kind_of_edge_has_a_colour_and_a_sentence(lab: Graph) -> None:
    chart = read(flowchart(lab).text)

    assert chart.colours.keys() == set(range(len(chart.edges)))
    for number, link in enumerate(lab.links):
        assert chart.colours[number] == EDGE_LOOKS[link.kind].colour
    legend = [sentence for sentence, _, target in chart.edges if not target]
    used_kinds = {link.kind for link in lab.links}
    assert EdgeKind.FEEDBACK not in used_kinds
    assert legend == [EDGE_LOOKS[kind].sentence for kind in EDGE_LOOKS if kind in used_kinds]


def test_every_one_of_several_specs_has_a_frame(lab: Graph) -> None:
    both = graph_of([*plan_paths([ROOT / "specs"], ROOT).plans])
    chart = read(flowchart(both).text)

    frames = {chart.inside[name] for name in chart.nodes if name.startswith("n")}

    assert {"lab", "kitchen", "lab/centrifuge", "lab/pcr_cycler"} <= frames
    assert len(lab.elements) < len(both.elements)


@given(st.text(max_size=30))
def test_no_label_can_break_out_of_its_quotes(label: str) -> None:
    graph = graph_of(
        [plan(checked_spec([ShortAlgorithm(name="p", identifies=["a"])], variables=[variable("a", label=label)]))]
    )

    chart = read(flowchart(graph).text)

    assert chart.nodes["n0"] == f"{label_of(graph.elements[0])}\n\u2264 5 s"


@pytest.mark.parametrize(
    "label", ["end", "1. one", "- dash", "`code`", "**bold**", "a@b", "-->", "A#quot;B", "%% no", "x & y"]
)
def test_syntax_of_mermaid_in_labels_becomes_codes(label: str) -> None:
    graph = graph_of(
        [plan(checked_spec([ShortAlgorithm(name="p", identifies=["a"])], variables=[variable("a", label=label)]))]
    )

    line = next(line for line in flowchart(graph).text.splitlines() if line.strip().startswith("n0"))

    assert re.fullmatch(r'  n0\("[\w ]*(#[0-9]+;[\w ]*)*<br/>\u2264 5 s"\):::context', line)


def halls(count: int) -> Graph:
    """Return many independent chains, as many uses of a template would give them."""
    looks = [
        ShortAlgorithm(
            name=f"see_{n}_{step}", identifies=[f"v_{n}_{step}"], needs=[f"v_{n}_{step - 1}"] if step else ["start"]
        )
        for n in range(count)
        for step in range(3)
    ]
    origins = {("perception", look.name): f"room_{look.name.split('_')[1]}" for look in looks}
    origins |= {("context", str(look.identifies[0])): f"room_{look.name.split('_')[1]}" for look in looks}
    return graph_of(
        [plan(checked_spec(looks, skills=[skill("go", [f"v_{n}_2" for n in range(count)])], origins=origins))]
    )


def test_a_large_graph_is_folded_with_its_legend_below(lab: Graph) -> None:
    chart = read(flowchart(fold(lab)).text)

    boxes = {label.split("\n")[0]: name for name, label in chart.nodes.items()}
    assert chart.nodes[boxes["centrifuge_lid"]] == (
        "centrifuge_lid\ncentrifuge_open\N{NO-BREAK SPACE}\u2264 12 s\ncentrifuge_locked\N{NO-BREAK SPACE}\u2264 18 s"
    )
    assert chart.inside[boxes["centrifuge_lid"]] == chart.inside[boxes["centrifuge: 5 skills"]] == "centrifuge"
    last_boxes = {source for source, arrow, _ in chart.edges if arrow == "~~~"}
    assert last_boxes == {boxes[title] for title in ("3 skills", "centrifuge: 5 skills", "pcr_cycler: 5 skills")}


def test_a_graph_beyond_mermaids_limits_is_within_them_when_folded() -> None:
    graph = halls(60)

    assert not flowchart(graph).is_within_limits
    assert flowchart(fold(graph)).is_within_limits


def test_a_part_of_it_is_drawn_in_full() -> None:
    graph = halls(60)

    chart = flowchart(fold(graph.select_part(select(graph.choices(), ["+v_7_2"]))))

    assert "v_7_1" in chart.text
