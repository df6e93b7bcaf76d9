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


def test_a_graph_too_large_for_mermaid_is_condensed_with_a_message(project: Path) -> None:
    names = [f"door_{number}" for number in range(300)]
    context = "".join(f"  {name}: {{type: bool, valid_for: 5 s}}\n" for name in names)
    looks = "".join(
        f"  see_{name}:\n    call: a.b:c\n    returns: {{seen: {{type: bool}}}}\n    observable_when: [door_open]\n"
        f"    identifies: {{{name}: seen}}\n"
        for name in names
    )
    spec = DOOR.replace("perception:\n", f"{context}perception:\n{looks}").split("skills:")[0]
    (project / "specs/door.yaml").write_text(spec)

    process = codra("graph", "specs", "--format", "mermaid", cwd=project)

    assert process.returncode == 0
    assert "was condensed: --select shows a part in full" in process.stderr
    assert "see_door_7<br/>3 nodes" in process.stdout
