"""Decisions as the details of events: plain values, and nothing that is None."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.journal.encoding import json_text
from codra_dsl.runtime.loops.analysis import Assessment, Degree, Fired, Judged, Stage
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.courses import Decision
from codra_dsl.runtime.loops.declarations import CourseModel, MapeModel, StageModel
from codra_dsl.runtime.loops.observations import Observation

Details = dict[str, Any]


def chain_of(loop: str, course: CourseModel, decision: Decision) -> Details:
    """Return the chain of a decision, from what was known to the action."""
    before = decision.chosen.before
    rule = decision.rule
    return _without_none(
        loop=loop,
        variable=course.variable or None,
        action=decision.action,
        before=decision.before or None,
        because=str(decision.because),
        rule=None if rule is None else f"{rule.text} then {rule.action}",
        place=(course.place if rule is None else rule.place) or None,
        since_s=_finite(before.since_s),
        dwell_until_s=_finite(before.dwell_until_s(course)),
        weights=[_weighed(course, decision, each) for each in _weights(course, decision)],
        **evidence_of(decision.assessment, [name for rule in course.always for name in rule.condition.variables()]),
    )


def evidence_of(assessment: Assessment, more: Iterable[str] = ()) -> Details:
    """Return what was known, and what the stages made of it.

    Args:
        assessment: of the instant.
        more: variables that a condition reads, be it that no stage does.
    """
    stages = (assessment.metrics, assessment.actions)
    return {
        "readings": _readings(stages, [assessment.scene[name] for name in sorted(set(more))]),
        "degrees": [_degree(each) for each in dict.fromkeys(each for stage in stages for each in stage.degrees)],
        "rules": [_rule(each) for stage in stages for each in stage.rules],
        "metrics": [_judged(each) for each in assessment.metrics.outputs],
    }


def analysis_of(model: MapeModel, assessment: Assessment, variables: Collection[str]) -> Details:
    """Return what led to some metrics and weights, from what was read to what came of it."""
    metrics = () if model.metrics is None else _told(model.metrics, assessment.metrics, variables)
    weights = () if model.actions is None else _told(model.actions, assessment.actions, variables)
    told = [*metrics, *weights]
    inputs = {each.variable: each for part in told for each in part.inputs}
    return {
        "readings": [_reading(each) for each in inputs.values()],
        "degrees": [_degree(each) for each in dict.fromkeys(each for part in told for each in part.degrees)],
        "rules": [_rule(each) for each in dict.fromkeys(each for part in told for each in part.rules)],
        "metrics": [part.details() for part in metrics],
        "weights": [part.details() for part in weights],
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Told:
    """An output with all that it follows from, but rules that did not act."""

    output: Judged
    inputs: tuple[Observation, ...]
    degrees: tuple[Degree, ...]
    rules: tuple[Fired, ...]

    def details(self) -> Details:
        """Return the output, and what it was read from."""
        reads = [each.variable for each in self.inputs]
        return _judged(self.output) | {"variable": self.output.variable, "reads": reads}


def _told(model: StageModel, stage: Stage, variables: Collection[str]) -> tuple[_Told, ...]:
    outputs = (each for each in stage.outputs if each.variable in variables)
    return tuple(_behind(model, stage, each) for each in outputs)


def _behind(model: StageModel, stage: Stage, output: Judged) -> _Told:
    about = [
        (rule, fired) for rule, fired in zip(model.rules, stage.rules, strict=True) if output.name in rule.concludes
    ]
    reads = {variable for rule, _ in about for variable in rule.reads}
    return _Told(
        output=output,
        inputs=tuple(each for each in stage.inputs if each.variable in reads),
        degrees=tuple(each for each in stage.degrees if each.variable in reads),
        rules=tuple(fired for _, fired in about if fired.high > 0.0),
    )


def kept_by(found: Iterable[Counterfactual]) -> list[Details]:
    """Return what would have kept a course."""
    return [
        _without_none(
            kind=str(each.kind),
            name=each.name,
            value=None if each.value is None else json_text(each.value),
            other=json_text(each.other),
            share=each.share,
        )
        for each in found
    ]


def _readings(stages: Sequence[Stage], more: Sequence[Observation]) -> list[Details]:
    read = [*(each for stage in stages for each in stage.inputs), *more]
    seen: dict[str, Observation] = {each.variable: each for each in read}
    judged = {each.variable for stage in stages for each in stage.outputs}
    return [_reading(each) for each in seen.values() if each.variable not in judged]


def _reading(each: Observation) -> Details:
    return _without_none(
        variable=each.variable,
        value=None if each.value is None else json_text(each.value),
        evidence_s=_finite(each.evidence_s),
        because=each.because or None,
    )


def _rule(each: Fired) -> Details:
    return _without_none(
        text=each.text,
        concludes=list(each.concludes),
        place=each.place or None,
        low=_finite(each.low),
        high=_finite(each.high),
    )


def _degree(each: Degree) -> Details:
    return _without_none(variable=each.variable, term=each.term, low=_finite(each.low), high=_finite(each.high))


def _judged(each: Judged) -> Details:
    return _without_none(
        name=each.name,
        low=_finite(each.bounds.low),
        high=_finite(each.bounds.high),
        value=each.value,
        evidence_s=_finite(each.evidence_s),
    )


def _weights(course: CourseModel, decision: Decision) -> list[Judged]:
    return [each for each in decision.assessment.actions.outputs if each.name in course.choose]


def _weighed(course: CourseModel, decision: Decision, each: Judged) -> Details:
    before = decision.chosen.before
    tracked = before.tracked[each.name]
    return _judged(each) | _without_none(
        smoothed=tracked.smoothed,
        leads_since_s=tracked.leads_since_s,
        cooldown_until_s=_finite(before.cooldown_until_s(course, each.name)),
    )


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _without_none(**details: object) -> Details:
    return {key: detail for key, detail in details.items() if detail is not None}


def plain(details: Mapping[str, object]) -> Details:
    """Return details without what is None."""
    return _without_none(**details)
