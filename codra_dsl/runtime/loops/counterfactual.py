"""What would have kept the course that was left: the smallest single change of an input, and of a weight.

Each is found by asking the stages again with the change, and counts only if they then say so: no action leads the
course by its lead, and no hard rule wants another. Smoothing, hold and dwell are left aside: they delay, they do not
decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import Assessment, assess
from codra_dsl.runtime.loops.courses import Decision, hard_rule
from codra_dsl.runtime.loops.declarations import CourseModel, InputModel, MapeModel
from codra_dsl.runtime.loops.filters import leads, threshold
from codra_dsl.runtime.loops.observations import Observation, number_of, value_of

_STEPS = 64
_HALVINGS = 30
_MARGIN = 1e-6


class Changed(StrEnum):
    """What a change is a change of."""

    INPUT = "input"
    WEIGHT = "weight"


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterfactual:
    """A single change that would have kept the course.

    Attributes:
        name: of the variable, or the action.
        value: what it was; None if it was unknown.
        other: what it would have had to be.
        share: how much of its range the change is; of what was unknown, nothing can be said.
    """

    kind: Changed
    name: str
    value: Value | None
    other: Value
    share: float


def keeping(
    model: MapeModel, course: CourseModel, decision: Decision, more: Iterable[InputModel] = ()
) -> tuple[Counterfactual, ...]:
    """Return the smallest change of an input and that of a weight, the smaller first; none where none helps.

    Args:
        model: of the loops.
        course: that was left.
        decision: for another one.
        more: inputs that hard rules read and no stage does.
    """
    if not decision.before or would_keep(course, decision.assessment, decision.before, decision.instant_s):
        return ()  # what was known would have kept it: what came before, smoothed or held, decided
    asked = {each.variable: each for each in (*more, *_inputs(model))}
    inputs = [found for each in asked.values() for found in _of_input(model, course, decision, each)]
    weights = [] if decision.rule is not None else list(_of_weights(course, decision))
    smallest = [min(found, key=_share) for found in (inputs, weights) if found]
    return tuple(sorted(smallest, key=_share))


def would_keep(course: CourseModel, assessment: Assessment, action: str, now_s: float) -> bool:
    """Return whether nothing takes an action's place: no hard rule, and no weight that leads."""
    rule = hard_rule(course, assessment, now_s)
    if rule is not None:
        return rule.action == action
    weights = assessment.weights()
    of_action = weights[action]
    if of_action is None:
        return False
    return not any(leads(course, weights[other], of_action) for other in course.choose if other != action)


def _share(found: Counterfactual) -> float:
    return found.share


def _inputs(model: MapeModel) -> Iterator[InputModel]:
    """Yield what the stages read and no stage works out, each once."""
    stages = [stage for stage in (model.metrics, model.actions) if stage is not None]
    judged = set() if model.metrics is None else {each.variable for each in model.metrics.outputs}
    inputs = {each.variable: each for stage in stages for each in stage.inputs if each.variable not in judged}
    yield from inputs.values()


def _of_input(model: MapeModel, course: CourseModel, decision: Decision, each: InputModel) -> Iterator[Counterfactual]:
    """Yield the nearest value of an input with which the course would have stood."""
    scene = decision.assessment.scene
    seen = scene[each.variable]
    number, width = number_of(each, seen.value), each.range.high - each.range.low

    def keeps(other: float) -> bool:
        changed = Observation(variable=each.variable, value=value_of(each, other), evidence_s=decision.instant_s)
        found = assess(model, {**scene, each.variable: changed})
        return would_keep(course, found, decision.before, decision.instant_s)

    found = _nearest(each, number, keeps)
    if found is not None:
        value = value_of(each, found)
        share = 1.0 if number != number else abs(found - number) / width
        yield Counterfactual(kind=Changed.INPUT, name=each.variable, value=seen.value, other=value, share=share)


def _nearest(each: InputModel, number: float, keeps: Callable[[float], bool]) -> float | None:
    """Return the value nearest to a number that keeps, if any does: of an unknown one, the least."""
    low, high = each.range.low, each.range.high
    if each.members:
        places = [float(index) for index in range(len(each.members)) if index != number]
    elif math.isfinite(high - low):
        places = [low + (high - low) * index / _STEPS for index in range(_STEPS + 1)]
    else:
        return None
    start = number if number == number else low
    found = next((place for place in sorted(places, key=lambda place: abs(place - start)) if keeps(place)), None)
    if found is None or each.members or number != number:
        return found
    return _narrowed(number, found, keeps)


def _narrowed(away: float, kept: float, keeps: Callable[[float], bool]) -> float:
    """Return a value that keeps and is as near as halving finds."""
    for _ in range(_HALVINGS):
        middle = (away + kept) / 2.0
        if keeps(middle):
            kept = middle
        else:
            away = middle
    return kept


def _of_weights(course: CourseModel, decision: Decision) -> Iterator[Counterfactual]:
    """Yield which single weight, if it had been another, would have kept the course, and what it would have to be."""
    weights = decision.assessment.weights()
    of_course, reach = weights[decision.before], threshold(course)
    rivals = (weights[action] for action in course.choose if action != decision.before)
    others = [value for value in rivals if value is not None]
    wanted = {decision.before: max(others, default=0.0) - reach + _MARGIN}
    if of_course is not None:
        wanted[decision.action] = of_course + reach - _MARGIN
    for action, other in wanted.items():
        nearest = min(1.0, max(0.0, other))
        if _would_keep_with(course, decision, action, nearest):
            value = weights[action]
            share = 1.0 if value is None else abs(nearest - value)
            yield Counterfactual(kind=Changed.WEIGHT, name=action, value=value, other=nearest, share=share)


def _would_keep_with(course: CourseModel, decision: Decision, action: str, weight: float) -> bool:
    stage = decision.assessment.actions
    outputs = tuple(replace(each, value=weight) if each.name == action else each for each in stage.outputs)
    changed = replace(decision.assessment, actions=replace(stage, outputs=outputs))
    return would_keep(course, changed, decision.before, decision.instant_s)
