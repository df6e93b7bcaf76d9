"""The dependency graph as JSON, for Graphviz, and as a picture."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pygraphviz
import pytest
from matplotlib.textpath import TextPath

from codra_dsl.build_plan import BuildPlan
from codra_dsl.compiler import plan_paths
from codra_dsl.plan import plan
from codra_dsl.report.findings import visible
from codra_dsl.report.graphs import render_dot, render_json, render_svg
from tests.checked_specs import Pi, checked_spec, condition, skill, variable

ROOT = Path(__file__).parents[2]
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def lab() -> BuildPlan:
    (made,) = plan_paths([ROOT / "specs/lab.yaml"], ROOT).plans
    return made


def feedback() -> BuildPlan:
    again = condition("not known(b) or age(b) > 10 s", "b", python="~known('b') | (age('b') > 10.0)")
    return plan(
        checked_spec(
            [
                Pi(name="p", identifies=["a"], needs=[again], feedback=["b"]),
                Pi(name="q", identifies=["b"], needs=["a", "given"]),
            ],
            name="loop",
            skills=[skill("s", ["a"])],
        )
    )


def sentences(plans: list[BuildPlan]) -> set[tuple[str, str, str]]:
    return {(edge["source"], edge["kind"], edge["target"]) for edge in json.loads(render_json(plans))["edges"]}


def test_json_reads_as_sentences_and_says_where_each_node_stands(lab: BuildPlan) -> None:
    graph = json.loads(render_json([lab]))

    nodes = {node["id"]: node for node in graph["nodes"]}

    assert nodes["lab/context/pcr_cycler_open"] == {
        "id": "lab/context/pcr_cycler_open",
        "kind": "context",
        "label": "PCR-cycler_open",
        "type": "bool",
        "file": "specs/parts/machine.yaml",
        "line": nodes["lab/context/centrifuge_open"]["line"],
    }
    assert {
        ("lab/skill/open_pcr_cycler", "decides_on", "lab/context/pcr_cycler_open"),
        ("lab/observer/pcr_cycler_lid", "runs", "lab/perception/localize_pcr_cycler_lid"),
        ("lab/perception/localize_pcr_cycler_lid", "identifies", "lab/context/pcr_cycler_open"),
        ("lab/perception/localize_pcr_cycler_lid", "requires", "lab/context/pcr_cycler_lid_in_FOV"),
    } <= sentences([lab])


def test_the_lab_has_the_seven_observers_and_fourteen_variables_of_table_1(lab: BuildPlan) -> None:
    nodes = json.loads(render_json([lab]))["nodes"]
    kinds = [node["kind"] for node in nodes]

    assert kinds.count("observer") == 7
    assert kinds.count("context") == 14 + 1
    assert sum(kind == "identifies" for _, kind, _ in sentences([lab])) == 14


@pytest.mark.parametrize("both", [False, True])
def test_graphviz_reads_the_same_nodes_and_edges(lab: BuildPlan, both: bool) -> None:
    plans = [lab, feedback()] if both else [lab]

    read = pygraphviz.AGraph(string=render_dot(plans))

    graph = json.loads(render_json(plans))
    assert {(node, node.attr["kind"], node.attr["label"]) for node in read.nodes()} == {
        (node["id"], node["kind"], node["label"]) for node in graph["nodes"]
    }
    assert {(edge[0], edge.attr["kind"], edge[1]) for edge in read.edges()} == sentences(plans)
    assert len(read.edges()) == len(graph["edges"])


def test_feedback_is_drawn_apart_from_what_is_required() -> None:
    read = pygraphviz.AGraph(string=render_dot([feedback()]))

    drawn = {edge.attr["kind"]: (edge.attr["color"], edge.attr["style"]) for edge in read.edges()}

    assert set(drawn) == {"identifies", "requires", "runs", "decides_on", "feedback"}
    assert len(set(drawn.values())) == 5


@pytest.mark.parametrize(
    "label", ['"', "\\", "\\N", "a\\", "<b>", "&amp;", "{x|y}", "\n", "", "a\nb", "ü戸", "]; evil [", "->"]
)
def test_no_label_can_break_out_of_its_quotes(label: str) -> None:
    made = plan(checked_spec([Pi(name="p", identifies=["a"])], variables=[variable("a", label=label)]))

    read = pygraphviz.AGraph(string=render_dot([made]))
    shown = "".join(ElementTree.fromstring(render_svg([made])).itertext())

    assert {str(node) for node in read.nodes()} == {"lab/context/a", "lab/perception/p", "lab/observer/p"}
    assert (visible(label).strip() or "a") in shown


# The picture


def groups(svg: str, kind: str) -> Iterator[ElementTree.Element]:
    for group in ElementTree.fromstring(svg).iter(f"{SVG}g"):
        if group.get("class") == kind:
            yield group


def test_the_picture_has_every_node_by_its_label_and_every_edge(lab: BuildPlan) -> None:
    svg = render_svg([lab])
    graph = json.loads(render_json([lab]))

    labels = sorted("".join(text.itertext()) for group in groups(svg, "node") for text in group.iter(f"{SVG}text"))

    assert labels == sorted(node["label"] for node in graph["nodes"])
    assert len(list(groups(svg, "edge"))) == len(graph["edges"])


def test_the_picture_points_from_what_must_be_known_to_what_it_is_for(lab: BuildPlan) -> None:
    titles = {group.findtext(f"{SVG}title") for group in groups(render_svg([lab]), "edge")}

    assert "lab/context/robot_is_localized->lab/perception/measure_centrifuge_distance" in titles
    assert "lab/context/pcr_cycler_open->lab/skill/open_pcr_cycler" in titles


def test_the_picture_explains_its_shapes_and_arrows(lab: BuildPlan) -> None:
    words = "".join(ElementTree.fromstring(render_svg([lab])).itertext())

    for meaning in (
        "context-variable",
        "perception algorithm",
        "observer",
        "skill of the main execution",
        "identifies",
    ):
        assert meaning in words
    assert "must be known first" in words


def width(shape: ElementTree.Element) -> float:
    """The width of a polygon, path or ellipse as Graphviz draws it."""
    numbers = (shape.get("points") or shape.get("d") or "").replace("M", " ").replace("C", " ").split()
    columns = [float(pair.split(",")[0]) for pair in numbers]
    return max(columns) - min(columns)


def test_labels_have_room_even_in_a_wide_font(lab: BuildPlan) -> None:
    """DejaVu Sans is the widest of the fonts that the picture names; matplotlib brings it along and can measure it."""
    for group in groups(render_svg([lab]), "node"):
        (text,) = group.iter(f"{SVG}text")
        shape = next(each for each in group if each.tag in (f"{SVG}polygon", f"{SVG}path"))
        label = TextPath((0, 0), text.text or "", size=float(text.get("font-size", "0")))

        assert label.get_extents().width + 8 < width(shape), text.text


def test_several_specs_stand_in_a_frame_each(lab: BuildPlan) -> None:
    svg = render_svg([lab, feedback()])

    frames = {group.findtext(f"{SVG}title") for group in groups(svg, "cluster")}

    assert {"cluster lab", "cluster loop"} <= frames
    assert len(list(groups(svg, "edge"))) == len(sentences([lab, feedback()]))


def test_the_picture_shrinks_with_its_window_but_stays_readable(lab: BuildPlan) -> None:
    svg = render_svg([lab])

    assert 'width="100%"' in svg
    assert "min-width" in svg
    assert "max-width" in svg
