"""The true value of every context-variable of the laboratory's spec, by definition, from the world's own state.

The definitions were fixed before any perception was tuned, and perception never uses them. `M` is the name of a
machine.

- `robot_is_localized`: the robot is localised.
- `M_in_observable_distance`: `Machine.distance_m` of the true pose of the robot's base is below 1.6 m.
- `M_in_manipulation_distance`: the same distance is below 0.95 m.
- `M_base_in_FOV`, `M_lid_in_FOV`: at least half of the corners of the part's tags are inside the image, in front of
  the camera, on tags that face the camera, and not hidden. Neither the light nor the distance from the camera matters.
- `M_open`: the lid is open by more than 0.6 rad.
- `M_locked`: the latch lever is less than half way from locked (0 rad) to unlocked (1 rad).
- `M_rotor_in_pos_1`: a centrifuge's rotor is less than 0.2 rad from its position at 0 rad.
- `M_rotor_in_pos_2`: a centrifuge's rotor is less than 0.2 rad from its position at half a turn.

A lid that hides the rotor does not change the truth about either position of the rotor.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, pi, remainder
from types import MappingProxyType

from codra_papers.lab.perception.layout import Machine, Part
from codra_papers.lab.simulator.geometric_camera import GeometricCamera
from codra_papers.lab.simulator.world import JointKey, LabState, LabWorld

OBSERVABLE_BELOW_M = 1.6
MANIPULATION_BELOW_M = 0.95
IN_VIEW_FROM_SHARE = 0.5
OPEN_ABOVE_RAD = 0.6
LOCKED_BELOW_RAD = 0.5
ROTOR_WITHIN_RAD = 0.2

SAMPLES_PER_S = 5.0
"""How often truth is sampled while something moves. The instant of a change between two samples is wrong by at most
half the time between them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthSpan:
    """The truth from one instant until just before another instant.

    Attributes:
        values: the true value of each context-variable.
    """

    start_s: float
    end_s: float
    values: Mapping[str, bool]


class GroundTruth:
    """The truth about one world. Only one thread may use it at a time."""

    def __init__(self, world: LabWorld) -> None:
        self._world = world
        self._camera = GeometricCamera(world.laboratory)
        self._viewed_parts = [
            (machine.name, part) for machine in world.laboratory.machines for part in (Part.BASE, Part.LID)
        ]

    def at(self, instant_s: float) -> Mapping[str, bool]:
        """Return the truth of every context-variable at an instant."""
        state = self._world.state(instant_s)
        truth = {"robot_is_localized": state.is_localized} | _rotor_truth(state)
        for machine in state.laboratory.machines:
            truth |= _machine_truth(state, machine)
        for (name, part), share in zip(
            self._viewed_parts, self._camera.visible_shares(state, self._viewed_parts), strict=True
        ):
            truth[f"{name}_{part}_in_FOV"] = share >= IN_VIEW_FROM_SHARE
        return MappingProxyType(truth)

    def over(self, start_s: float, end_s: float) -> tuple[TruthSpan, ...]:
        """Return the truth from one instant to another, as spans in order and without gaps. Consecutive spans differ.

        While something moves, truth is sampled `SAMPLES_PER_S` times a second. Each span without motion is sampled
        once.
        """
        spans: list[TruthSpan] = []
        for span_start_s, span_end_s in _sampled_spans(self._world, start_s, end_s):
            values = self.at((span_start_s + span_end_s) / 2)
            if spans and spans[-1].values == values:
                span_start_s = spans.pop().start_s  # noqa: PLW2901
            spans.append(TruthSpan(start_s=span_start_s, end_s=span_end_s, values=values))
        return tuple(spans)


def truth_at(world: LabWorld, instant_s: float) -> Mapping[str, bool]:
    """Return the truth of every context-variable at one instant; for many instants, `GroundTruth` is faster."""
    return GroundTruth(world).at(instant_s)


def _machine_truth(state: LabState, machine: Machine) -> dict[str, bool]:
    distance_m = machine.distance_m(state.map_from_robot())
    return {
        f"{machine.name}_in_observable_distance": distance_m < OBSERVABLE_BELOW_M,
        f"{machine.name}_in_manipulation_distance": distance_m < MANIPULATION_BELOW_M,
        f"{machine.name}_open": state.joints_rad[JointKey(machine.name, Part.LID)] > OPEN_ABOVE_RAD,
        f"{machine.name}_locked": state.joints_rad[JointKey(machine.name, Part.LATCH)] < LOCKED_BELOW_RAD,
    }


def _rotor_truth(state: LabState) -> dict[str, bool]:
    truth: dict[str, bool] = {}
    for key, angle_rad in state.joints_rad.items():
        if key.part is Part.ROTOR:
            truth[f"{key.machine}_rotor_in_pos_1"] = abs(remainder(angle_rad, 2 * pi)) < ROTOR_WITHIN_RAD
            truth[f"{key.machine}_rotor_in_pos_2"] = abs(remainder(angle_rad - pi, 2 * pi)) < ROTOR_WITHIN_RAD
    return truth


def _sampled_spans(world: LabWorld, start_s: float, end_s: float) -> Iterator[tuple[float, float]]:
    """Yield spans of time, in order and without gaps. One sample is taken for each span."""
    covered_until_s = start_s
    for moving_from_s, moving_until_s in world.moving_spans():
        motion_start_s, motion_end_s = min(max(moving_from_s, covered_until_s), end_s), min(moving_until_s, end_s)
        if motion_start_s > covered_until_s:
            yield covered_until_s, motion_start_s
            covered_until_s = motion_start_s
        count = ceil(max(motion_end_s - covered_until_s, 0.0) * SAMPLES_PER_S)
        boundaries_s = [
            covered_until_s + (motion_end_s - covered_until_s) * index / count for index in range(count)
        ] + [motion_end_s]
        yield from pairwise(boundaries_s)
        covered_until_s = max(covered_until_s, motion_end_s)
    if end_s > covered_until_s:
        yield covered_until_s, end_s
