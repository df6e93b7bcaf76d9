"""Details of events about analyses and decisions: plain values, without None."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.loops.analysis import Assessment, Degree, OutputResult, RuleActivation, Stage
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.courses import Decision
from codra_dsl.runtime.loops.declarations import CourseModel, MapeModel, RateModel, StageModel
from codra_dsl.runtime.loops.observations import Observation

Details = dict[str, Any]


def chain_of(loop: str, course: CourseModel, decision: Decision) -> Details:
    """Return the chain of a decision, from the readings to the action."""
    filter_state = decision.filter_step.before
    rule = decision.rule
    return _without_none(
        loop=loop,
        variable=course.variable or None,
        action=decision.action,
        before=decision.before or None,
        because=str(decision.because),
        rule=None if rule is None else str(rule),
        place=(course.place if rule is None else rule.place) or None,
        since_s=_finite_or_none(filter_state.since_s),
        dwell_until_s=_finite_or_none(filter_state.dwell_until_s(course)),
        weights=[
            _weight_details(course, decision, weight)
            for weight in decision.assessment.actions.outputs
            if weight.name in course.choose
        ],
        **evidence_of(decision.assessment, [name for rule in course.always for name in rule.condition.variables()]),
    )


def evidence_of(assessment: Assessment, extra_variables: Iterable[str] = ()) -> Details:
    """Return the details of an assessment: the readings, and the results of the stages.

    Args:
        assessment: the assessment of the instant.
        extra_variables: variables that a condition reads, even if no stage reads them.
    """
    stages = (assessment.metrics, assessment.actions)
    return {
        "readings": _readings_details(stages, [assessment.scene[name] for name in sorted(set(extra_variables))]),
        "degrees": [
            _degree_details(degree) for degree in dict.fromkeys(degree for stage in stages for degree in stage.degrees)
        ],
        "rules": [_rule_details(rule) for stage in stages for rule in stage.rules],
        "metrics": [_output_details(metric) for metric in assessment.metrics.outputs],
    }


def rate_details(rate: RateModel, observation: Observation) -> Details:
    """Return the description of a rate, and the missing information while it is unknown."""
    return _without_none(
        variable=rate.variable,
        rule=str(rate),
        input=rate.of,
        message=observation.because or None,
        since_s=_finite_or_none(observation.since_s) if observation.value is None else None,
        known_from_s=_finite_or_none(observation.until_s) if observation.value is None else None,
    )


def analysis_of(model: MapeModel, assessment: Assessment, variables: Collection[str]) -> Details:
    """Return the derivation of some metrics and weights, from the readings to the results."""
    metrics = () if model.metrics is None else _explain_outputs(model.metrics, assessment.metrics, variables)
    weights = () if model.actions is None else _explain_outputs(model.actions, assessment.actions, variables)
    outputs = [*metrics, *weights]
    inputs = {observation.variable: observation for output in outputs for observation in output.inputs}
    return {
        "readings": [_reading_details(observation) for observation in inputs.values()],
        "degrees": [
            _degree_details(degree)
            for degree in dict.fromkeys(degree for output in outputs for degree in output.degrees)
        ],
        "rules": [_rule_details(rule) for rule in dict.fromkeys(rule for output in outputs for rule in output.rules)],
        "metrics": [output.details() for output in metrics],
        "weights": [output.details() for output in weights],
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _ExplainedOutput:
    """An output with the inputs, degrees and rules that it follows from, except rules that did not act."""

    output: OutputResult
    inputs: tuple[Observation, ...]
    degrees: tuple[Degree, ...]
    rules: tuple[RuleActivation, ...]

    def details(self) -> Details:
        """Return the output, and the variables that its rules read."""
        variables_read = [observation.variable for observation in self.inputs]
        return _output_details(self.output) | {"variable": self.output.variable, "reads": variables_read}


def _explain_outputs(model: StageModel, stage: Stage, variables: Collection[str]) -> tuple[_ExplainedOutput, ...]:
    outputs = (output for output in stage.outputs if output.variable in variables)
    return tuple(_explain_output(model, stage, output) for output in outputs)


def _explain_output(model: StageModel, stage: Stage, output: OutputResult) -> _ExplainedOutput:
    rules_and_activations = [
        (rule, activation)
        for rule, activation in zip(model.rules, stage.rules, strict=True)
        if output.name in rule.concludes
    ]
    variables_read = {variable for rule, _ in rules_and_activations for variable in rule.reads}
    return _ExplainedOutput(
        output=output,
        inputs=tuple(observation for observation in stage.inputs if observation.variable in variables_read),
        degrees=tuple(degree for degree in stage.degrees if degree.variable in variables_read),
        rules=tuple(activation for _, activation in rules_and_activations if activation.high > 0.0),
    )


def counterfactual_details(counterfactuals: Iterable[Counterfactual]) -> list[Details]:
    """Return the details of changes that would have kept a course."""
    return [
        _without_none(
            kind=str(counterfactual.kind),
            name=counterfactual.name,
            value=None if counterfactual.value is None else json_text(counterfactual.value),
            other=json_text(counterfactual.other),
            share=counterfactual.share,
        )
        for counterfactual in counterfactuals
    ]


def _readings_details(stages: Sequence[Stage], extra_observations: Sequence[Observation]) -> list[Details]:
    inputs = [*(observation for stage in stages for observation in stage.inputs), *extra_observations]
    observations: dict[str, Observation] = {observation.variable: observation for observation in inputs}
    computed_variables = {output.variable for stage in stages for output in stage.outputs}
    return [
        _reading_details(observation)
        for observation in observations.values()
        if observation.variable not in computed_variables
    ]


def _reading_details(observation: Observation) -> Details:
    return _without_none(
        variable=observation.variable,
        value=None if observation.value is None else json_text(observation.value),
        evidence_s=_finite_or_none(observation.evidence_s),
        because=observation.because or None,
    )


def _rule_details(rule: RuleActivation) -> Details:
    return _without_none(
        text=rule.text,
        concludes=list(rule.concludes),
        place=rule.place or None,
        low=_finite_or_none(rule.low),
        high=_finite_or_none(rule.high),
    )


def _degree_details(degree: Degree) -> Details:
    return _without_none(
        variable=degree.variable, term=degree.term, low=_finite_or_none(degree.low), high=_finite_or_none(degree.high)
    )


def _output_details(output: OutputResult) -> Details:
    return _without_none(
        name=output.name,
        low=_finite_or_none(output.bounds.low),
        high=_finite_or_none(output.bounds.high),
        value=output.value,
        evidence_s=_finite_or_none(output.evidence_s),
    )


def _weight_details(course: CourseModel, decision: Decision, weight: OutputResult) -> Details:
    filter_state = decision.filter_step.before
    tracked_action = filter_state.tracked_actions[weight.name]
    return _output_details(weight) | _without_none(
        smoothed=tracked_action.smoothed_weight,
        leads_since_s=tracked_action.leads_since_s,
        cooldown_until_s=_finite_or_none(filter_state.cooldown_until_s(course, weight.name)),
    )


def _finite_or_none(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _without_none(**details: object) -> Details:
    return {key: detail for key, detail in details.items() if detail is not None}


def without_none_values(details: Mapping[str, object]) -> Details:
    """Return the details without values that are None."""
    return _without_none(**details)
