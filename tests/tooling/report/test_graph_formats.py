"""The registry of graph formats: discovery, names, endings, and the page that documents them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from codra_dsl.tooling.report.graph_formats import DEFAULT_FORMAT, FORMATS, format_by_ending

PAGE = Path(__file__).parents[3] / "docs/reference/graph.md"

PROGRAM_WITH_ADDED_FOLDER = """
import sys, codra_dsl.tooling.report
codra_dsl.tooling.report.__path__.insert(0, sys.argv[1])
from codra_dsl.cli.app import app
app(["graph", "--help"])
"""


def test_formats_are_in_alphabetical_order() -> None:
    assert list(FORMATS) == ["dot", "html", "json", "mermaid", "svg"]
    assert DEFAULT_FORMAT.name == "dot"


def test_every_ending_chooses_one_format() -> None:
    endings = [ending for graph_format in FORMATS.values() for ending in graph_format.endings]

    assert len(endings) == len(set(endings)) == len(format_by_ending())
    assert all(ending.startswith(".") and ending == ending.lower() for ending in endings)


@pytest.mark.parametrize("name", FORMATS)
def test_the_page_documents_every_format_and_its_endings(name: str) -> None:
    page = PAGE.read_text("utf-8")

    assert f"| `{name}` |" in page
    assert all(f"`{ending}`" in page for ending in FORMATS[name].endings)


def test_a_new_module_is_a_new_choice_of_the_command(tmp_path: Path) -> None:
    import codra_dsl.tooling.report.graph_formats as package

    folder = tmp_path / "graph_formats"
    folder.mkdir()
    for file in Path(package.__file__).parent.glob("*.py"):
        (folder / file.name).write_text(file.read_text("utf-8"))
    (folder / "listing.py").write_text(
        "from codra_dsl.tooling.report.graph_formats import GraphFormat\n"
        "FORMAT = GraphFormat(name='listing', endings=('.lst',), render=lambda graph, picture, say: '')\n"
    )

    process = subprocess.run(
        [sys.executable, "-c", PROGRAM_WITH_ADDED_FOLDER, tmp_path], capture_output=True, text=True, check=True
    )

    assert "--format <dot|html|json|listing|mermaid|svg>" in process.stdout
