"""Poses of the arm camera for each purpose: to look at a machine, to grip a part, to wait in front of a machine.

A gaze belongs to an action. It does not depend on the observers, and no value here is chosen to suit an observer.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, sin
from types import MappingProxyType

import numpy as np

from codra_papers.lab.perception.layout import Machine, Part
from codra_papers.lab.perception.poses import Array, Pose, looking_at
from codra_papers.lab.simulator.scene import FINGER_TIP_M, PCR_CYCLER_HANDLE_M, PCR_CYCLER_KNOB_M

Gaze = tuple[float, ...]
"""The camera's position and a point on its axis: six numbers in metres, in one frame."""

_OVERVIEW_GAZES: Mapping[str, Gaze] = MappingProxyType(
    {
        "centrifuge": (1.15, 0.0, 0.90, 0.10, 0.0, 0.437),
        "pcr_cycler": (0.92, 0.0, 0.64, 0.05, 0.0, 0.275),
        "shaker": (1.00, 0.0, 0.74, 0.08, 0.0, 0.33),
    }
)
"""Gazes that show the complete machine with its lid closed or open, in the machine's base frame."""

_SIDE_GAZES: Mapping[str, Gaze] = MappingProxyType(
    {
        "centrifuge": (1.12, -0.15, 0.88, 0.12, 0.0, 0.437),
        "pcr_cycler": (0.88, -0.10, 0.58, 0.06, -0.02, 0.27),
        "shaker": (0.98, -0.12, 0.70, 0.09, -0.01, 0.33),
    }
)
"""Gazes that show the complete machine from half left, to check the latch, in the machine's base frame."""

_ROTOR_GAZE: Gaze = (0.82, 0.0, 1.08, 0.125, 0.0, 0.36)
"""The gaze down on the centrifuge's rotor, past the open lid, in the machine's base frame."""

_READY_GAZES: Mapping[str, Gaze] = MappingProxyType(
    {
        "centrifuge": (0.85, 0.0, 0.78, 0.27, 0.0, 0.36),
        "pcr_cycler": (0.86, 0.06, 0.60, 0.07, 0.02, 0.272),
        "shaker": (0.88, 0.04, 0.72, 0.12, 0.01, 0.37),
    }
)
"""Gazes to which the arm returns after it touched a machine, in the machine's base frame.

The camera is then so close that an open lid of the centrifuge is out of view."""

DECK_GAZE: Gaze = (0.05, 0.175, 0.57, 0.34, 0.175, 0.164)
"""The gaze down on the robot's own deck, to put a tray on it or to take the tray, in the robot's base frame."""

_STAND_OFF_M = 0.16
"""Distance of the hand from a part before the hand grips the part, and after the hand has released the part."""

_GRIP_POINTS_M: Mapping[tuple[str, Part], tuple[float, float, float]] = MappingProxyType(
    {
        ("centrifuge", Part.LID): (0.515, 0.0, 0.065),
        ("centrifuge", Part.LATCH): (0.0, 0.03, 0.0),
        ("centrifuge", Part.ROTOR): (0.0, 0.0, 0.02),
        ("pcr_cycler", Part.LID): PCR_CYCLER_HANDLE_M,
        ("pcr_cycler", Part.LATCH): PCR_CYCLER_KNOB_M,
        ("shaker", Part.LID): (0.435, 0.0, 0.055),
        ("shaker", Part.LATCH): (0.0, 0.02, 0.0),
    }
)
"""Where the fingers hold a part, in the part's frame."""

