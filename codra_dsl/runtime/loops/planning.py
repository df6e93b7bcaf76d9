"""Planning of one loop: its state and its decisions about rates, metrics, weights, courses and parameters."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from codra_dsl.logic import Value
from codra_dsl.runtime.loops.analysis import Assessment, OutputResult, assess
from codra_dsl.runtime.loops.counterfactual import Counterfactual, smallest_changes
from codra_dsl.runtime.loops.course_filters import JUST_AFTER_S
from codra_dsl.runtime.loops.courses import CourseState, Decision, Metrics, choose, metrics_of, values_before_worsening
from codra_dsl.runtime.loops.declarations import (
    CourseModel,
    InputModel,
    LoopModel,
    MapeModel,
    ParameterModel,
    RateModel,
)
from codra_dsl.runtime.loops.fuzzy.bounds import Bounds
from codra_dsl.runtime.loops.observations import Observation, Scene, SceneScope
from codra_dsl.runtime.loops.rates import observe_rate
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.model import NotOfTypeError, ValueType

MAX_KEPT_DECISIONS = 100
"""The number of decisions of a course that are kept in memory."""

_ROUNDING_S = 1e-9


class Context(Protocol):
    """The context that a loop reads."""

    def readings(self, names: Iterable[Any]) -> Mapping[str, Reading[Any]]:
        """Return the readings of several variables at one instant."""
        ...

    def history(self, name: Any) -> tuple[Reading[Any], ...]:
        """Return the kept readings of a variable."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableWrite:
    """A value to write to a variable.

    Attributes:
        evidence_s: when the evidence was taken; minus infinity if there is no evidence.
    """

    variable: str
    value: Value | None
    evidence_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A new value of a parameter.

    Attributes:
        since_s: since when the parameter had the value `before`.
        is_urgent: whether the new value breaks the dwell, because a metric has become worse.
        is_otherwise: whether the new value is that of `otherwise`, because the value became unknown.
    """

    instant_s: float
    parameter: ParameterModel
    value: Value
    before: Value | None
    since_s: float
    is_urgent: bool
    assessment: Assessment
    is_otherwise: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """A value computed for a parameter that the parameter's variable cannot take; the parameter keeps its old value."""

    parameter: ParameterModel
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """The result of one analysis.

    Attributes:
        values_to_write: rates, metrics, weights and filtered weights (P2's tentative actions, section 4), to be written
            by the analyst.
        changed: the variables of the metrics and weights that have changed since the last analysis. An `analysed` event
            records only these variables, so `why` has the chain of each metric, and nothing is recorded while nothing
            changes.
        due_s: when to analyse again if no input changes.
        refusals: values that cannot be set; a refused value is reported again only after another value was computed.
        unconfirmed: the variables of the parameters for which the analysis has no value: it is unknown and there is no
            `otherwise`, or it is refused. Their evidence is not renewed.
        rate_changes: the observations of the rates that have become known or unknown, or are unknown for another reason
            than before. A `computed` event records each of them, so `why` can show why a rate is unknown.
    """

    assessment: Assessment
    values_to_write: tuple[VariableWrite, ...]
    changed: frozenset[str]
    decisions: tuple[Decision, ...]
    settings: tuple[Setting, ...]
    due_s: float
    refusals: tuple[Refusal, ...] = ()
    unconfirmed: frozenset[str] = frozenset()
    rate_changes: tuple[Observation, ...] = ()


class Planner(Protocol):
    """Analyses and decides for one loop. `Planning` follows the spec; another planner can replace it."""

    @property
    def model(self) -> MapeModel:
        """Return the model whose stages the planner uses for the analysis."""
        ...

    @property
    def courses(self) -> Mapping[str, CourseModel]:
        """Return the courses that the planner decides on, by name."""
        ...

    @property
    def decisions(self) -> Mapping[str, Sequence[Decision]]:
        """Return the newest decisions of each course, the oldest first."""
        ...

    def resume(self) -> None:
        """Begin, or continue after a time without analyses."""
        ...

    def course_state(self, course: str) -> CourseState:
        """Return the state of a course."""
        ...

    def watches(self) -> tuple[str, ...]:
        """Return the variables whose changes trigger an analysis."""
        ...

    def plan(self, context: Context, now_s: float) -> Plan:
        """Analyse the present context, and decide; the caller writes the results."""
        ...

    def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
        """Return the changes that would have kept the course that a decision left."""
        ...


