"""Which of several failed looks makes a variable unknown."""

from __future__ import annotations

import pytest

from codra_dsl.logic import Value
from codra_dsl.runtime.observers.failed_look import FailedLook, decisive_look
from codra_dsl.runtime.values.cell import Reading, Reason


def known_by(source: str, evidence_s: float = 1.0) -> Reading[Value]:
    return Reading(name="x", content=True, evidence_s=evidence_s, source=source)


def unknown(reason: Reason, detail: str = "", evidence_s: float = 1.0) -> Reading[Value]:
    return Reading(name="x", reason=reason, detail=detail, evidence_s=evidence_s, source="eye")


FAILED = FailedLook(Reason.FAILED, "no picture", 2.0, "eye")
TIMED_OUT = FailedLook(Reason.TIMED_OUT, "no result within 3 s", 2.5, "ear")
REJECTED = FailedLook(Reason.REJECTED, "not markers >= 3", 3.0, "eye")


@pytest.mark.parametrize("forgets", [False, True], ids=["keeps", "forgets"])
def test_a_failure_removes_only_a_value_of_its_own_algorithm(forgets: bool) -> None:
    assert decisive_look(known_by("eye"), [FAILED], forgets=forgets) is FAILED
    assert decisive_look(known_by("main_execution"), [FAILED], forgets=forgets) is None
    assert decisive_look(known_by("ear"), [FAILED], forgets=forgets) is None


def test_a_rejection_removes_the_last_value_only_if_the_variable_forgets() -> None:
    assert decisive_look(known_by("ear"), [REJECTED], forgets=True) is REJECTED
    assert decisive_look(known_by("eye"), [REJECTED], forgets=False) is None


def test_of_several_alternatives_the_one_that_wrote_the_value_counts() -> None:
    assert decisive_look(known_by("eye"), [FAILED, TIMED_OUT, REJECTED], forgets=False) is FAILED
    assert decisive_look(known_by("ear"), [FAILED, TIMED_OUT, REJECTED], forgets=False) is TIMED_OUT


def test_a_failed_look_older_than_the_value_has_no_effect() -> None:
    assert decisive_look(known_by("eye", evidence_s=2.1), [FAILED], forgets=True) is None
    assert decisive_look(unknown(Reason.INVALIDATED, evidence_s=2.1), [FAILED], forgets=True) is None


def test_an_unknown_variable_takes_the_latest_reason_once() -> None:
    assert decisive_look(unknown(Reason.NEVER_OBSERVED), [FAILED, REJECTED], forgets=False) is REJECTED
    assert decisive_look(unknown(Reason.REJECTED, "not markers >= 3"), [REJECTED], forgets=False) is None
    assert decisive_look(unknown(Reason.STALE), [], forgets=False) is None
