"""Changes in the laboratory that the robot does not cause: people, and the light."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np

from codra_papers.lab.perception.layout import Part
from codra_papers.lab.simulator.laboratory import LidMoved, LightDown, PersonBefore
from codra_papers.lab.simulator.world import OUTSIDE, JointKey, LabWorld, Move, Quantity, straight_path

LID_S = 3.0
"""How long a person takes to open or close a lid. The robot's hand needs longer to reach a lid."""

STEP_S = 2.0
"""How long a person takes to step in front of the camera, and to step away."""

FADE_S = 1.0
"""How long the light takes to go down, and how long to go up again."""

PERSON_AHEAD_M = 0.45
"""Distance of the person in front of the camera."""

PERSON_ASIDE_M = 2.0
"""How far to the left of this place the person comes from."""

_RETRY_S = 1.0


class Clock(Protocol):
    """The clock of the disturbances."""

    def now_s(self) -> float:
        """Return the current time in seconds."""
        ...

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> object:
        """Schedule a call at an instant."""
        ...


def disturb(world: LabWorld, clock: Clock) -> None:
    """Schedule all disturbances of the world's laboratory."""
    for disturbance in world.laboratory.disturbances:
        match disturbance:
            case LidMoved():
                begin = partial(_move_lid, world, clock, disturbance)
            case PersonBefore():
                begin = partial(_step_in, world, clock, disturbance)
            case LightDown():
                begin = partial(_dim, world, clock, disturbance)
        clock.call_at(disturbance.at_s, begin)


def _move_lid(world: LabWorld, clock: Clock, lid_moved: LidMoved) -> None:
    """Let a person move a lid. If the robot's hand is not drawn back, or the lid is already moving, try again later.

    So two hands never move the same lid.
    """
    now_s, key = clock.now_s(), JointKey(lid_moved.machine, Part.LID)
    hand_is_back = world.values(Quantity.REACH, now_s) == (0.0,) and world.is_at_rest(Quantity.REACH, now_s)
    if not (hand_is_back and world.is_at_rest(key, now_s)):
        clock.call_at(now_s + _RETRY_S, partial(_move_lid, world, clock, lid_moved))
        return
    low_rad, high_rad = world.laboratory.machine(lid_moved.machine).joint(Part.LID).range_rad
    angle_rad = low_rad + lid_moved.open_share * (high_rad - low_rad)
    world.schedule(now_s, [world.moves_to(now_s, key, (angle_rad,), LID_S)])


def _step_in(world: LabWorld, clock: Clock, person_before: PersonBefore) -> None:
    """Let a person come from the left of the camera's current view, wait in front of the camera, and go back."""
    now_s = clock.now_s()
    map_from_camera = world.state(now_s).map_from_camera()
    forward = map_from_camera.rotation[:2, 2] / np.linalg.norm(map_from_camera.rotation[:2, 2])
    left = np.array([-forward[1], forward[0]])
    spot_m = map_from_camera.translation_m[:2] + PERSON_AHEAD_M * forward
    place_m, outside_place_m = ((float(x_m), float(y_m)) for x_m, y_m in (spot_m, spot_m + PERSON_ASIDE_M * left))
    path_in, path_out = straight_path(outside_place_m, place_m), straight_path(place_m, outside_place_m)
    moves = (
        Move(channel=Quantity.PERSON, path=straight_path(OUTSIDE, outside_place_m), duration_s=0.0),
        Move(channel=Quantity.PERSON, path=path_in, duration_s=STEP_S),
        Move(channel=Quantity.PERSON, path=path_out, duration_s=STEP_S, delay_s=person_before.lasts_s),
        Move(
            channel=Quantity.PERSON,
            path=straight_path(outside_place_m, OUTSIDE),
            duration_s=0.0,
            delay_s=person_before.lasts_s + STEP_S,
        ),
    )
    world.schedule(now_s, moves)


def _dim(world: LabWorld, clock: Clock, light_down: LightDown) -> None:
    before, after = (world.laboratory.light,), (light_down.light,)
    moves = (
        Move(channel=Quantity.LIGHT, path=straight_path(before, after), duration_s=FADE_S),
        Move(channel=Quantity.LIGHT, path=straight_path(after, before), duration_s=FADE_S, delay_s=light_down.lasts_s),
    )
    world.schedule(clock.now_s(), moves)