Planners = Callable[[MapeModel, LoopModel, Mapping[str, ValueType]], Planner]
"""Makes the planner of a loop from the model of all loops, the model of this loop, and the types of the variables."""


@dataclass(frozen=True, slots=True)
class _Target:
    """The value that a parameter should have; None if it is unknown and there is no `otherwise`."""

    value: Value | None
    is_otherwise: bool = False


@dataclass(slots=True)
class _ParameterState:
    value: Value | None = None
    refused_value: Value | None = None
    since_s: float = -math.inf
    metrics: Metrics = field(default_factory=dict)


class Planning:
    """Analyses and decides for one loop by the rules of the spec. It writes no variables itself."""

    def __init__(self, model: MapeModel, loop: LoopModel, types: Mapping[str, ValueType]) -> None:
        """Make the planner of a loop, without any state yet.

        Args:
            model: the model of all loops.
            loop: the model of this loop.
            types: the types of the context-variables.
        """
        self.model = model
        self._loop = loop
        self._types = types
        self._rates = {
            rate_model.variable: rate_model for rate_model in model.rates if rate_model.variable in loop.rates
        }
        self.courses = {course.name: course for course in model.courses if course.name in loop.adapt}
        self._parameters = tuple(parameter for parameter in model.parameters if parameter.name in loop.adapt)
        self._course_states = {name: CourseState() for name in self.courses}
        self._parameter_states = {parameter.name: _ParameterState() for parameter in self._parameters}
        self._bounds: dict[str, Bounds] = {}
        self._rate_states: dict[str, tuple[object, ...]] = {}
        self.decisions: dict[str, deque[Decision]] = {name: deque(maxlen=MAX_KEPT_DECISIONS) for name in self.courses}
        self._read_variables = tuple(sorted(self._find_read_variables()))

    def resume(self) -> None:
        """Continue after a time without analyses: keep the courses, and discard the smoothed weights and leads."""
        for name, course_state in self._course_states.items():
            self._course_states[name] = course_state.after_pause()

    def course_state(self, course: str) -> CourseState:
        """Return the state of a course."""
        return self._course_states[course]

    def watches(self) -> tuple[str, ...]:
        """Return the variables whose changes trigger an analysis."""
        return tuple(name for name in self._read_variables if name not in self._rates)

    def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
        """Return the changes that would have kept the course that a decision left."""
        course = self.courses[decision.course]
        whole_numbers = {name for name, type_ in self._types.items() if type_.kind == "int"}
        return smallest_changes(self.model, course, decision, self._hard_rule_inputs(course), whole_numbers)

    def _hard_rule_inputs(self, course: CourseModel) -> tuple[InputModel, ...]:
        """Return the bounded variables that the hard rules of a course read, as inputs; metrics are left out."""
        names = sorted(
            {name for rule in course.always for name in rule.condition.variables()} - self._metric_variables()
        )
        return tuple(_as_input(name, self._types[name]) for name in names if _is_bounded(self._types[name]))

    def plan(self, context: Context, now_s: float) -> Plan:
        """Analyse the present context, and decide."""
        scene = self._scene(context, now_s)
        assessment = assess(self.model, scene)
        decisions, decisions_due_s = self._decide(assessment, now_s)
        targets = {model.name: _target(model, assessment.scene, now_s) for model in self._parameters}
        refusals = tuple(self._find_refusals(targets))
        settings, settings_due_s = self._choose_settings(targets, assessment, now_s)
        return Plan(
            assessment=assessment,
            values_to_write=tuple(self._values_to_write(assessment)),
            changed=frozenset(self._changed_variables(assessment)),
            rate_changes=tuple(self._rate_changes(assessment.scene)),
            decisions=decisions,
            settings=settings,
            due_s=min(decisions_due_s, settings_due_s, self._next_flip_s(assessment.scene, now_s)),
            refusals=refusals,
            unconfirmed=frozenset(
                model.variable
                for model in self._parameters
                if targets[model.name].value in (None, self._parameter_states[model.name].refused_value)
            ),
        )

    # Reading

    def _metric_variables(self) -> set[str]:
        return set() if self.model.metrics is None else {metric.variable for metric in self.model.metrics.outputs}

    def _find_read_variables(self) -> set[str]:
        stages = [stage for stage in (self.model.metrics, self.model.actions) if stage is not None]
        names = {model_input.variable for stage in stages for model_input in stage.inputs}
        names |= {rate_model.of for rate_model in self._rates.values()}
        for course in self.courses.values():
            names |= {name for rule in course.always for name in rule.condition.variables()}
        names |= {name for parameter in self._parameters for name in parameter.value.variables()}
        return names - self._metric_variables()

    def _scene(self, context: Context, now_s: float) -> Scene:
        readings = context.readings(name for name in self._read_variables if name not in self._rates)
        scene = {name: Observation.of(reading.at(now_s)) for name, reading in readings.items()}
        for name, model in self._rates.items():
            scene[name] = self._observe_rate(model, context, scene[model.of], now_s)
        return scene

    def _observe_rate(
        self, model: RateModel, context: Context, present_observation: Observation, now_s: float
    ) -> Observation:
        observed_rate = observe_rate(model, context.history(model.of), present_observation, now_s)
        range_limits = self._types[model.variable].range
        if range_limits is None or not isinstance(observed_rate.value, float):
            return observed_rate
        return replace(observed_rate, value=min(max(observed_rate.value, range_limits[0]), range_limits[1]))

    # Results to write

    def _values_to_write(self, assessment: Assessment) -> Iterator[VariableWrite]:
        for name in self._rates:
            observation = assessment.scene[name]
            if observation.because == Reason.STALE:  # its last value has become stale by itself
                continue
            yield VariableWrite(variable=name, value=observation.value, evidence_s=observation.evidence_s)
        for output in self._outputs(assessment):
            yield VariableWrite(variable=output.variable, value=output.value, evidence_s=output.evidence_s)
        evidence_s = {output.name: output.evidence_s for output in assessment.actions.outputs}
        for name, course in self.courses.items():
            tracked_actions = self._course_states[name].state.tracked_actions
            for action, variable in course.filtered_weights.items():
                weight = tracked_actions[action].smoothed_weight
                yield VariableWrite(variable=variable, value=weight, evidence_s=evidence_s[action])

    def _outputs(self, assessment: Assessment) -> Iterator[OutputResult]:
        """Yield the metrics and weights that this loop computes."""
        yield from (output for output in assessment.metrics.outputs if output.name in self._loop.analyse)
        actions = {action for course in self.courses.values() for action in course.choose}
        yield from (output for output in assessment.actions.outputs if output.name in actions)

    def _changed_variables(self, assessment: Assessment) -> Iterator[str]:
        for output in self._outputs(assessment):
            if not _are_same_bounds(self._bounds.get(output.variable), output.bounds):
                self._bounds[output.variable] = output.bounds
                yield output.variable

    def _rate_changes(self, scene: Scene) -> Iterator[Observation]:
        for name in self._rates:
            observation = scene[name]
            state = _rate_state(observation)
            if self._rate_states.get(name) != state:
                self._rate_states[name] = state
                yield observation

    # Decisions

    def _decide(self, assessment: Assessment, now_s: float) -> tuple[tuple[Decision, ...], float]:
        decisions, due_s = [], math.inf
        for name, course in self.courses.items():
            course_state, decision, course_due_s = choose(
                self.model, course, self._course_states[name], assessment, now_s
            )
            self._course_states[name] = course_state
            due_s = min(due_s, course_due_s)
            if decision is not None:
                decisions.append(decision)
                self.decisions[name].append(decision)
        return tuple(decisions), due_s

    def _find_refusals(self, targets: Mapping[str, _Target]) -> Iterator[Refusal]:
        """Yield a refusal for each value that its variable cannot take, but not again if the value stays the same."""
        for model in self._parameters:
            state, value = self._parameter_states[model.name], targets[model.name].value
            refused_value_before, state.refused_value = state.refused_value, None
            try:
                if value is not None:
                    self._types[model.variable].convert(value)
            except NotOfTypeError as error:
                state.refused_value = value
                if value != refused_value_before:
                    message = f"{model.variable!r} is not set: {error}; limit the value, or state a wider range"
                    yield Refusal(parameter=model, message=message)

    def _choose_settings(
        self, targets: Mapping[str, _Target], assessment: Assessment, now_s: float
    ) -> tuple[tuple[Setting, ...], float]:
        settings, due_s = [], math.inf
        metrics = metrics_of(self.model, assessment)
        for model in self._parameters:
            state, target = self._parameter_states[model.name], targets[model.name]
            value = target.value
            if value is None or value in (state.value, state.refused_value):
                continue
            free_s = state.since_s + model.dwell_s
            is_free = free_s <= now_s + _ROUNDING_S
            ends_dwell = is_free or target.is_otherwise  # an unknown value must not keep the former value
            if not ends_dwell and not self._is_urgent(model, assessment, state, now_s):
                due_s = min(due_s, free_s + JUST_AFTER_S)
                continue
            settings.append(
                Setting(
                    instant_s=now_s,
                    parameter=model,
                    value=value,
                    before=state.value,
                    since_s=state.since_s,
                    is_urgent=not ends_dwell,
                    assessment=assessment,
                    is_otherwise=target.is_otherwise,
                )
            )
            self._parameter_states[model.name] = _ParameterState(value=value, since_s=now_s, metrics=metrics)
        return tuple(settings), due_s

    def _is_urgent(self, model: ParameterModel, assessment: Assessment, state: _ParameterState, now_s: float) -> bool:
        """Return whether the parameter would keep its value if no metric had become worse since the value was set."""
        former_metrics = values_before_worsening(self.model, metrics_of(self.model, assessment), state.metrics)
        if not former_metrics:
            return False
        former_observations = {
            name: replace(assessment.scene[name], value=former_value) for name, former_value in former_metrics.items()
        }
        return _target(model, {**assessment.scene, **former_observations}, now_s).value == state.value

    def _next_flip_s(self, scene: Scene, now_s: float) -> float:
        """Return the next instant at which a comparison with an age or a rate changes by itself; infinite if never."""
        scope = SceneScope(scene, now_s)
        terms = [rule.condition for course in self.courses.values() for rule in course.always]
        terms += [parameter.value for parameter in self._parameters]
        waits_s = (term.flips_s(scope) for term in terms)
        changes_s = (now_s + wait_s for wait_s in waits_s if wait_s is not None)
        return min([*changes_s, *(scene[name].until_s for name in self._rates)], default=math.inf)


