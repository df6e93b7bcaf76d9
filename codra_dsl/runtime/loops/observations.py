"""Inputs of the analysis: readings of context at one instant, and rates of change over their histories."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.declarations import InputModel, RateModel
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds, point
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Reading

MIN_SPAN_SHARE = 0.5
"""The smallest share of a rate's window that the readings must span."""

_ROUNDING_S = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """The value of one variable at one instant, or why it is unknown.

    Attributes:
        value: the value; None if it is unknown.
        evidence_s: when the evidence was taken; minus infinity if the value is unknown.
        because: why the value is unknown; empty if the value is known.
    """

    variable: str
    value: Value | None = None
    evidence_s: float = BEFORE_ALL_S
    because: str = ""

    @classmethod
    def of(cls, reading: Reading[Value]) -> Observation:
        """Return the observation of a reading."""
        if reading.known:
            return cls(variable=reading.name, value=reading.content, evidence_s=reading.evidence_s)
        return cls(variable=reading.name, because=str(reading.reason))


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


def share(
    model: RateModel, history: Sequence[Reading[Value]], present_observation: Observation, now_s: float
) -> Observation:
    """Return the share of time in which a bool was true, among the times of the window at which it was known.

    A reading holds until the next reading, or until it is no longer valid; a derived variable gets a reading whenever
    its value changes. The arguments are those of `rate`.
    """
    if present_observation.value is None:
        return Observation(variable=model.variable, because=f"{model.of} is unknown")
    ends_s = [*(reading.holds_from_s for reading in history[1:]), now_s]
    start_s = now_s - model.over_s
    durations_s = [
        (reading.content, max(0.0, min(end_s, reading.expires_s) - max(start_s, reading.holds_from_s)))
        for reading, end_s in zip(history, ends_s, strict=False)
        if reading.content is not None
    ]
    known_s = math.fsum(duration_s for _, duration_s in durations_s)
    if known_s < MIN_SPAN_SHARE * model.over_s - _ROUNDING_S:
        return Observation(variable=model.variable, because=f"{model.of} is known for {known_s:g} s only")
    true_s = math.fsum(duration_s for content, duration_s in durations_s if content is True)
    value = min(true_s / known_s, 1.0)
    return Observation(variable=model.variable, value=value, evidence_s=present_observation.evidence_s)


def rate(
    model: RateModel, history: Sequence[Reading[Value]], present_observation: Observation, now_s: float
) -> Observation:
    """Return the rate of change of a variable: the slope of the line that best fits the known readings of the window.

    Args:
        model: the model of the rate.
        history: the readings of the variable, ordered by the instants from which on they hold.
        present_observation: the present observation of the variable.
        now_s: the end of the window.
    """
    if present_observation.value is None:
        return Observation(variable=model.variable, because=f"{model.of} is unknown")
    points = _points(history, now_s - model.over_s)
    span_s = points[-1][0] - points[0][0] if points else 0.0
    if span_s < MIN_SPAN_SHARE * model.over_s or span_s <= 0.0:
        return Observation(variable=model.variable, because=f"{model.of} is known for {span_s:g} s only")
    slope = _slope(points) * model.factor
    if not math.isfinite(slope):
        return Observation(variable=model.variable, because=f"{model.of} is not finite")
    return Observation(variable=model.variable, value=slope + 0.0, evidence_s=history[-1].evidence_s)


def _points(history: Sequence[Reading[Value]], since_s: float) -> list[tuple[float, float]]:
    """Return the instants and values of the readings in the window, but only since the variable was last unknown."""
    points: list[tuple[float, float]] = []
    for reading in reversed(history):
        if reading.holds_from_s < since_s or not isinstance(reading.content, (int, float)):
            break
        points.append((reading.holds_from_s, float(reading.content)))
    return points[::-1]


def _slope(points: Sequence[tuple[float, float]]) -> float:
    middle_s = math.fsum(instant_s for instant_s, _ in points) / len(points)
    mean = math.fsum(value for _, value in points) / len(points)
    spread = math.fsum((instant_s - middle_s) ** 2 for instant_s, _ in points)
    return math.fsum((instant_s - middle_s) * (value - mean) for instant_s, value in points) / spread
