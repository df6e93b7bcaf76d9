"""Declarations and uses of names, over files, parts, templates, sites and timelines."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.compiler import lint_paths
from codra_dsl.tooling.language_server.documents import Texts
from codra_dsl.tooling.language_server.index import Cursor, SpecNames
from tests.tooling.language_server.workspace import FILES, Workspace

ROOT = Path(__file__).parents[3]


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path)


def definitions(workspace: Workspace, cursor: Cursor) -> list[str]:
    return workspace.words(cursor.index.definitions(cursor))


def references(workspace: Workspace, cursor: Cursor) -> list[str]:
    return workspace.words(cursor.index.ranges(cursor.index.symbols(cursor), workspace.project.other_files()))


@pytest.mark.parametrize("spec", ["kitchen", "lab", "store"])
def test_every_name_of_a_spec_is_found_at_its_exact_place(spec: str) -> None:
    specs: list[SpecNames] = []
    texts = Texts(ROOT, {})
    lint_paths([ROOT / f"specs/{spec}.yaml"], ROOT, inspect=lambda _, *loaded: specs.append(SpecNames(*loaded, texts)))

    for file, ranges in specs[0].ranges.items():
        text = texts.document(file).text
        for name_range in ranges:
            written = text[name_range.start : name_range.end]
            assert written == name_range.symbol.name if name_range.is_written else "$(" in written, name_range


def test_a_use_in_a_condition_leads_to_the_declaration_in_a_part(workspace: Workspace) -> None:
    assert definitions(workspace, workspace.cursor("hall.yaml", "derived: near and la")) == ["parts/lights.yaml:3 lamp"]


def test_references_are_found_in_specs_templates_and_timelines(workspace: Workspace) -> None:
    assert references(workspace, workspace.cursor("parts/lights.yaml", "  la")) == [
        "hall.timeline.yaml:6 lamp",
        "hall.yaml:7 lamp",
        "hall.yaml:21 lamp",
        "hall.yaml:34 lamp",
        "parts/lights.yaml:3 lamp",
    ]


def test_a_name_in_a_site_leads_to_its_declaration(workspace: Workspace) -> None:
    assert definitions(workspace, workspace.cursor("sites/north.yaml", "  ope")) == ["hall.yaml:8 open"]
    assert definitions(workspace, workspace.cursor("sites/north.yaml", "  fron")) == ["hall.yaml:24 front"]
    assert definitions(workspace, workspace.cursor("sites/north.yaml", "overlays: ha")) == ["hall.yaml:2 hall"]


def test_references_are_found_in_sites(workspace: Workspace) -> None:
    assert "sites/north.yaml:4 open" in references(
        workspace, workspace.cursor("hall.yaml", "changes: [near]\n"[:0] + "  ope")
    )


def test_a_name_in_a_timeline_leads_to_its_declaration(workspace: Workspace) -> None:
    assert definitions(workspace, workspace.cursor("hall.timeline.yaml", "running: [find")) == [
        "hall.yaml:27 find_door"
    ]
    assert definitions(workspace, workspace.cursor("hall.timeline.yaml", "source: find")) == ["hall.yaml:27 find_door"]


def test_a_name_that_a_template_makes_leads_into_the_template(workspace: Workspace) -> None:
    cursor = workspace.cursor("hall.yaml", "preview: [open == true, front")
    assert definitions(workspace, cursor) == ["hall.yaml:15 $(instance)_down"]


def test_the_text_of_a_template_has_the_references_of_all_its_uses(workspace: Workspace) -> None:
    assert references(workspace, workspace.cursor("hall.yaml", "      $(instance)")) == [
        "hall.timeline.yaml:9 front_down",
        "hall.yaml:15 $(instance)_down",
        "hall.yaml:22 $(instance)_down",
        "hall.yaml:39 front_down",
        "hall.yaml:39 back_down",
    ]


def test_a_template_and_an_included_file_are_found_by_name(workspace: Workspace) -> None:
    assert definitions(workspace, workspace.cursor("hall.yaml", "front: {template: shut")) == ["hall.yaml:12 shutter"]
    cursor = workspace.cursor("hall.yaml", "include: [parts/li")
    assert [name_range.file for name_range in cursor.index.definitions(cursor)] == ["parts/lights.yaml"]


def test_a_returned_value_is_another_name_than_a_variable(tmp_path: Path) -> None:
    spec = FILES["hall.yaml"].replace("angle", "near")
    workspace = Workspace(tmp_path, {**FILES, "hall.yaml": spec})

    assert definitions(workspace, workspace.cursor("hall.yaml", "open: ne")) == ["hall.yaml:31 near"]
    assert definitions(workspace, workspace.cursor("hall.yaml", "derived: ne")) == ["hall.yaml:5 near"]


def test_a_part_of_two_specs_has_the_references_of_both(tmp_path: Path) -> None:
    other = "codra: 1\nname: other\ninclude: [parts/lights.yaml]\nskills: {go: {preview: [lamp]}}\n"
    workspace = Workspace(tmp_path, {**FILES, "other.yaml": other})

    places = references(workspace, workspace.cursor("hall.yaml", "derived: near and la"))
    assert {"other.yaml:4 lamp", "hall.yaml:7 lamp", "parts/lights.yaml:3 lamp"} <= set(places)


def test_while_text_is_broken_names_outside_of_the_change_are_still_found(workspace: Workspace) -> None:
    broken = FILES["hall.yaml"].replace("resources:", "  x: {type: [bool,\nresources: ][", 1)
    workspace.edit("hall.yaml", broken)
    workspace.lint()

    assert definitions(workspace, workspace.cursor("hall.yaml", "preview: [ope")) == ["hall.yaml:8 open"]
    assert definitions(workspace, workspace.cursor("hall.yaml", "find_door:\n    call")) == []


def test_a_name_that_is_being_changed_has_no_answer_until_it_is_linted(workspace: Workspace) -> None:
    workspace.edit("hall.yaml", FILES["hall.yaml"].replace("preview: [open", "preview: [opened"))
    cursor = workspace.cursor("hall.yaml", "preview: [ope")
    assert definitions(workspace, cursor) == []

    workspace.lint()
    assert definitions(workspace, workspace.cursor("hall.yaml", "preview: [ope")) == []
    assert definitions(workspace, workspace.cursor("hall.yaml", "monitor: [ope")) == ["hall.yaml:8 open"]


def test_a_place_without_a_name_has_no_definition_and_no_references(workspace: Workspace) -> None:
    cursor = workspace.cursor("hall.yaml", "timeout: 3")
    assert (definitions(workspace, cursor), references(workspace, cursor)) == ([], [])
