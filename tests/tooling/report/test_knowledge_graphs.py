"""Graphs of specs with knowledge: agents, their elements, types, edges and tasks, in every format."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.build_plan import EdgeKind
from codra_dsl.tooling.report.dot import render_dot, render_svg
from codra_dsl.tooling.report.graphs import Graph, graph_of, render_json
from codra_dsl.tooling.report.looks import EDGE_LOOKS, NODE_LOOKS, ShownKind
from codra_dsl.tooling.report.mermaid import flowchart
from codra_dsl.tooling.report.page import render_html
from codra_dsl.tooling.selection import select

VALID = Path(__file__).parents[2] / "cases/valid"
KNOWN = (ShownKind.AGENT, ShownKind.TYPE, ShownKind.EDGE, ShownKind.TASK)
KNOWING = (
    *(EdgeKind.OWNS, EdgeKind.READS, EdgeKind.REQUESTS),
    *(EdgeKind.EXECUTES, EdgeKind.LEADS_FROM, EdgeKind.LEADS_TO),
)


def graph(name: str) -> Graph:
    planned = plan_paths([VALID / name], VALID)
    return graph_of(planned.plans)


@pytest.fixture(scope="module")
def shop() -> Graph:
    return graph("knowledge.yaml")


def chosen(of: Graph, *selectors: str) -> list[str]:
    return sorted(node_id.split("/", 1)[1] for node_id in select(of.choices(), selectors))


def test_the_json_has_every_element_with_its_place(shop: Graph) -> None:
    graph_json = json.loads(render_json(shop))

    assert Counter(node["kind"] for node in graph_json["nodes"]) == {
        "context": 3,
        "agent": 6,
        "type": 7,
        "edge": 9,
        "task": 3,
    }
    (fork,) = [node for node in graph_json["nodes"] if node["id"] == "picking_up/agent/fork"]
    assert fork == {
        "id": "picking_up/agent/fork",
        "kind": "agent",
        "label": "The fork",
        "wakes": ["distance(robot, area_1) < 50 cm"],
        "file": "knowledge.yaml",
        "line": 43,
    }
    ids = {node["id"] for node in graph_json["nodes"]}
    assert {edge[end] for edge in graph_json["edges"] for end in ("source", "target")} <= ids


def test_every_text_format_has_every_element_and_link(shop: Graph) -> None:
    dot, chart = render_dot(shop), flowchart(shop).text

    for element in shop.elements:
        assert f'"{element.id}" [kind="{element.kind}"' in dot
    assert len(re.findall(r"^  n\d+[\[({].*:::", chart, re.MULTILINE)) == len(shop.elements)
    assert dot.count(" -> ") == len(shop.links)
    for kind in KNOWING:
        assert f'kind="{kind}"' in dot


def test_the_picture_draws_all_elements_and_its_legend_explains_them(shop: Graph) -> None:
    text = render_svg(shop)
    ET.fromstring(text)

    for element in shop.elements:
        assert f">{element.label}</text>" in text
    for shown in KNOWN:
        assert NODE_LOOKS[shown].meaning in text
    for kind in KNOWING:
        assert EDGE_LOOKS[kind].sentence in text


def test_the_page_shows_the_wakes_of_an_agent_and_the_results_of_a_task(shop: Graph) -> None:
    page = render_html(shop)

    assert '"Wakes":"robot -wants-\\u003e navigating, battery_level \\u003c 10 percent"' in page
    assert '"Results":"there, blocked"' in page


def test_kinds_and_steps_select_agents_and_their_elements(shop: Graph) -> None:
    assert chosen(shop, "kind:task") == ["task/detecting", "task/navigating", "task/picking_up"]
    assert chosen(shop, "1+detecting+1") == ["agent/container_detection", "agent/picking", "task/detecting"]
    assert chosen(shop, "fork+1") == ["agent/fork", "edge/container_pose", "type/roll_container"]
    assert chosen(shop, "1+fork") == ["agent/fork", "context/container_load"]


def test_uses_of_templates_hold_their_agents() -> None:
    forks = graph("knowledge-in-templates.yaml")

    assert "agent/front_driver" in chosen(forks, "use:front")
    assert "task/lifting_back" in chosen(forks, "use:back,kind:task")
    assert "subgraph use_two_forks_front" in flowchart(forks).text


def test_perception_and_knowledge_are_in_one_picture() -> None:
    night = graph("knowledge-everything.yaml")
    sentences = {(link.source.split("/", 1)[1], link.kind.value, link.target.split("/", 1)[1]) for link in night.links}

    assert ("perception/look_at_door", "identifies", "context/door_open") in sentences
    assert ("agent/planner", "reads", "context/door_open") in sentences
    assert ("agent/wall_switch", "owns", "context/lit") in sentences


def test_a_spec_without_knowledge_has_no_nodes_of_knowledge() -> None:
    lamp = graph("trees.yaml")

    assert not {element.kind.value for element in lamp.elements} & {"agent", "type", "edge", "task"}
    for shown in KNOWN:
        assert NODE_LOOKS[shown].meaning not in render_svg(lamp)
