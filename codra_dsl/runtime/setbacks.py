"""What it means for a variable that a look brought no value."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reading, Reason

_FAILURES = (Reason.FAILED, Reason.TIMED_OUT)


@dataclass(frozen=True, slots=True)
class Setback:
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


def decisive(reading: Reading[Value], setbacks: Iterable[Setback], *, forgets: bool) -> Setback | None:
    """Return the setback that makes a variable unknown, or says anew why it is, once no alternative has delivered.

    A failure makes unknown what the failed algorithm wrote itself, never a newer value of another writer. A rejection
    takes the last value only if the variable `forgets`. A variable that is unknown anyway takes the latest reason.
    """
    latest: Setback | None = None
    for setback in setbacks:
        if setback.since_s >= reading.evidence_s and _counts(reading, setback, forgets):
            latest = setback
    is_told = latest is not None and (latest.reason, latest.detail) == (reading.reason, reading.detail)
    return None if is_told else latest


def _counts(reading: Reading[Value], setback: Setback, forgets: bool) -> bool:
    if not reading.known:
        return True
    if setback.reason in _FAILURES:
        return setback.algorithm == reading.source
    return forgets
