"""The choice of a course: hard rules, actions that are urgent because a metric has become worse, and the filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from codra_dsl.runtime.loops.analysis import Assessment, assess
from codra_dsl.runtime.loops.course_filters import FilterState, FilterStep, SwitchReason, leads, step
from codra_dsl.runtime.loops.declarations import CourseModel, HardRuleModel, MapeModel, OutputModel
from codra_dsl.runtime.loops.fuzzy.bounds import End
from codra_dsl.runtime.loops.observations import SceneScope

_METRIC_TOLERANCE = 1e-9
_ROUNDING_S = 1e-9

Metrics = Mapping[str, float | None]
"""The value of each metric, by variable; None if it is unknown."""


@dataclass(frozen=True, slots=True)
class RuleHold:
    """The time in which the condition of a hard rule has held without interruption.

    Attributes:
        since_s: the beginning of this time.
        overridden: the overridden variables that the condition reads. When they change, the time restarts, because
            an override is not evidence.
    """

    since_s: float
    overridden: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseState:
    """The state of a course between two analyses.

    Attributes:
        metrics: the values of the metrics when the course was chosen.
        rule_holds: for the index of each hard rule that holds, since when it has held.
    """

    state: FilterState = field(default_factory=FilterState)
    metrics: Metrics = field(default_factory=dict)
    rule_holds: Mapping[int, RuleHold] = field(default_factory=dict)

    def after_pause(self) -> CourseState:
        """Return the state after a time without analyses: whether rules held and actions led is not known."""
        return replace(self, state=self.state.after_pause(), rule_holds={})


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """One choice of a course, with everything that led to it.

    Attributes:
        before: the action that was left; empty for the first choice.
        filter_step: the step of the filter.
        rule: the hard rule that decided; None if no hard rule did.
        pending_rules: the indices of the hard rules whose conditions held, but not for the required time.
    """

    instant_s: float
    course: str
    action: str
    before: str
    because: SwitchReason
    assessment: Assessment
    filter_step: FilterStep
    rule: HardRuleModel | None = None
    pending_rules: frozenset[int] = frozenset()


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
    """Return the first hard rule that certainly holds, for however short a time."""
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
    holds = _rule_holds(course, course_state, assessment, now_s)
    ready_s = {index: hold.since_s + course.always[index].for_s - _ROUNDING_S for index, hold in holds.items()}
    pending_rules = frozenset(index for index in ready_s if ready_s[index] > now_s)
    rule = next((course.always[index] for index in ready_s if index not in pending_rules), None)
    weights = assessment.weights()
    filter_step = step(
        course,
        course_state.state,
        now_s,
        {action: weights[action] for action in course.choose},
        urgent_actions=urgent_actions(model, course, course_state, assessment),
        forced_action="" if rule is None else rule.action,
    )
    due_s = min([filter_step.due_s, *(ready_s[index] + _ROUNDING_S for index in pending_rules)])
    state = replace(course_state, state=filter_step.state, rule_holds=holds)
    if filter_step.because is None:
        return state, None, due_s
    decision = Decision(
        instant_s=now_s,
        course=course.name,
        action=filter_step.state.action,
        before=course_state.state.action,
        because=filter_step.because,
        assessment=assessment,
        filter_step=filter_step,
        rule=rule,
        pending_rules=pending_rules,
    )
    return replace(state, metrics=metrics_of(model, assessment)), decision, due_s


def _rule_holds(
    course: CourseModel, course_state: CourseState, assessment: Assessment, now_s: float
) -> Mapping[int, RuleHold]:
    """Return, for the index of each hard rule that certainly holds now, since when it has held, in their order."""
    scope = SceneScope(assessment.scene, now_s)
    holds: dict[int, RuleHold] = {}
    for index, rule in enumerate(course.always):
        if rule.condition.holds(scope):
            names = rule.condition.variables()
            overridden = frozenset(name for name in names if assessment.scene[name].is_overridden)
            before = course_state.rule_holds.get(index)
            is_new = before is None or before.overridden != overridden
            holds[index] = RuleHold(now_s, overridden) if before is None or is_new else before
    return holds


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
