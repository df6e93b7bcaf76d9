"""The findings of open documents are those of `codra lint` on the same texts."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.compiler import lint_paths
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.tooling.language_server.documents import Document
from codra_dsl.tooling.language_server.projects import OutdatedError, Project
from tests.tooling.language_server.workspace import FILES, Workspace

EDITED_FILES = ("hall.yaml", "parts/lights.yaml", "sites/north.yaml")
SNIPPETS = (
    "",
    "\n",
    "  ",
    "{",
    "]",
    ": ",
    "'",
    "# codra: ignore\n",
    "name: lights\n",
    "lamp",
    "\t",
    "\r\n",
    "\U0001f600",
)

_edits = st.tuples(
    st.sampled_from(EDITED_FILES), st.floats(0, 1), st.integers(0, 12), st.sampled_from(SNIPPETS), st.booleans()
)


def linted(files: dict[str, str]) -> list[Diagnostic]:
    """Return the findings of a project that has these texts on disk."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "project"  # a finding about a folder without a spec has the name of the folder
        for file, text in files.items():
            (root / file).parent.mkdir(parents=True, exist_ok=True)
            (root / file).write_bytes(text.encode())
        return sorted(lint_paths([root], root).diagnostics, key=repr)


@settings(max_examples=15)
@given(st.lists(_edits, min_size=1, max_size=4))
def test_after_every_edit_the_findings_are_those_of_lint(edits: list[tuple[str, float, int, str, bool]]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace(Path(folder) / "project")
        for file, where, length, snippet, is_restored in edits:
            text = FILES[file] if is_restored else workspace.texts[file]
            start = int(where * len(text))
            workspace.edit(file, text[:start] + snippet + text[start + length :])
            workspace.lint()

            assert sorted(workspace.project.checked.diagnostics, key=repr) == linted(workspace.texts)


def test_a_comment_in_unsaved_text_silences_a_finding(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.edit("hall.yaml", FILES["hall.yaml"].replace("  camera: {}", "  camera: {}\n  radio: {}"))
    assert workspace.lint() == ["CDR7111"]

    workspace.edit(
        "hall.yaml", workspace.texts["hall.yaml"].replace("radio: {}", "radio: {}  # codra: ignore[CDR7111] later")
    )
    assert workspace.lint() == []


def test_findings_about_other_files_are_included(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.edit("parts/lights.yaml", FILES["parts/lights.yaml"].replace("lamp", "sun"))
    workspace.lint()

    assert {"hall.yaml", "parts/lights.yaml"} <= workspace.project.checked.findings.keys()
    assert {finding.place.span.file for finding in workspace.project.checked.diagnostics} == {"hall.yaml"}


def test_a_document_that_was_never_saved_is_linted(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.edit("new.yaml", "codra: 1\nname: new\ncontext: {x: {}}\n")

    assert workspace.lint() != []
    assert {finding.place.span.file for finding in workspace.project.checked.diagnostics} == {"new.yaml"}


def test_unsaved_text_that_names_a_part_makes_it_a_spec(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.edit("parts/lights.yaml", f"name: lights\n{FILES['parts/lights.yaml']}")

    workspace.lint()
    assert [names.spec.name for names in workspace.project.checked.specs if names.spec.site is None] == [
        "hall",
        "lights",
    ]


def test_outside_of_projects_only_the_document_is_linted_and_only_if_it_is_a_spec(tmp_path: Path) -> None:
    (tmp_path / "other.yaml").write_text("codra: 1\nname: [\n")
    known: dict[Path, Project] = {}
    spec, foreign = Project.of(tmp_path / "a.yaml", known), Project.of(tmp_path / "compose.yaml", known)

    checked = spec.lint({"a.yaml": Document("codra: 1\nname: a\nskills: {go: {preview: [x]}}\n")})
    assert [finding.code for finding in checked.diagnostics] == ["CDR3101"]
    assert foreign.lint({"compose.yaml": Document("services: {web: {}}\n")}).diagnostics == ()
    assert [finding.code for finding in spec.lint({"a.yaml": Document("")}).diagnostics] == ["CDR2001"]


def test_linting_ends_early_if_its_result_is_outdated(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    workspace.edit("hall.yaml", "codra: 1\nname: hall\n")

    with pytest.raises(OutdatedError):
        workspace.project.lint(workspace.documents, lambda: True)


def test_a_deleted_spec_has_no_names_any_more(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    (tmp_path / "hall.yaml").unlink()
    workspace.lint()

    assert workspace.project.checked.specs == ()


def test_projects_are_found_by_their_settings(tmp_path: Path) -> None:
    Workspace(tmp_path)
    known: dict[Path, Project] = {}

    project = Project.of(tmp_path / "hall.yaml", known)
    assert project is Project.of(tmp_path / "parts/lights.yaml", known)
    assert project.file_of(tmp_path / "parts/lights.yaml") == "parts/lights.yaml"