_HAND_ANGLES_RAD: Mapping[tuple[str, Part], tuple[tuple[float, float], tuple[float, float]]] = MappingProxyType(
    {
        ("centrifuge", Part.LID): ((0.55, 0.0), (0.05, 0.0)),
        ("centrifuge", Part.LATCH): ((0.45, 0.0), (0.45, 0.0)),
        ("centrifuge", Part.ROTOR): ((1.05, 0.0), (1.05, 0.0)),
        ("pcr_cycler", Part.LID): ((0.45, 0.50), (1.07, 0.84)),
        ("pcr_cycler", Part.LATCH): ((0.20, 0.03), (0.20, 0.03)),
        ("shaker", Part.LID): ((0.55, 0.0), (0.05, 0.0)),
        ("shaker", Part.LATCH): ((0.45, 0.0), (0.45, 0.0)),
    }
)
"""Pitch (down) and yaw (from right to left) of the hand at the two ends of a part's motion."""

_TRAY_POINTS_M: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {"centrifuge": (0.06, 0.0, 0.31), "pcr_cycler": (0.03, 0.0, 0.23), "shaker": (0.04, 0.0, 0.26)}
)
"""Where a machine holds the sample tray, in its base frame."""


def observation_gaze(shape: str, part: Part) -> Gaze:
    """Return a gaze, in the machine's base frame, that shows a part of a machine with this shape well."""
    if part is Part.ROTOR:
        return _ROTOR_GAZE
    return _SIDE_GAZES[shape] if part is Part.LATCH else _OVERVIEW_GAZES[shape]


def ready_gaze(shape: str) -> Gaze:
    """Return the gaze to which the arm returns after it touched a machine, in the machine's base frame."""
    return _READY_GAZES[shape]


def grip_gaze(machine: Machine, part: Part, angle_rad: float) -> Gaze:
    """Return the gaze while the fingers hold a part whose joint is at an angle, in the machine's base frame."""
    joint = machine.joint(part)
    base_from_part = machine.map_from_base.inverse() @ machine.map_from_part(part, angle_rad)
    low_rad, high_rad = joint.range_rad
    first_rad, last_rad = (np.array(angles_rad) for angles_rad in _HAND_ANGLES_RAD[machine.shape, part])
    share = (angle_rad - low_rad) / (high_rad - low_rad)
    pitch_rad, yaw_rad = first_rad + (last_rad - first_rad) * share
    return _gaze_at_finger_tip(base_from_part.apply(np.array(_GRIP_POINTS_M[machine.shape, part])), pitch_rad, yaw_rad)


def tray_gaze(shape: str) -> Gaze:
    """Return the gaze while the fingers hold the tray in a machine with this shape, in the machine's base frame."""
    return _gaze_at_finger_tip(np.array(_TRAY_POINTS_M[shape]), pitch_rad=0.95, yaw_rad=0.0)


def stand_off_gaze(gaze: Gaze) -> Gaze:
    """Return a gaze moved back along its own axis, so that the hand no longer touches the part that it held."""
    eye_m, target_m = np.array(gaze[:3]), np.array(gaze[3:])
    back_m = (eye_m - target_m) / np.linalg.norm(eye_m - target_m) * _STAND_OFF_M
    return _gaze(eye_m + back_m, target_m + back_m)


def gaze_in_frame(gaze: Gaze, frame_from_machine: Pose) -> Gaze:
    """Transform a gaze from a machine's base frame to another frame."""
    return _gaze(*frame_from_machine.apply(np.array(gaze).reshape(2, 3)))


def _gaze_at_finger_tip(finger_tip_m: Array, pitch_rad: float, yaw_rad: float) -> Gaze:
    """Return the gaze of a hand that comes from the machine's front and whose finger tips are at a point.

    The pitch turns the hand down, and the yaw turns the hand from the machine's right to its left. The camera is behind
    and above the fingers.
    """
    horizontal_length = cos(pitch_rad)
    forward = np.array([-horizontal_length * cos(yaw_rad), -horizontal_length * sin(yaw_rad), -sin(pitch_rad)])
    axes = looking_at(np.zeros(3), forward).rotation
    eye_m = finger_tip_m - axes @ np.array(FINGER_TIP_M)
    return _gaze(eye_m, eye_m + 0.5 * forward)


def _gaze(eye_m: Array, target_m: Array) -> Gaze:
    return tuple(float(number) for number in (*eye_m, *target_m))
