"""A cell holds one context-variable: its present reading, and its history ordered by the instant of the evidence.

In P1, section 3.3, a variable has a value, a flag for known or unknown, and the instant of identification. A reading
here also has the instant at which the evidence was taken and, for an unknown variable, a reason.
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

MIN_KEPT_READINGS = 100
"""At least this many readings are kept, even if the spec declares a shorter history: evidence is checked against them.
"""

MAX_PINNED_READINGS = 10_000
"""While evidence is taken, at most this many readings are kept beyond the usual limit. This bounds the memory."""


class Reason(StrEnum):
    """Why a variable is unknown.

    `schema.json` lists the reasons, for timelines. `pytest tests/integrations/testing/test_reasons.py --renew-cases`
    renews this list.

    Attributes:
        meaning: a short text for people.
        is_failure: whether the reason is that the algorithm failed. A failure makes a variable unknown only if the
            value of the variable comes from the failed algorithm.
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

    A reading has no truth value, and `value` raises an error if the variable is unknown. So unknown cannot be mistaken
    for False.

    Attributes:
        name: the variable.
        content: the value, or None if the variable is unknown. `value` is the safe way to read the value.
        reason: why the variable is unknown; None if it is known.
        detail: what made the variable unknown: a skill, a condition, an error message.
        evidence_s: when the evidence was taken. For an unknown variable, the instant since which it is unknown; for a
            stale variable, the instant of its last evidence.
        start_s: when the taking of the evidence began, if this is known. For evidence of one instant, it equals
            `evidence_s`.
        identified_s: when the context manager received the reading.
        expires_s: the end of the validity of the value.
        source: who wrote the reading: a perception algorithm, `main_execution`, or an agent.
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
            UnknownValueError: if the variable is unknown; the message has the reason.
        """
        if self.reason is not None:
            reason_text = f"{self.reason}: {self.detail}" if self.detail else str(self.reason)
            raise UnknownValueError(f"{self.name} is unknown ({reason_text})")
        return cast("ValueT_co", self.content)

    def age_s(self, now_s: float) -> float:
        """Return the time since the evidence was taken."""
        return now_s - self.evidence_s

    def at(self, instant_s: float) -> Reading[ValueT_co]:
        """Return this reading as it is at an instant: unknown if the end of its validity has been reached."""
        if self.reason is None and instant_s >= self.expires_s:
            return replace(self, content=None, reason=Reason.STALE, identified_s=self.expires_s, expires_s=FOREVER_S)
        return self

    def __bool__(self) -> bool:
        raise TypeError(f"a reading has no truth value: use .known, then .value, of {self.name!r}")


@dataclass(slots=True)
class _MutableReading(Generic[ValueT_co]):
    """The fields of a reading, in the same order, in a mutable object that becomes a reading."""

    name: str
    content: Value | None
    reason: Reason | None
    detail: str
    evidence_s: float
    start_s: float
    identified_s: float
    expires_s: float
    source: str


def known_reading(  # noqa: PLR0917 - keyword arguments would take a third more time
    name: str,
    content: Value,
    evidence_s: float,
    start_s: float,
    identified_s: float,
    expires_s: float,
    source: str,
) -> Reading[Value]:
    """Return a reading of a known variable; for code that creates very many readings.

    A frozen class sets each of its fields by a call. To create a mutable object and change its class takes a third of
    the time.
    """
    mutable_reading: Any = _MutableReading(
        name, content, None, "", evidence_s, start_s, identified_s, expires_s, source
    )
    mutable_reading.__class__ = Reading
    reading: Reading[Value] = mutable_reading
    return reading


class Cell:
    """The present reading and the history of one variable.

    Code that writes a cell must hold the context manager's lock; code that reads it needs no lock.

    Attributes:
        reading: the present reading.
        invalidated_s: when a skill last changed the variable.
        late_reading_count: the number of readings that were identified after their evidence was taken.
    """

    __slots__ = (
        "_has_dropped_readings",
        "_history_limit",
        "_max_readings",
        "_pinned_instants_s",
        "_readings",
        "invalidated_s",
        "late_reading_count",
        "reading",
    )

    def __init__(self, name: str, history: int) -> None:
        """Create a cell of a variable that was never observed.

        Args:
            name: the variable.
            history: the largest number of readings that `history` returns.
        """
        self.reading: Reading[Value] = Reading(name=name, reason=Reason.NEVER_OBSERVED)
        self.invalidated_s = BEFORE_ALL_S
        self.late_reading_count = 0
        self._readings: list[Reading[Value]] = []
        self._history_limit = history
        self._max_readings = max(history, MIN_KEPT_READINGS)
        self._pinned_instants_s: list[float] = []
        self._has_dropped_readings = False

    def admits(self, start_s: float, stamp_s: float) -> bool:
        """Return whether evidence counts: false if the variable was invalidated while the evidence was taken."""
        return not start_s <= self.invalidated_s <= stamp_s

    def write(self, reading: Reading[Value]) -> bool:
        """Add a reading to the history. It becomes the present reading unless the present one has newer evidence.

        Returns:
            Whether the added reading is now the present reading.
        """
        self._append(reading)
        if reading.evidence_s < self.reading.evidence_s:
            return False
        self.reading = reading
        return True

    def now(self, now_s: float) -> Reading[Value]:
        """Return the present reading as it is now."""
        return self.reading.at(now_s)

    def _append(self, reading: Reading[Value]) -> None:
        """Add a reading to the history."""
        if reading.evidence_s < reading.identified_s:
            self.late_reading_count += 1
        if not self._readings or reading.evidence_s >= self._readings[-1].evidence_s:
            self._readings.append(reading)
        else:
            self._readings.insert(bisect_right(self._readings, reading.evidence_s, key=_evidence_s), reading)
        while len(self._readings) > self._max_readings and (
            not self._pinned_instants_s or self._has_too_many_readings()
        ):
            del self._readings[0]
            self._has_dropped_readings = True

    def pin(self, instant_s: float) -> None:
        """Keep the readings that cover the time since an instant, because evidence that is being taken needs them."""
        self._pinned_instants_s.append(instant_s)

    def unpin(self, instant_s: float) -> None:
        """Undo one `pin`."""
        self._pinned_instants_s.remove(instant_s)

    def _has_too_many_readings(self) -> bool:
        surplus_count = len(self._readings) - self._max_readings
        pinned_instants_s = self._pinned_instants_s
        is_pinned = (
            bool(pinned_instants_s) and surplus_count > 0 and self._readings[1].evidence_s > min(pinned_instants_s)
        )
        return surplus_count > (MAX_PINNED_READINGS if is_pinned else 0)

    def expire(self, now_s: float) -> bool:
        """Make the variable unknown if its present reading is no longer valid; return whether it became unknown."""
        reading = self.reading.at(now_s)
        if reading is self.reading:
            return False
        self.reading = reading
        return True

    def history(self) -> tuple[Reading[Value], ...]:
        """Return the newest readings, ordered by the instant of their evidence, the oldest first."""
        return tuple(self._readings[max(0, len(self._readings) - self._history_limit) :])

    def at(self, instant_s: float) -> Reading[Value]:
        """Return the reading at an instant, according to what is known today.

        This is the reading with the newest evidence up to the instant. If this reading was no longer valid at the
        instant, the variable is unknown in the returned reading.
        """
        position = bisect_right(self._readings, instant_s, key=_evidence_s)
        if position == 0:
            return Reading(name=self.reading.name, reason=Reason.NEVER_OBSERVED)
        return self._readings[position - 1].at(instant_s)

    @property
    def complete_from_s(self) -> float:
        """Return the instant since which the history is complete."""
        return self._readings[0].evidence_s if self._has_dropped_readings else BEFORE_ALL_S

    def between(self, start_s: float, end_s: float) -> tuple[Reading[Value], ...]:
        """Return the readings whose evidence was taken in (start, end], in order."""
        first = bisect_right(self._readings, start_s, key=_evidence_s)
        return tuple(self._readings[first : bisect_right(self._readings, end_s, key=_evidence_s)])


def _evidence_s(reading: Reading[Value]) -> float:
    return reading.evidence_s
