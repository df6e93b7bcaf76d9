"""Comparisons that replace both fuzzy stages. They are lists of lines; the first true line of each list decides."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from codra_dsl.runtime.loops import InputModel, MapeModel, OutputModel, StageModel, StageRuleModel
from codra_dsl.runtime.loops.fuzzy import BoundedInference, Bounds, Inference

VariableValues = Mapping[str, float]
"""The value of each variable. NaN stands for an unknown value; no comparison with NaN is true."""

CHARGED_PERCENT = 80.0
"""A battery that is being charged is charged at least to this level."""

_FULL_SAFETY, _HALF_SAFETY, _NO_SAFETY = 1.0, 0.5, 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """The thresholds of the comparisons. As an edit of the loops, they replace both fuzzy stages.

    Attributes:
        distance_m: a person nearer than this is close.
        battery_percent: a battery below this must be charged.
        load: a container with at least this load (`loading` or `full`) is delivered.
    """

    distance_m: float
    battery_percent: float
    load: str

    def __str__(self) -> str:
        """Return the thresholds for tables."""
        return f"person {self.distance_m:g} m, battery {self.battery_percent:g} percent, load {self.load}"

    def __call__(self, model: MapeModel) -> MapeModel:
        """Return the loops of the store with comparisons in place of the fuzzy stages."""
        assert model.metrics is not None
        assert model.actions is not None
        inputs = {
            model_input.variable: model_input
            for stage in (model.metrics, model.actions)
            for model_input in stage.inputs
        }
        load = inputs["container_load"].members.index(self.load)
        return replace(
            model,
            metrics=_stage(inputs, model.metrics.outputs, _metric_lists(self)),
            actions=_stage(inputs, model.actions.outputs, (_action_lines(load),)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line of a list.

    Attributes:
        output_values: the values of outputs if this line decides; the value is 0 for outputs that are not in the
            mapping.
        holds: a function that returns whether the condition of the line is true for the given values.
    """

    text: str
    reads: tuple[str, ...]
    output_values: Mapping[str, float]
    holds: Callable[[VariableValues], bool]


def _metric_lists(thresholds: Thresholds) -> tuple[tuple[Line, ...], ...]:
    near_m, low_percent = thresholds.distance_m, thresholds.battery_percent
    return (
        (
            Line(
                text="bumped",
                reads=("bumped",),
                output_values={"safety": _NO_SAFETY},
                holds=lambda n: n["bumped"] > 0.5,
            ),
            Line(
                text=f"person_distance < {near_m:g} and picking_up",
                reads=("person_distance", "picking_up"),
                output_values={"safety": _HALF_SAFETY},
                holds=lambda n: n["person_distance"] < near_m and n["picking_up"] > 0.5,
            ),
            _default_line({"safety": _FULL_SAFETY}),
        ),
        (
            Line(
                text="order_open and not loaded",
                reads=("order_open", "loaded"),
                output_values={"mission_completion": 0.0},
                holds=lambda n: n["order_open"] > 0.5 and n["loaded"] < 0.5,
            ),
            Line(
                text="order_open",
                reads=("order_open",),
                output_values={"mission_completion": 0.5},
                holds=lambda n: n["order_open"] > 0.5,
            ),
            _default_line({"mission_completion": 1.0}),
        ),
        (
            Line(
                text=f"battery_level < {low_percent:g}",
                reads=("battery_level",),
                output_values={"power_autonomy": 0.0},
                holds=lambda n: n["battery_level"] < low_percent,
            ),
            Line(
                text=f"charging and battery_level < {CHARGED_PERCENT:g}",
                reads=("charging", "battery_level"),
                output_values={"power_autonomy": 0.0},
                holds=lambda n: n["charging"] > 0.5 and n["battery_level"] < CHARGED_PERCENT,
            ),
            _default_line({"power_autonomy": 1.0}),
        ),
    )


