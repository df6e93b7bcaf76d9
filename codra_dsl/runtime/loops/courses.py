"""The choice of a course: hard rules, actions that are urgent because a metric has become worse, and the filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from codra_dsl.runtime.loops.analysis import Assessment, assess
from codra_dsl.runtime.loops.course_filters import FilterState, FilterStep, SwitchReason, leads, step
from codra_dsl.runtime.loops.declarations import CourseModel, HardRuleModel, MapeModel, OutputModel
from codra_dsl.runtime.loops.fuzzy.bounds import End
from codra_dsl.runtime.loops.observations import SceneScope

_METRIC_TOLERANCE = 1e-9

Metrics = Mapping[str, float | None]
"""The value of each metric, by variable; None if it is unknown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseState:
    """The state of a course between two analyses.

    Attributes:
        metrics: the values of the metrics when the course was chosen.
    """

    state: FilterState = field(default_factory=FilterState)
    metrics: Metrics = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One choice of a course, with everything that led to it.

    Attributes:
        before: the action that was left; empty for the first choice.
        filter_step: the step of the filter.
        rule: the hard rule that decided; None if no hard rule did.
    """

    instant_s: float
    course: str
    action: str
    before: str
    because: SwitchReason
    assessment: Assessment
    filter_step: FilterStep
    rule: HardRuleModel | None = None


def metrics_of(model: MapeModel, assessment: Assessment) -> Metrics:
    """Return the value of each metric."""
    outputs = () if model.metrics is None else model.metrics.outputs
    return {metric.variable: _float_or_none(assessment.scene[metric.variable].value) for metric in outputs}


def values_before_worsening(model: MapeModel, metrics_now: Metrics, metrics_then: Metrics) -> Metrics:
    """Return a mapping from each metric that has become worse to its old value."""
    outputs = () if model.metrics is None else model.metrics.outputs
    return {
        metric.variable: metrics_then[metric.variable]
        for metric in outputs
        if metric.variable in metrics_then
        and _is_worse(metric, metrics_now[metric.variable], metrics_then[metric.variable])
    }


def hard_rule(model: CourseModel, assessment: Assessment, now_s: float) -> HardRuleModel | None:
    """Return the first hard rule that certainly holds."""
    scope = SceneScope(assessment.scene, now_s)
    return next((rule for rule in model.always if rule.condition.holds(scope)), None)


def urgent_actions(
    model: MapeModel, course: CourseModel, course_state: CourseState, assessment: Assessment
) -> frozenset[str]:
    """Return the actions that lead the course only because a metric has become worse since the course was chosen.

    Such an action is urgent. This depends on the effect on the weights and not on the size of the metric's change: the
    action would not lead if the metrics that have become worse still had the values that they had at the last switch.
    """
    running_action = course_state.state.action
    former_metrics = (
        values_before_worsening(model, metrics_of(model, assessment), course_state.metrics) if running_action else {}
    )
    if not former_metrics:
        return frozenset()
    weights = assessment.weights()
    former_weights = assess(model, assessment.scene, metrics=former_metrics).weights()
    return frozenset(
        action
        for action in course.choose
        if leads(course, weights[action], weights[running_action])
        and not leads(course, former_weights[action], former_weights[running_action])
    )


def choose(
    model: MapeModel, course: CourseModel, course_state: CourseState, assessment: Assessment, now_s: float
) -> tuple[CourseState, Decision | None, float]:
    """Choose the course of an instant.

    Returns:
        The new state; the decision, or None if the course does not change; the instant at which to choose again.
    """
    rule = hard_rule(course, assessment, now_s)
    weights = assessment.weights()
    filter_step = step(
        course,
        course_state.state,
        now_s,
        {action: weights[action] for action in course.choose},
        urgent_actions=urgent_actions(model, course, course_state, assessment),
        forced_action="" if rule is None else rule.action,
    )
    if filter_step.because is None:
        return CourseState(state=filter_step.state, metrics=course_state.metrics), None, filter_step.due_s
    decision = Decision(
        instant_s=now_s,
        course=course.name,
        action=filter_step.state.action,
        before=course_state.state.action,
        because=filter_step.because,
        assessment=assessment,
        filter_step=filter_step,
        rule=rule,
    )
    return CourseState(state=filter_step.state, metrics=metrics_of(model, assessment)), decision, filter_step.due_s


def _is_worse(output: OutputModel, value_now: float | None, value_then: float | None) -> bool:
    if value_then is None or value_now is None:
        return value_then is not None
    return (
        value_now < value_then - _METRIC_TOLERANCE
        if output.worse is End.LOW
        else value_now > value_then + _METRIC_TOLERANCE
    )


def _float_or_none(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) else None
