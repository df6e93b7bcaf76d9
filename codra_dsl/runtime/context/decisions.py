"""Decisions of the main execution: on the value of a variable, or on the preview of a skill (P1, section 3.3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import ClassVar, Protocol

from codra_dsl.logic import Value
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import SkillModel
from codra_dsl.runtime.values.previews import PreviewAnswer, PreviewOutcome, evaluate, with_details


class DecisionContext(Protocol):
    """The present context, as decisions read it. No method takes a lock."""

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable now."""
        ...

    def has_evidence_since(self, reading: Reading[Value], since_s: Mapping[str, float]) -> bool:
        """Return whether the value of a present reading follows from evidence since some instants, by variable."""
        ...


Explain = Callable[[Reading[Value]], Reading[Value]]
"""Adds to an unknown reading the reason why the variable cannot be observed now."""


class _Limits:
    """What limits a request: the evidence that may be used, and the wait."""

    __slots__ = ()
    max_age_s: float
    since_s: float | Mapping[str, float]
    wait_up_to_s: float

    def __post_init__(self) -> None:
        """Refuse a limit that is NaN.

        Raises:
            ValueError: if there is one.
        """
        since_s = self.since_s.values() if isinstance(self.since_s, Mapping) else (self.since_s,)
        if any(map(math.isnan, (self.max_age_s, self.wait_up_to_s, *since_s))):
            raise ValueError("`max_age_s`, `since_s` and `wait_up_to_s` of a decision must not be NaN")

    def permits(self, reading: Reading[Value], context: DecisionContext, now_s: float) -> bool:
        """Return whether a present reading is known and may be used."""
        if not reading.known or not reading.age_s(now_s) <= self.max_age_s:
            return False
        if isinstance(self.since_s, Mapping):
            return not self.since_s or context.has_evidence_since(reading, self.since_s)
        return reading.start_s >= self.since_s

    def input_details(self) -> dict[str, object]:
        """Return the details of the request for the journal: all that differ from their defaults."""
        details: dict[str, object] = {}
        for request_field in fields(self):  # type: ignore[arg-type]
            content = getattr(self, request_field.name)
            if isinstance(content, Mapping):
                details |= {"since": json_text(dict(content))} if content else {}
            elif content != request_field.default:
                details[request_field.name] = content
        return details


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionRequest(_Limits):
    """A request for the value of a variable.

    Attributes:
        variable: the variable.
        max_age_s: the largest permitted age of the evidence.
        since_s: the taking of the evidence must have begun at or after this instant; or an instant for each of some
            variables, which can be inputs of a derived variable.
        wait_up_to_s: the longest wait for observers.
        shadow: whether the main execution looks in any case.
    """

    variable: str
    max_age_s: float = math.inf
    since_s: float | Mapping[str, float] = -math.inf
    wait_up_to_s: float = 0.0
    shadow: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewRequest(_Limits):
    """A request for the answer to a skill's preview.

    Attributes:
        max_age_s: the largest permitted age of the evidence of each variable.
        since_s: for some variables, the instant at or after which the taking of the evidence must have begun; they can
            be inputs of derived variables.
        wait_up_to_s: the longest wait for observers.
        looks: whether the main execution looks for the variables that are still unknown after the wait.
    """

    skill: str
    max_age_s: float = math.inf
    since_s: Mapping[str, float] = field(default_factory=dict)
    wait_up_to_s: float = 0.0
    looks: bool = False


@dataclass(slots=True, kw_only=True)
class _State:
    """The state of one decision.

    Attributes:
        number: the number of the decision in the run, from 1.
        name: the variable or skill.
        asked_s: when the decision was requested.
        looked_s: when the main execution began its present look.
        is_over: whether the answer is final and recorded.
    """

    number: int
    name: str
    request: DecisionRequest | PreviewRequest
    asked_s: float
    looked_s: float = math.nan
    is_over: bool = False

    @property
    def is_waiting(self) -> bool:
        """Return whether the decision waits for observers after the request."""
        return not self.is_over and math.isnan(self.looked_s)

    @property
    def until_s(self) -> float:
        """Return when the wait ends."""
        return self.asked_s + self.request.wait_up_to_s


