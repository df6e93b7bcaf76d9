"""Previews: one decision on everything that a skill needs before it acts (P1, section 3.3 and Figure 1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import SkillModel
from codra_dsl.runtime.values.previews import PreviewAnswer, PreviewOutcome


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewRequest:
    """A request for the answer to a skill's preview.

    Attributes:
        max_age_s: the largest permitted age of the evidence of each variable.
        since_s: for some variables, the instant at or after which the taking of the evidence must have begun.
        wait_up_to_s: the longest wait for observers.
        looks: whether the main execution looks for the variables that are still unknown after the wait.
    """

    skill: str
    max_age_s: float = math.inf
    since_s: Mapping[str, float] = field(default_factory=dict)
    wait_up_to_s: float = 0.0
    looks: bool = False

    def __post_init__(self) -> None:
        """Refuse a limit that is NaN.

        Raises:
            ValueError: if there is one.
        """
        if any(map(math.isnan, (self.max_age_s, self.wait_up_to_s, *self.since_s.values()))):
            raise ValueError("`max_age_s`, `since_s` and `wait_up_to_s` of a preview must not be NaN")

    def permits(self, reading: Reading[Value], now_s: float) -> bool:
        """Return whether the preview may use a reading at an instant."""
        since_s = self.since_s.get(reading.name, -math.inf)
        return reading.known and reading.start_s >= since_s and reading.age_s(now_s) <= self.max_age_s


@dataclass(slots=True, kw_only=True)
class Preview:
    """The state of one preview.

    Attributes:
        number: the number of the decision in the run, from 1; previews and decisions on variables share the numbers.
        asked_s: when the preview was requested.
        looked: what the main execution found, by variable; None where it found no value.
        looked_s: when the main execution began its present look.
        sources: for each variable that the last evaluation read, the source of its value; empty if it was unknown.
        answer: the answer of the last evaluation.
        is_over: whether the answer is final and recorded.
    """

    number: int
    request: PreviewRequest
    skill: SkillModel
    asked_s: float
    looked: dict[str, Value | None] = field(default_factory=dict)
    looked_s: float = math.nan
    sources: Mapping[str, str] = field(default_factory=dict)
    answer: PreviewAnswer
    is_over: bool = False

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the variables for which the main execution should look now; none, if this cannot change the answer."""
        if not self.request.looks or self.answer.outcome is not PreviewOutcome.UNKNOWN:
            return ()
        return tuple(variable.name for variable in self.answer.unknown if variable.name not in self.looked)


@dataclass(frozen=True, slots=True)
class PreviewContext:
    """The context as a preview sees it: readings that the request permits, and otherwise what was found by looking."""

    request: PreviewRequest
    readings: Mapping[str, Reading[Value]]
    looked: Mapping[str, Value | None]
    now_s: float

    def value(self, name: str) -> Value | None:
        """Return the value of a variable, or None if the preview may use none."""
        reading = self.readings[name]
        return reading.content if self.request.permits(reading, self.now_s) else self.looked.get(name)

    def age_s(self, name: str) -> float | None:
        """Return the age of a variable's evidence, which is 0 for a value that was found by looking."""
        reading = self.readings[name]
        if self.request.permits(reading, self.now_s):
            return reading.age_s(self.now_s)
        return None if self.looked.get(name) is None else 0.0

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable, which the request may not permit."""
        return self.readings[name]
