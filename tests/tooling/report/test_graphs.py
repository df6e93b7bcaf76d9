"""The dependency graph as JSON, for Graphviz, and as a picture."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pygraphviz
import pytest
from matplotlib.textpath import TextPath

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.tooling.report.dot import render_dot, render_drawing, render_svg
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.graphs import Graph, graph_of, render_json
from codra_dsl.tooling.selection import select
from tests.language.check.checked_specs import ShortAlgorithm, checked_spec, condition, skill, variable

ROOT = Path(__file__).parents[3]
ROTOR = ("centrifuge_rotor_in_pos_1", "centrifuge_rotor_in_pos_2")
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def lab_plan() -> BuildPlan:
    (made,) = plan_paths([ROOT / "specs/lab.yaml"], ROOT).plans
    return made


@pytest.fixture(scope="module")
def lab(lab_plan: BuildPlan) -> Graph:
    return graph_of([lab_plan])


def feedback() -> BuildPlan:
    again = condition("not known(b) or age(b) > 10 s", "b", python="~known('b') | (age('b') > 10.0)")
    return plan(
        checked_spec(
            [
                ShortAlgorithm(name="p", identifies=["a"], needs=[again], feedback=["b"]),
                ShortAlgorithm(name="q", identifies=["b"], needs=["a", "given"]),
            ],
            name="loop",
            skills=[skill("s", ["a"])],
        )
    )


def sentences(graph: Graph) -> set[tuple[str, str, str]]:
    return {(edge["source"], edge["kind"], edge["target"]) for edge in json.loads(render_json(graph))["edges"]}


def test_json_reads_as_sentences_and_has_the_place_of_every_node(lab: Graph) -> None:
    graph = json.loads(render_json(lab))

    nodes = {node["id"]: node for node in graph["nodes"]}

    assert nodes["lab/context/pcr_cycler_open"] == {
        "id": "lab/context/pcr_cycler_open",
        "kind": "context",
        "label": "PCR-cycler_open",
        "type": "bool",
        "worst_case_s": 12.0,
        "file": "specs/parts/machine.yaml",
        "line": nodes["lab/context/centrifuge_open"]["line"],
    }
    assert {
        ("lab/skill/open_pcr_cycler", "decides_on", "lab/context/pcr_cycler_open"),
        ("lab/observer/pcr_cycler_lid", "runs", "lab/perception/localize_pcr_cycler_lid"),
        ("lab/perception/localize_pcr_cycler_lid", "identifies", "lab/context/pcr_cycler_open"),
        ("lab/perception/localize_pcr_cycler_lid", "requires", "lab/context/pcr_cycler_lid_in_FOV"),
    } <= sentences(lab)


def test_only_variables_that_observers_identify_have_a_worst_case(lab: Graph) -> None:
    nodes = {node["id"]: node for node in json.loads(render_json(lab))["nodes"]}

    assert nodes["lab/context/centrifuge_in_observable_distance"]["worst_case_s"] == 1.0
    assert nodes["lab/context/robot_is_localized"]["worst_case_s"] is None
    assert "worst_case_s" not in nodes["lab/skill/open_centrifuge"]


def test_the_lab_has_the_seven_observers_and_fourteen_variables_of_table_1(lab: Graph) -> None:
    nodes = json.loads(render_json(lab))["nodes"]
    kinds = [node["kind"] for node in nodes]

    assert kinds.count("observer") == 7
    assert kinds.count("context") == 14 + 1
    assert len({variable for _, kind, variable in sentences(lab) if kind == "identifies"}) == 14


@pytest.mark.parametrize("has_both", [False, True])
def test_graphviz_reads_the_same_nodes_and_edges(lab_plan: BuildPlan, has_both: bool) -> None:
    dependency_graph = graph_of([lab_plan, feedback()] if has_both else [lab_plan])

    parsed_graph = pygraphviz.AGraph(string=render_dot(dependency_graph))

    graph = json.loads(render_json(dependency_graph))
    assert {(node, node.attr["kind"], node.attr["label"].split("\\n")[0]) for node in parsed_graph.nodes()} == {
        (node["id"], node["kind"], node["label"]) for node in graph["nodes"]
    }
    flows = [(*link.flow, link.kind.value) for link in dependency_graph.links]
    assert sorted((*edge, edge.attr["kind"]) for edge in parsed_graph.edges()) == sorted(flows)


def test_feedback_is_drawn_differently_from_requirements() -> None:
    parsed_graph = pygraphviz.AGraph(string=render_dot(graph_of([feedback()])))

    drawn = {edge.attr["kind"]: (edge.attr["color"], edge.attr["style"]) for edge in parsed_graph.edges()}

    assert set(drawn) == {"identifies", "requires", "runs", "decides_on", "feedback"}
    assert len(set(drawn.values())) == 5


@pytest.mark.parametrize(
    "label", ['"', "\\", "\\N", "a\\", "<b>", "&amp;", "{x|y}", "\n", "", "a\nb", "ü戸", "]; evil [", "->"]
)
def test_no_label_can_break_out_of_its_quotes(label: str) -> None:
    made = graph_of(
        [plan(checked_spec([ShortAlgorithm(name="p", identifies=["a"])], variables=[variable("a", label=label)]))]
    )

    read = pygraphviz.AGraph(string=render_dot(made))
    shown = "".join(ElementTree.fromstring(render_svg(made)).itertext())

    assert {str(node) for node in read.nodes()} == {"lab/context/a", "lab/perception/p", "lab/observer/p"}
    assert (visible_text(label).strip() or "a") in shown


# A part


def test_a_part_has_the_chosen_nodes_and_all_edges_between_them(lab: Graph) -> None:
    part = lab.select_part(select(lab.choices(), ["1+pcr_cycler_open"]))

    assert [element.name for element in part.elements] == ["pcr_cycler_open", "localize_pcr_cycler_lid"]
    assert sentences(part) == {
        ("lab/perception/localize_pcr_cycler_lid", "identifies", "lab/context/pcr_cycler_open"),
    }


def test_needs_lead_from_the_main_execution_to_the_skills(lab: Graph) -> None:
    before = select(lab.choices(), ["+pcr_cycler_open"])
    after = select(lab.choices(), ["pcr_cycler_lid_in_FOV+"])

    assert {"lab/context/robot_is_localized", "lab/observer/pcr_cycler_lid"} < before
    assert "lab/skill/lock_pcr_cycler" in after
    assert not any("centrifuge" in name for name in before | after)


def test_elements_are_selected_by_the_use_and_the_file_that_declare_them(lab: Graph) -> None:
    use = select(lab.choices(), ["use:pcr_cycler"])
    file = select(lab.choices(), ["file:specs/lab.yaml,kind:context"])

    assert len(use) == 6 + 3 + 3 + 5
    assert file == {f"lab/context/{name}" for name in ("robot_is_localized", *ROTOR)}


def test_a_part_is_drawn_like_the_complete_graph(lab: Graph) -> None:
    part = lab.select_part(select(lab.choices(), ["kind:skill"]))

    words = "".join(ElementTree.fromstring(render_svg(part)).itertext())

    assert "open_pcr_cycler" in words
    assert "A identifies B" not in words


# The picture


def groups(svg: str, kind: str) -> Iterator[ElementTree.Element]:
    for group in ElementTree.fromstring(svg).iter(f"{SVG}g"):
        if kind in group.get("class", "").split():
            yield group


def test_the_picture_has_every_node_by_its_label_and_every_edge(lab: Graph) -> None:
    svg = render_svg(lab)
    graph = json.loads(render_json(lab))

    labels = [[text.text for text in group.iter(f"{SVG}text")] for group in groups(svg, "node")]

    assert sorted(lines[0] for lines in labels) == sorted(node["label"] for node in graph["nodes"])
    assert ["PCR-cycler_open", "\u2264 12 s"] in labels
    assert ["robot_is_localized"] in labels
    assert len(list(groups(svg, "edge"))) == len(graph["edges"])


def test_the_arrows_of_the_picture_follow_the_flow_of_knowledge(lab: Graph) -> None:
    titles = {group.findtext(f"{SVG}title") for group in groups(render_svg(lab), "edge")}

    assert "lab/context/robot_is_localized->lab/perception/measure_centrifuge_distance" in titles
    assert "lab/context/pcr_cycler_open->lab/skill/open_pcr_cycler" in titles


def test_the_picture_explains_its_shapes_arrows_and_frames_in_sentences(lab: Graph) -> None:
    words = "".join(ElementTree.fromstring(render_svg(lab)).itertext())

    for meaning in (
        "context-variable that an observer identifies",
        "context-variable from another source",
        "perception algorithm",
        "skill of the main execution",
        "an observer with its algorithms and variables",
        "A must be known before B looks",
        "A identifies B",
        "A runs B",
        "B decides on A",
        "the longest time from declared to known",
    ):
        assert meaning in words


@pytest.mark.parametrize(("has_feedback", "is_explained"), [(True, True), (False, False)])
def test_the_legend_has_only_what_the_picture_has(lab: Graph, has_feedback: bool, is_explained: bool) -> None:
    svg = render_svg(graph_of([feedback()]) if has_feedback else lab)

    assert ("does not wait for it" in svg) == is_explained


def test_the_legend_is_below_the_picture_and_inside_its_frame(lab: Graph) -> None:
    root = ElementTree.fromstring(render_svg(lab))
    _, _, width_pt, height_pt = map(float, root.get("viewBox", "").split())
    (legend,) = groups(render_svg(lab), "legend")
    drawn_pt = float(re.search(r"translate\(4 ([0-9.]+)\)", render_svg(lab))[1])  # type: ignore[index]

    for row in legend:
        x, y = map(float, re.findall(r"[0-9.]+", row.get("transform", "")))
        ends = [x + float(text.get("x", "0")) + 0.62 * 12 * len(text.text or "") for text in row.iter(f"{SVG}text")]

        assert drawn_pt < y < height_pt
        assert max(ends) < width_pt


def width(shape: ElementTree.Element) -> float:
    """Return the width of a polygon, path or ellipse that Graphviz drew."""
    numbers = (shape.get("points") or shape.get("d") or "").replace("M", " ").replace("C", " ").split()
    columns = [float(pair.split(",")[0]) for pair in numbers]
    return max(columns) - min(columns)


def test_labels_fit_even_in_a_wide_font(lab: Graph) -> None:
    """DejaVu Sans is the widest of the fonts that the picture names; matplotlib contains it and can measure it."""
    for group in groups(render_svg(lab), "node"):
        text = next(group.iter(f"{SVG}text"))
        shape = next(element for element in group if element.tag in (f"{SVG}polygon", f"{SVG}path"))
        label = TextPath((0, 0), text.text or "", size=float(text.get("font-size", "0")))

        assert label.get_extents().width + 8 < width(shape), text.text


def test_every_one_of_several_specs_has_a_frame(lab_plan: BuildPlan) -> None:
    both = graph_of([lab_plan, feedback()])
    svg = render_svg(both)

    frames = {group.findtext(f"{SVG}title") for group in groups(svg, "cluster")}

    assert {"cluster lab", "cluster loop"} <= frames
    assert len(list(groups(svg, "edge"))) == len(sentences(both))


def test_the_picture_shrinks_with_its_window_but_stays_readable(lab: Graph) -> None:
    svg = render_svg(lab)

    assert 'width="100%"' in svg
    assert "min-width" in svg
    assert "max-width" in svg


def test_a_drawing_for_a_page_names_nodes_and_edges_by_number(lab: Graph) -> None:
    root = ElementTree.fromstring(render_drawing(lab))

    names = [group.get("id", "") for group in root.iter(f"{SVG}g")]
    label = next(group for group in root.iter(f"{SVG}g") if group.get("id") == "n0").findtext(f"{SVG}text")

    assert {f"n{number}" for number in range(len(lab.elements))} <= set(names)
    assert {f"e{number}" for number in range(len(lab.links))} <= set(names)
    assert label == lab.elements[0].label
    assert root.find(f".//{SVG}title") is None


def test_a_large_graph_is_drawn_without_warnings(capfd: pytest.CaptureFixture[str]) -> None:
    many = [ShortAlgorithm(name=f"p{number}", identifies=[f"v{number}"]) for number in range(350)]

    svg = render_svg(graph_of([plan(checked_spec(many))]))

    assert "v349" in svg
    assert "Warning: graph has" not in capfd.readouterr().err
