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
    assert len(near) >= 0.9 * len(meant), report(judged)


def test_a_changed_token_gives_few_findings() -> None:
    found = [len(each.findings) for each in verdicts(COUNT, seed=2) if each.findings]

    assert sum(found) <= 1.5 * len(found)
