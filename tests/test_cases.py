"""Complete specs: those in cases/valid give no finding, those in cases/invalid exactly the expected findings.

A case is a file NAME.yaml, or a folder NAME with spec.yaml, its parts, and its sites in a folder `sites`; NAME.txt has
the expected text. Renew the expected texts with `pytest tests/test_cases.py --renew-cases`, and read the diff.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.compiler import Planned, plan_paths
from codra_dsl.generation.build_plan import verify
from codra_dsl.generation.emit import emit
from codra_dsl.generation.emit.self_check import prove
from codra_dsl.tooling.report.findings import render_full

CASES = Path(__file__).parent / "cases"


def cases(folder: str) -> list[Path]:
    paths = [path for path in (CASES / folder).iterdir() if path.is_dir() or path.suffix == ".yaml"]
    assert paths
    return sorted(paths)


def planned(case: Path) -> Planned:
    path, root = (case / "spec.yaml", case) if case.is_dir() else (case, case.parent)
    sites = sorted(case.glob("sites/*.yaml"))
    return plan_paths([path, *sites], root)


def all_findings(case: Path) -> str:
    """Return the findings about a case in the form for people, as `codra lint` prints them."""
    result = planned(case)
    return render_full(result.diagnostics, lambda file: (result.root / file).read_text("utf-8", errors="replace"))


@pytest.mark.parametrize("case", cases("valid"), ids=lambda case: case.stem)
def test_a_valid_spec_gives_no_finding_and_its_plan_and_output_are_proven(case: Path) -> None:
    result = planned(case)

    assert result.diagnostics == ()
    for plan in result.plans:
        verify(plan, plan.checked)
        prove(emit(plan))


@pytest.mark.parametrize("case", cases("invalid"), ids=lambda case: case.stem)
def test_an_invalid_spec_gives_exactly_the_expected_findings(case: Path, renew_cases: bool) -> None:
    expected = case.with_suffix(".txt")
    findings = all_findings(case)
    if renew_cases:
        expected.write_text(findings, "utf-8")

    assert findings == expected.read_text("utf-8")
    assert findings != ""
