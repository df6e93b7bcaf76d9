"""Misspelt declarations: reported once, at their place, and read as the intended name."""

from __future__ import annotations

import pytest

from codra_dsl.language.check import check
from codra_dsl.language.diagnostics import Applicability, Diagnostic
from codra_dsl.language.load import load_text
from tests.language.check.specs import HERE, edit_spec, findings, marked_text

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


def lamp_findings(text: str) -> list[Diagnostic]:
    """Return the findings about a text, without those about keys that have no effect yet."""
    return [finding for finding in findings(text) if not finding.code.startswith("CDR8")]


def test_the_hall_has_no_mistake() -> None:
    assert lamp_findings(LAMP) == []


@pytest.mark.parametrize(
    ("declared", "written", "intended_name"),
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
def test_a_misspelt_declaration_is_the_only_finding_and_names_its_uses(
    declared: str, written: str, intended_name: str
) -> None:
    (finding,) = lamp_findings(edit_spec((declared, written), text=LAMP))

    assert finding.help == f"did you mean '{intended_name}'?"
    assert finding.place.span.line == LAMP[: LAMP.index(declared)].count("\n") + 1
    assert len(finding.related) >= 1
    assert finding.fix is not None
    assert finding.fix.applicability is Applicability.SUGGESTED


def test_the_message_has_the_number_of_uses_of_the_name() -> None:
    text = edit_spec(("  near: {", "  naer: {"), text=LAMP)
    (finding,) = lamp_findings(text)

    assert finding.message == "context-variable 'naer' is used nowhere, and 'near', used 2 times, is not declared"
    assert marked_text(text, finding) == "naer"
    assert [other.message for other in finding.related] == ["in algorithm 'look_at_lamp'", "in algorithm 'look_again'"]


def test_a_name_that_is_used_once_is_the_misspelt_one() -> None:
    text = edit_spec(('identifies: {lamp: \'"dim" if seen', 'identifies: {lamp: \'"dim" if sen'), text=LAMP)
    (finding,) = lamp_findings(text)

    assert finding.rule.name == "unknown-returned-value"
    assert (marked_text(text, finding), finding.help) == ("sen", "did you mean 'seen'?")


def test_if_two_names_occur_once_the_one_with_words_of_the_spec_is_right() -> None:
    text = edit_spec(
        ("{light: {type: float, unit: lux}, ", "{ligt: {type: float, unit: lux}, "),
        ("accept_when: [light > 0, light < 900 lux]", "accept_when: [light > 0]"),
        ("call: hall.perception:look\n", "call: hall.perception:measure_light\n"),
        text=LAMP,
    )
    (finding,) = lamp_findings(text)

    assert marked_text(text, finding) == "ligt"


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
    (finding,) = lamp_findings(template)

    assert marked_text(template, finding) == "$(instance)_opn"
    assert "'door_open', used 2 times, is not declared" in finding.message


def test_conditions_with_a_misspelt_name_are_checked_with_the_intended_name() -> None:
    """The light is compared with m, in both spellings."""
    text = edit_spec(
        ("accept_when: [light > 0, light < 900 lux]", "accept_when: [ligth > 0, light < 900 m]"), text=LAMP
    )

    assert [finding.rule.name for finding in lamp_findings(text)] == ["unknown-returned-value", "mismatched-units"]


# Unreadable names


def test_an_unknown_name_may_mean_a_variable_with_an_unreadable_name() -> None:
    spec, load_findings = load_text(LAMP.replace("  near: {", "  17: {"), "spec.yaml", HERE)
    assert spec is not None

    assert [finding.rule.name for finding in load_findings] == ["ill-formed-name"]
    assert [finding for finding in check(spec)[1] if not finding.code.startswith("CDR8")] == []


def test_an_unknown_identified_name_may_mean_the_unidentified_variable() -> None:
    text = LAMP.replace("identifies: {lamp:", "identifies: {unheard_of:")
    (finding,) = lamp_findings(text)

    assert finding.rule.name == "unknown-variable"
    assert marked_text(text, finding) == "unheard_of"


# Members


def test_a_missing_comma_between_members_is_reported_at_their_declaration() -> None:
    text = edit_spec(
        ("lamp: {type: enum, values: [off, dim, bright]", "lamp: {type: enum, values: [off dim, bright]"), text=LAMP
    )
    (finding,) = lamp_findings(text)

    assert finding.message == (
        "the member 'off dim' of context-variable 'lamp' is not used, but its words are used as members"
    )
    assert (marked_text(text, finding), finding.help) == ("off dim", "write 'off, dim'")


def test_a_member_may_contain_a_space() -> None:
    text = LAMP.replace("bright", "very bright")

    assert lamp_findings(text) == []


def test_an_unknown_member_is_reported_where_it_is_used() -> None:
    text = edit_spec(('lamp stays "bright"', 'lamp stays "brigt"'), text=LAMP)
    (finding,) = lamp_findings(text)

    assert (marked_text(text, finding), finding.help) == ('"brigt"', 'did you mean "bright"?')