@dataclass(slots=True, kw_only=True)
class ValueDecision(_State):
    """A decision on the value of a variable.

    Attributes:
        kind: the kind of the event that states how the decision was answered.
        reading: the last reading of the variable that was looked up for this decision.
        is_decided: whether this reading answers the request.
    """

    kind: ClassVar[Kind] = Kind.DECISION
    request: DecisionRequest
    reading: Reading[Value] = field(init=False)
    is_decided: bool = False

    @property
    def is_answered(self) -> bool:
        """Return whether context has answered, so that the main execution need not look."""
        return self.is_decided and not self.request.shadow

    @property
    def variables(self) -> tuple[str, ...]:
        """Return the variables that are decided."""
        return (self.name,)

    @property
    def unknown(self) -> tuple[str, ...]:
        """Return the variables that context does not know."""
        return () if self.is_decided else (self.name,)

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the variables for which the main execution should look now."""
        return () if self.is_answered else (self.name,)

    @property
    def how(self) -> str:
        """Return how the decision was answered."""
        return "answered" if self.is_answered else "shadowed" if self.is_decided else "fell_back"

    def event_details(self, skill: str, look_details: Mapping[str, object]) -> dict[str, object]:
        """Return the details of the event that states how the decision was answered.

        Args:
            skill: the last skill that began and still runs; empty if there is none.
            look_details: the values that the main execution found by looking.
        """
        reading = self.reading
        return {
            "value": reading.content,
            "reason": reading.reason,
            "detail": reading.detail,
            "asked_s": self.asked_s,
            "source": reading.source,
            **({"skill": skill} if skill else {}),
            **look_details,
            **({"shadow": True} if self.request.shadow and not self.is_decided else {}),
        }

    def can_be_decided(self, context: DecisionContext, now_s: float) -> bool:
        """Return whether context has the answer now."""
        return self.request.permits(context.reading(self.name), context, now_s)

    def next_check_s(self, _context: DecisionContext, _now_s: float) -> float:
        """Return the next instant at which time alone can end the wait."""
        return self.until_s

    def look_up(self, context: DecisionContext, now_s: float) -> None:
        """Look up the answer in the context."""
        self.reading = context.reading(self.name)
        self.is_decided = self.request.permits(self.reading, context, now_s)

    def explain(self, explain: Explain) -> None:
        """Add the reason why a variable cannot be observed now to each unknown variable."""
        if not self.is_answered:
            self.reading = explain(self.reading)


@dataclass(frozen=True, slots=True)
class PreviewContext:
    """The context as a preview sees it: readings that the request permits, and otherwise the values found by looking.

    Attributes:
        readings: the readings of the preview's variables.
        permitted: the variables whose readings the request permits.
        looked: the readings that the main execution found, by variable.
        now_s: the present instant.
    """

    readings: Mapping[str, Reading[Value]]
    permitted: Collection[str]
    looked: Mapping[str, Reading[Value]]
    now_s: float

    def usable_reading(self, name: str) -> Reading[Value] | None:
        """Return the reading of a variable that the preview uses; None if there is none."""
        if name in self.permitted:
            return self.readings[name]
        looked_reading = self.looked.get(name)
        return looked_reading if looked_reading is not None and looked_reading.known else None

    def value(self, name: str) -> Value | None:
        """Return the value of a variable, or None if the preview may use none."""
        reading = self.usable_reading(name)
        return None if reading is None else reading.content

    def age_s(self, name: str) -> float | None:
        """Return the age of a variable's evidence, or None if the preview may use none."""
        reading = self.usable_reading(name)
        return None if reading is None else reading.age_s(self.now_s)

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable, which the request may not permit."""
        return self.readings[name]


@dataclass(slots=True, kw_only=True)
class Preview(_State):
    """A decision on the preview of a skill; its properties and methods are those of `ValueDecision`.

    Attributes:
        looked: the readings that the main execution found, by variable; unknown where it found no value.
        context: the context in which the answer was last evaluated.
        answer: this answer.
    """

    kind: ClassVar[Kind] = Kind.PREVIEW
    request: PreviewRequest
    skill: SkillModel
    looked: dict[str, Reading[Value]] = field(default_factory=dict)
    context: PreviewContext = field(init=False)
    answer: PreviewAnswer = field(init=False)

    @property
    def variables(self) -> tuple[str, ...]:
        """Return the variables of the preview."""
        return self.skill.preview

    @property
    def is_decided(self) -> bool:
        """Return whether the preview certainly holds, or is certainly violated."""
        return self.answer.outcome is not PreviewOutcome.UNKNOWN

    @property
    def unknown(self) -> tuple[str, ...]:
        """Return the variables that leave the preview undecided."""
        return () if self.is_decided else tuple(variable.name for variable in self.answer.unknown)

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the variables for which the main execution should look now; none, if this cannot change the answer."""
        return tuple(name for name in self.unknown if name not in self.looked) if self.request.looks else ()

    @property
    def how(self) -> str:
        """Return how the preview was answered."""
        return "fell_back" if self.looked else "answered" if self.is_decided else "unanswered"

    def event_details(self, _skill: str, look_details: Mapping[str, object]) -> dict[str, object]:
        """Return the details of the event that states how the preview was answered."""
        answer, names = self.answer, self.skill.preview
        lists = {
            "violated": answer.violated,
            "undecided": answer.undecided,
            "unknown": [variable.name for variable in answer.unknown],
            "reasons": [variable.reason for variable in answer.unknown],
            "details": [variable.detail for variable in answer.unknown],
            "looked": self.looked,
        }
        usable_readings = map(self.context.usable_reading, names)
        return {
            "outcome": str(answer.outcome),
            **{key: list(entries) for key, entries in lists.items() if entries},
            "variables": list(names),
            "sources": ["" if reading is None else reading.source for reading in usable_readings],
            "asked_s": self.asked_s,
            **look_details,
        }

    def can_be_decided(self, context: DecisionContext, now_s: float) -> bool:
        """Return whether context, with the values found by looking, decides the preview now."""
        return evaluate(self.skill, self._preview_context(context, now_s)).outcome is not PreviewOutcome.UNKNOWN

    def next_check_s(self, context: DecisionContext, now_s: float) -> float:
        """Return the next instant at which the wait ends, or an age in a condition passes its limit."""
        preview_context = self._preview_context(context, now_s)
        waits_s = (condition.condition.flips_s(preview_context) for condition in self.skill.preview_conditions)
        return min([self.until_s, *(now_s + wait_s for wait_s in waits_s if wait_s is not None)])

    def look_up(self, context: DecisionContext, now_s: float) -> None:
        """Evaluate the preview."""
        self.context = self._preview_context(context, now_s)
        self.answer = evaluate(self.skill, self.context)

    def explain(self, explain: Explain) -> None:
        """Add to each unknown variable the reason why it cannot be observed now."""
        readings = (self.context.readings[variable.name] for variable in self.answer.unknown)
        self.answer = with_details(self.answer, {reading.name: explain(reading).detail for reading in readings})

    def _preview_context(self, context: DecisionContext, now_s: float) -> PreviewContext:
        readings = {name: context.reading(name) for name in self.skill.preview}
        permitted = {name for name, reading in readings.items() if self.request.permits(reading, context, now_s)}
        return PreviewContext(readings, permitted, self.looked, now_s)


Decision = ValueDecision | Preview
"""A decision of the main execution."""