def _action_lines(load: int) -> tuple[Line, ...]:
    return (
        Line(
            text="the battery is low",
            reads=("power_autonomy",),
            output_values={"dock": 1.0},
            holds=lambda n: n["power_autonomy"] < 0.5,
        ),
        Line(text="bumped", reads=("safety",), output_values={"start": 1.0}, holds=lambda n: n["safety"] < 0.25),
        Line(
            text=f"loaded and container_load >= {load}",
            reads=("loaded", "container_load"),
            output_values={"deliver": 1.0},
            holds=lambda n: n["loaded"] > 0.5 and n["container_load"] >= load,
        ),
        Line(
            text="loaded and no order is open",
            reads=("loaded", "mission_completion"),
            output_values={"deliver": 1.0},
            holds=lambda n: n["loaded"] > 0.5 and n["mission_completion"] > 0.75,
        ),
        Line(
            text="somebody is close and not loaded",
            reads=("safety", "loaded"),
            output_values={"start": 1.0},
            holds=lambda n: n["safety"] < 0.75 and n["loaded"] < 0.5,
        ),
        Line(text="somebody is close", reads=("safety",), output_values={}, holds=lambda n: n["safety"] < 0.75),
        Line(
            text="an order is open",
            reads=("mission_completion",),
            output_values={"pick": 1.0},
            holds=lambda n: n["mission_completion"] < 0.75,
        ),
        _default_line({"start": 1.0}),
    )


def _default_line(output_values: Mapping[str, float]) -> Line:
    return Line(text="otherwise", reads=(), output_values=output_values, holds=lambda _: True)


# As a stage


def _stage(
    inputs: Mapping[str, InputModel], outputs: Sequence[OutputModel], lists: Sequence[Sequence[Line]]
) -> StageModel:
    input_names = sorted({name for lines in lists for line in lines for name in line.reads})
    engine = _ThresholdEngine(tuple(input_names), tuple(output.name for output in outputs), lists)
    return StageModel(
        infer=engine.infer,
        infer_bounds=engine.infer_bounds,
        inputs=tuple(replace(inputs[name], terms={}) for name in input_names),
        outputs=tuple(outputs),
        rules=tuple(_rules(lists, engine.outputs)),
        pieces=1,
    )


def _rules(lists: Sequence[Sequence[Line]], outputs: Sequence[str]) -> Sequence[StageRuleModel]:
    """Return lines as rules. Each rule concludes on all outputs of its list, because it can exclude later lines."""
    rules = []
    for lines in lists:
        concluded_outputs = {name for line in lines for name in line.output_values}
        concludes = tuple(name for name in outputs if name in concluded_outputs)
        rules += [StageRuleModel(text=line.text, concludes=concludes, reads=line.reads) for line in lines]
    return rules


@dataclass(frozen=True, slots=True)
class _ThresholdEngine:
    """Lists of lines with the interface of a fuzzy engine."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    lists: Sequence[Sequence[Line]]

    def infer(self, *numbers: float) -> Inference:
        """Return the results of all lists. The strength of a line is 1 if the line decides, and otherwise 0."""
        values_by_name = dict(zip(self.inputs, numbers, strict=True))
        values, strengths = dict.fromkeys(self.outputs, 0.0), []
        for lines in self.lists:
            deciding_line = next(line for line in lines if line.holds(values_by_name))
            values |= deciding_line.output_values
            strengths += [float(line is deciding_line) for line in lines]
        return Inference(tuple(values.values()), tuple(strengths))

    def infer_bounds(self, *bounds: Bounds) -> BoundedInference:
        """Return the bounds of all results, from the ends and the middle of each range.

        These points are enough, because a range contains at most two thresholds, and its middle is between them.
        """
        ends = (
            dict.fromkeys((interval.low, (interval.low + interval.high) / 2.0, interval.high)) for interval in bounds
        )
        corners = itertools.product(*ends)
        inferences = [self.infer(*corner) for corner in corners]
        return BoundedInference(
            tuple(
                Bounds(min(values), max(values))
                for values in zip(*(inference.values for inference in inferences), strict=True)
            ),
            tuple(
                Bounds(min(strengths), max(strengths))
                for strengths in zip(*(inference.strengths for inference in inferences), strict=True)
            ),
        )
