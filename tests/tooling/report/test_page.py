"""The graph as a page: one file that fetches nothing and runs no text of a spec."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import EdgeKind
from codra_dsl.tooling.report.dot import MAX_QUICK_NODES
from codra_dsl.tooling.report.folding import fold
from codra_dsl.tooling.report.graphs import Graph, graph_of
from codra_dsl.tooling.report.looks import EDGE_LOOKS, NODE_LOOKS, ShownKind
from codra_dsl.tooling.report.page import render_html
from tests.language.check.checked_specs import ShortAlgorithm, checked_spec, variable

ROOT = Path(__file__).parents[3]
FETCHING = {"src", "href", "xlink:href", "action", "srcset", "poster", "data", "formaction", "background"}


@dataclass
class Page(HTMLParser):
    """A page as a browser parses it: its elements, and the text within scripts and styles."""

    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    raw: list[tuple[str, dict[str, str | None], str]] = field(default_factory=list)
    open: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self.raw.append((tag, dict(attrs), ""))
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("script", "style"):
            tag, attributes, text = self.raw[-1]
            self.raw[-1] = (tag, attributes, text + data)

    def all(self, tag: str) -> Iterator[dict[str, str | None]]:
        return (attributes for name, attributes in self.elements if name == tag)

    @property
    def data(self) -> dict[str, Any]:
        (text,) = (text for _, attributes, text in self.raw if attributes.get("id") == "data")
        data_object: dict[str, Any] = json.loads(text)
        return data_object

    @property
    def script(self) -> str:
        (text,) = (text for tag, attributes, text in self.raw if tag == "script" and not attributes)
        return text


def read(text: str) -> Page:
    page = Page()
    page.feed(text)
    page.close()
    return page


@pytest.fixture(scope="module")
def lab() -> Graph:
    return graph_of(plan_paths([ROOT / "specs/lab.yaml"], ROOT).plans)


def small(label: str = "a", description: str = "") -> Graph:
    declared = [variable("a", label=label, description=description)]
    return graph_of([plan(checked_spec([ShortAlgorithm(name="p", identifies=["a"])], variables=declared))])


def test_the_page_holds_the_graph_as_data(lab: Graph) -> None:
    data = read(render_html(lab)).data

    nodes = {node["id"]: node for node in data["nodes"]}
    ends = {(data["nodes"][need]["id"], data["nodes"][user]["id"], kind) for need, user, kind in data["edges"]}
    assert nodes.keys() == {element.id for element in lab.elements}
    assert ends == {(*link.flow, link.kind.value) for link in lab.links}
    assert nodes["lab/context/pcr_cycler_open"] == {
        "id": "lab/context/pcr_cycler_open",
        "kind": "context",
        "name": "pcr_cycler_open",
        "label": "PCR-cycler_open",
        "spec": "lab",
        "group": "pcr_cycler",
        "place": f"specs/parts/machine.yaml:{nodes['lab/context/centrifuge_open']['place'].split(':')[1]}",
        "description": "The lid stands open.",
        "worst_case_s": 12.0,
        "latency": "\u2264 12 s",
        "facts": {"Type": "bool"},
    }
    assert nodes["lab/observer/pcr_cycler_lid"]["facts"] == {"Looks every": "1 s"}
    assert data["kinds"].keys() == {"context", "given", "perception", "observer", "skill"}
    assert data["arrows"].keys() == {"requires", "identifies", "runs", "decides_on"}


def test_the_page_has_a_drawing_of_every_node_and_edge(lab: Graph) -> None:
    page = read(render_html(lab))

    names = {attributes.get("id") for attributes in page.all("g")}

    assert {f"n{number}" for number in range(len(lab.elements))} <= names
    assert {f"e{number}" for number in range(len(lab.links))} <= names


def test_a_folded_graph_is_an_overview_whose_boxes_have_every_node_once(lab: Graph) -> None:
    picture = fold(lab)

    data = read(render_html(lab, picture)).data

    assert [box["label"] for box in data["boxes"]] == [element.label for element in picture.elements]
    assert sorted(number for box in data["boxes"] for number in box["members"]) == list(range(len(lab.elements)))
    assert len(data["nodes"]) == len(lab.elements)


def test_a_page_of_a_complete_picture_has_no_overview(lab: Graph) -> None:
    assert read(render_html(lab, lab)).data["boxes"] == read(render_html(lab)).data["boxes"] == []


def test_a_graph_that_is_slow_to_draw_is_laid_out_by_the_page() -> None:
    many = [ShortAlgorithm(name=f"p{number}", identifies=[f"v{number}"]) for number in range(MAX_QUICK_NODES // 3 + 1)]

    page = read(render_html(graph_of([plan(checked_spec(many))])))

    assert len(page.data["nodes"]) > MAX_QUICK_NODES
    assert list(page.all("g")) == []


def test_the_page_fetches_no_resource(lab: Graph) -> None:
    text = render_html(lab)
    page = read(text)

    named = [(tag, key, value) for tag, attributes in page.elements for key, value in attributes.items()]
    assert [attribute for attribute in named if attribute[1] in FETCHING] == []
    assert {tag for tag, _ in page.elements} & {"link", "iframe", "object", "embed", "img", "base", "form"} <= {"form"}
    assert not re.search(r"url\s*\(|@import", text)
    assert not re.search(r"\b(fetch|XMLHttpRequest|WebSocket|EventSource|import|sendBeacon)\s*\(", page.script)
    assert set(re.findall(r"https?://[^\s\"'<>]+", text)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }


def test_the_policy_allows_only_the_pages_own_script(lab: Graph) -> None:
    page = read(render_html(lab))

    (policy,) = (meta["content"] for meta in page.all("meta") if meta.get("http-equiv") == "Content-Security-Policy")
    digest = base64.b64encode(hashlib.sha256(page.script.encode()).digest()).decode()
    assert policy is not None
    assert "default-src 'none'" in policy
    assert f"script-src 'sha256-{digest}'" in policy
    assert "unsafe-inline" not in policy.split("script-src")[1]


HOSTILE = [
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "<img src=x onerror=alert(1)>",
    "{{ script }}",
    "{{SCRIPT}}",
    "{% raw %}",
    "]]>",
    "\\u003c/script>",
    "&lt;b&gt;",
    '"><svg onload=alert(1)>',
    "a\u2028b",
    "\x00",
]


@pytest.mark.parametrize("text", HOSTILE)
def test_text_of_a_spec_stays_data(text: str) -> None:
    plain, hostile = read(render_html(small())), read(render_html(small(label=text, description=text)))

    tags = [tag for tag, _ in hostile.elements if tag not in ("text", "polygon", "path")]

    assert tags == [tag for tag, _ in plain.elements if tag not in ("text", "polygon", "path")]
    assert hostile.script == plain.script
    assert not any(key.startswith("on") for _, attributes in hostile.elements for key in attributes)
    assert hostile.data["nodes"][0]["description"].rstrip("\ufffd") in (
        text,
        text.replace("\u2028", "\ufffd"),
        "a\ufffdb",
        "",
    )


@settings(max_examples=40)
@given(st.text())
def test_any_description_is_stored_in_its_visible_form(text: str) -> None:
    node = read(render_html(small(description=text))).data["nodes"][0]

    assert [letter for letter in node["description"] if letter != "\ufffd"] == [
        letter
        for character in text
        for letter in ("    " if character == "\t" else character)
        if letter.isprintable() and letter != "\ufffd"
    ]


def test_every_kind_that_the_page_shows_has_a_style() -> None:
    (style,) = (text for tag, _, text in read(render_html(small())).raw if tag == "style")

    for kind in ("context", "given", "perception", "observer", "skill"):
        assert style.count(f"--{kind}: #") == 2, "once for light, once for dark"
        assert f".node.{kind} >" in style
    for kind in ("requires", "identifies", "runs", "decides_on", "feedback"):
        assert style.count(f"--{kind}: #") == 2
        assert f"svg .{kind} " in style


@pytest.mark.parametrize("kind", NODE_LOOKS)
def test_every_kind_of_node_has_its_colour_in_the_graph_in_the_legend_and_in_lists(kind: ShownKind) -> None:
    (style,) = (text for tag, _, text in read(render_html(small())).raw if tag == "style")

    assert style.count(f"--{kind}: #") == 2, "once for light, once for dark"
    assert re.search(rf"svg \.node\.{kind} > [^{{}}]*\{{ fill: var\(--{kind}\);", style)
    assert f".swatch.{kind}, .dot.{kind} {{ background: var(--{kind}); }}" in style


@pytest.mark.parametrize("kind", EDGE_LOOKS)
def test_every_kind_of_edge_has_a_colour(kind: EdgeKind) -> None:
    (style,) = (text for tag, _, text in read(render_html(small())).raw if tag == "style")

    assert re.search(rf"svg (\.{kind} |:is\([^)]*\.{kind}\b)[^{{}}]*\{{ stroke: var\(--\w+\);", style)


def test_every_element_that_the_script_uses_is_in_the_page() -> None:
    page = read(render_html(small()))

    wanted = set(re.findall(r'find\("([a-z-]+)"\)', page.script))

    assert len(wanted) > 10
    assert wanted <= {attributes.get("id") for _, attributes in page.elements}


def test_the_same_specs_give_the_same_page(lab: Graph) -> None:
    assert render_html(lab) == render_html(lab)
