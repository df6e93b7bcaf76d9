"""Changes of derived variables."""

from __future__ import annotations

import pytest

from codra_dsl.tooling.diff import Review
from tests.tooling.diff.versions import review_edits

WARD = """\
codra: 1
name: ward
agents:
  house: {}
context:
  door: {type: bool, source: house, valid_for: 10 s}
  lamp: {type: bool, source: house, valid_for: 10 s}
  ready: {type: bool, derived: door and not lamp}
  level: {type: float, unit: percent, range: [0, 200], derived: 100 percent if door else 50 percent}
skills:
  leave: {preview: [ready, level]}
"""


def messages(review: Review) -> list[str]:
    return [f"{change.element.rpartition('/')[2]}: {change.message}" for change in review.changes]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("derived: door and not lamp", "derived: not (lamp or not door)", []),
        ("derived: door and not lamp", "derived: door or not lamp", ["ready: the value is computed in another way"]),
        ("derived: door and not lamp", 'derived: "door else lamp"', ["ready: the value is computed in another way"]),
        ("50 percent}", "40 percent}", ["level: the value is computed in another way"]),
        ("derived: door and not lamp", "source: house", ["ready: it no longer follows from other variables"]),
    ],
)
def test_a_derived_variable_is_compared_by_the_meaning_of_its_expression(
    old: str, new: str, expected: list[str]
) -> None:
    assert messages(review_edits(WARD, (old, new))) == expected


def test_a_variable_that_becomes_derived_is_reported() -> None:
    edit = ("  lamp: {type: bool, source: house, valid_for: 10 s}", "  lamp: {type: bool, derived: not door}")
    assert "lamp: it follows from other variables now" in messages(review_edits(WARD, edit))
