"""The reference of timelines, and the features that the timelines of this repository use."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from codra_dsl.integrations.testing.reading import read_timeline
from codra_dsl.integrations.testing.timeline import Belief
from codra_dsl.language.load.schema.keys_and_values import schema
from codra_dsl.runtime import Reason

TESTS = Path(__file__).parents[2]
REFERENCE = (TESTS.parent / "docs/reference/timeline.md").read_text("utf-8")
ROWS = {key for row in re.findall(r"^\| (`[^|]+`) \|", REFERENCE, re.MULTILINE) for key in re.findall(r"`(\w+)`", row)}


@pytest.mark.parametrize(
    "definition", ["timeline", "moment", "behaviour_object", "main_execution", "belief_object", "override_object"]
)
def test_the_reference_has_a_row_for_every_key(definition: str) -> None:
    assert schema()["$defs"][definition]["properties"].keys() - ROWS == set()


@pytest.mark.parametrize("definition", ["decision", "handle_maker", "speaker"])
def test_the_reference_names_every_key_without_a_table(definition: str) -> None:
    assert [key for key in schema()["$defs"][definition]["properties"] if f"{key}: " not in REFERENCE] == []


def test_the_reference_names_every_word_that_a_key_can_have() -> None:
    outcomes = schema()["$defs"]["outcomes"]["additionalProperties"]["enum"]

    assert [word for word in (*outcomes, "silent", "works", "any", "cleared") if f"`{word}`" not in REFERENCE] == []


def test_the_timelines_show_every_reason_for_which_a_variable_is_unknown() -> None:
    used_reasons: set[Reason | None] = set()
    for name in ("kitchen", "lab"):
        timeline, _, mistakes = read_timeline(TESTS / f"{name}.timeline.yaml")
        assert timeline is not None, mistakes
        checks = [check for story in timeline.stories for moment in story.moments for check in moment.checks]
        used_reasons |= {check.reason for check in checks if isinstance(check, Belief) and check.is_unknown}

    unused_reasons = {Reason.UNCONFIRMED, Reason.UNREACHABLE}
    assert {*Reason} - used_reasons == unused_reasons, "which no variable of these specs can have"
