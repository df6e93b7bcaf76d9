"""Comparisons in place of both fuzzy stages: lists of lines. The first line of a list that holds decides."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from codra_dsl.runtime.loops import InputModel, MapeModel, OutputModel, StageModel, StageRuleModel
from codra_dsl.runtime.loops.fuzzy import BoundedInference, Bounds, Inference

Numbers = Mapping[str, float]
"""The value of each variable. NaN stands for unknown, and no comparison with NaN holds."""

_SAFE, _HALF_SAFE, _UNSAFE = 1.0, 0.5, 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """The thresholds of the comparisons.

    Attributes:
        distance_m: a person nearer than this is close.
        battery_percent: a battery below this must be charged.
        load: a container with at least this load is brought away: `loading` or `full`.
    """

    distance_m: float
    battery_percent: float
    load: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line of a list.

    Attributes:
        gives: the values of outputs if this line decides; the value is 0 for outputs that are not in the mapping.
        holds: returns whether the condition of the line is true for given numbers.
    """

    text: str
    reads: tuple[str, ...]
    gives: Mapping[str, float]
    holds: Callable[[Numbers], bool]


def with_thresholds(model: MapeModel, thresholds: Thresholds) -> MapeModel:
    """Return the loops of the store with comparisons in place of their stages; everything else is unchanged.

    Args:
        model: the loops of `specs/store.yaml`.
        thresholds: the thresholds of the comparisons.
    """
    assert model.metrics is not None
    assert model.actions is not None
    inputs = {
        model_input.variable: model_input for stage in (model.metrics, model.actions) for model_input in stage.inputs
    }
    load = inputs["container_load"].members.index(thresholds.load)
    return replace(
        model,
        metrics=_stage(inputs, model.metrics.outputs, _metric_lists(thresholds)),
        actions=_stage(inputs, model.actions.outputs, (_action_lines(load),)),
    )


def _metric_lists(thresholds: Thresholds) -> tuple[tuple[Line, ...], ...]:
    near, low = thresholds.distance_m, thresholds.battery_percent
    return (
        (
            Line(text="bumped", reads=("bumped",), gives={"safety": _UNSAFE}, holds=lambda n: n["bumped"] > 0.5),
            Line(
                text=f"person_distance < {near:g} and picking_up",
                reads=("person_distance", "picking_up"),
                gives={"safety": _HALF_SAFE},
                holds=lambda n: n["person_distance"] < near and n["picking_up"] > 0.5,
            ),
            _otherwise({"safety": _SAFE}),
        ),
        (
            Line(
                text="order_open and not loaded",
                reads=("order_open", "loaded"),
                gives={"mission_completion": 0.0},
                holds=lambda n: n["order_open"] > 0.5 and n["loaded"] < 0.5,
            ),
            Line(
                text="order_open",
                reads=("order_open",),
                gives={"mission_completion": 0.5},
                holds=lambda n: n["order_open"] > 0.5,
            ),
            _otherwise({"mission_completion": 1.0}),
        ),
        (
            Line(
                text=f"battery_level < {low:g}",
                reads=("battery_level",),
                gives={"power_autonomy": 0.0},
                holds=lambda n: n["battery_level"] < low,
            ),
            _otherwise({"power_autonomy": 1.0}),
        ),
    )


def _action_lines(load: int) -> tuple[Line, ...]:
    return (
        Line(
            text="the battery is low",
            reads=("power_autonomy",),
            gives={"dock": 1.0},
            holds=lambda n: n["power_autonomy"] < 0.5,
        ),
        Line(text="bumped", reads=("safety",), gives={"start": 1.0}, holds=lambda n: n["safety"] < 0.25),
        Line(
            text=f"loaded and container_load >= {load}",
            reads=("loaded", "container_load"),
            gives={"deliver": 1.0},
            holds=lambda n: n["loaded"] > 0.5 and n["container_load"] >= load,
        ),
        Line(
            text="loaded and no order is open",
            reads=("loaded", "mission_completion"),
            gives={"deliver": 1.0},
            holds=lambda n: n["loaded"] > 0.5 and n["mission_completion"] > 0.75,
        ),
        Line(
            text="somebody is close and not loaded",
            reads=("safety", "loaded"),
            gives={"start": 1.0},
            holds=lambda n: n["safety"] < 0.75 and n["loaded"] < 0.5,
        ),
        Line(text="somebody is close", reads=("safety",), gives={}, holds=lambda n: n["safety"] < 0.75),
        Line(
            text="an order is open",
            reads=("mission_completion",),
            gives={"pick": 1.0},
            holds=lambda n: n["mission_completion"] < 0.75,
        ),
        _otherwise({"start": 1.0}),
    )


def _otherwise(gives: Mapping[str, float]) -> Line:
    return Line(text="otherwise", reads=(), gives=gives, holds=lambda _: True)


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
    """Return lines as rules. Each rule concludes on all outputs of its list: it may keep later lines from deciding."""
    rules = []
    for lines in lists:
        concluded_outputs = {name for line in lines for name in line.gives}
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
        """Return the results of all lists; the strength of a line is 1 if it decides."""
        values_by_name = dict(zip(self.inputs, numbers, strict=True))
        values, strengths = dict.fromkeys(self.outputs, 0.0), []
        for lines in self.lists:
            deciding = next(line for line in lines if line.holds(values_by_name))
            values |= deciding.gives
            strengths += [float(line is deciding) for line in lines]
        return Inference(tuple(values.values()), tuple(strengths))

    def infer_bounds(self, *bounds: Bounds) -> BoundedInference:
        """Return the bounds of all results, from the ends and the middle of each range.

        These are enough: a range contains at most two thresholds, and its middle is between them.
        """
        ends = (
            dict.fromkeys((interval.low, (interval.low + interval.high) / 2.0, interval.high)) for interval in bounds
        )
        corners = itertools.product(*ends)
        inferences = [self.infer(*corner) for corner in corners]
        return BoundedInference(
            tuple(
                Bounds(min(numbers), max(numbers))
                for numbers in zip(*(inference.values for inference in inferences), strict=True)
            ),
            tuple(
                Bounds(min(numbers), max(numbers))
                for numbers in zip(*(inference.strengths for inference in inferences), strict=True)
            ),
        )
