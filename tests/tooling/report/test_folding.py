"""Folded graphs: which elements become one, under which title, and what stays."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import forests
from codra_dsl.compiler import plan_paths
from codra_dsl.generation.algorithm2 import plan
from codra_dsl.tooling.report.dot import render_svg
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.folding import MAX_SHOWN, fold
from codra_dsl.tooling.report.graphs import Element, Graph, graph_of
from codra_dsl.tooling.report.looks import FOLDED_TEXT, text_lines
from tests.language.check.checked_specs import ShortAlgorithm, checked_spec, variable

ROOT = Path(__file__).parents[3]


def graph_of_spec(name: str) -> Graph:
    return graph_of(plan_paths([ROOT / f"specs/{name}.yaml"], ROOT).plans)


@pytest.fixture(scope="module")
def lab() -> Graph:
    return graph_of_spec("lab")


def titles(graph: Graph) -> dict[str, Element]:
    return {element.label: element for element in graph.elements}


def plain_lines(element: Element) -> list[str]:
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in text_lines(element)]


def test_a_small_graph_stays_as_it_is(lab: Graph) -> None:
    part = lab.select_part({element.id for element in lab.elements[:MAX_SHOWN]})

    assert fold(part) is part


def test_an_observer_takes_in_its_algorithms_and_variables_and_skills_of_a_use_become_one(lab: Graph) -> None:
    folded = fold(lab)

    assert set(titles(folded)) == {
        *(f"centrifuge_{name}" for name in ("distance", "view_frame", "lid", "rotor")),
        *(f"pcr_cycler_{name}" for name in ("distance", "view_frame", "lid")),
        *("robot_is_localized", "centrifuge: 5 skills", "pcr_cycler: 5 skills", "3 skills"),
    }
    assert plain_lines(titles(folded)["centrifuge_lid"]) == [
        "centrifuge_lid",
        "centrifuge_open \u2264 12 s",
        "centrifuge_locked \u2264 18 s",
    ]


def test_every_element_is_in_one_box_and_every_link_between_boxes_stays(lab: Graph) -> None:
    folded = fold(lab)

    box_by_id = {member.id: box.id for box in folded.elements for member in box.members or (box,)}
    assert box_by_id.keys() == {element.id for element in lab.elements}
    ends = {(box_by_id[link.source], box_by_id[link.target], link.kind) for link in lab.links}
    assert {(link.source, link.target, link.kind) for link in folded.links} == {
        link for link in ends if link[0] != link[1]
    }
    assert len(set(folded.links)) == len(folded.links)


def test_variables_are_folded_by_their_node_and_agents_by_their_phase() -> None:
    boxes = titles(fold(graph_of_spec("store")))

    assert {title.split(":")[0] for title in boxes if ": " in title} >= {"robot", "battery", "monitor", "plan"}
    assert plain_lines(boxes["execute: 3 agents"]) == ["execute: 3 agents", "navigation", "turning", "fork"]
    (edges,) = (box for title, box in boxes.items() if title.endswith(" types of edges"))
    assert text_lines(edges)[-1] == f"and {len(edges.members) - 7} more"


def test_one_file_without_repetitions_is_folded_by_kinds() -> None:
    words = [f"{one}{other}" for one in "abcdefgh" for other in "abcdefgh"]
    looks = [ShortAlgorithm(name=f"see_{word}", identifies=[f"is_{word}"], needs=["start"]) for word in words]

    folded = fold(graph_of([plan(checked_spec(looks))]))

    assert set(titles(folded)) == {"65 variables", "64 algorithms", "64 observers"}


@pytest.mark.parametrize(("made", "owner"), [(forests.templated, "bay"), (forests.flat, "flat_*")])
def test_a_repeated_group_is_drawn_once_with_its_number(tmp_path: Path, made: object, owner: str) -> None:
    assert callable(made)
    files = made(1000)
    forests.write(files, tmp_path)
    graph = graph_of(plan_paths([tmp_path / next(iter(files))], tmp_path).plans)

    boxes = titles(fold(graph))

    assert set(boxes) == {
        *(
            f"83 \N{MULTIPLICATION SIGN} find_{name}_door_{number}"
            for number in range(10)
            for name in [pattern_of(owner)]
        ),
        *(f"{owner}: 166 variables", f"{owner}: 83 skills", "4 variables", "enter"),
    }
    assert len(graph.elements) == 2744


def pattern_of(owner: str) -> str:
    return "*" if owner == "bay" else "bay_*"


def test_uses_and_files_of_several_specs_are_boxes_with_the_numbers_of_their_nodes() -> None:
    folded = fold(graph_of(plan_paths([ROOT / "specs"], ROOT).plans))

    assert [element.label for element in folded.elements if element.spec == "lab"] == [
        "centrifuge",
        "lab",
        "pcr_cycler",
    ]
    assert text_lines(titles(folded)["centrifuge"])[1:] == ["6 variables", "4 algorithms", "3 observers", "5 skills"]


def test_boxes_with_chosen_elements_are_unfolded(lab: Graph) -> None:
    folded = fold(lab, {"lab/context/centrifuge_open"})

    names = {element.name for element in folded.elements if not element.members}
    assert names == {
        *("centrifuge_open", "centrifuge_locked", "centrifuge_lid", "localize_centrifuge_lid", "see_centrifuge_rotor"),
        "robot_is_localized",
    }


@given(counts=st.lists(st.integers(1, 40), min_size=1, max_size=8))
def test_any_graph_is_folded_to_at_most_so_many_elements(counts: list[int]) -> None:
    looks = [
        ShortAlgorithm(name=f"see_{letter}_{number}", identifies=[f"{letter}_{number}"])
        for letter, count in zip("abcdefgh", counts, strict=False)
        for number in range(count)
    ]

    assert len(fold(graph_of([plan(checked_spec(looks))])).elements) <= MAX_SHOWN


@pytest.mark.parametrize("label", ['"', "\\", "\\N", "<b>", "</b>>", "&amp;", "a\nb", "\x00", "ü戸", "]; evil [", ">"])
def test_no_label_in_a_box_can_break_out_of_it(label: str) -> None:
    names = [f"a{number}" for number in range(6)]
    looks = [ShortAlgorithm(name=f"p_{letter}", identifies=[f"{letter}{n}" for n in range(6)]) for letter in "abcdefg"]
    declared = [variable(name, label=label) for name in names]

    folded = fold(graph_of([plan(checked_spec(looks, variables=declared))]))

    shown = [text.text for text in ElementTree.fromstring(render_svg(folded)).iter() if text.tag.endswith("}text")]
    assert len(folded.elements) == 7
    assert any((visible_text(label).strip() or "a0") in (text or "") for text in shown)


def test_the_legend_explains_boxes(lab: Graph) -> None:
    assert FOLDED_TEXT in render_svg(fold(lab))
    assert FOLDED_TEXT not in render_svg(lab)
