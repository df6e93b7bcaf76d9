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
        close_shift_m: by how much the terms of `person_distance` are moved to larger distances.
        battery_shift_percent: by how much the terms of `battery_level` are moved to higher levels.
        hold_s: how long an action must lead before it becomes the course; None for the time of the spec.
    """

    close_shift_m: float = 0.0
    battery_shift_percent: float = 0.0
    hold_s: float | None = None

    def __str__(self) -> str:
        """Return the numbers for tables."""
        hold = "of the spec" if self.hold_s is None else f"{self.hold_s:g} s"
        return f"close {self.close_shift_m:+g} m, battery {self.battery_shift_percent:+g} percent, hold {hold}"

    def __call__(self, model: MapeModel) -> MapeModel:
        """Return the loops with these numbers."""
        assert model.metrics is not None
        shifts = {"person_distance": self.close_shift_m, "battery_level": self.battery_shift_percent}
        courses = (
            course if self.hold_s is None else replace(course, hold_s=self.hold_s, holds_s={})
            for course in model.courses
        )
        return replace(model, metrics=_shifted(model.metrics, shifts), courses=tuple(courses))


def _shifted(stage: StageModel, shifts: Mapping[str, float]) -> StageModel:
    """Return a stage whose terms are moved by the shifts of their variables.

    The stage computes with numbers that are moved the other way. This has the same effect as long as the moved terms
    are constant at both ends of the range.
    """
    missing_names = shifts.keys() - {model_input.variable for model_input in stage.inputs}
    if missing_names:
        raise ValueError(f"the metrics of the spec do not read {', '.join(sorted(missing_names))}")
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
