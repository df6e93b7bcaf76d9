"""Failed looks: what happens to a variable if a job brings no value for it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import Reading, Reason


@dataclass(frozen=True, slots=True)
class FailedLook:
    """Why an algorithm delivered no value for a variable.

    Attributes:
        reason: why the variable may become unknown.
        since_s: the instant of the look, to be compared with the times of evidence.
        algorithm: the algorithm that looked.
    """

    reason: Reason
    detail: str
    since_s: float
    algorithm: str


def decisive_look(
    reading: Reading[Value], failed_looks: Iterable[FailedLook], *, does_forget: bool
) -> FailedLook | None:
    """Return the failed look that makes a variable unknown, or gives an unknown variable a new reason; otherwise None.

    This is called when it is clear that no alternative delivers a value. A failure makes the variable unknown only if
    the failed algorithm wrote the present value; the value of another writer stays. A rejection makes the variable
    unknown only if `does_forget`. A variable that is already unknown gets the latest reason.
    """
    latest_look: FailedLook | None = None
    for failed_look in failed_looks:
        if failed_look.since_s >= reading.evidence_s and _has_effect(reading, failed_look, does_forget):
            latest_look = failed_look
    is_reported = latest_look is not None and (latest_look.reason, latest_look.detail) == (
        reading.reason,
        reading.detail,
    )
    return None if is_reported else latest_look


def _has_effect(reading: Reading[Value], failed_look: FailedLook, does_forget: bool) -> bool:
    if not reading.known:
        return True
    if failed_look.reason.is_failure:
        return failed_look.algorithm == reading.source
    return does_forget
