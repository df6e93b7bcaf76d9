"""Choosing the course: hard rules, what a worse metric makes urgent, and the filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from codra_dsl.runtime.loops.analysis import Assessment, assess
from codra_dsl.runtime.loops.declarations import CourseModel, HardRuleModel, MapeModel, OutputModel
from codra_dsl.runtime.loops.filters import Chosen, FilterState, SwitchReason, leads, step
from codra_dsl.runtime.loops.fuzzy.bounds import End
from codra_dsl.runtime.loops.observations import SceneScope

_SAME = 1e-9

Metrics = Mapping[str, float | None]
"""What counts of each metric, by variable."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseState:
    """What is remembered of a course from one analysis to the next.

    Attributes:
        metrics: as they were when the course was chosen.
    """

    state: FilterState = field(default_factory=FilterState)
    metrics: Metrics = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One choice of a course, with all that led to it.

    Attributes:
        before: the action that was left; empty for the first choice.
        chosen: the step of the filter.
        rule: the hard rule that decided, if one did.
    """

    instant_s: float
    course: str
    action: str
    before: str
    because: SwitchReason
    assessment: Assessment
    chosen: Chosen
    rule: HardRuleModel | None = None


def metrics_of(model: MapeModel, assessment: Assessment) -> Metrics:
    """Return what counts of each metric."""
    outputs = () if model.metrics is None else model.metrics.outputs
    return {each.variable: _number(assessment.scene[each.variable].value) for each in outputs}


def worsened(model: MapeModel, now: Metrics, then: Metrics) -> Metrics:
    """Return the metrics that are worse than they were, as they were."""
    outputs = () if model.metrics is None else model.metrics.outputs
    return {
        each.variable: then[each.variable]
        for each in outputs
        if each.variable in then and _is_worse(each, now[each.variable], then[each.variable])
    }


def hard_rule(model: CourseModel, assessment: Assessment, now_s: float) -> HardRuleModel | None:
    """Return the first hard rule that certainly holds."""
    scope = SceneScope(assessment.scene, now_s)
    return next((rule for rule in model.always if rule.condition.holds(scope)), None)


def urgent(model: MapeModel, course: CourseModel, course_state: CourseState, assessment: Assessment) -> frozenset[str]:
    """Return the actions that lead the course, and would not if no metric had become worse since it was chosen."""
    running = course_state.state.action
    worse = worsened(model, metrics_of(model, assessment), course_state.metrics) if running else {}
    if not worse:
        return frozenset()
    present = assessment.weights()
    otherwise = assess(model, assessment.scene, metrics=worse).weights()
    return frozenset(
        action
        for action in course.choose
        if leads(course, present[action], present[running]) and not leads(course, otherwise[action], otherwise[running])
    )


def choose(
    model: MapeModel, course: CourseModel, course_state: CourseState, assessment: Assessment, now_s: float
) -> tuple[CourseState, Decision | None, float]:
    """Choose the course of an instant.

    Returns:
        What is to be remembered; the decision, if the course is another one; when to choose again.
    """
    rule = hard_rule(course, assessment, now_s)
    weights = assessment.weights()
    chosen = step(
        course,
        course_state.state,
        now_s,
        {action: weights[action] for action in course.choose},
        urgent=urgent(model, course, course_state, assessment),
        forced="" if rule is None else rule.action,
    )
    if chosen.because is None:
        return CourseState(state=chosen.state, metrics=course_state.metrics), None, chosen.due_s
    decision = Decision(
        instant_s=now_s,
        course=course.name,
        action=chosen.state.action,
        before=course_state.state.action,
        because=chosen.because,
        assessment=assessment,
        chosen=chosen,
        rule=rule,
    )
    return CourseState(state=chosen.state, metrics=metrics_of(model, assessment)), decision, chosen.due_s


def _is_worse(output: OutputModel, now: float | None, then: float | None) -> bool:
    if then is None or now is None:
        return then is not None
    return now < then - _SAME if output.worse is End.LOW else now > then + _SAME


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, (int, float)) else None
