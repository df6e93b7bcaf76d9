"""Missing punctuation: one finding at its place, and the rest is read as intended."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Applicability
from codra_dsl.language.expression import Node
from codra_dsl.language.model import Spec

from .texts import findings_of, loaded, marked, rules_of, spec_of

SPEC = """\
codra: 1
name: house
context:
  door_open: {type: bool, label: "Door", valid_for: 5 s}
  lamp: {type: enum, values: [lit, dark], source: main_execution}
resources:
  vision: {slots: 1}
perception:
  look:
    call: house.perception:look
    uses: {vision: slot}
    returns: {angle: {type: float, unit: rad}}
    observable_when:
      - lamp == "lit"
    identifies:
      door_open: angle > 0.5 rad
skills:
  enter: {preview: [door_open, lamp]}
"""

CLOSING = {"[": "]", "{": "}"}

Mistake = tuple[str, str, str, str]
"""The original text, the damaged text, the text that the finding marks, and the missing text."""

MISTAKES: dict[str, Mistake] = {
    "a ':' before a brace": ("door_open: {", "door_open {", "door_open", ":"),
    "a ':' before a brace, one entry in it": ("vision: {", "vision {", "vision", ":"),
    "a ':' between key and value in braces": ("{type: bool, label", "{type bool, label", "type", ":"),
    "a ':' before a brace in braces": ("returns: {angle: {", "returns: {angle {", "angle", ":"),
    "a ':' before a bracket in braces": ("values: [", "values [", "values", ":"),
    "a ':' that ends a line before a list": ("observable_when:", "observable_when", "observable_when", ":"),
    "a ':' that ends a line before a mapping": ("  look:", "  look", "look", ":"),
    "a ':' after the first key": ("codra: 1", "codra 1", "codra", ":"),
    "a ':' before a value on the line": ("call: house", "call house", "call", ":"),
    "a ',' between entries": ("{type: bool, label", "{type: bool label", "label", ","),
    "a ',' after a quoted value": ('"Door", valid', '"Door" valid', "valid_for", ","),
    "a ',' after a list": ("[lit, dark], source", "[lit, dark] source", "source", ","),
    "a '{' after a key": ("vision: {slots", "vision: slots", "slots", "{"),
    "a '{' after a key, several entries": ("lamp: {type", "lamp: type", "type", "{"),
    "a '}' at the end of a line": ("{slots: 1}", "{slots: 1", "{", "}"),
    "a '}' after a list": ("source: main_execution}", "source: main_execution", "{", "}"),
}


def content(value: object) -> object:
    """Return the content of a value of the model, without places."""
    if isinstance(value, tuple):
        return tuple(map(content, value))
    if not is_dataclass(value) or isinstance(value, Node):
        return value
    names = (field.name for field in fields(value) if field.name not in ("place", "places", "letters"))
    return {name: content(getattr(value, name)) for name in names}


def elements(spec: Spec | None) -> object:
    assert spec is not None
    return content((spec.context, spec.resources, spec.perception, spec.skills))


@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES)
def test_a_missing_letter_is_one_finding_and_the_file_is_read_as_if_it_were_there(mistake: Mistake) -> None:
    old, new, marked_text, _ = mistake
    assert SPEC.count(old) == 1
    spec, findings = loaded(SPEC.replace(old, new))
    (finding,) = findings

    assert finding.rule.name == "yaml-syntax"
    assert finding.place.span.line == SPEC[: SPEC.index(old)].count("\n") + 1
    assert marked(SPEC.replace(old, new), finding.place) == marked_text
    assert elements(spec) == elements(spec_of(SPEC))


@pytest.mark.parametrize("mistake", MISTAKES.values(), ids=MISTAKES)
def test_the_fix_inserts_the_missing_letter_and_is_only_suggested(mistake: Mistake) -> None:
    old, new, _, missing = mistake
    damaged_text = SPEC.replace(old, new)
    (finding,) = findings_of(damaged_text)
    assert finding.fix is not None
    (edit,) = finding.fix.edits
    lines = damaged_text.split("\n")
    line = lines[edit.span.line - 1]
    lines[edit.span.line - 1] = line[: edit.span.column - 1] + edit.text + line[edit.span.column - 1 :]

    assert finding.fix.applicability is Applicability.SUGGESTED
    assert edit.text == missing
    assert findings_of("\n".join(lines)) == ()


def test_text_after_a_missing_letter_keeps_its_place() -> None:
    text = SPEC.replace("door_open: {type: bool, label", "door_open {type: bol, label").replace("slots: 1", "slots: x")
    missing, type_, slots = findings_of(text)

    assert missing.rule.name == "yaml-syntax"
    assert marked(text, type_.place) == "bol"
    assert marked(text, slots.place) == "x"


def test_several_mistakes_give_several_findings() -> None:
    text = SPEC.replace("door_open: {", "door_open {").replace("vision: {", "vision {").replace("look:", "look")

    assert [finding.place.span.line for finding in findings_of(text)] == [4, 7, 9]


def test_a_brace_that_may_end_at_several_places_is_reported_where_it_opens_without_a_fix() -> None:
    text = SPEC.replace("returns: {angle: {type: float, unit: rad}}", "returns: {angle: {type: float, unit: rad}")
    (finding,) = findings_of(text)

    assert marked(text, finding.place) == "{"
    assert finding.place.span.line == 12
    assert finding.fix is None


def test_a_missing_comma_at_the_end_of_a_line_is_not_reported_as_an_unclosed_bracket() -> None:
    text = "codra: 1\nname: kitchen\ncontext: {a: {type: bool}\n  b: {type: bool}}\n"

    assert [finding.place.span.line for finding in findings_of(text)] == [4]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("{type: bool, label", "{: bool, label"),
        ('label: "Door"', ': "Door"'),
        ("valid_for: 5 s", ": 5 s"),
        ("  door_open: {", "  : {"),
        ("vision: slot", ": slot"),
        ("angle: {", ": {"),
        ("    uses: {", "    : {"),
        ("perception:", ":"),
        ("  look:", "  :"),
        ("      door_open: angle", "      : angle"),
        ("codra: 1", ": 1"),
        ("name: house", ": house"),
        ("{type: bool, label", "{[]: bool, label"),
        ("    uses: {", "    []: {"),
        ("perception:", "[]:"),
    ],
)
def test_a_missing_or_unreadable_key_is_one_finding(old: str, new: str) -> None:
    assert len(findings_of(SPEC.replace(old, new, 1))) == 1


@pytest.mark.parametrize(
    ("condition", "rule"),
    [
        ("{door_open: angle: 3}", "torn-at-colon"),
        ("{door_open: max(angle, 3) > 1 rad}", "torn-at-comma"),
        ('{door_open: "a" if angle > 1 rad else "b"}', "read-as-quoted"),
        ("{door_open: !angle}", "read-as-tag"),
        ("{door_open: angle > 1 rad # and so on}", "cut-off-by-comment"),
    ],
)
def test_traps_for_conditions_are_still_reported_as_traps(condition: str, rule: str) -> None:
    text = SPEC.replace("\n      door_open: angle > 0.5 rad", f" {condition}")

    assert rules_of(text)[0] == rule


def test_a_colon_in_a_text_needs_quotes_not_a_comma() -> None:
    assert rules_of(SPEC.replace('label: "Door"', "label: The door: front")) == ["torn-at-colon"]


def test_a_blank_after_the_colon_of_a_function_is_reported_with_the_function_to_write() -> None:
    text = SPEC.replace("house.perception:look", "house.perception: look")
    (finding,) = findings_of(text)

    assert (finding.rule.name, marked(text, finding.place)) == ("torn-at-colon", "house.perception: look")
    assert finding.help == "write house.perception:look, without a blank"


def test_a_bracket_that_is_not_closed_on_a_later_line_is_reported_where_it_opens() -> None:
    text = SPEC.replace("[door_open, lamp]}", "[door_open,\n    lamp")
    finding = next(finding for finding in findings_of(text) if "never closed" in finding.message)

    assert (finding.message, marked(text, finding.place)) == ("the '[' here is never closed", "[")


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("skills: {", 9),
        ("skills: [\n", 9),
        ("skills: {enter: {", 17),
        ("skills: {enter: [1, {a: 2}", 17),
        ("skills: {enter: [1, {a: 2}]", 9),
        ("skills: {enter: [1, {a: 2}], ", 9),
        ("skills: {a: '}', b: [", 21),
        ("skills: {a: [1,  # ]\n", 13),
    ],
)
def test_at_the_end_of_a_file_the_innermost_open_bracket_is_reported(text: str, column: int) -> None:
    bracket = text[column - 1]
    (finding,) = [finding for finding in findings_of(text) if "never closed" in finding.message]

    assert (finding.place.span.line, finding.place.span.column) == (1, column)
    assert finding.message == f"the '{bracket}' here is never closed"
    assert finding.help == f"add '{CLOSING[bracket]}' where it ends"


@given(st.lists(st.sampled_from(("[", "{", "close", "word", '"]"', "'}'")), max_size=30))
def test_in_any_nesting_the_innermost_open_bracket_is_reported(steps: list[str]) -> None:
    text, open_brackets = "skills: [", [8]
    for number, step in enumerate(steps):
        if step == "close":
            text += f"{CLOSING[text[open_brackets.pop()]]}, " if len(open_brackets) > 1 else ""
            continue
        text += f"k{number}: " if text[open_brackets[-1]] == "{" else ""
        open_brackets += [len(text)] if step in CLOSING else []
        text += step if step in CLOSING else f"{step}, "
    (finding,) = [finding for finding in findings_of(text) if "never closed" in finding.message]

    assert finding.place.span.column == open_brackets[-1] + 1


def test_an_empty_item_is_reported_at_its_dash() -> None:
    text = SPEC.replace('- lamp == "lit"', "-")
    (finding,) = findings_of(text)

    assert (finding.place.span.line, marked(text, finding.place)) == (14, "-")


def test_a_dash_before_a_colon_is_a_key_and_not_an_item_without_a_key() -> None:
    text = SPEC.replace("    identifies:\n      door_open: angle > 0.5 rad\n", "    identifies: -:\n")
    (finding,) = findings_of(text)

    assert finding.code == "CDR1022"
    assert finding.message == "YAML reads '-:' as a key and its value, not as a mapping"
