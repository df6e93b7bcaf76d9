"""A typing mistake in a valid spec is reported at its place; `python -m tests.campaigns.mutants` prints all figures."""

from __future__ import annotations

from tests.campaigns.mutants.__main__ import report, verdicts
from tests.campaigns.mutants.judgement import Fate

COUNT = 400


def test_a_changed_token_is_reported_near_its_place() -> None:
    judged = list(verdicts(COUNT, seed=1))
    changed = [verdict for verdict in judged if verdict.fate in (Fate.NEAR, Fate.FAR, Fate.MISSED)]
    near = [verdict for verdict in changed if verdict.fate is Fate.NEAR]

    assert len(judged) == COUNT
    assert len(near) >= 0.95 * len(changed), report(judged)


def test_a_changed_token_gives_few_findings() -> None:
    counts = [len(verdict.findings) for verdict in verdicts(COUNT, seed=2) if verdict.findings]

    assert sum(counts) <= 1.1 * len(counts)


def test_the_original_name_is_suggested_for_a_misspelt_one() -> None:
    suggestions = [verdict.suggestion for verdict in verdicts(2 * COUNT, seed=3) if verdict.suggestion is not None]

    assert len(suggestions) >= 50
    assert sum(right for _, right in suggestions) >= 0.9 * len(suggestions)
