"""A slip of the hand in a valid spec is found where it was made; `python -m tests.mutants` gives the whole figures."""

from __future__ import annotations

from tests.mutants.__main__ import report, verdicts
from tests.mutants.judgement import Fate

COUNT = 400


def test_a_changed_token_is_found_near_where_it_was_changed() -> None:
    judged = list(verdicts(COUNT, seed=1))
    meant = [each for each in judged if each.fate in (Fate.NEAR, Fate.FAR, Fate.MISSED)]
    near = [each for each in meant if each.fate is Fate.NEAR]

    assert len(judged) == COUNT
    assert len(near) >= 0.95 * len(meant), report(judged)


def test_a_changed_token_gives_few_findings() -> None:
    found = [len(each.findings) for each in verdicts(COUNT, seed=2) if each.findings]

    assert sum(found) <= 1.1 * len(found)


def test_what_is_suggested_for_a_misspelt_name_is_that_name() -> None:
    suggestions = [each.suggestion for each in verdicts(2 * COUNT, seed=3) if each.suggestion is not None]

    assert len(suggestions) >= 50
    assert sum(right for _, right in suggestions) >= 0.9 * len(suggestions)
