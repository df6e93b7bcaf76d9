"""What a spec declares, and every place that uses a name."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.symbols import PARAMETERS, RETURNS, VALUES, Symbol, Uses, declarations
from codra_dsl.language.load import load_text
from codra_dsl.language.model import Spec
from tests.language.check.specs import DOOR

ROOT = Path(__file__).parents[3]


def loaded(text: str) -> Spec:
    spec, _ = load_text(text, "house.yaml", Path())
    assert spec is not None
    return spec


def words(text: str, symbol: Symbol) -> list[str]:
    """Return the lines of the uses of a symbol, each with the text there."""
    lines = text.splitlines()
    spans = sorted(place.span for used, place in Uses(SpecIndex(loaded(text))).all() if used == symbol)
    return [f"{span.line}: {lines[span.line - 1][span.column - 1 : span.end_column - 1]}" for span in spans]


def test_members_belong_to_a_variable_or_to_a_returned_value() -> None:
    declared = dict(declarations(loaded(DOOR)))

    assert declared[Symbol(VALUES, "ajar", "door_state")].span.line == 6
    assert declared[Symbol(VALUES, "level", "look_at_door.handle")].span.line == 32
    assert Symbol(VALUES, "level", "handle") not in declared


@pytest.mark.parametrize(
    ("expression", "places"),
    [
        ('door_state == "ajar"', ['7: "ajar"']),
        ('"ajar" != door_state', ['7: "ajar"']),
        ('door_state not in ("open", "ajar")', ['7: "ajar"']),
        ('door_state == ("ajar" if near_door else "open")', ['7: "ajar"']),
        ('(door_state else "ajar") == "open"', ['7: "ajar"']),
        ('near_door and known(door_state) and door_state == "ajar"', ['7: "ajar"']),
        ("near_door", []),
    ],
)
def test_a_text_in_a_condition_is_a_member_of_the_enum_with_which_it_is_compared(
    expression: str, places: list[str]
) -> None:
    text = DOOR.replace("  door_gap:", f"  seen: {{type: bool, derived: '{expression}'}}\n  door_gap:", 1)

    assert words(text, Symbol(VALUES, "ajar", "door_state")) == [*places, "41: ajar"]


def test_a_text_in_the_value_of_an_enum_is_a_member_of_this_enum() -> None:
    value = '"shut" if door_state == "open" else "open"'
    mood = f"  mood: {{type: enum, values: [open, shut], derived: '{value}'}}\n"
    text = DOOR.replace("  door_gap:", f"{mood}  door_gap:", 1)

    assert words(text, Symbol(VALUES, "open", "mood")) == ['7: "open"']
    assert words(text, Symbol(VALUES, "open", "door_state")) == ['7: "open"', "41: open"]


def test_a_text_in_a_condition_on_results_is_a_member_of_a_returned_value() -> None:
    assert words(DOOR, Symbol(VALUES, "level", "look_at_door.handle")) == ['42: "level"']
    assert words(DOOR, Symbol(RETURNS, "handle", "look_at_door")) == ["42: handle"]


def test_parameters_are_used_in_the_template_and_by_arguments() -> None:
    text = f"""{DOOR}templates:
  lamp:
    parameters: {{limit: quantity, kind: {{type: identifier, default: lit}}}}
    context:
      $(instance)_$(kind): {{type: bool, label: "Up to $(limit)", valid_for: $(limit)}}
use:
  hall: {{template: lamp, limit: 4 s}}
"""
    assert words(text, Symbol(PARAMETERS, "limit", "lamp")) == ["55: $(limit)", "55: $(limit)", "57: limit"]
    assert words(text, Symbol(PARAMETERS, "kind", "lamp")) == ["55: $(kind)"]


def test_the_members_of_a_course_are_actions_and_words_of_rules_are_members() -> None:
    text = (ROOT / "specs/store.yaml").read_text("utf-8")
    spec, _ = load_text(text, "specs/store.yaml", ROOT)
    assert spec is not None
    uses = Uses(SpecIndex(spec))
    lines = text.splitlines()

    assert uses.symbol(VALUES, "dock", "course") == Symbol("actions", "dock")
    empty = {lines[place.span.line - 1].strip() for used, place in uses.all() if used.name == "empty"}
    assert any("container_load is not empty" in line for line in empty)
