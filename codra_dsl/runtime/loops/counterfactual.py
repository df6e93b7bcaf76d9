"""Counterfactuals: the smallest change of one input, or of one weight, that would have kept a course.

Each candidate is verified: with the changed input or weight, no other weight may exceed the weight of the course by the
required lead, and no hard rule may demand another action. For a changed input, the stages are run again. Smoothing,
hold and dwell are ignored, because they only delay a switch.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import Assessment, assess
from codra_dsl.runtime.loops.course_filters import lead_threshold, leads
from codra_dsl.runtime.loops.courses import Decision, hard_rule
from codra_dsl.runtime.loops.declarations import CourseModel, InputModel, MapeModel
from codra_dsl.runtime.loops.observations import Observation, number_of, value_of

_GRID_STEPS = 64
_BISECTION_STEPS = 30
_WEIGHT_MARGIN = 1e-6


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
    model: MapeModel,
    course: CourseModel,
    decision: Decision,
    hard_rule_inputs: Iterable[InputModel] = (),
    whole_numbers: Collection[str] = (),
) -> tuple[Counterfactual, ...]:
    """Return the smallest change of an input and the smallest change of a weight that would have kept the course.

    The smaller change comes first; the result is empty if no single change would have kept the course.

    Args:
        model: the model of the loops.
        course: the model of the course.
        decision: the decision to leave the old action.
        hard_rule_inputs: inputs that hard rules read and no stage reads.
        whole_numbers: the variables that have only whole numbers.
    """
    ready_rules = (rule for index, rule in enumerate(course.always) if index not in decision.pending_rules)
    course = replace(course, always=tuple(ready_rules))
    if not decision.before or would_keep_course(course, decision.assessment, decision.before, decision.instant_s):
        return ()  # smoothing or the hold time caused the switch: the present weights would have kept the course
    model_inputs = {model_input.variable: model_input for model_input in (*hard_rule_inputs, *_stage_inputs(model))}
    input_changes = [
        change
        for model_input in model_inputs.values()
        for change in _input_changes(model, course, decision, model_input, model_input.variable in whole_numbers)
    ]
    weight_changes = [] if decision.rule is not None else list(_weight_changes(course, decision))
    smallest_change_per_kind = [min(changes, key=_get_share) for changes in (input_changes, weight_changes) if changes]
    return tuple(sorted(smallest_change_per_kind, key=_get_share))


def would_keep_course(course: CourseModel, assessment: Assessment, action: str, now_s: float) -> bool:
    """Return whether an action would remain the course.

    The first hard rule that holds decides. If no hard rule holds, the action's weight must be known, and no other
    weight may exceed this weight by the required lead.
    """
    rule = hard_rule(course, assessment, now_s)
    if rule is not None:
        return rule.action == action
    weights = assessment.weights()
    action_weight = weights[action]
    if action_weight is None:
        return False
    return not any(leads(course, weights[other], action_weight) for other in course.choose if other != action)


def _get_share(change: Counterfactual) -> float:
    return change.share


def _stage_inputs(model: MapeModel) -> Iterator[InputModel]:
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
    model: MapeModel, course: CourseModel, decision: Decision, model_input: InputModel, is_whole: bool
) -> Iterator[Counterfactual]:
    """Yield the smallest change of an input that would have kept the course; nothing if there is none."""
    scene = decision.assessment.scene
    observation = scene[model_input.variable]
    number, range_width = number_of(model_input, observation.value), model_input.range.high - model_input.range.low

    def keeps_course(candidate: float) -> bool:
        changed_observation = Observation(
            variable=model_input.variable, value=value_of(model_input, candidate), evidence_s=decision.instant_s
        )
        assessment = assess(model, {**scene, model_input.variable: changed_observation})
        return would_keep_course(course, assessment, decision.before, decision.instant_s)

    nearest_number = _nearest_keeping_number(model_input, number, is_whole, keeps_course)
    if nearest_number is not None:
        value = int(nearest_number) if is_whole else value_of(model_input, nearest_number)
        share = 1.0 if number != number else abs(nearest_number - number) / range_width
        yield Counterfactual(
            kind=ChangeKind.INPUT, name=model_input.variable, value=observation.value, other=value, share=share
        )


def _nearest_keeping_number(
    model_input: InputModel, number: float, is_whole: bool, keeps_course: Callable[[float], bool]
) -> float | None:
    """Return the value nearest to `number` that keeps the course; None if there is no such value.

    If `number` is NaN, return the least value that keeps the course.
    """
    low, high = model_input.range.low, model_input.range.high
    if model_input.members:
        candidates = [float(index) for index in range(len(model_input.members)) if index != number]
    elif math.isfinite(high - low):
        candidates = [low + (high - low) * index / _GRID_STEPS for index in range(_GRID_STEPS + 1)]
        candidates = sorted({float(round(candidate)) for candidate in candidates}) if is_whole else candidates
    else:
        return None
    reference_number = number if number == number else low
    nearest_number = next(
        (
            candidate
            for candidate in sorted(candidates, key=lambda candidate: abs(candidate - reference_number))
            if keeps_course(candidate)
        ),
        None,
    )
    if nearest_number is None or model_input.members or number != number:
        return nearest_number
    return _bisect(number, nearest_number, is_whole, keeps_course)


def _bisect(
    failing_number: float, keeping_number: float, is_whole: bool, keeps_course: Callable[[float], bool]
) -> float:
    """Return a value that keeps the course, found by bisection as near to `failing_number` as possible."""
    for _ in range(_BISECTION_STEPS):
        middle = (failing_number + keeping_number) / 2.0
        if is_whole:
            middle = math.floor(middle)
            if middle in (failing_number, keeping_number):
                break
        if keeps_course(middle):
            keeping_number = middle
        else:
            failing_number = middle
    return keeping_number


def _weight_changes(course: CourseModel, decision: Decision) -> Iterator[Counterfactual]:
    """Yield the changes of a single weight that would have kept the course."""
    weights = decision.assessment.weights()
    course_weight, min_lead = weights[decision.before], lead_threshold(course)
    all_rival_weights = (weights[action] for action in course.choose if action != decision.before)
    known_rival_weights = [value for value in all_rival_weights if value is not None]
    sufficient_weights = {decision.before: max(known_rival_weights, default=0.0) - min_lead + _WEIGHT_MARGIN}
    if course_weight is not None:
        sufficient_weights[decision.action] = course_weight + min_lead - _WEIGHT_MARGIN
    for action, weight in sufficient_weights.items():
        clamped_weight = min(1.0, max(0.0, weight))
        if _would_keep_course_with_weight(course, decision, action, clamped_weight):
            value = weights[action]
            share = 1.0 if value is None else abs(clamped_weight - value)
            yield Counterfactual(kind=ChangeKind.WEIGHT, name=action, value=value, other=clamped_weight, share=share)


def _would_keep_course_with_weight(course: CourseModel, decision: Decision, action: str, weight: float) -> bool:
    stage = decision.assessment.actions
    outputs = tuple(replace(output, value=weight) if output.name == action else output for output in stage.outputs)
    changed_assessment = replace(decision.assessment, actions=replace(stage, outputs=outputs))
    return would_keep_course(course, changed_assessment, decision.before, decision.instant_s)
