"""Seeded defects of context quality are reported at their place, and clean specs have no findings.

The specs were written from `docs/reference/context-quality.md` alone, before the rules first ran on them.
`python -m tests.language.check.test_quality_corpus` prints precision and recall of each rule.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.language.diagnostics import Diagnostic

CORPUS = Path(__file__).parent / "quality_corpus"
EXPECT = re.compile(r"# expect: (?P<code>CDR\d{4}) (?P<first>\d+)(?:-(?P<last>\d+))?$")


@dataclass(frozen=True)
class Defect:
    """A spec with one seeded defect, and its lines."""

    path: Path
    code: str
    first: int
    last: int


def defects() -> list[Defect]:
    """Return the seeded defects."""
    seeded_defects = []
    for path in sorted((CORPUS / "defects").glob("*.yaml")):
        match = EXPECT.match(path.read_text("utf-8").splitlines()[0])
        assert match is not None, path
        seeded_defects.append(Defect(path, match["code"], int(match["first"]), int(match["last"] or match["first"])))
    return seeded_defects


def clean_specs() -> list[Path]:
    """Return the specs without a defect."""
    return sorted((CORPUS / "clean").glob("*.yaml"))


def findings(path: Path) -> list[Diagnostic]:
    """Return the findings about a spec."""
    return list(plan_paths([path], path.parent).diagnostics)


@pytest.mark.parametrize("defect", defects(), ids=lambda defect: defect.path.stem)
def test_a_seeded_defect_is_the_only_finding_and_at_its_place(defect: Defect) -> None:
    diagnostics = findings(defect.path)

    assert {finding.code for finding in diagnostics} == {defect.code}, diagnostics
    assert any(defect.first <= finding.place.span.line <= defect.last for finding in diagnostics), diagnostics


@pytest.mark.parametrize("path", clean_specs(), ids=lambda path: path.stem)
def test_a_clean_spec_has_no_findings(path: Path) -> None:
    assert findings(path) == []


def report() -> str:
    """Return the precision and recall of each rule over the corpus."""
    right, missed, wrong = Counter[str](), Counter[str](), Counter[str]()
    lines = []
    for defect in defects():
        diagnostics = findings(defect.path)
        is_reported = any(
            finding.code == defect.code and defect.first <= finding.place.span.line <= defect.last
            for finding in diagnostics
        )
        (right if is_reported else missed)[defect.code] += 1
        others = [finding for finding in diagnostics if finding.code != defect.code]
        wrong.update({other.code for other in others})
        lines += [] if is_reported and not others else [f"{defect.path.stem}: {_findings_text(diagnostics)}"]
    for path in clean_specs():
        diagnostics = findings(path)
        wrong.update({finding.code for finding in diagnostics})
        lines += [f"clean {path.stem}: {_findings_text(diagnostics)}"] if diagnostics else []
    rows = [f"{'rule':8} {'right':>6} {'missed':>7} {'wrong':>6} {'precision':>10} {'recall':>7}"]
    for code in sorted({*right, *missed, *wrong}):
        precision = right[code] / max(1, right[code] + wrong[code])
        recall = right[code] / max(1, right[code] + missed[code])
        rows.append(f"{code:8} {right[code]:6} {missed[code]:7} {wrong[code]:6} {precision:10.0%} {recall:7.0%}")
    return "\n".join(rows + lines)


def _findings_text(diagnostics: list[Diagnostic]) -> str:
    return (
        "; ".join(f"{finding.place.span.line} {finding.code} {finding.message}" for finding in diagnostics) or "nothing"
    )


if __name__ == "__main__":
    print(report())
