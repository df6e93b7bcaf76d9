"""`codra graph` in real processes: selections, formats, and the errors of selectors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.tooling.report.graph_formats import FORMATS
from tests.cli.test_commands import DOOR, codra

ROOT = Path(__file__).parents[2]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/door.yaml").write_text(DOOR)
    return tmp_path


def graph(*arguments: str) -> tuple[dict[str, Any], str]:
    process = codra("graph", "specs/lab.yaml", "--format", "json", *arguments, cwd=ROOT)
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout), process.stderr


def test_a_selector_leaves_a_part_of_the_graph() -> None:
    graph_object, message = graph("--select", "1+pcr_cycler_open")

    assert [node["id"] for node in graph_object["nodes"]] == [
        "lab/context/pcr_cycler_open",
        "lab/perception/localize_pcr_cycler_lid",
    ]
    assert [edge["kind"] for edge in graph_object["edges"]] == ["identifies"]
    assert message == "2 of 43 nodes\n"


def test_several_selectors_add_up_and_exclusions_are_removed() -> None:
    graph_object, _ = graph(
        "-s", "kind:observer", "--select", "+pcr_cycler_open", "--exclude", "kind:perception *centrifuge*"
    )

    assert {node["kind"] for node in graph_object["nodes"]} == {"observer", "context"}
    assert not any("centrifuge" in node["id"] for node in graph_object["nodes"])


def test_an_empty_part_is_an_empty_graph() -> None:
    graph_object, message = graph("--select", "kind:skill,kind:observer")

    assert (graph_object, message) == ({"nodes": [], "edges": []}, "0 of 43 nodes\n")


@pytest.mark.parametrize("format_", FORMATS)
def test_an_empty_part_can_be_shown_in_every_format(project: Path, format_: str) -> None:
    process = codra("graph", "specs", "--select", "kind:skill,kind:observer", "--format", format_, cwd=project)

    assert process.returncode == 0
    assert process.stdout


@pytest.mark.parametrize(
    ("option", "selector", "message"),
    [
        (
            "--select",
            "+door_opn",
            "no node matches 'door_opn' (did you mean 'door_open'?) (column 2)\n  +door_opn\n   ^^^^^^^^",
        ),
        (
            "--exclude",
            "kind:skil",
            "there is no kind 'skil': did you mean 'skill'? (column 6)\n  kind:skil\n       ^^^^",
        ),
        (
            "--select",
            "a,,b",
            "a name is missing; a selector has no blanks around '+' and ',' (column 3)\n  a,,b\n    ^",
        ),
        ("--select", "", "the selector is empty (column 1)"),
    ],
)
def test_a_wrong_selector_is_a_usage_error(project: Path, option: str, selector: str, message: str) -> None:
    process = codra("graph", "specs", option, selector, cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert f"Error: Invalid value for {option}: {message}" in process.stderr


@pytest.mark.parametrize(
    ("name", "begins"),
    [
        ("graph.dot", "digraph codra {"),
        ("graph.gv", "digraph codra {"),
        ("graph.json", "{"),
        ("graph.mmd", "flowchart LR"),
        ("graph.mermaid", "flowchart LR"),
        ("graph.svg", "<?xml"),
        ("GRAPH.HTML", "<!doctype html>"),
        ("graph.txt", "digraph codra {"),
        ("graph", "digraph codra {"),
    ],
)
def test_the_ending_of_the_file_chooses_the_format(project: Path, name: str, begins: str) -> None:
    process = codra("graph", "specs", "--output", name, cwd=project)

    assert (process.returncode, process.stdout) == (0, "")
    assert (project / name).read_text("utf-8").startswith(begins)


def test_a_file_with_an_unknown_ending_is_not_written(project: Path) -> None:
    process = codra("graph", "specs", "--output", "graph.png", cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert "no graph format has the ending '.png'" in process.stderr
    assert not (project / "graph.png").exists()


def test_the_format_option_goes_before_the_ending(project: Path) -> None:
    codra("graph", "specs", "--output", "graph.svg", "--format", "json", cwd=project)

    assert json.loads((project / "graph.svg").read_text())["nodes"]


def test_a_variable_that_no_decision_needs_is_distinguished_from_an_unknown_name(project: Path) -> None:
    unused = "  unused: {type: bool, source: main_execution}\nperception:"
    (project / "specs/door.yaml").write_text(DOOR.replace("perception:", unused))

    process = codra("graph", "specs", "--select", "unused", cwd=project)

    assert process.returncode == 2
    assert "no node matches 'unused' in the graph: it is declared, but no decision needs it" in process.stderr


@pytest.mark.parametrize("format_", ["dot", "html", "mermaid", "svg"])
def test_a_picture_of_a_large_graph_is_folded_and_a_message_says_how_to_unfold_it(format_: str) -> None:
    process = codra("graph", "specs/lab.yaml", "--format", format_, cwd=ROOT)

    assert "5 skills" in process.stdout
    assert process.stderr.startswith(
        "43 nodes are drawn as 11: --all draws every node, --unfold NAME those of one box, "
        "--select +NAME what NAME needs\n"
    )


def test_json_always_has_every_node() -> None:
    graph_object, message = graph()

    assert (len(graph_object["nodes"]), message) == (43, "")


@pytest.mark.parametrize("format_", ["dot", "html", "mermaid", "svg"])
def test_all_draws_every_node(format_: str) -> None:
    process = codra("graph", "specs/lab.yaml", "--format", format_, "--all", cwd=ROOT)

    assert "5 skills" not in process.stdout
    assert "localize_pcr_cycler_lid" in process.stdout
    assert "nodes are drawn" not in process.stderr


def test_a_box_is_unfolded_by_the_name_of_one_of_its_nodes() -> None:
    process = codra("graph", "specs/lab.yaml", "--unfold", "see_centrifuge_rotor", cwd=ROOT)

    assert '"lab/perception/localize_centrifuge_lid"' in process.stdout
    assert '"lab/context/centrifuge_open"' in process.stdout
    assert '"lab/context/pcr_cycler_open"' not in process.stdout
    assert process.stderr.startswith("43 nodes are drawn as 15: ")


def test_a_wrong_name_of_a_box_is_a_usage_error() -> None:
    process = codra("graph", "specs/lab.yaml", "--unfold", "centrifuge_lif", cwd=ROOT)

    assert (process.returncode, process.stdout) == (2, "")
    assert (
        "Invalid value for --unfold: no node matches 'centrifuge_lif' (did you mean 'centrifuge_lid'?" in process.stderr
    )
