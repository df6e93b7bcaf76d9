"""The answer to a skill's preview: whether its conditions hold, and which variables it lacks (P1, Figure 1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

from codra_dsl.logic import Scope, Value
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.derived import unknown_inputs
from codra_dsl.runtime.values.model import SkillModel

TOO_OLD = "too_old"
"""The reason of a variable that is known, but from evidence that the preview may not use."""


class PreviewOutcome(StrEnum):
    """The outcome of a preview."""

    HOLDS = "holds"
    """All conditions hold, and all variables that are named alone are known."""
    VIOLATED = "violated"
    """At least one condition does not hold, for all values of the unknown variables."""
    UNKNOWN = "unknown"
    """No condition is violated, and at least one needed variable is unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownVariable:
    """A variable that leaves a preview open.

    Attributes:
        reason: why it is unknown: a `Reason`, or `too_old`.
        detail: the cause, or why it cannot be observed now; may be empty.
    """

    name: str
    reason: str
    detail: str = ""

    def __str__(self) -> str:
        return f"{self.name} ({self.reason}{f': {self.detail}' if self.detail else ''})"


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewAnswer:
    """The answer to a preview. It has no truth value, because the outcome may be `UNKNOWN`; `str` gives the reason.

    Attributes:
        skill: the skill that comes next.
        violated: the conditions that do not hold, as written in the spec.
        undecided: the conditions whose result is unknown, and the unknown variables that are named alone.
        unknown: the unknown variables that leave a condition or a name undecided.
    """

    skill: str
    violated: tuple[str, ...] = ()
    undecided: tuple[str, ...] = ()
    unknown: tuple[UnknownVariable, ...] = ()

    @property
    def outcome(self) -> PreviewOutcome:
        """Return the outcome: one violated condition is enough, even if others are undecided."""
        if self.violated:
            return PreviewOutcome.VIOLATED
        return PreviewOutcome.UNKNOWN if self.undecided else PreviewOutcome.HOLDS

    @property
    def holds(self) -> bool:
        """Return whether the skill may act: all conditions certainly hold."""
        return self.outcome is PreviewOutcome.HOLDS

    def __str__(self) -> str:
        match self.outcome:
            case PreviewOutcome.VIOLATED:
                return f"violated: {', '.join(self.violated)}"
            case PreviewOutcome.UNKNOWN:
                return f"unknown: {', '.join(map(str, self.unknown)) or ', '.join(self.undecided)}"
        return "holds"

    def __bool__(self) -> bool:
        raise TypeError(f"a preview has no truth value: use .holds, .violated or .unknown of {self.skill!r}")


class PreviewScope(Scope, Protocol):
    """Where a preview finds values, and why there is none."""

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable, whose value the scope may still refuse as too old."""
        ...


def evaluate(skill: SkillModel, scope: PreviewScope) -> PreviewAnswer:
    """Return the answer to a skill's preview in a scope."""
    entries = list(_entries(skill, scope))
    open_names = dict.fromkeys(name for _, truth, names in entries if truth is None for name in names)
    return PreviewAnswer(
        skill=skill.name,
        violated=tuple(text for text, truth, _ in entries if truth is False),
        undecided=tuple(text for text, truth, _ in entries if truth is None),
        unknown=tuple(_unknown_variable(scope.reading(name)) for name in skill.preview if name in open_names),
    )


def with_details(answer: PreviewAnswer, detail_of: Mapping[str, str]) -> PreviewAnswer:
    """Return an answer with new details for its unknown variables; a variable without a new detail keeps its detail."""
    unknown = (
        replace(variable, detail=detail_of.get(variable.name, "") or variable.detail) for variable in answer.unknown
    )
    return replace(answer, unknown=tuple(unknown))


def _entries(skill: SkillModel, scope: PreviewScope) -> Iterator[tuple[str, bool | None, tuple[str, ...]]]:
    """Yield each condition, and each variable that is named alone.

    Each has its text, its result, and the unknown variables that make the result unknown.
    """
    names_in_conditions: set[str] = set()
    for condition in skill.preview_conditions:
        names_in_conditions |= condition.condition.variables()
        truth = condition.condition.evaluate(scope)
        yield condition.text, None if truth is None else truth is True, unknown_inputs(condition.condition, scope)
    for name in skill.preview:
        if name not in names_in_conditions:
            yield name, True if scope.value(name) is not None else None, (name,)


def _unknown_variable(reading: Reading[Value]) -> UnknownVariable:
    reason = TOO_OLD if reading.reason is None else str(reading.reason)
    return UnknownVariable(name=reading.name, reason=reason, detail=reading.detail)
