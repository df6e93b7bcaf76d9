"""Rates of change, shares of time and held bools: observations that follow from the history of another variable.

An override is not evidence. So an overridden reading counts as a gap in the history, like a time in which the variable
was unknown. The same applies to a reading that is derived from an overridden one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.course_filters import JUST_AFTER_S
from codra_dsl.runtime.loops.declarations import RateKind, RateModel
from codra_dsl.runtime.loops.observations import Observation, is_evidence
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.declarations import DERIVED

MIN_SPAN_SHARE = 0.5
"""The smallest share of the window of a rate or share that the readings must span."""

RENEWAL_S = 1e-3
"""How long before a rate becomes stale it is computed again, because its input may have newer evidence by then."""

_ROUNDING_S = 1e-9

History = Sequence[Reading[Value]]
"""The readings of a variable, ordered by the instants from which on they hold."""


def observe_rate(model: RateModel, history: History, present_observation: Observation, now_s: float) -> Observation:
    """Return the observation of a rate, a share or a held bool.

    It is unknown while the other variable is unknown and, unless it is a held bool, while it is overridden. It is stale
    from the end of the validity of its evidence on.

    Args:
        model: the model of the rate.
        history: the readings of the other variable.
        present_observation: the present observation of the other variable.
        now_s: the end of the window.
    """
    if present_observation.value is None:
        return Observation(variable=model.variable, because=f"{model.of} is unknown")
    if model.kind is not RateKind.HELD and present_observation.is_overridden:
        return Observation(variable=model.variable, because=f"{model.of} is overridden")
    observed = _FUNCTIONS[model.kind](model, history, now_s)
    if observed.value is None:
        return observed
    evidence_s = history[-1].evidence_s
    expires_s = evidence_s + model.valid_for_s
    if now_s >= expires_s:
        return Observation(variable=model.variable, because=Reason.STALE)
    renewal_s = expires_s - RENEWAL_S
    until_s = min(observed.until_s, renewal_s if now_s < renewal_s else expires_s)
    return replace(observed, evidence_s=evidence_s, until_s=until_s)


# Rates


def rate(model: RateModel, history: History, now_s: float) -> Observation:
    """Return the rate of change of a variable: the slope of the line that best fits the known readings of the window.

    A derived variable keeps its value until it is derived again. So its values at both ends of the window count too.
    """
    points = _points(history, now_s - model.over_s, now_s)
    span_s, min_span_s = points[-1][0] - points[0][0] if points else 0.0, MIN_SPAN_SHARE * model.over_s
    is_derived = history[-1].source == DERIVED
    if span_s < min_span_s or span_s <= 0.0:
        since_s = points[0][0] if points else now_s
        known_from_s = since_s + min_span_s + JUST_AFTER_S if is_derived else math.inf
        because = f"{model.of} is known for {span_s:g} s, but must be for {min_span_s:g} s"
        return Observation(variable=model.variable, because=because, until_s=known_from_s, since_s=since_s)
    slope = _slope(points) * model.factor
    if not math.isfinite(slope):
        return Observation(variable=model.variable, because=f"{model.of} is not finite")
    last_needed_s = max(instant_s for instant_s, _ in points if points[-1][0] - instant_s >= min_span_s)
    unknown_from_s = math.inf if is_derived else last_needed_s + model.over_s + JUST_AFTER_S
    return Observation(variable=model.variable, value=slope + 0.0, until_s=unknown_from_s)


def _points(history: History, start_s: float, now_s: float) -> list[tuple[float, float]]:
    """Return the instants and values of the readings in the window, but only since the last gap."""
    points: list[tuple[float, float]] = []
    for reading in reversed(history):
        content = reading.content
        if not isinstance(content, (int, float)) or not is_evidence(reading):
            break
        is_derived, instant_s = reading.source == DERIVED, reading.holds_from_s
        if is_derived and not points and instant_s < now_s:
            points.append((now_s, float(content)))
        if instant_s < start_s:
            if is_derived and points[-1][0] > start_s:
                points.append((start_s, float(content)))
            break
        points.append((instant_s, float(content)))
    return points[::-1]


def _slope(points: Sequence[tuple[float, float]]) -> float:
    middle_s = math.fsum(instant_s for instant_s, _ in points) / len(points)
    mean = math.fsum(value for _, value in points) / len(points)
    spread = math.fsum((instant_s - middle_s) ** 2 for instant_s, _ in points)
    return math.fsum((instant_s - middle_s) * (value - mean) for instant_s, value in points) / spread


# Shares and held bools


@dataclass(frozen=True, slots=True)
class _Phase:
    """A time in which a bool had one reading. After the end of the validity of this reading, `content` is None."""

    content: Value | None
    from_s: float
    until_s: float
    is_evidence: bool = True


def _phases(history: History, now_s: float) -> Iterator[_Phase]:
    """Yield the phases of a history, the newest first. A reading holds until the next one."""
    end_s = now_s
    for reading in reversed(history):
        if reading.expires_s < end_s:
            yield _Phase(None, reading.expires_s, end_s)
        until_s = min(end_s, reading.expires_s)
        yield _Phase(reading.content, reading.holds_from_s, until_s, is_evidence(reading))
        end_s = reading.holds_from_s


def share(model: RateModel, history: History, now_s: float) -> Observation:
    """Return the share of time in which a bool was true, among the times of the window at which it was known."""
    start_s = now_s - model.over_s
    durations_s = [
        (phase.content, max(0.0, phase.until_s - max(start_s, phase.from_s)))
        for phase in takewhile(lambda phase: phase.until_s > start_s, _phases(history, now_s))
        if phase.content is not None and phase.is_evidence
    ]
    known_s = math.fsum(duration_s for _, duration_s in durations_s)
    min_span_s = MIN_SPAN_SHARE * model.over_s
    missing_s = min_span_s - known_s
    if missing_s > _ROUNDING_S:
        because = f"{model.of} is known for {known_s:g} s, but must be for {min_span_s:g} s"
        return Observation(variable=model.variable, because=because, until_s=now_s + missing_s + JUST_AFTER_S)
    true_s = math.fsum(duration_s for content, duration_s in durations_s if content is True)
    return Observation(variable=model.variable, value=min(true_s / known_s, 1.0))


def held(model: RateModel, history: History, now_s: float) -> Observation:
    """Return whether a bool has been true, without interruption, for `over_s`.

    The result is true if the bool was known to be true at each instant of this time, and false if it was false at one
    of them. Otherwise it is unknown. An override that is true counts while it lasts, but the time without interruption
    restarts when the override begins.
    """
    phases = list(_phases(history, now_s))
    if phases[0].content is False:
        return Observation(variable=model.variable, value=False)
    since_s = now_s
    for phase in phases:
        if phase.content is not True or phase.is_evidence is not phases[0].is_evidence:
            break
        since_s = phase.from_s
    true_from_s = since_s + model.over_s
    if true_from_s <= now_s + _ROUNDING_S:
        return Observation(variable=model.variable, value=True)
    false_until_s = max(
        (phase.until_s for phase in phases if phase.content is False and phase.is_evidence), default=-math.inf
    )
    unknown_from_s = false_until_s + model.over_s
    if unknown_from_s > now_s:
        return Observation(variable=model.variable, value=False, until_s=min(unknown_from_s, true_from_s))
    because = f"{model.of} is known to be true for {now_s - since_s:g} s, but must be for {model.over_s:g} s"
    return Observation(variable=model.variable, because=because, until_s=true_from_s, since_s=since_s)


_FUNCTIONS: Mapping[RateKind, Callable[[RateModel, History, float], Observation]] = {
    RateKind.RATE: rate,
    RateKind.SHARE: share,
    RateKind.HELD: held,
}