def _target(model: ParameterModel, scene: Scene, now_s: float) -> _Target:
    """Return the value that a parameter should have: its value if it is known, or else that of `otherwise`."""
    scope = SceneScope(scene, now_s)
    value = model.value.evaluate(scope)
    if value is not None or model.otherwise is None:
        return _Target(value)
    return _Target(model.otherwise.evaluate(scope), is_otherwise=True)


def _rate_state(observation: Observation) -> tuple[object, ...]:
    """Return what `why` needs to know about an unknown rate, without durations that grow; () if the rate is known."""
    if observation.value is not None:
        return ()
    instants_s = (observation.since_s, observation.until_s)
    if any(map(math.isfinite, instants_s)):
        return tuple(f"{instant_s:.3f}" for instant_s in instants_s)
    return (observation.because,)


def _are_same_bounds(before: Bounds | None, now: Bounds) -> bool:
    """Return whether bounds are unchanged; NaN equals NaN here."""
    return before is not None and repr(before) == repr(now)


def _is_bounded(value_type: ValueType) -> bool:
    return (
        value_type.kind == "bool"
        or bool(value_type.members)
        or (value_type.range is not None and value_type.kind in ("int", "float"))
    )


def _as_input(name: str, value_type: ValueType) -> InputModel:
    if value_type.kind == "bool":
        return InputModel(variable=name, range=Bounds(0.0, 1.0), members=("false", "true"))
    if value_type.members:
        return InputModel(variable=name, range=Bounds(0.0, len(value_type.members) - 1.0), members=value_type.members)
    low, high = value_type.range or (-math.inf, math.inf)
    return InputModel(variable=name, range=Bounds(low, high))
