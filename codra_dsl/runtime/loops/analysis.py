"""Analysis: from readings to metrics, and from metrics to weights of actions (P2, sections 3.3 and 5.2).

The analysis is a function of a scene, so counterfactual questions are answered by the same code as the present state.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from codra_dsl.runtime.loops.declarations import InputModel, MapeModel, OutputModel, StageModel
from codra_dsl.runtime.loops.fuzzy.bounds import UNKNOWN, Bounds, is_finite, join
from codra_dsl.runtime.loops.observations import Observation, Scene, number_of, possible_values
from codra_dsl.runtime.values.cell import BEFORE_ALL_S

MAX_BOXES = 256
"""The largest number of boxes of unknown inputs for which one output is computed."""

Box = tuple[Bounds, ...]

MAX_CACHED_BOUNDS = 4096
"""The number of cached bounds: while an input is unknown, every change of another input needs new bounds."""

_MAX_CACHED_INFERENCES = 64
"""The number of cached stage results: most changes that trigger an analysis do not change the inputs of the rules."""

_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Degree:
    """The degree of membership of an input in a term, as two bounds, which are equal if the input is known."""

    variable: str
    term: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleActivation:
    """The strength with which a rule acts, as two bounds, which are equal if all inputs of the rule are known."""

    text: str
    concludes: tuple[str, ...]
    place: str
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputResult:
    """The result for one output.

    Attributes:
        name: the metric, or the action.
        bounds: all possible values.
        value: the worse end of the bounds, which is used as the value; None if this end is unknown.
        evidence_s: the instant of the oldest evidence, among the known inputs that the rules of the output read.
    """

    name: str
    variable: str
    bounds: Bounds
    value: float | None
    evidence_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """The result of one stage.

    Attributes:
        inputs: the observations of the inputs, in the engine's order.
    """

    inputs: tuple[Observation, ...] = ()
    degrees: tuple[Degree, ...] = ()
    rules: tuple[RuleActivation, ...] = ()
    outputs: tuple[OutputResult, ...] = ()

    def value(self, name: str) -> float | None:
        """Return the value of an output; None if it is unknown."""
        return next(output.value for output in self.outputs if output.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """The result of an analysis.

    Attributes:
        scene: the observations, including the metrics.
    """

    scene: Scene
    metrics: Stage = field(default_factory=Stage)
    actions: Stage = field(default_factory=Stage)

    def weights(self) -> dict[str, float | None]:
        """Return a mapping from each action to its weight; None if the weight is unknown."""
        return {output.name: output.value for output in self.actions.outputs}


def assess(model: MapeModel, scene: Scene, *, metrics: Mapping[str, float | None] | None = None) -> Assessment:
    """Return the metrics and weights of a scene.

    Args:
        model: the model of the loops.
        scene: everything that the stages read, except metrics.
        metrics: values that replace the computed values of some metrics in the second stage.
    """
    metrics_stage = Stage() if model.metrics is None else infer(model.metrics, scene)
    metric_observations = {output.variable: _observation_of(output) for output in metrics_stage.outputs}
    full_scene = {**scene, **metric_observations}
    for variable, value in (metrics or {}).items():
        full_scene[variable] = Observation(variable=variable, value=value, evidence_s=full_scene[variable].evidence_s)
    actions_stage = Stage() if model.actions is None else infer(model.actions, full_scene)
    return Assessment(scene=full_scene, metrics=metrics_stage, actions=actions_stage)


def _observation_of(output: OutputResult) -> Observation:
    because = "possibly no rule acts" if output.value is None else ""
    return Observation(variable=output.variable, value=output.value, evidence_s=output.evidence_s, because=because)


def infer(model: StageModel, scene: Scene) -> Stage:
    """Return the result of a stage."""
    inputs = tuple(scene[model_input.variable] for model_input in model.inputs)
    numbers = (
        number_of(model_input, observation.value) for model_input, observation in zip(model.inputs, inputs, strict=True)
    )
    inference = _inference_of(model, tuple(None if number != number else number for number in numbers))
    return Stage(
        inputs=inputs,
        degrees=inference.degrees,
        rules=inference.rules,
        outputs=tuple(
            _output_result(model, output, bounds, scene)
            for output, bounds in zip(model.outputs, inference.values, strict=True)
        ),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _StageInference:
    """The result of a stage for some numbers, independent of the age of their evidence."""

    degrees: tuple[Degree, ...]
    rules: tuple[RuleActivation, ...]
    values: tuple[Bounds, ...]


@lru_cache(maxsize=_MAX_CACHED_INFERENCES)
def _inference_of(model: StageModel, input_numbers: tuple[float | None, ...]) -> _StageInference:
    """Return the result of a stage for its inputs; None is an unknown input."""
    numbers = [math.nan if number is None else number for number in input_numbers]
    point_inference = model.infer(*numbers)
    values = [Bounds(value, value) if value == value else UNKNOWN for value in point_inference.values]
    strengths = [Bounds(strength, strength) for strength in point_inference.strengths]
    unknown_variables = {
        model_input.variable for model_input, number in zip(model.inputs, input_numbers, strict=True) if number is None
    }
    if unknown_variables:
        _widen(model, numbers, unknown_variables, values, strengths)
    return _StageInference(
        degrees=tuple(_degrees(model.inputs, numbers)),
        rules=tuple(
            RuleActivation(
                text=rule.text, concludes=rule.concludes, place=rule.place, low=strength.low, high=strength.high
            )
            for rule, strength in zip(model.rules, strengths, strict=True)
        ),
        values=tuple(values),
    )


def _widen(
    model: StageModel,
    numbers: Sequence[float],
    unknown_variables: set[str],
    values: list[Bounds],
    strengths: list[Bounds],
) -> None:
    """Replace the values and strengths that depend on an unknown input by bounds."""
    for index, output in enumerate(model.outputs):
        variables_read = _variables_read_for_output(model, output)
        if unknown_variables & variables_read:
            inputs_with_numbers = zip(model.inputs, numbers, strict=True)
            numbers_read = (
                number if number == number and model_input.variable in variables_read else None
                for model_input, number in inputs_with_numbers
            )
            values[index] = _output_bounds(model, index, tuple(numbers_read))
    input_hulls = [
        _hull(possible_values(model_input, number)) for model_input, number in zip(model.inputs, numbers, strict=True)
    ]
    widened_strengths = model.infer_bounds(*input_hulls).strengths
    for index, rule in enumerate(model.rules):
        if unknown_variables & set(rule.reads):
            strengths[index] = widened_strengths[index]


@lru_cache(maxsize=MAX_CACHED_BOUNDS)
def _output_bounds(model: StageModel, index: int, numbers: tuple[float | None, ...]) -> Bounds:
    """Return the bounds of all possible values of an output.

    Args:
        model: the model of the stage.
        index: the index of the output.
        numbers: the inputs; None for unknown inputs, and for inputs that no rule of the output reads.
    """
    return _BoxCutter(model, numbers, index).bounds()


class _BoxCutter:
    """Computes the bounds of one output: cuts the unknown inputs into boxes, and joins the bounds of all boxes.

    In a box, two mentions of one input are treated as two inputs. It can therefore seem possible that no rule acts
    although some rule certainly acts. Such a box is cut further, unless no rule acts in the middle of the box.
    """

    def __init__(self, model: StageModel, numbers: Sequence[float | None], index: int) -> None:
        self._model = model
        self._index = index
        self._range_widths = [model_input.range.high - model_input.range.low for model_input in model.inputs]
        variables_read = _variables_read_for_output(model, model.outputs[index])
        inputs_with_numbers = list(zip(model.inputs, numbers, strict=True))
        self._open_flags = [
            number is None and model_input.variable in variables_read and not model_input.members
            for model_input, number in inputs_with_numbers
        ]
        self._choices = [
            possible_values(model_input, math.nan if number is None else number)
            if number is not None or model_input.variable in variables_read
            else (model_input.range,)
            for model_input, number in inputs_with_numbers
        ]
        self._remaining_box_count = MAX_BOXES

    def bounds(self) -> Bounds:
        """Return the bounds of all possible values of the output."""
        union: Bounds | None = None
        pending_boxes = list(self._boxes())
        while pending_boxes:
            box = pending_boxes.pop()
            self._remaining_box_count -= 1
            value = self._model.infer_bounds(*box).values[self._index]
            halves = self._halves(box) if value.may_be_unknown and self._remaining_box_count > 0 else ()
            pending_boxes.extend(halves)
            if not halves:
                union = value if union is None else join(union, value)
        assert union is not None
        return union

    def _boxes(self) -> Iterator[Box]:
        """Yield the initial boxes: one for each member, and equal pieces of ranges."""
        open_input_count = sum(self._open_flags)
        max_range_box_count = max(1.0, MAX_BOXES / 4 / math.prod(map(len, self._choices)))
        piece_count = max(
            1, min(self._model.pieces, int(max_range_box_count ** (1 / max(1, open_input_count)) + _ROUNDING))
        )
        pieces_of_inputs = [
            tuple(part for choice in choices for part in _split(choice, piece_count if is_open else 1))
            for choices, is_open in zip(self._choices, self._open_flags, strict=True)
        ]
        yield from itertools.product(*pieces_of_inputs)

    def _halves(self, box: Box) -> tuple[Box, ...]:
        """Return both halves of a box along its longest side; nothing if no rule acts in the middle of the box."""
        middle = [bounds.low + (bounds.high - bounds.low) / 2.0 for bounds in box]
        value = self._model.infer(*middle).values[self._index]
        side_lengths = [self._relative_side_length(index, bounds) for index, bounds in enumerate(box)]
        longest_index = max(range(len(box)), key=side_lengths.__getitem__)
        if value != value or side_lengths[longest_index] <= 0.0:
            return ()
        half_ranges = _split(box[longest_index], 2)
        return tuple((*box[:longest_index], part, *box[longest_index + 1 :]) for part in half_ranges)

    def _relative_side_length(self, index: int, bounds: Bounds) -> float:
        range_width = self._range_widths[index]
        return (
            (bounds.high - bounds.low) / range_width
            if self._open_flags[index] and range_width and is_finite(bounds)
            else 0.0
        )


def _split(bounds: Bounds, piece_count: int) -> tuple[Bounds, ...]:
    if piece_count == 1 or not (bounds.low < bounds.high and is_finite(bounds)):
        return (bounds,)
    ends = [bounds.low + (bounds.high - bounds.low) * index / piece_count for index in range(piece_count)] + [
        bounds.high
    ]
    return tuple(Bounds(low, max(low, high)) for low, high in itertools.pairwise(ends))


def _hull(choices: Sequence[Bounds]) -> Bounds:
    return Bounds(min(choice.low for choice in choices), max(choice.high for choice in choices))


def _variables_read_for_output(model: StageModel, output: OutputModel) -> set[str]:
    return {variable for rule in model.rules if output.name in rule.concludes for variable in rule.reads}


def _output_result(model: StageModel, output: OutputModel, bounds: Bounds, scene: Scene) -> OutputResult:
    worse_end = bounds.worse(output.worse)
    observations = (scene[variable] for variable in _variables_read_for_output(model, output))
    stamps_s = [observation.evidence_s for observation in observations if observation.value is not None]
    return OutputResult(
        name=output.name,
        variable=output.variable,
        bounds=bounds,
        value=worse_end if math.isfinite(worse_end) else None,
        evidence_s=min(stamps_s, default=BEFORE_ALL_S),
    )


def _degrees(inputs: Sequence[InputModel], numbers: Sequence[float]) -> Iterator[Degree]:
    for model, number in zip(inputs, numbers, strict=True):
        for term, degree in model.terms.items():
            low, high = (degree(number),) * 2 if number == number else (0.0, 1.0)
            yield Degree(variable=model.variable, term=term, low=low, high=high)
