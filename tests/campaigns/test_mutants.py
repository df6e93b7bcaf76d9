"""A typing mistake in a valid spec is reported at its place; `python -m tests.campaigns.mutants` prints all figures."""

from __future__ import annotations

import pytest

from tests.campaigns.mutants.__main__ import report, verdicts
from tests.campaigns.mutants.judgement import Fate, Verdict

MUTANT_COUNT = 120


@pytest.fixture(scope="module")
def mutant_verdicts() -> list[Verdict]:
    return list(verdicts(MUTANT_COUNT, seed=1))


def test_a_changed_token_is_reported_near_its_place(mutant_verdicts: list[Verdict]) -> None:
    changed_verdicts = [verdict for verdict in mutant_verdicts if verdict.fate in (Fate.NEAR, Fate.FAR, Fate.MISSED)]
    near_verdicts = [verdict for verdict in changed_verdicts if verdict.fate is Fate.NEAR]

    assert len(mutant_verdicts) == MUTANT_COUNT
    assert len(near_verdicts) >= 0.95 * len(changed_verdicts), report(mutant_verdicts)


def test_a_changed_token_gives_few_findings(mutant_verdicts: list[Verdict]) -> None:
    finding_counts = [len(verdict.findings) for verdict in mutant_verdicts if verdict.findings]

    assert sum(finding_counts) <= 1.1 * len(finding_counts)


def test_the_original_name_is_suggested_for_a_misspelt_one(mutant_verdicts: list[Verdict]) -> None:
    suggestions = [verdict.suggestion for verdict in mutant_verdicts if verdict.suggestion is not None]

    assert len(suggestions) >= 6
    assert sum(is_correct for _, is_correct in suggestions) >= 0.9 * len(suggestions)
