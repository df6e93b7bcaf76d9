"""Values of adaptations that leave the range of what they set, as far as ranges tell."""

from __future__ import annotations

import pytest

from tests.check.specs import findings

SPEC = """\
codra: 1
name: oven
context:
  heat: {{type: int, range: [0, 40], source: probe}}
  glow: {{type: float, unit: mm, range: [0, 1000], source: probe}}
  odd: {{type: int, source: probe}}
  open: {{type: bool, source: probe}}
  count: {{type: {kind}, source: adaptation}}
agents: {{probe: {{}}}}
adaptation:
  b: {{set: count, value: '{value}'}}
loops:
  round: {{adapt: [b]}}
"""


def told(value: str, kind: str = "int, range: [0, 9]") -> list[tuple[str, str]]:
    return [(each.rule.code, each.message) for each in findings(SPEC.format(value=value, kind=kind))]


def leaves(said: str) -> list[tuple[str, str]]:
    return [("CDR7128", f"adaptation 'b' can set 'count' to {said}, where its range ends")]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("3 if known(heat) else 40", "more than 9"),
        ("40", "more than 9"),
        ("-1 if open else 9", "less than 0"),
        ("heat * 2", "more than 9"),
        ("heat - 20", "less than 0 or more than 9"),
        ("max(odd, 10)", "more than 9"),
        ("heat if heat < 11 else 9", "more than 9"),
    ],
)
def test_a_value_that_can_leave_the_range_of_what_it_sets_is_found(value: str, said: str) -> None:
    assert told(value) == leaves(said)


@pytest.mark.parametrize(
    "value",
    [
        "3 if known(heat) else 4",
        "min(heat * 2, 9)",
        "heat if heat < 10 else 9",
        "heat if not heat > 9 else 0",
        "odd",  # it states no range, so nothing tells that it leaves one
        "odd + 1 if open else min(odd, 9)",
        "9 - (heat - heat)",
    ],
)
def test_a_value_that_stays_in_the_range_or_of_which_no_range_tells_is_not(value: str) -> None:
    assert told(value) == []


def test_ranges_are_compared_in_their_units() -> None:
    metres = "float, unit: m, range: [0, 0.5]"
    assert told("glow * 0.5", metres) == []
    assert told("glow", metres) == leaves("more than 0.5 m")


def test_what_has_no_range_is_left_by_nothing() -> None:
    assert told("heat * 2", "int") == []
