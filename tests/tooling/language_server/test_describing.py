"""Descriptions of names, the symbols of a file, and the colours of conditions."""

from __future__ import annotations

from pathlib import Path

import pytest
from lsprotocol import types

from codra_dsl.tooling.language_server.describing import TOKEN_TYPES, hover, semantic_tokens, symbols
from tests.tooling.language_server.workspace import FILES, Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path)


def description(workspace: Workspace, before: str) -> str:
    shown = hover(workspace.cursor("hall.yaml", before))
    assert shown is not None
    assert isinstance(shown.contents, types.MarkupContent)
    return shown.contents.value


def test_a_variable_is_described_with_its_observer_and_the_reasons_why_it_can_be_unknown(workspace: Workspace) -> None:
    assert description(workspace, "preview: [op").splitlines() == [
        "context-variable `open`: bool",
        "",
        '- identified by algorithm `find_door`, when `near and place == "door"` and `lamp`',
        "- unknown until it is identified for the first time; when its evidence is older than 60 s;"
        " as soon as a precondition fails or a result is rejected",
        "- known at most 3 s after its declaration",
    ]


def test_a_variable_that_is_written_is_described_with_its_writers(workspace: Workspace) -> None:
    assert description(workspace, "      - ne").splitlines() == [
        "context-variable `near`: bool",
        "",
        "- written by `main_execution`",
        "- unknown until it is written for the first time; when its evidence is older than 20 s;"
        " after `enter` has changed it",
    ]


def test_a_derived_variable_is_described_with_its_expression(workspace: Workspace) -> None:
    text = description(workspace, "  bo")
    assert "- derived: `near and lamp`" in text
    assert "- unknown while `near`, `lamp` is unknown and decides the value" in text


def test_a_value_that_loops_compute_is_described_with_its_input(tmp_path: Path) -> None:
    spec = FILES["hall.yaml"].replace("  open: {", "  near_for: {type: bool, held: near, for: 5 s}\n  open: {", 1)
    shown = hover(Workspace(tmp_path, {**FILES, "hall.yaml": spec}).cursor("hall.yaml", "  near_f"))

    assert shown is not None
    assert isinstance(shown.contents, types.MarkupContent)
    assert shown.contents.value.splitlines()[2:] == [
        "- computed by loops: `held: near, for: 5 s`",
        "- unknown until it is computed for the first time",
    ]


def test_a_returned_value_and_an_algorithm_are_described(workspace: Workspace) -> None:
    assert description(workspace, "open: an") == (
        "`angle`: float in rad from 0 to 2\n\nreturned by algorithm `find_door`"
    )
    assert description(workspace, "  find") == "algorithm `find_door`"


def test_the_text_of_a_template_is_described_for_each_use(workspace: Workspace) -> None:
    text = description(workspace, "      $(inst")
    assert [line for line in text.splitlines() if line.startswith("context-variable")] == [
        "context-variable `front_down`: bool",
        "context-variable `back_down`: bool",
    ]


def test_other_texts_are_not_described(workspace: Workspace) -> None:
    assert hover(workspace.cursor("hall.yaml", "timeout: 3")) is None


def test_the_symbols_of_a_file_are_its_declarations(workspace: Workspace) -> None:
    outline = symbols(workspace.cursor("hall.yaml", ""))

    assert [(symbol.name, symbol.detail) for symbol in outline] == [
        ("near", "context"),
        ("place", "context"),
        ("both", "context"),
        ("open", "context"),
        ("camera", "resources"),
        ("shutter", "templates"),
        ("$(instance)_down", "context"),
        ("see_$(instance)", "perception"),
        ("front", "use"),
        ("back", "use"),
        ("find_door", "perception"),
        ("enter", "skills"),
    ]
    algorithm = outline[-2]
    assert (algorithm.range.start.line, algorithm.range.end.line) == (26, 35)


def colours(workspace: Workspace, file: str) -> list[tuple[str, str]]:
    lines = workspace.texts[file].split("\n")
    words = []
    line = column = 0
    numbers = iter(semantic_tokens(workspace.cursor(file, "")).data)
    for line_step, column_step, length, kind, _ in zip(*[numbers] * 5, strict=True):
        line, column = line + line_step, column_step + (0 if line_step else column)
        words.append((lines[line][column : column + length], TOKEN_TYPES[kind]))
    return words


def test_the_words_of_conditions_have_types(workspace: Workspace) -> None:
    assert colours(workspace, "hall.yaml") == [
        *(("near", "variable"), ("and", "keyword"), ("lamp", "variable")),
        ("lamp", "variable"),
        *(("height", "parameter"), ("<", "operator"), ("$(gap)", "number")),
        *(("near", "variable"), ("and", "keyword"), ("place", "variable"), ("==", "operator"), ('"door"', "string")),
        ("lamp", "variable"),
        *(("angle", "parameter"), (">", "operator"), ("0.2 rad", "number")),
        *(("open", "variable"), ("==", "operator"), ("true", "keyword")),
        *(("open", "variable"), ("true", "keyword")),
    ]


def test_words_after_a_change_move_with_the_text(workspace: Workspace) -> None:
    before = colours(workspace, "hall.yaml")
    workspace.edit("hall.yaml", FILES["hall.yaml"].replace("resources:", "resources: [\n\U0001f600", 1))

    assert colours(workspace, "hall.yaml") == before
