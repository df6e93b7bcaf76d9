"""Renaming changes every occurrence, and is refused where a name cannot be changed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from codra_dsl.tooling.language_server.index import Cursor
from codra_dsl.tooling.language_server.renaming import RefusedError, rename
from tests.tooling.language_server.workspace import FILES, Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path)


def renamed(workspace: Workspace, cursor: Cursor, new_name: str) -> dict[str, str]:
    """Return the texts that a renaming changes."""
    texts: dict[str, str] = {}
    for edit in reversed(rename(workspace.project, cursor, new_name)):
        span = edit.span
        text = texts.get(span.file, workspace.texts[span.file])
        start, end = cursor.index.texts.document(span.file).offsets_of(span)
        texts[span.file] = text[:start] + edit.text + text[end:]
    return texts


@pytest.mark.parametrize(
    ("file", "before", "old"),
    [
        ("parts/lights.yaml", "  la", "lamp"),
        ("hall.yaml", "      - ne", "near"),
        ("hall.yaml", "derived: ne", "near"),
        ("hall.yaml", "monitor: [op", "open"),
        ("hall.yaml", "identifies:\n      op", "open"),
        ("sites/north.yaml", "  op", "open"),
        ("hall.timeline.yaml", "running: [fi", "find_door"),
        ("hall.yaml", "uses: {cam", "camera"),
        ("hall.yaml", "open: an", "angle"),
        ("hall.yaml", "template: sh", "shutter"),
        ("hall.yaml", "skills:\n  en", "enter"),
    ],
)
def test_a_new_name_replaces_every_occurrence(workspace: Workspace, file: str, before: str, old: str) -> None:
    texts = renamed(workspace, workspace.cursor(file, before), "fresh_name")
    for name, text in texts.items():
        workspace.edit(name, text)

    assert workspace.lint() == []
    assert not [
        name
        for name, text in workspace.texts.items()
        if re.search(rf"(?<![\w.])(?<!: ){old}\b(?!_)", text.replace(":find_door", ""))
    ]


def test_other_names_with_the_same_letters_stay(workspace: Workspace) -> None:
    texts = renamed(workspace, workspace.cursor("hall.yaml", "  open"), "is_open")

    assert texts["hall.yaml"] == FILES["hall.yaml"].replace("open:", "is_open:").replace(
        "open ==", "is_open =="
    ).replace("open stays", "is_open stays")
    assert texts["sites/north.yaml"] == FILES["sites/north.yaml"].replace("open:", "is_open:")
    timeline = FILES["hall.timeline.yaml"].replace("open]", "is_open]").replace("{open:", "{is_open:")
    assert texts["hall.timeline.yaml"] == timeline


def test_quotes_and_letters_beside_a_name_stay(tmp_path: Path) -> None:
    spec = FILES["hall.yaml"].replace("preview: [open == true,", "preview: ['open == true', \"open\",")
    spec = spec.replace("changes: [near]", 'changes: ["near"]  # \U0001f600 near')
    workspace = Workspace(tmp_path, {**FILES, "hall.yaml": spec})

    texts = renamed(workspace, workspace.cursor("hall.yaml", "derived: ne"), "close_by")
    assert 'changes: ["close_by"]  # \U0001f600 near' in texts["hall.yaml"]
    assert '"is_open"' in renamed(workspace, workspace.cursor("hall.yaml", "  open"), "is_open")["hall.yaml"]


@pytest.mark.parametrize(
    ("before", "new_name", "reason"),
    [
        ("      $(instance)", "shut", "a template makes back_down and front_down from '$(instance)_down'"),
        ("preview: [open == true, front", "shut", "'front_down' is made from '$(instance)_down' at hall.yaml:15"),
        ("  near", "open", "'open' is taken: see hall.yaml:8"),
        ("  near", "Lamp", "'lamp' is taken: see parts/lights.yaml:3"),
        ("  near", "if", "'if' is reserved"),
        ("  near", "known", "'known' is reserved"),
        ("  near", "a-b", "'a-b' is not a name: use letters A to Z, digits and '_', a letter first"),
        ("  near", "", "'' is not a name: use letters A to Z, digits and '_', a letter first"),
        ("  fron", "near", "'near' would cause"),
        ("name: ha", "room", "the name of a spec is also the name of its generated package, which programs import"),
        ("timeout: 3", "x", "there is no name here, or the text around it cannot be read at the moment"),
    ],
)
def test_a_name_is_not_changed_without_stating_the_reason(
    workspace: Workspace, before: str, new_name: str, reason: str
) -> None:
    with pytest.raises(RefusedError) as refusal:
        rename(workspace.project, workspace.cursor("hall.yaml", before), new_name)
    assert str(refusal.value).startswith(reason)


def test_a_name_is_not_changed_while_a_text_that_uses_it_is_broken(workspace: Workspace) -> None:
    workspace.edit("parts/lights.yaml", FILES["parts/lights.yaml"] + "  x: [}\n  y: {type: bool\n")
    workspace.lint()

    with pytest.raises(RefusedError, match="cannot be read at the moment"):
        rename(workspace.project, workspace.cursor("hall.yaml", "derived: near and la"), "sun")


def test_a_name_is_not_changed_while_an_element_has_a_mistake_that_may_hide_a_use(workspace: Workspace) -> None:
    workspace.edit("hall.yaml", FILES["hall.yaml"].replace("  enter:", "  pass:"))
    workspace.lint()

    with pytest.raises(RefusedError, match="skill 'pass' cannot be read at the moment"):
        rename(workspace.project, workspace.cursor("hall.yaml", "derived: ne"), "close_by")


@pytest.mark.parametrize("word", ["main_execution", "observer", "operator"])
def test_the_writers_of_the_language_keep_their_names_and_no_agent_gets_one(tmp_path: Path, word: str) -> None:
    spec = FILES["hall.yaml"].replace("source: main_execution, valid_for: 20 s", "source: [house, main_execution]")
    workspace = Workspace(tmp_path, {**FILES, "hall.yaml": f"{spec}agents: {{house: {{}}}}\n"})

    with pytest.raises(RefusedError, match="'main_execution' is a word of the language"):
        rename(workspace.project, workspace.cursor("hall.yaml", "source: [house, main"), "planner")
    with pytest.raises(RefusedError, match=f"'{word}' would cause"):
        rename(workspace.project, workspace.cursor("hall.yaml", "agents: {ho"), word)


def test_a_change_of_case_is_a_new_name(workspace: Workspace) -> None:
    assert "Near: {" in renamed(workspace, workspace.cursor("hall.yaml", "  ne"), "Near")["hall.yaml"]
