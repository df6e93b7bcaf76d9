"""Forty and more edits of a spec: the verdict and every change, as `edits.yaml` says that they must be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from codra_dsl.compiler import plan_text
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.tooling.diff import Broken, Version, review

CASES: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("edits.yaml").read_text("utf-8"))
EDITS = CASES["edits"]


def version(text: str, root: Path) -> Version:
    planned = plan_text(text, "bench.yaml", root)
    if not has_errors(planned.diagnostics):
        return Version(plans=planned.plans)
    errors = tuple(found for found in planned.diagnostics if has_errors([found]))
    return Version(broken=(Broken(name="bench", file="bench.yaml", errors=errors),))


def edited(edit: dict[str, Any]) -> str:
    text = CASES["base"]
    for old, new in edit["edit"]:
        assert CASES["base"].count(old) == 1, f"{old!r} does not stand in the base exactly once"
        text = text.replace(old, new)
    return text


def test_there_are_at_least_forty_edits() -> None:
    assert len(EDITS) >= 40


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit["name"])
def test_an_edit_gives_the_verdict_and_the_changes_that_it_must(edit: dict[str, Any], tmp_path: Path) -> None:
    found = review(version(CASES["base"], tmp_path), version(edited(edit), tmp_path))

    told = sorted(f"{change.category} {change.element}" for change in found.changes)
    assert (found.verdict, told) == (edit["verdict"], sorted(edit["changes"]))
