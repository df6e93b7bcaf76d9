"""What it means for a variable that a look brought no value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import Reading, Reason


@dataclass(frozen=True, slots=True)
class FailedLook:
    """Why an algorithm brought no value for a variable.

    Attributes:
        reason: why the variable may become unknown.
        since_s: on the axis of evidence, when the look was that brought none.
        algorithm: whose look it was.
    """

    reason: Reason
    detail: str
    since_s: float
    algorithm: str


def decisive(reading: Reading[Value], failed_looks: Iterable[FailedLook], *, forgets: bool) -> FailedLook | None:
    """Return the setback that makes a variable unknown, or says anew why it is, once no alternative has delivered.

    A failure makes unknown what the failed algorithm wrote itself, never a newer value of another writer. A rejection
    takes the last value only if the variable `forgets`. A variable that is unknown anyway takes the latest reason.
    """
    latest: FailedLook | None = None
    for failed_look in failed_looks:
        if failed_look.since_s >= reading.evidence_s and _counts(reading, failed_look, forgets):
            latest = failed_look
    is_told = latest is not None and (latest.reason, latest.detail) == (reading.reason, reading.detail)
    return None if is_told else latest


def _counts(reading: Reading[Value], failed_look: FailedLook, forgets: bool) -> bool:
    if not reading.known:
        return True
    if failed_look.reason.is_failure:
        return failed_look.algorithm == reading.source
    return forgets
