"""A cell holds one context-variable: its present reading, and its history ordered by the instant of the evidence.

P1, section 3.3 has a value, a flag for known or unknown, and the instant of identification. A reading here also has
the instant at which the evidence was taken, and a reason if it is unknown.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Generic, Self, TypeVar, cast

from codra_dsl.logic import Value

ValueT_co = TypeVar("ValueT_co", covariant=True)

BEFORE_ALL_S = -math.inf

FOREVER_S = math.inf

FEWEST_KEPT = 100
"""Readings that are kept even if the spec asks for a shorter history, because evidence is judged by the history."""

MOST_PINNED = 10_000
"""The largest number of readings beyond the limit that are kept for evidence being taken, so that memory is bounded."""


class Reason(StrEnum):
    """Why a variable is unknown.

    `schema.json` lists the reasons for timelines. `pytest tests/integrations/testing/test_reasons.py --renew-cases`
    renews its list.

    Attributes:
        meaning: a short text for people.
        is_failure: whether the algorithm failed; then only values of this algorithm become unknown.
    """

    meaning: str
    is_failure: bool

    NEVER_OBSERVED = "never_observed", "it has not been identified yet"
    STALE = "stale", "its evidence is older than `valid_for`"
    INVALIDATED = "invalidated", "a skill that changes it acts or has acted"
    FORGOTTEN = "forgotten", "a precondition failed"
    REJECTED = "rejected", "the result was not good enough"
    UNCONFIRMED = "unconfirmed", "it was not confirmed by enough results"
    FAILED = "failed", "its algorithm raised an error, or returned an invalid value", True
    TIMED_OUT = "timed_out", "its algorithm took too long", True
    WITHDRAWN = "withdrawn", "its observer stopped"

    def __new__(cls, word: str, meaning: str = "", is_failure: bool = False) -> Self:
        """Return a reason that is equal to its word."""
        reason = str.__new__(cls, word)
        reason._value_ = word
        reason.meaning = meaning
        reason.is_failure = is_failure
        return reason


class UnknownValueError(LookupError):
    """The value of an unknown variable was read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading(Generic[ValueT_co]):
    """The value of a variable, or the reason why it is unknown.

    A reading has no truth value, and `value` raises when unknown: so unknown cannot be taken for False by accident.

    Attributes:
        name: the variable.
        content: the value, or None when unknown; `value` is the safe way to read it.
        reason: why it is unknown; None when known.
        detail: what made it unknown: a skill, a condition, an error message.
        evidence_s: when the evidence was taken. For an unknown variable, the instant from which it is unknown; for a
            stale one, the instant of its last evidence.
        start_s: when the evidence began to be taken, if known; equal to `evidence_s` for evidence of one instant.
        identified_s: when the context manager received it.
        expires_s: the end of its validity.
        source: who wrote it: a perception algorithm, `main_execution`, or an agent.
    """

    name: str
    content: Value | None = None
    reason: Reason | None = None
    detail: str = ""
    evidence_s: float = BEFORE_ALL_S
    start_s: float = BEFORE_ALL_S
    identified_s: float = BEFORE_ALL_S
    expires_s: float = FOREVER_S
    source: str = ""

    @property
    def known(self) -> bool:
        """Return whether the value is known."""
        return self.reason is None

    @property
    def value(self) -> ValueT_co:
        """Return the value.

        Raises:
            UnknownValueError: when it is unknown, with the reason.
        """
        if self.reason is not None:
            because = f"{self.reason}: {self.detail}" if self.detail else str(self.reason)
            raise UnknownValueError(f"{self.name} is unknown ({because})")
        return cast("ValueT_co", self.content)

    def age_s(self, now_s: float) -> float:
        """Return the time since the evidence was taken."""
        return now_s - self.evidence_s

    def at(self, instant_s: float) -> Reading[ValueT_co]:
        """Return this reading as of an instant: unknown once its validity is over."""
        if self.reason is None and instant_s >= self.expires_s:
            return replace(self, content=None, reason=Reason.STALE, identified_s=self.expires_s, expires_s=FOREVER_S)
        return self

    def __bool__(self) -> bool:
        raise TypeError(f"a reading has no truth value: use .known, then .value, of {self.name!r}")


@dataclass(slots=True)
class _MutableReading(Generic[ValueT_co]):
    """The fields of a reading, in the same order, before it is frozen."""

    name: str
    content: Value | None
    reason: Reason | None
    detail: str
    evidence_s: float
    start_s: float
    identified_s: float
    expires_s: float
    source: str


