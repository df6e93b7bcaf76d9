"""Declarations that are misspelt: told once, where they stand, and read as they were meant."""

from __future__ import annotations

import pytest

from codra_dsl.check import check
from codra_dsl.diagnostics import Applicability, Diagnostic
from codra_dsl.load import load_text
from tests.check.specs import HERE, edited, findings, marked

LAMP = """\
codra: 1
name: hall
context:
  near: {type: bool, source: main_execution, valid_for: 10 s}
  lamp: {type: enum, values: [off, dim, bright], valid_for: 10 s}
  switch_on: {type: bool, source: panel, valid_for: 10 s}
  door_shut: {type: bool, source: panel, valid_for: 10 s}
resources:
  camera: {}
agents:
  panel: {}
perception:
  look_at_lamp:
    call: hall.perception:look
    uses: {camera: read}
    returns: {light: {type: float, unit: lux}, glow: {type: enum, values: [off, dim, bright]}}
    observable_when: [near, switch_on]
    accept_when: [light > 0, light < 900 lux]
    identifies: {lamp: glow}
  look_again:
    call: hall.perception:look_again
    uses: {camera: read}
    returns: {seen: {type: bool}}
    observable_when: [near, switch_on, door_shut]
    identifies: {lamp: '"dim" if seen else "off"'}
    rank: 2
skills:
  enter: {preview: [lamp], monitor: [lamp stays "bright"]}
"""


def found_in(text: str) -> list[Diagnostic]:
    """Return the findings about a text, but those about what has no effect yet."""
    return [found for found in findings(text) if not found.code.startswith("CDR8")]


def test_the_hall_has_no_mistake() -> None:
    assert found_in(LAMP) == []


@pytest.mark.parametrize(
    ("declared", "written", "meant"),
    [
        ("  near: {", "  naer: {", "near"),
        ("  lamp: {", "  lampp: {", "lamp"),
        ("  switch_on: {", "  swich_on: {", "switch_on"),
        ("  camera: {}", "  camrea: {}", "camera"),
        ("  panel: {}", "  pannel: {}", "panel"),
        ("{light: {", "{ligth: {", "light"),
        ("lamp: {type: enum, values: [off, dim, bright]", "lamp: {type: enum, values: [of, dim, bright]", "off"),
        ("glow: {type: enum, values: [off, dim, bright]", "glow: {type: enum, values: [off, dim, brigt]", "bright"),
    ],
)
def test_a_misspelt_declaration_is_the_only_finding_and_names_its_uses(declared: str, written: str, meant: str) -> None:
    (found,) = found_in(edited((declared, written), text=LAMP))

    assert found.help == f"did you mean '{meant}'?"
    assert found.place.span.line == LAMP[: LAMP.index(declared)].count("\n") + 1
    assert len(found.related) >= 1
    assert found.fix is not None
    assert found.fix.applicability is Applicability.SUGGESTED


def test_the_message_says_how_often_the_name_is_used() -> None:
    text = edited(("  near: {", "  naer: {"), text=LAMP)
    (found,) = found_in(text)

    assert found.message == "context-variable 'naer' is used nowhere, and 'near', used 2 times, is not declared"
    assert marked(text, found) == "naer"
    assert [other.message for other in found.related] == ["in algorithm 'look_at_lamp'", "in algorithm 'look_again'"]


def test_a_name_that_is_used_once_is_taken_for_the_slip() -> None:
    text = edited(('identifies: {lamp: \'"dim" if seen', 'identifies: {lamp: \'"dim" if sen'), text=LAMP)
    (found,) = found_in(text)

    assert found.rule.name == "unknown-returned-value"
    assert (marked(text, found), found.help) == ("sen", "did you mean 'seen'?")


def test_of_two_names_that_stand_once_each_the_one_whose_words_the_spec_knows_is_right() -> None:
    text = edited(
        ("{light: {type: float, unit: lux}, ", "{ligt: {type: float, unit: lux}, "),
        ("accept_when: [light > 0, light < 900 lux]", "accept_when: [light > 0]"),
        ("call: hall.perception:look\n", "call: hall.perception:measure_light\n"),
        text=LAMP,
    )
    (found,) = found_in(text)

    assert marked(text, found) == "ligt"


def test_a_declaration_in_a_template_is_blamed_once_for_all_uses() -> None:
    template = """\
codra: 1
name: hall
templates:
  watched:
    context: {$(instance)_opn: {type: bool}}
    perception:
      look_at_$(instance):
        call: hall.perception:look
        returns: {gap: {type: float, unit: m}}
        identifies: {$(instance)_open: gap > 1 cm}
    skills:
      pass_$(instance): {preview: [$(instance)_open]}
use:
  door: {template: watched}
  gate: {template: watched}
"""
    (found,) = found_in(template)

    assert marked(template, found) == "$(instance)_opn"
    assert "'door_open', used 2 times, is not declared" in found.message


def test_what_depends_on_a_misspelt_use_is_judged_as_it_was_meant() -> None:
    """The light is compared in m, whichever way it is spelled."""
    text = edited(("accept_when: [light > 0, light < 900 lux]", "accept_when: [ligth > 0, light < 900 m]"), text=LAMP)

    assert [found.rule.name for found in found_in(text)] == ["unknown-returned-value", "mismatched-units"]


# Names that nobody can read


def test_a_variable_whose_name_nobody_can_read_may_be_what_an_unknown_name_means() -> None:
    spec, told = load_text(LAMP.replace("  near: {", "  17: {"), "spec.yaml", HERE)
    assert spec is not None

    assert [found.rule.name for found in told] == ["ill-formed-name"]
    assert [found for found in check(spec)[1] if not found.code.startswith("CDR8")] == []


def test_an_unknown_name_that_is_identified_may_be_what_nobody_identifies() -> None:
    text = LAMP.replace("identifies: {lamp:", "identifies: {unheard_of:")
    (found,) = found_in(text)

    assert found.rule.name == "unknown-variable"
    assert marked(text, found) == "unheard_of"


# Members


def test_a_comma_lost_between_members_is_told_at_their_declaration() -> None:
    text = edited(
        ("lamp: {type: enum, values: [off, dim, bright]", "lamp: {type: enum, values: [off dim, bright]"), text=LAMP
    )
    (found,) = found_in(text)

    assert found.message == "the member 'off dim' of context-variable 'lamp' is named nowhere, but its words are"
    assert (marked(text, found), found.help) == ("off dim", "write 'off, dim'")


def test_a_member_may_hold_a_blank() -> None:
    text = LAMP.replace("bright", "very bright")

    assert found_in(text) == []


def test_a_member_that_is_no_member_anywhere_is_told_where_it_is_named() -> None:
    text = edited(('lamp stays "bright"', 'lamp stays "brigt"'), text=LAMP)
    (found,) = found_in(text)

    assert (marked(text, found), found.help) == ('"brigt"', 'did you mean "bright"?')
