"""Numbers of the spec's loops that can be tuned, as an edit of the loops in memory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from codra_dsl.runtime.loops import MapeModel, StageModel
from codra_dsl.runtime.loops.fuzzy import BoundedInference, Bounds, Inference


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopParameters:
    """Numbers of the loops. The defaults are those of the spec.

    Attributes:
        crowding_shift: by how much the terms of `crowding` are moved to larger shares of time.
        battery_shift_percent: by how much the terms of `battery_level` are moved to higher levels.
        hold_s: how long an action must lead before it becomes the course; None for the time of the spec.
    """

    crowding_shift: float = 0.0
    battery_shift_percent: float = 0.0
    hold_s: float | None = None

    def __str__(self) -> str:
        """Return the numbers for tables."""
        hold = "of the spec" if self.hold_s is None else f"{self.hold_s:g} s"
        return f"crowding {self.crowding_shift:+g}, battery {self.battery_shift_percent:+g} percent, hold {hold}"

    def __call__(self, model: MapeModel) -> MapeModel:
        """Return the loops with these numbers.

        Raises:
            ValueError: if the loops do not read a variable whose terms are moved.
        """
        assert model.metrics is not None
        assert model.actions is not None
        shifts = {"crowding": self.crowding_shift, "battery_level": self.battery_shift_percent}
        inputs = {model_input.variable for stage in (model.metrics, model.actions) for model_input in stage.inputs}
        if missing_names := shifts.keys() - inputs:
            raise ValueError(f"the loops of the spec do not read {', '.join(sorted(missing_names))}")
        courses = (
            course if self.hold_s is None else replace(course, hold_s=self.hold_s, holds_s={})
            for course in model.courses
        )
        return replace(
            model,
            metrics=_shifted(model.metrics, shifts),
            actions=_shifted(model.actions, shifts),
            courses=tuple(courses),
        )


def _shifted(stage: StageModel, shifts: Mapping[str, float]) -> StageModel:
    """Return a stage whose terms are moved by the shifts of their variables.

    The stage computes with numbers that are moved the other way. This has the same effect as long as the moved terms
    are constant at both ends of the range.
    """
    input_shifts = [shifts.get(model_input.variable, 0.0) for model_input in stage.inputs]

    def infer(*numbers: float) -> Inference:
        return stage.infer(*(number - shift for number, shift in zip(numbers, input_shifts, strict=True)))

    def infer_bounds(*bounds: Bounds) -> BoundedInference:
        return stage.infer_bounds(
            *(
                interval._replace(low=interval.low - shift, high=interval.high - shift)
                for interval, shift in zip(bounds, input_shifts, strict=True)
            )
        )

    return replace(stage, infer=infer, infer_bounds=infer_bounds)
