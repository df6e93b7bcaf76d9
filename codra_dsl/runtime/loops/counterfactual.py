"""Counterfactuals: the smallest single change of an input, and of a weight, that would have kept a course.

Each candidate is verified by running the stages again with the change: no action may lead the course by the lead, and
no hard rule may demand another action. Smoothing, hold and dwell are ignored, because they delay a switch and do not
decide it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import Assessment, assess
from codra_dsl.runtime.loops.course_filters import leads, threshold
from codra_dsl.runtime.loops.courses import Decision, hard_rule
from codra_dsl.runtime.loops.declarations import CourseModel, InputModel, MapeModel
from codra_dsl.runtime.loops.observations import Observation, number_of, value_of

_STEPS = 64
_HALVINGS = 30
_MARGIN = 1e-6


class ChangeKind(StrEnum):
    """The kind of value that is changed."""

    INPUT = "input"
    WEIGHT = "weight"


@dataclass(frozen=True, slots=True, kw_only=True)
class Counterfactual:
    """A single change that would have kept the course.

    Attributes:
        name: the name of the variable, or of the action.
        value: the value at the decision; None if it was unknown.
        other: the value that would have kept the course.
        share: the size of the change as a share of the range; 1 if the value was unknown.
    """

    kind: ChangeKind
    name: str
    value: Value | None
    other: Value
    share: float


def smallest_changes(
    model: MapeModel, course: CourseModel, decision: Decision, more: Iterable[InputModel] = ()
) -> tuple[Counterfactual, ...]:
    """Return the smallest change of an input and the smallest change of a weight that would have kept the course.

    The smaller change comes first; the result is empty if no single change would have kept the course.

    Args:
        model: the model of the loops.
        course: the model of the course.
        decision: the decision to leave the old action.
        more: inputs that hard rules read and no stage reads.
    """
    if not decision.before or would_keep(course, decision.assessment, decision.before, decision.instant_s):
        return ()  # smoothed or held weights decided; the present weights would have kept the course
    model_inputs = {model_input.variable: model_input for model_input in (*more, *_inputs(model))}
    input_changes = [
        change
        for model_input in model_inputs.values()
        for change in _input_changes(model, course, decision, model_input)
    ]
    weight_changes = [] if decision.rule is not None else list(_weight_changes(course, decision))
    smallest = [min(changes, key=_share) for changes in (input_changes, weight_changes) if changes]
    return tuple(sorted(smallest, key=_share))


def would_keep(course: CourseModel, assessment: Assessment, action: str, now_s: float) -> bool:
    """Return whether an action stays the course.

    The first hard rule that holds decides. If no hard rule holds, the action's weight must be known, and no other
    weight may lead it.
    """
    rule = hard_rule(course, assessment, now_s)
    if rule is not None:
        return rule.action == action
    weights = assessment.weights()
    action_weight = weights[action]
    if action_weight is None:
        return False
    return not any(leads(course, weights[other], action_weight) for other in course.choose if other != action)


def _share(change: Counterfactual) -> float:
    return change.share


def _inputs(model: MapeModel) -> Iterator[InputModel]:
    """Yield the inputs that the stages read and no stage computes, each once."""
    stages = [stage for stage in (model.metrics, model.actions) if stage is not None]
    metric_variables = set() if model.metrics is None else {output.variable for output in model.metrics.outputs}
    inputs = {
        model_input.variable: model_input
        for stage in stages
        for model_input in stage.inputs
        if model_input.variable not in metric_variables
    }
    yield from inputs.values()


def _input_changes(
    model: MapeModel, course: CourseModel, decision: Decision, model_input: InputModel
) -> Iterator[Counterfactual]:
    """Yield the nearest value of an input that would have kept the course."""
    scene = decision.assessment.scene
    observation = scene[model_input.variable]
    number, width = number_of(model_input, observation.value), model_input.range.high - model_input.range.low

    def keeps_course(other: float) -> bool:
        changed_observation = Observation(
            variable=model_input.variable, value=value_of(model_input, other), evidence_s=decision.instant_s
        )
        assessment = assess(model, {**scene, model_input.variable: changed_observation})
        return would_keep(course, assessment, decision.before, decision.instant_s)

    nearest = _nearest(model_input, number, keeps_course)
    if nearest is not None:
        value = value_of(model_input, nearest)
        share = 1.0 if number != number else abs(nearest - number) / width
        yield Counterfactual(
            kind=ChangeKind.INPUT, name=model_input.variable, value=observation.value, other=value, share=share
        )


def _nearest(model_input: InputModel, number: float, keeps_course: Callable[[float], bool]) -> float | None:
    """Return the value that keeps the course and is nearest to a number, or the least such value if that is NaN."""
    low, high = model_input.range.low, model_input.range.high
    if model_input.members:
        candidates = [float(index) for index in range(len(model_input.members)) if index != number]
    elif math.isfinite(high - low):
        candidates = [low + (high - low) * index / _STEPS for index in range(_STEPS + 1)]
    else:
        return None
    start = number if number == number else low
    nearest = next(
        (
            candidate
            for candidate in sorted(candidates, key=lambda candidate: abs(candidate - start))
            if keeps_course(candidate)
        ),
        None,
    )
    if nearest is None or model_input.members or number != number:
        return nearest
    return _bisect(number, nearest, keeps_course)


def _bisect(failing: float, keeping: float, keeps_course: Callable[[float], bool]) -> float:
    """Return a value that keeps the course and is as near as bisection can determine."""
    for _ in range(_HALVINGS):
        middle = (failing + keeping) / 2.0
        if keeps_course(middle):
            keeping = middle
        else:
            failing = middle
    return keeping


def _weight_changes(course: CourseModel, decision: Decision) -> Iterator[Counterfactual]:
    """Yield the changes of a single weight that would have kept the course."""
    weights = decision.assessment.weights()
    course_weight, lead = weights[decision.before], threshold(course)
    rivals = (weights[action] for action in course.choose if action != decision.before)
    rival_weights = [value for value in rivals if value is not None]
    sufficient_weights = {decision.before: max(rival_weights, default=0.0) - lead + _MARGIN}
    if course_weight is not None:
        sufficient_weights[decision.action] = course_weight + lead - _MARGIN
    for action, weight in sufficient_weights.items():
        nearest = min(1.0, max(0.0, weight))
        if _would_keep_with(course, decision, action, nearest):
            value = weights[action]
            share = 1.0 if value is None else abs(nearest - value)
            yield Counterfactual(kind=ChangeKind.WEIGHT, name=action, value=value, other=nearest, share=share)


def _would_keep_with(course: CourseModel, decision: Decision, action: str, weight: float) -> bool:
    stage = decision.assessment.actions
    outputs = tuple(replace(output, value=weight) if output.name == action else output for output in stage.outputs)
    changed_assessment = replace(decision.assessment, actions=replace(stage, outputs=outputs))
    return would_keep(course, changed_assessment, decision.before, decision.instant_s)
