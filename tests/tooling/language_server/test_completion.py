"""Completion of keys, names, members and units, also while the text cannot be read."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.tooling.language_server.completion import completions, slot_at
from codra_dsl.tooling.language_server.documents import Document, Texts
from codra_dsl.tooling.language_server.index import Cursor, Index
from tests.tooling.language_server.workspace import FILES, Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path)


def labels(workspace: Workspace, file: str, after: str, typed: str) -> list[str]:
    """Return what can follow a text that is typed after another text, before anything is linted again."""
    workspace.edit(file, FILES[file].replace(after, after + typed, 1))
    cursor = workspace.cursor(file, after + typed)
    return [item.label for item in completions(cursor)]


@pytest.mark.parametrize(
    ("after", "typed", "expected"),
    [
        ("context:\n", "  new: {", ["type", "unit", "valid_for"]),
        ("context:\n", "  new:\n    type: bool\n    ", ["valid_for", "derived"]),
        ("context:\n", "  new: {type: ", ["bool", "enum"]),
        ("context:\n", "  new: {type: float, unit: ", ["m", "rad"]),
        ("context:\n", "  new: {derived: ne", ["near", "lamp", "known"]),
        ("  find_door:\n", "    ti", ["timeout", "call"]),
        ("  find_door:\n", "    given: [", ["near", "open"]),
        ("  find_door:\n", "    isolate: ", ["thread", "process"]),
        ("uses: {camera: read", "}\n    uses: {", ["camera"]),
        ("    observable_when:\n", "      - place == ", ['"door"', '"window"']),
        ("    observable_when:\n", '      - place in ("door", "', ["window"]),
        ("    observable_when:\n", "      - age(open) < 5 ", ["s", "min"]),
        ("      open: angle > 0.2 rad\n", "      place:\n        ", ["door", "window", "enter"]),
        ("      open: ", "", ["angle"]),
        ("front_down, back_down, ", "", ["near", "front_down"]),
        ("use:\n", "  side: {template: ", ["shutter"]),
        ("use:\n", "  side: {template: shutter, ", ["gap"]),
        ("        observable_when: [", "", ["lamp", "$(instance)_down"]),
        ("      $(instance)_down: ", "{", ["type"]),
        ("skills:\n  enter:\n", "    changes:\n      - ", ["near", "open"]),
        ("height < ", "", ["height", "$(gap)", "$(instance)"]),
        ("observable_when: [", "known(la", ["lamp"]),
        ("    observable_when:\n", "      - (place == ", ['"door"', '"window"']),
        ("use:\n", "  side: {template: shutter,\n         ", ["gap"]),
        ("open == true,", "\n              ", ["near", "front_down"]),
        ("preview: [open", " == true,\n              place == ", ['"door"', '"window"']),
    ],
)
def test_what_can_follow_is_offered(workspace: Workspace, after: str, typed: str, expected: list[str]) -> None:
    assert set(expected) <= set(labels(workspace, "hall.yaml", after, typed))


def test_timelines_have_the_members_of_enums_and_the_words_of_the_language(workspace: Workspace) -> None:
    assert {"door", "window"} <= set(labels(workspace, "hall.timeline.yaml", "lamp: true, place: ", ""))
    assert {"door", "window"} <= set(labels(workspace, "hall.timeline.yaml", "believes: {", "place: {is: "))
    assert {"stale", "any"} <= set(labels(workspace, "hall.timeline.yaml", "front_down: {unknown: ", ""))
    assert {"find_door"} <= set(labels(workspace, "hall.timeline.yaml", "is: true, source: ", ""))


def test_the_name_of_a_story_may_have_commas_and_brackets(workspace: Workspace) -> None:
    story = "  a story, (with, much) {in} it:\n    0 s:\n      believes: {"
    assert {"near", "open"} <= set(labels(workspace, "hall.timeline.yaml", "stories:\n", story))


def test_sites_and_timelines_have_the_names_of_their_spec(workspace: Workspace) -> None:
    assert {"near", "open", "lamp"} <= set(labels(workspace, "hall.timeline.yaml", "believes: {", ""))
    assert {"find_door"} <= set(labels(workspace, "hall.timeline.yaml", "running: [", ""))
    assert {"hall"} == set(labels(workspace, "sites/north.yaml", "overlays: ", ""))
    assert {"gap"} == set(labels(workspace, "sites/north.yaml", "front: {", ""))
    assert {"refresh", "valid_for"} <= set(labels(workspace, "sites/north.yaml", "open: {", ""))
    assert {"periodic"} <= set(labels(workspace, "sites/north.yaml", "open: {", "refresh: "))
    assert {"camera"} == set(labels(workspace, "sites/north.yaml", "context:\n", "resources:\n  "))
    assert {"call", "slots"} <= set(labels(workspace, "sites/north.yaml", "context:\n", "resources:\n  camera: {"))


def test_a_result_is_offered_only_to_the_conditions_of_its_algorithm(workspace: Workspace) -> None:
    assert "angle" not in labels(workspace, "hall.yaml", "identifies: {$(instance)_down: ", "")
    assert "height" not in labels(workspace, "hall.yaml", "      open: ", "")
    assert "near" not in labels(workspace, "hall.yaml", "      open: ", "")


def test_an_item_replaces_the_word_before_the_cursor(workspace: Workspace) -> None:
    cursor = workspace.cursor("hall.yaml", "preview: [op")
    item = next(item for item in completions(cursor) if item.label == "open")
    edit = item.text_edit
    assert edit is not None
    changed = workspace.texts["hall.yaml"].splitlines()[edit.range.start.line]

    assert (edit.new_text, changed[edit.range.start.character : edit.range.end.character]) == ("open", "op")


@pytest.mark.parametrize(
    ("text", "path", "is_key"),
    [
        ("context:\n  a: {type: b", ("context", "a", "type"), False),
        ("context:\n  a: {type: bool, ", ("context", "a"), True),
        ("context:\n  a: {values: [x, ", ("context", "a", "values"), False),
        ('context:\n  a: {label: "x: {", ', ("context", "a"), True),
        ("context:\n\n  # b:\n  a:\n    ty", ("context", "a"), True),
        ("skills:\n  go:\n    preview:\n    - x\n    - ", ("skills", "go", "preview"), False),
        ("adaptation:\n  a:\n    always:\n      - if: x\n        th", ("adaptation", "a", "always"), True),
        ("context:\n  a: {type: bool}\nski", (), True),
        ("use:\n  'a b': {tem", ("use", "a b"), True),
    ],
)
def test_a_place_is_found_by_indentation_and_brackets(text: str, path: tuple[str, ...], is_key: bool) -> None:
    slot = slot_at(Document(text), len(text))

    assert (slot.path, slot.is_key) == (path, is_key)


@given(st.text(alphabet="ab: -{}[],\"'#\n\r\t$()\U0001f600", max_size=40), st.integers(0, 40))
def test_any_text_has_an_answer(text: str, offset: int) -> None:
    texts = Texts(Path("/nowhere"), {"a.yaml": Document(f"context:\n  a: {text}")})
    completions(Cursor(Index((), texts), "a.yaml", min(offset, len(text))))
