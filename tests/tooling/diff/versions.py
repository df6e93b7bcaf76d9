"""Versions of a spec, from its text."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.compiler import plan_text
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.tooling.diff import Review, Version, review
from tests.language.check.specs import edit_spec


def plan_version(text: str) -> Version:
    """Return a version that holds one spec, without errors."""
    planning_result = plan_text(text, "spec.yaml", Path(__file__).parents[2])
    assert not has_errors(planning_result.diagnostics), planning_result.diagnostics
    return Version(plans=planning_result.plans)


def review_edits(base_text: str, *edits: tuple[str, str]) -> Review:
    """Return the review of edits; each edited text is in the base once."""
    return review(plan_version(base_text), plan_version(edit_spec(*edits, text=base_text)))
