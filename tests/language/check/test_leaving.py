"""Values of adaptations outside the range of the variable that they set, as far as ranges show."""

from __future__ import annotations

import pytest

from tests.language.check.specs import findings

SPEC = """\
codra: 1
name: oven
context:
  heat: {{type: int, range: [0, 40], source: probe, valid_for: forever}}
  glow: {{type: float, unit: mm, range: [0, 1000], source: probe, valid_for: forever}}
  odd: {{type: int, source: probe, valid_for: forever}}
  open: {{type: bool, source: probe, valid_for: forever}}
  count: {{type: {kind}, source: adaptation, valid_for: forever}}
agents: {{probe: {{}}}}
adaptation:
  b: {{set: count, value: '{value}'}}
loops:
  round: {{adapt: [b]}}
"""


def codes_and_messages(value: str, kind: str = "int, range: [0, 9]") -> list[tuple[str, str]]:
    return [(finding.rule.code, finding.message) for finding in findings(SPEC.format(value=value, kind=kind))]


def expected_findings(sides: str) -> list[tuple[str, str]]:
    return [("CDR7128", f"adaptation 'b' can set 'count' to {sides}, outside of its range")]


@pytest.mark.parametrize(
    ("value", "sides"),
    [
        ("heat * 2", "more than 9"),
        ("heat - 20", "less than 0 or more than 9"),
        ("max(odd, 10)", "more than 9"),
        ("heat if heat < 11 else 9", "more than 9"),
    ],
)
def test_a_value_outside_the_range_of_its_variable_is_reported(value: str, sides: str) -> None:
    assert codes_and_messages(value) == expected_findings(sides)


@pytest.mark.parametrize(
    ("value", "side"),
    [("3 if known(heat) else 40", "more than 9"), ("40", "more than 9"), ("-1 if open else 9", "less than 0")],
)
def test_a_constant_outside_the_range_of_its_variable_is_an_error(value: str, side: str) -> None:
    message = f"adaptation 'b' sets 'count' to {side}, outside of its range"
    assert codes_and_messages(value) == [("CDR4136", message)]


@pytest.mark.parametrize(
    "value",
    [
        "3 if known(heat) else 4",
        "min(heat * 2, 9)",
        "heat if heat < 10 else 9",
        "heat if not heat > 9 else 0",
        "odd",  # it states no range, so it is unknown whether it leaves one
        "odd + 1 if open else min(odd, 9)",
        "9 - (heat - heat)",
    ],
)
def test_a_value_inside_the_range_or_without_known_range_is_not_reported(value: str) -> None:
    assert codes_and_messages(value) == []


def test_ranges_are_compared_in_their_units() -> None:
    metres = "float, unit: m, range: [0, 0.5]"
    assert codes_and_messages("glow * 0.5", metres) == []
    assert codes_and_messages("glow", metres) == expected_findings("more than 0.5 m")


def test_a_variable_without_a_range_accepts_every_value() -> None:
    assert codes_and_messages("heat * 2", "int") == []
