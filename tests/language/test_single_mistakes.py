"""Specs of three domains without a finding, and typical mistakes in them: each gives one finding.

Each line of `single_mistakes/mistakes.jsonl` is one mistake: the spec, the correct text and the wrong text, the code of
the finding, its line, the text that it underlines on that line, and the help.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.check import check
from codra_dsl.language.diagnostics import Diagnostic, Span
from codra_dsl.language.load import load_text

HERE = Path(__file__).parent / "single_mistakes"
SPECS = {path.stem: path.read_text("utf-8") for path in HERE.glob("*.yaml")}
MISTAKES = [json.loads(line) for line in (HERE / "mistakes.jsonl").read_text("utf-8").splitlines()]
NOT_YET_EFFECTIVE = "CDR81"


def findings(text: str) -> list[Diagnostic]:
    spec, diagnostics = load_text(text, "-", HERE)
    if spec is not None:
        diagnostics += check(spec)[1]
    return [finding for finding in diagnostics if not finding.rule.code.startswith(NOT_YET_EFFECTIVE)]


def marked(text: str, span: Span) -> str:
    line = text.split("\n")[span.line - 1]
    return (
        line[span.column - 1 : span.end_column - 1] if span.end_line == span.line else f"{line[span.column - 1 :]}..."
    )


VALID_CLAUSES = ("gap is close", "gap is not close", "people is very some_near", "bumped is true", "door is any")
WRONG_CLAUSES = (
    "gap < 2 m",
    "bumped",
    "not bumped",
    "gap is near",
    'door == "open"',
    "door in (open, closed)",
    "crowd is near",
    "bumped for 5 s",
    "distance(robot, dock) is close",
    "count(some person) > 0",
    "(gap else 10 m) is close",
    "gap is between 1 and 2",
)
clauses = st.tuples(st.booleans(), st.sampled_from((*VALID_CLAUSES, *WRONG_CLAUSES)))


@given(
    st.lists(clauses, min_size=1, max_size=4, unique_by=lambda clause: clause[1]), st.sampled_from((" and ", " or "))
)
@settings(max_examples=40, deadline=None)
def test_each_wrong_part_of_a_rule_gives_one_finding_and_the_others_none(
    parts: list[tuple[bool, str]], operator: str
) -> None:
    rule = operator.join(f"({clause})" if has_parentheses else clause for has_parentheses, clause in parts)
    text = SPECS["porter"].replace("if people is some_near or gap is close then low", f"if {rule} then low", 1)

    wrong_clauses = [clause for _, clause in parts if clause in WRONG_CLAUSES]
    rule_findings = [finding for finding in findings(text) if finding.rule.code in ("CDR3141", "CDR4131")]

    assert len(rule_findings) == len(wrong_clauses)
    places = sorted(marked(text, finding.place.span) for finding in rule_findings)
    assert all(any(place in clause for clause in wrong_clauses) for place in places)


@pytest.mark.parametrize(
    ("rule", "places"),
    [
        ("(people is some_near or gap < 2 m", ["(", "gap < 2 m"]),
        ("(gap < 2 m or people is some_near", ["(", "gap < 2 m"]),
        ("gap < 2 m) or people is some_near", [")", "gap < 2 m"]),
        ("((people is some_near) or gap is close", ["("]),
    ],
)
def test_an_unmatched_parenthesis_of_a_rule_is_reported_beside_other_mistakes(rule: str, places: list[str]) -> None:
    text = SPECS["porter"].replace("if people is some_near or gap is close then low", f"if {rule} then low", 1)

    rule_findings = [finding for finding in findings(text) if finding.rule.code == "CDR4131"]

    assert sorted(marked(text, finding.place.span) for finding in rule_findings) == places


def test_the_missing_unit_of_a_fallback_is_reported_with_the_distance_as_written() -> None:
    (finding,) = findings(SPECS["porter"].replace("else 50 m", "else 50"))

    assert finding.message.startswith("50 has no unit, but distance(robot, dock) is in m (")


@pytest.mark.parametrize("name", SPECS)
def test_the_specs_without_mistakes_give_no_finding(name: str) -> None:
    assert findings(SPECS[name]) == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: f"{mistake['spec']}: {mistake['instead']!r}")
def test_one_mistake_gives_one_finding_at_its_place_with_its_help(mistake: dict[str, str]) -> None:
    correct_text = SPECS[mistake["spec"]]
    assert mistake["written"] in correct_text
    text = correct_text.replace(mistake["written"], mistake["instead"], 1)

    (finding,) = findings(text)

    assert finding.rule.code == mistake["code"]
    assert finding.place.span.line == mistake["line"]
    assert marked(text, finding.place.span) == mistake["marked"]
    assert finding.help == mistake["help"]
