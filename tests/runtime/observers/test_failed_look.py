"""Which of several failed looks makes a variable unknown."""

from __future__ import annotations

import pytest

from codra_dsl.logic import Value
from codra_dsl.runtime.observers.failed_look import FailedLook, decisive_look
from codra_dsl.runtime.values.cell import Reading, Reason


def known_reading(source: str, evidence_s: float = 1.0) -> Reading[Value]:
    return Reading(name="x", content=True, evidence_s=evidence_s, source=source)


def unknown_reading(reason: Reason, detail: str = "", evidence_s: float = 1.0) -> Reading[Value]:
    return Reading(name="x", reason=reason, detail=detail, evidence_s=evidence_s, source="eye")


FAILED_LOOK = FailedLook(Reason.FAILED, "no picture", 2.0, "eye")
TIMED_OUT_LOOK = FailedLook(Reason.TIMED_OUT, "no result within 3 s", 2.5, "ear")
REJECTED_LOOK = FailedLook(Reason.REJECTED, "not markers >= 3", 3.0, "eye")


@pytest.mark.parametrize("does_forget", [False, True], ids=["keeps", "forgets"])
def test_a_failure_removes_only_a_value_of_its_own_algorithm(does_forget: bool) -> None:
    assert decisive_look(known_reading("eye"), [FAILED_LOOK], does_forget=does_forget) is FAILED_LOOK
    assert decisive_look(known_reading("main_execution"), [FAILED_LOOK], does_forget=does_forget) is None
    assert decisive_look(known_reading("ear"), [FAILED_LOOK], does_forget=does_forget) is None


def test_a_rejection_removes_the_last_value_only_if_the_variable_forgets() -> None:
    assert decisive_look(known_reading("ear"), [REJECTED_LOOK], does_forget=True) is REJECTED_LOOK
    assert decisive_look(known_reading("eye"), [REJECTED_LOOK], does_forget=False) is None


def test_of_several_alternatives_the_one_that_wrote_the_value_counts() -> None:
    assert (
        decisive_look(known_reading("eye"), [FAILED_LOOK, TIMED_OUT_LOOK, REJECTED_LOOK], does_forget=False)
        is FAILED_LOOK
    )
    assert (
        decisive_look(known_reading("ear"), [FAILED_LOOK, TIMED_OUT_LOOK, REJECTED_LOOK], does_forget=False)
        is TIMED_OUT_LOOK
    )


def test_a_failed_look_older_than_the_value_has_no_effect() -> None:
    assert decisive_look(known_reading("eye", evidence_s=2.1), [FAILED_LOOK], does_forget=True) is None
    assert decisive_look(unknown_reading(Reason.INVALIDATED, evidence_s=2.1), [FAILED_LOOK], does_forget=True) is None


def test_an_unknown_variable_takes_the_latest_reason_once() -> None:
    assert (
        decisive_look(unknown_reading(Reason.NEVER_OBSERVED), [FAILED_LOOK, REJECTED_LOOK], does_forget=False)
        is REJECTED_LOOK
    )
    assert (
        decisive_look(unknown_reading(Reason.REJECTED, "not markers >= 3"), [REJECTED_LOOK], does_forget=False) is None
    )
    assert decisive_look(unknown_reading(Reason.STALE), [], does_forget=False) is None