def known_reading(  # noqa: PLR0917 - names would cost a third more
    name: str,
    content: Value,
    evidence_s: float,
    start_s: float,
    identified_s: float,
    expires_s: float,
    source: str,
) -> Reading[Value]:
    """Return a reading of a known variable; for code that creates very many.

    A frozen class sets each of its fields by a call. Creating a mutable object and changing its class takes a third
    of the time.
    """
    made: Any = _MutableReading(name, content, None, "", evidence_s, start_s, identified_s, expires_s, source)
    made.__class__ = Reading
    frozen: Reading[Value] = made
    return frozen


class Cell:
    """The present reading and the history of one variable.

    A writer holds the context manager's lock; a reader needs no lock.

    Attributes:
        reading: the present reading.
        invalidated_s: when a skill last changed the variable.
        late: how many readings had evidence older than the instant at which they were identified.
    """

    __slots__ = ("_dropped", "_kept", "_limit", "_past", "_pins", "invalidated_s", "late", "reading")

    def __init__(self, name: str, history: int) -> None:
        """Create a cell that was never observed.

        Args:
            name: the variable.
            history: the largest number of readings that `history` returns.
        """
        self.reading: Reading[Value] = Reading(name=name, reason=Reason.NEVER_OBSERVED)
        self.invalidated_s = BEFORE_ALL_S
        self.late = 0
        self._past: list[Reading[Value]] = []
        self._limit = history
        self._kept = max(history, FEWEST_KEPT)
        self._pins: list[float] = []
        self._dropped = False

    def admits(self, start_s: float, stamp_s: float) -> bool:
        """Return whether evidence counts: it does not if it was being taken when the variable was invalidated."""
        return not start_s <= self.invalidated_s <= stamp_s

    def write(self, reading: Reading[Value]) -> bool:
        """Add a reading to the history and, unless its evidence is older, make it the present reading.

        Returns:
            Whether it is the present reading now.
        """
        if reading.evidence_s < reading.identified_s:
            self.late += 1
        if not self._past or reading.evidence_s >= self._past[-1].evidence_s:
            self._past.append(reading)
        else:
            self._past.insert(bisect_right(self._past, reading.evidence_s, key=_evidence_s), reading)
        while len(self._past) > self._kept and (not self._pins or self._has_too_many()):
            del self._past[0]
            self._dropped = True
        if reading.evidence_s < self.reading.evidence_s:
            return False
        self.reading = reading
        return True

    def pin(self, instant_s: float) -> None:
        """Keep the readings that cover the time from an instant on, because evidence taken since then needs them."""
        self._pins.append(instant_s)

    def unpin(self, instant_s: float) -> None:
        """Undo one `pin`."""
        self._pins.remove(instant_s)

    def _has_too_many(self) -> bool:
        surplus = len(self._past) - self._kept
        is_pinned = bool(self._pins) and surplus > 0 and self._past[1].evidence_s > min(self._pins)
        return surplus > (MOST_PINNED if is_pinned else 0)

    def expire(self, now_s: float) -> bool:
        """Make the present reading unknown if its validity is over; return whether it became unknown."""
        reading = self.reading.at(now_s)
        if reading is self.reading:
            return False
        self.reading = reading
        return True

    def history(self) -> tuple[Reading[Value], ...]:
        """Return the newest readings in the order of their evidence, oldest first."""
        return tuple(self._past[max(0, len(self._past) - self._limit) :])

    def at(self, instant_s: float) -> Reading[Value]:
        """Return the reading at an instant, as known today: the newest evidence up to then, if it was still valid."""
        position = bisect_right(self._past, instant_s, key=_evidence_s)
        if position == 0:
            return Reading(name=self.reading.name, reason=Reason.NEVER_OBSERVED)
        return self._past[position - 1].at(instant_s)

    @property
    def complete_from_s(self) -> float:
        """Return the instant from which on the history is complete."""
        return self._past[0].evidence_s if self._dropped else BEFORE_ALL_S

    def between(self, start_s: float, end_s: float) -> tuple[Reading[Value], ...]:
        """Return the readings whose evidence was taken in (start, end], in order."""
        first = bisect_right(self._past, start_s, key=_evidence_s)
        return tuple(self._past[first : bisect_right(self._past, end_s, key=_evidence_s)])


def _evidence_s(reading: Reading[Value]) -> float:
    return reading.evidence_s
