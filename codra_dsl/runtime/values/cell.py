"""A cell holds one context-variable: its present reading, and its history ordered by the instant of the evidence.

In P1, section 3.3, a variable has a value, a flag for known or unknown, and the instant of identification. A reading
here also has the instant at which the evidence was taken and, for an unknown variable, a reason.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass, replace
from enum import StrEnum
from operator import itemgetter
from typing import Any, Generic, NamedTuple, Self, TypeVar, cast

from codra_dsl.logic import Value
from codra_dsl.runtime.values.declarations import DERIVED

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
    UNREACHABLE = "unreachable", "the host of its algorithm is not connected", True
    WITHDRAWN = "withdrawn", "its observer stopped"
    OVERRIDDEN = "overridden", "the operator made it unknown"

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
        detail: what made the variable unknown: a skill, a condition, an error message; for an override, the reason that
            the operator gave.
        evidence_s: when the evidence was taken. For an unknown variable, the instant since which it is unknown; for a
            stale variable, the instant of its last evidence.
        start_s: when the taking of the evidence began, if this is known. For evidence of one instant, it equals
            `evidence_s`.
        identified_s: when the context manager received the reading.
        expires_s: the end of the validity of the value.
        source: who wrote the reading: a perception algorithm, `main_execution`, an agent, or `operator`.
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

    @property
    def holds_from_s(self) -> float:
        """Return since when a history has this reading: since its evidence; if it is derived, since the derivation."""
        return self.identified_s if self.source == DERIVED else self.evidence_s

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Override(Reading[Value]):
    """The reading that the operator gives a variable until `expires_s`; it hides the readings of all sources.

    `start_s` is not known, because an override is not evidence: it never answers a request for evidence since an
    instant.

    Attributes:
        beneath: the present reading of the sources.
    """

    beneath: Reading[Value]

    def at(self, instant_s: float) -> Reading[Value]:
        """Return this reading at an instant, or the reading beneath it if the override has ended by then."""
        return self if instant_s < self.expires_s else self.beneath.at(instant_s)


class _OverrideSpan(NamedTuple):
    """An override of a variable, from its evidence to `until_s`, which is not included."""

    override: Override
    until_s: float

    def covers(self, instant_s: float) -> bool:
        return self.override.evidence_s <= instant_s < self.until_s


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
        reading: the present reading: an `Override`, or the reading of the sources.
        overridden_until_s: the end of the last override that has ended.
        invalidated_s: when a skill last changed the variable.
        late_reading_count: the number of readings that were identified after their evidence was taken.
    """

    __slots__ = (
        "_has_dropped_readings",
        "_history_limit",
        "_max_readings",
        "_override_spans",
        "_pinned_instants_s",
        "_readings",
        "invalidated_s",
        "late_reading_count",
        "overridden_until_s",
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
        self.overridden_until_s = BEFORE_ALL_S
        self._override_spans: list[_OverrideSpan] = []
        self._readings: list[Reading[Value]] = []
        self._history_limit = history
        self._max_readings = max(history, MIN_KEPT_READINGS)
        self._pinned_instants_s: list[float] = []
        self._has_dropped_readings = False

    @property
    def observed(self) -> Reading[Value]:
        """Return the present reading of the sources, which an override hides."""
        reading = self.reading
        return reading.beneath if isinstance(reading, Override) else reading

    def admits(self, start_s: float, stamp_s: float) -> bool:
        """Return whether evidence counts: false if the variable was invalidated while the evidence was taken."""
        return not start_s <= self.invalidated_s <= stamp_s

    def write(self, reading: Reading[Value]) -> bool:
        """Add a reading to the history. It becomes the present reading unless the present one has newer evidence.

        Returns:
            Whether the added reading is now the present reading of the sources.
        """
        self._append(reading)
        present_reading = self.reading
        if isinstance(present_reading, Override):
            is_present = reading.evidence_s >= present_reading.beneath.evidence_s
            if is_present:
                self.reading = replace(present_reading, beneath=reading)
        else:
            is_present = reading.evidence_s >= present_reading.evidence_s
            if is_present:
                self.reading = reading
        return is_present

    def replace_observed(self, reading: Reading[Value]) -> None:
        """Replace the present reading of the sources; an override goes on to hide it."""
        present_reading = self.reading
        if isinstance(present_reading, Override):
            self.reading = replace(present_reading, beneath=reading)
        else:
            self.reading = reading

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
        """Make the reading of the sources unknown if it is no longer valid; return whether it became unknown."""
        observed = self.observed
        reading = observed.at(now_s)
        if reading is observed:
            return False
        self.replace_observed(reading)
        return True

    def begin_override(self, override: Override) -> None:
        """Hide the reading of the sources by an override, which replaces an earlier one."""
        self.end_override(override.evidence_s)
        self.reading = override
        self._override_spans.append(_OverrideSpan(override, override.expires_s))
        if len(self._override_spans) > self._max_readings:
            del self._override_spans[0]

    def end_override(self, instant_s: float) -> bool:
        """End the override at an instant, or at its own end if this is earlier; return whether there was one."""
        override = self.reading
        if not isinstance(override, Override):
            return False
        self.overridden_until_s = min(instant_s, override.expires_s)
        self._override_spans[-1] = _OverrideSpan(self._override_spans[-1].override, self.overridden_until_s)
        self.reading = override.beneath
        return True

    def history(self) -> tuple[Reading[Value], ...]:
        """Return the newest readings, ordered by the instant of their evidence, the oldest first."""
        return tuple(self._readings[max(0, len(self._readings) - self._history_limit) :])

    def at(self, instant_s: float) -> Reading[Value]:
        """Return the reading at an instant, as far as known today.

        This is the override at the instant, or the reading of the sources.
        """
        override = self.override_at(instant_s)
        return self.observed_at(instant_s) if override is None else override

    def override_at(self, instant_s: float) -> Override | None:
        """Return the override at an instant; None if there was none."""
        spans = reversed(self._override_spans)
        return next((span.override for span in spans if span.covers(instant_s)), None)

    def observed_at(self, instant_s: float) -> Reading[Value]:
        """Return the reading of the sources at an instant, as far as known today.

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
        complete_from_s = self._readings[0].evidence_s if self._has_dropped_readings else BEFORE_ALL_S
        return max(complete_from_s, self._overrides_complete_from_s) if self._override_spans else complete_from_s

    @property
    def _overrides_complete_from_s(self) -> float:
        if len(self._override_spans) < self._max_readings:
            return BEFORE_ALL_S
        return self._override_spans[0].override.evidence_s

    @property
    def was_overridden(self) -> bool:
        """Return whether there is or was an override."""
        return bool(self._override_spans)

    def between(self, start_s: float, end_s: float) -> tuple[Reading[Value], ...]:
        """Return the readings of the sources whose evidence was taken in (start, end], in order."""
        first = bisect_right(self._readings, start_s, key=_evidence_s)
        return tuple(self._readings[first : bisect_right(self._readings, end_s, key=_evidence_s)])

    def changes(self, start_s: float, end_s: float) -> list[tuple[float, Reading[Value]]]:
        """Return the instants in (start, end] at which the variable received a reading, with these readings, in order.

        An override is one of these readings. At the end of the override, the variable receives the reading of the
        sources at this instant.
        """
        changes = [(reading.evidence_s, reading) for reading in self.between(start_s, end_s)]
        if not self._override_spans:
            return changes
        spans = self._override_spans
        changes = [change for change in changes if not any(span.covers(change[0]) for span in spans)]
        for override, until_s in spans:
            if start_s < override.evidence_s <= end_s:
                changes.append((override.evidence_s, override))
            if start_s < until_s <= end_s:
                changes.append((until_s, self.at(until_s)))
        return sorted(changes, key=itemgetter(0))


def _evidence_s(reading: Reading[Value]) -> float:
    return reading.evidence_s
