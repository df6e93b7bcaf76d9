"""Specs of three domains without a finding, and mistakes that people make in them: each gives one finding.

`single_mistakes/mistakes.jsonl` has a mistake a line: what is written in which spec and what instead, the code of the
finding, its line, the text that it underlines on that line, and the way out.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from codra_dsl.check import check
from codra_dsl.diagnostics import Diagnostic, Span
from codra_dsl.load import load_text

HERE = Path(__file__).parent / "single_mistakes"
SPECS = {path.stem: path.read_text("utf-8") for path in HERE.glob("*.yaml")}
MISTAKES = [json.loads(line) for line in (HERE / "mistakes.jsonl").read_text("utf-8").splitlines()]
NOT_YET_EFFECTIVE = "CDR81"


def findings(text: str) -> list[Diagnostic]:
    spec, found = load_text(text, "-", HERE)
    if spec is not None:
        found += check(spec)[1]
    return [each for each in found if not each.rule.code.startswith(NOT_YET_EFFECTIVE)]


def marked(text: str, span: Span) -> str:
    line = text.split("\n")[span.line - 1]
    return (
        line[span.column - 1 : span.end_column - 1] if span.end_line == span.line else f"{line[span.column - 1 :]}..."
    )


@pytest.mark.parametrize("name", SPECS)
def test_the_specs_without_mistakes_give_no_finding(name: str) -> None:
    assert findings(SPECS[name]) == []


@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: f"{mistake['spec']}: {mistake['instead']!r}")
def test_one_mistake_gives_one_finding_at_its_place_with_the_way_out(mistake: dict[str, str]) -> None:
    whole = SPECS[mistake["spec"]]
    assert mistake["written"] in whole
    text = whole.replace(mistake["written"], mistake["instead"], 1)

    (found,) = findings(text)

    assert found.rule.code == mistake["code"]
    assert found.place.span.line == mistake["line"]
    assert marked(text, found.place.span) == mistake["marked"]
    assert found.help == mistake["help"]
