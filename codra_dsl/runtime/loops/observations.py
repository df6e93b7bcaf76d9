"""Inputs of the analysis: the readings of context at one instant, as the numbers that engines read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.declarations import InputModel
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds, point
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Reading
from codra_dsl.runtime.values.declarations import DERIVED, OPERATOR


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """The value of one variable at one instant, or why it is unknown.

    Attributes:
        value: the value; None if it is unknown.
        evidence_s: when the evidence was taken; minus infinity if the value is unknown.
        because: why the value is unknown; empty if the value is known.
        is_overridden: whether the value is an override, or is derived from one.
        until_s: for a rate, share or held bool, the instant at which it must be computed again even without a change of
            its input, because it becomes known, unknown or stale, or a held bool changes; infinite if there is none.
        since_s: for an unknown rate, the instant since which its readings have no gap; for a bool that is not held long
            enough, the instant since which it is true; otherwise minus infinity.
    """

    variable: str
    value: Value | None = None
    evidence_s: float = BEFORE_ALL_S
    because: str = ""
    is_overridden: bool = False
    until_s: float = math.inf
    since_s: float = BEFORE_ALL_S

    @classmethod
    def of(cls, reading: Reading[Value]) -> Observation:
        """Return the observation of a reading."""
        if reading.known:
            return cls(
                variable=reading.name,
                value=reading.content,
                evidence_s=reading.evidence_s,
                is_overridden=not is_evidence(reading),
            )
        return cls(variable=reading.name, because=str(reading.reason))


def is_evidence(reading: Reading[Value]) -> bool:
    """Return whether a reading rests on evidence: it is not an override, and is not derived from one."""
    return reading.source != OPERATOR and not (reading.source == DERIVED and reading.start_s == BEFORE_ALL_S)


Scene = Mapping[str, Observation]
"""The observations of one instant, by variable."""


@dataclass(frozen=True, slots=True)
class SceneScope:
    """A scene in the form in which conditions read it."""

    scene: Scene
    now_s: float

    def value(self, name: str) -> Value | None:
        """Return the value of a variable; None if it is unknown."""
        return self.scene[name].value

    def age_s(self, name: str) -> float | None:
        """Return the time since the evidence was taken; None if the value is unknown."""
        observation = self.scene[name]
        return None if observation.value is None else self.now_s - observation.evidence_s


def number_of(model: InputModel, value: Value | None) -> float:
    """Return the engine's number for a value; NaN if the value is unknown."""
    if value is None:
        return math.nan
    if isinstance(value, str):
        return float(model.members.index(value)) if value in model.members else math.nan
    return float(value)


def value_of(model: InputModel, number: float) -> Value:
    """Return the value for a number of the engine."""
    if not model.members:
        return number
    member = model.members[round(number)]
    return member == "true" if model.members == ("false", "true") else member


def possible_values(model: InputModel, number: float) -> tuple[Bounds, ...]:
    """Return the possible values of an input: one number, each of its members, or its full range.

    The possible values of an unknown enum or bool are its members. A range would also contain numbers between crisp
    terms, at which no rule acts.
    """
    if number == number:
        return (point(number) if math.isfinite(number) else Bounds(number, number),)
    return tuple(point(float(index)) for index in range(len(model.members))) or (model.range,)
