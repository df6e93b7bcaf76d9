"""Slips of punctuation: one finding where the slip is, and the rest is read as it was meant."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import pytest

from codra_dsl.diagnostics import Applicability
from codra_dsl.expression import Node
from codra_dsl.model import Spec

from .texts import findings_of, loaded, marked, rules_of, spec_of

WHOLE = """\
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

Slip = tuple[str, str, str, str]
"""What is written, what is left of it, what the finding marks, and what is missing."""

SLIPS: dict[str, Slip] = {
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


def said(value: object) -> object:
    """What a value of the model says, without where it says so."""
    if isinstance(value, tuple):
        return tuple(map(said, value))
    if not is_dataclass(value) or isinstance(value, Node):
        return value
    told = (field.name for field in fields(value) if field.name not in ("place", "places", "letters"))
    return {name: said(getattr(value, name)) for name in told}


def elements(spec: Spec | None) -> object:
    assert spec is not None
    return said((spec.context, spec.resources, spec.perception, spec.skills))


@pytest.mark.parametrize("slip", SLIPS.values(), ids=SLIPS)
def test_a_letter_that_is_missing_is_one_finding_and_the_file_is_read_as_if_it_stood_there(slip: Slip) -> None:
    old, new, offender, _ = slip
    assert WHOLE.count(old) == 1
    spec, findings = loaded(WHOLE.replace(old, new))
    (found,) = findings

    assert found.rule.name == "yaml-syntax"
    assert found.place.span.line == WHOLE[: WHOLE.index(old)].count("\n") + 1
    assert marked(WHOLE.replace(old, new), found.place) == offender
    assert elements(spec) == elements(spec_of(WHOLE))


@pytest.mark.parametrize("slip", SLIPS.values(), ids=SLIPS)
def test_the_fix_puts_in_what_is_missing_and_a_person_decides(slip: Slip) -> None:
    old, new, _, missing = slip
    broken = WHOLE.replace(old, new)
    (found,) = findings_of(broken)
    assert found.fix is not None
    (edit,) = found.fix.edits
    lines = broken.split("\n")
    line = lines[edit.span.line - 1]
    lines[edit.span.line - 1] = line[: edit.span.column - 1] + edit.text + line[edit.span.column - 1 :]

    assert found.fix.applicability is Applicability.SUGGESTED
    assert edit.text == missing
    assert findings_of("\n".join(lines)) == ()


def test_what_stands_after_a_letter_that_is_missing_keeps_its_place() -> None:
    text = WHOLE.replace("door_open: {type: bool, label", "door_open {type: bol, label").replace("slots: 1", "slots: x")
    missing, type_, slots = findings_of(text)

    assert missing.rule.name == "yaml-syntax"
    assert marked(text, type_.place) == "bol"
    assert marked(text, slots.place) == "x"


def test_several_slips_are_as_many_findings() -> None:
    text = WHOLE.replace("door_open: {", "door_open {").replace("vision: {", "vision {").replace("look:", "look")

    assert [found.place.span.line for found in findings_of(text)] == [4, 7, 9]


def test_a_brace_that_may_end_at_several_places_is_told_where_it_opens_and_nothing_is_guessed() -> None:
    text = WHOLE.replace("returns: {angle: {type: float, unit: rad}}", "returns: {angle: {type: float, unit: rad}")
    (found,) = findings_of(text)

    assert marked(text, found.place) == "{"
    assert found.place.span.line == 12
    assert found.fix is None


def test_a_missing_comma_at_the_end_of_a_line_is_no_bracket_that_is_never_closed() -> None:
    text = "codra: 1\nname: kitchen\ncontext: {a: {type: bool}\n  b: {type: bool}}\n"

    assert [found.place.span.line for found in findings_of(text)] == [4]


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
def test_a_key_that_nobody_knows_is_one_finding_and_what_it_may_have_said_is_not_missed(old: str, new: str) -> None:
    assert len(findings_of(WHOLE.replace(old, new, 1))) == 1


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
def test_what_yaml_does_to_a_condition_is_still_told_as_that(condition: str, rule: str) -> None:
    text = WHOLE.replace("\n      door_open: angle > 0.5 rad", f" {condition}")

    assert rules_of(text)[0] == rule


def test_a_colon_in_a_text_asks_for_quotes_not_for_a_comma() -> None:
    assert rules_of(WHOLE.replace('label: "Door"', "label: The door: front")) == ["torn-at-colon"]


def test_an_item_that_is_empty_is_told_at_its_dash() -> None:
    text = WHOLE.replace('- lamp == "lit"', "-")
    (found,) = findings_of(text)

    assert (found.place.span.line, marked(text, found.place)) == (14, "-")
