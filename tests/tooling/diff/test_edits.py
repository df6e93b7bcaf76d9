"""More than forty edits of a spec, each with the verdict and all changes that `edits.yaml` expects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from codra_dsl.compiler import plan_text
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.tooling.diff import BrokenSpec, Version, review

CASES: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("edits.yaml").read_text("utf-8"))
EDITS = CASES["edits"]


def version(text: str, root: Path) -> Version:
    planning_result = plan_text(text, "bench.yaml", root)
    if not has_errors(planning_result.diagnostics):
        return Version(plans=planning_result.plans)
    errors = tuple(finding for finding in planning_result.diagnostics if has_errors([finding]))
    return Version(broken_specs=(BrokenSpec(name="bench", file="bench.yaml", errors=errors),))


def edited_text(edit: dict[str, Any]) -> str:
    text = CASES["base"]
    for old, new in edit["edit"]:
        assert CASES["base"].count(old) == 1, f"{old!r} is not in the base exactly once"
        text = text.replace(old, new)
    return text


def test_there_are_at_least_forty_edits() -> None:
    assert len(EDITS) >= 40


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit["name"])
def test_an_edit_has_the_expected_verdict_and_changes(edit: dict[str, Any], tmp_path: Path) -> None:
    diff_review = review(version(CASES["base"], tmp_path), version(edited_text(edit), tmp_path))

    changes = sorted(f"{change.category} {change.element}" for change in diff_review.changes)
    assert (diff_review.verdict, changes) == (edit["verdict"], sorted(edit["changes"]))
