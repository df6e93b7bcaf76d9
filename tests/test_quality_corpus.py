"""Seeded defects of context quality are found where they are, and nothing is found where there is none.

The specs were written from `docs/reference/context-quality.md` alone, before the rules first ran on them.
`python -m tests.test_quality_corpus` prints precision and recall of each rule.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.diagnostics import Diagnostic

CORPUS = Path(__file__).parent / "quality_corpus"
EXPECT = re.compile(r"# expect: (?P<code>CDR\d{4}) (?P<first>\d+)(?:-(?P<last>\d+))?$")


@dataclass(frozen=True)
class Defect:
    """A spec with one seeded defect, and where it is."""

    path: Path
    code: str
    first: int
    last: int


def defects() -> list[Defect]:
    """Return the seeded defects."""
    found = []
    for path in sorted((CORPUS / "defects").glob("*.yaml")):
        match = EXPECT.match(path.read_text("utf-8").splitlines()[0])
        assert match is not None, path
        found.append(Defect(path, match["code"], int(match["first"]), int(match["last"] or match["first"])))
    return found


def clean() -> list[Path]:
    """Return the specs without a defect."""
    return sorted((CORPUS / "clean").glob("*.yaml"))


def findings(path: Path) -> list[Diagnostic]:
    """Return what is found about a spec."""
    return list(plan_paths([path], path.parent).diagnostics)


@pytest.mark.parametrize("defect", defects(), ids=lambda defect: defect.path.stem)
def test_a_seeded_defect_is_found_where_it_is_and_nothing_else(defect: Defect) -> None:
    found = findings(defect.path)

    assert {each.code for each in found} == {defect.code}, found
    assert any(defect.first <= each.place.span.line <= defect.last for each in found), found


@pytest.mark.parametrize("path", clean(), ids=lambda path: path.stem)
def test_nothing_is_found_where_there_is_no_defect(path: Path) -> None:
    assert findings(path) == []


def report() -> str:
    """Return precision and recall of each rule over the whole corpus."""
    right, missed, wrong = Counter[str](), Counter[str](), Counter[str]()
    lines = []
    for defect in defects():
        found = findings(defect.path)
        is_there = any(
            each.code == defect.code and defect.first <= each.place.span.line <= defect.last for each in found
        )
        (right if is_there else missed)[defect.code] += 1
        others = [each for each in found if each.code != defect.code]
        wrong.update({each.code for each in others})
        lines += [] if is_there and not others else [f"{defect.path.stem}: {_told(found)}"]
    for path in clean():
        found = findings(path)
        wrong.update({each.code for each in found})
        lines += [f"clean {path.stem}: {_told(found)}"] if found else []
    rows = [f"{'rule':8} {'right':>6} {'missed':>7} {'wrong':>6} {'precision':>10} {'recall':>7}"]
    for code in sorted({*right, *missed, *wrong}):
        precision = right[code] / max(1, right[code] + wrong[code])
        recall = right[code] / max(1, right[code] + missed[code])
        rows.append(f"{code:8} {right[code]:6} {missed[code]:7} {wrong[code]:6} {precision:10.0%} {recall:7.0%}")
    return "\n".join(rows + lines)


def _told(found: list[Diagnostic]) -> str:
    return "; ".join(f"{each.place.span.line} {each.code} {each.message}" for each in found) or "nothing"


if __name__ == "__main__":
    print(report())
