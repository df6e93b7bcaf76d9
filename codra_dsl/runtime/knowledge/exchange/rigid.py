"""Poses of DSR's RT edges.

The rotation is given by Euler angles about x, then the new y, then the new z. The translation is given in
the unit `unit_m`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge.exchange.document import DsrValue, ValueCode

TRANSLATION = "rt_translation"
ROTATION = "rt_rotation_euler_xyz"
STAMPS = "rt_timestamps"
HEAD = "rt_head_index"
POSE_ATTRIBUTES = (TRANSLATION, ROTATION, STAMPS, HEAD)
"""The attributes that hold the poses of an edge, the present one and earlier ones."""

MILLIMETRE_M = 0.001

_GIMBAL_LOCK_COSINE = 1e-12
"""If the cosine of the second angle is below this value, only the sum of the other two angles is determined."""


def pose_of(attributes: Mapping[str, DsrValue], unit_m: float) -> Pose | None:
    """Return the present pose of an RT edge; None if the edge has no pose.

    An edge with a history has several poses in one list; the pose with the newest stamp is the present one. The head
    index is not used, because its meaning depends on the version of RoboComp that wrote the file.

    Args:
        attributes: the attributes of the edge.
        unit_m: the unit of translations, in metres.
    """
    newest_index = _newest_index(attributes.get(STAMPS))
    if newest_index is None:
        return None
    start = 3 * newest_index
    translation, angles_rad = (_three_numbers(attributes.get(name), start) for name in (TRANSLATION, ROTATION))
    if translation is None or angles_rad is None:
        return None
    x, y, z = translation
    pose = Pose.of((unit_m * x, unit_m * y, unit_m * z))
    for axis, angle_rad in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), angles_rad, strict=True):
        pose @= Pose.about(axis, angle_rad)
    return pose


def attributes_of(pose: Pose, unit_m: float) -> dict[str, DsrValue]:
    """Return the attributes of an RT edge with one pose.

    Args:
        pose: the pose of the target relative to the origin.
        unit_m: the unit of translations, in metres.
    """
    translation = tuple(component_m / unit_m for component_m in pose.translation_m)
    return {
        TRANSLATION: DsrValue(code=ValueCode.FLOATS, value=translation),
        ROTATION: DsrValue(code=ValueCode.FLOATS, value=_euler_rad(pose)),
    }


def _euler_rad(pose: Pose) -> tuple[float, float, float]:
    (a, b, c, _), (_, e, f, _), (_, h, i, _), _ = pose.matrix()
    cosine = math.hypot(a, b)
    if cosine < _GIMBAL_LOCK_COSINE:  # the first and the third axis coincide
        return (math.atan2(h, e), math.atan2(c, cosine), 0.0)
    return (math.atan2(-f, i), math.atan2(c, cosine), math.atan2(-b, a))


def _newest_index(stamps: DsrValue | None) -> int | None:
    """Return the index of the greatest stamp, 0 without stamps; None if a stamp is unknown."""
    if stamps is None or not isinstance(stamps.value, tuple) or not stamps.value:
        return 0
    if any(stamp is None or math.isnan(stamp) for stamp in stamps.value):
        return None
    return stamps.value.index(max(stamps.value))


def _three_numbers(value: DsrValue | None, start: int) -> tuple[float, float, float] | None:
    """Return three numbers of a list, from an index on; None if they do not exist or are not finite."""
    numbers = value.value[start : start + 3] if value is not None and isinstance(value.value, tuple) else ()
    if len(numbers) != 3 or not all(isinstance(number, (int, float)) and math.isfinite(number) for number in numbers):
        return None
    return (float(numbers[0]), float(numbers[1]), float(numbers[2]))
