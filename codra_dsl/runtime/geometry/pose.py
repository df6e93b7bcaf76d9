"""Rigid motions, SE(3): a rotation and then a translation. Lengths are in metres, angles in radians.

Rotations are unit quaternions (w, x, y, z) in Hamilton's convention, acting on column vectors. They are equivalent to
the 4 x 4 matrices that P2 multiplies along RT edges, need less computation, and cannot drift out of SO(3) unnoticed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

NO_TRANSLATION: Vector = (0.0, 0.0, 0.0)
NO_ROTATION: Quaternion = (1.0, 0.0, 0.0, 0.0)

_NEARLY_PARALLEL_COSINE = 1.0 - 1e-9
"""The cosine beyond which slerp would divide by almost zero, and linear interpolation is as good."""

_SMALLEST_NORM = 1e-9
_ORTHONORMAL_TOLERANCE = 1e-6

_SQUARED_NORM_TOLERANCE = 1e-12
"""The tolerance for the squared norm of a unit quaternion; products of many quaternions deviate this far from 1."""


@dataclass(frozen=True, slots=True)
class Pose:
    """The pose of one frame in another: p_outer = R(rotation) p_inner + translation.

    Attributes:
        translation_m: the translation of the inner frame's origin, in the outer frame.
        rotation: a unit quaternion (w, x, y, z), from the inner to the outer frame's axes.
    """

    translation_m: Vector = NO_TRANSLATION
    rotation: Quaternion = NO_ROTATION

    @classmethod
    def of(cls, translation_m: Sequence[float] = NO_TRANSLATION, rotation: Sequence[float] = NO_ROTATION) -> Pose:
        """Return a pose of checked numbers; the quaternion is normalized.

        Raises:
            ValueError: if the translation does not have 3 finite numbers, the quaternion does not have 4 finite
                numbers, or the quaternion is almost zero.
        """
        x, y, z = _finite_numbers(translation_m, 3, "a translation")
        w, i, j, k = _finite_numbers(rotation, 4, "a quaternion")
        return cls((x, y, z), _normalized_quaternion((w, i, j, k)))

    def checked(self) -> Pose:
        """Return this pose if its fields are tuples that form a rigid motion, or else the pose that `of` makes of them.

        Raises:
            ValueError: if `of` raises it for these fields.
        """
        translation_m, rotation = self.translation_m, self.rotation
        if type(translation_m) is tuple is type(rotation) and len(translation_m) == 3 and len(rotation) == 4:
            (x, y, z), (w, i, j, k) = translation_m, rotation
            try:
                is_rigid = (
                    abs(w * w + i * i + j * j + k * k - 1.0) < _SQUARED_NORM_TOLERANCE
                    and isfinite(x)
                    and isfinite(y)
                    and isfinite(z)
                )
            except (TypeError, OverflowError):
                is_rigid = False
            if is_rigid:
                return self
        return Pose.of(translation_m, rotation)

    @classmethod
    def about(cls, axis: Sequence[float], angle_rad: float, translation_m: Sequence[float] = NO_TRANSLATION) -> Pose:
        """Return the pose of a rotation about an axis, by the right-hand rule, followed by a translation.

        Raises:
            ValueError: if the axis is almost zero, or a number is not finite.
        """
        direction = _finite_numbers(axis, 3, "an axis")
        length = math.hypot(*direction)
        if length < _SMALLEST_NORM:
            raise ValueError("an axis needs a direction: its numbers must not all be 0")
        half_angle_rad, scale = angle_rad / 2.0, math.sin(angle_rad / 2.0) / length
        return cls.of(translation_m, (math.cos(half_angle_rad), *(scale * component for component in direction)))

    @classmethod
    def from_matrix(cls, matrix: Sequence[Sequence[float]]) -> Pose:
        """Return the pose of a homogeneous 4 x 4 matrix.

        Raises:
            ValueError: if the matrix is not in SE(3).
        """
        rows = [_finite_numbers(row, 4, "a row of the matrix") for row in matrix]
        if len(rows) != 4 or not _is_rigid(rows):
            raise ValueError("a rigid motion is a 4 x 4 matrix: a rotation, a translation, and 0 0 0 1 in the last row")
        return cls.of([row[3] for row in rows[:3]], _quaternion_of(rows))

    def matrix(self) -> tuple[tuple[float, float, float, float], ...]:
        """Return the homogeneous 4 x 4 matrix, row by row."""
        w, x, y, z = self.rotation
        tx, ty, tz = self.translation_m
        return (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), tx),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), ty),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), tz),
            (0.0, 0.0, 0.0, 1.0),
        )

    def __matmul__(self, inner: Pose) -> Pose:
        """Return the pose of C in A, if this is the pose of B in A and `inner` is the pose of C in B."""
        ix, iy, iz = _rotated_vector(self.rotation, inner.translation_m)
        tx, ty, tz = self.translation_m
        return _new_pose((tx + ix, ty + iy, tz + iz), _product(self.rotation, inner.rotation))

    def inverse(self) -> Pose:
        """Return the pose of the outer frame in the inner one."""
        w, x, y, z = self.rotation
        inverse_rotation = (w, -x, -y, -z)
        tx, ty, tz = _rotated_vector(inverse_rotation, self.translation_m)
        return _new_pose((-tx, -ty, -tz), inverse_rotation)

    def apply(self, point_m: Vector) -> Vector:
        """Return the coordinates in the outer frame of a point given in the inner one."""
        x, y, z = _rotated_vector(self.rotation, point_m)
        tx, ty, tz = self.translation_m
        return (tx + x, ty + y, tz + z)

    def towards(self, other: Pose, share: float) -> Pose:
        """Return an interpolated pose, with a straight translation and the shortest rotation at a constant rate.

        Args:
            other: the other pose.
            share: 0 means this pose, 1 means the other pose; outside of [0, 1], the motion is extrapolated.
        """
        a, b = self.translation_m, other.translation_m
        translation_m = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2]))
        return _new_pose(translation_m, _slerp(self.rotation, other.rotation, share))

    def distance_m(self, other: Pose) -> float:
        """Return the distance between the two origins."""
        return math.dist(self.translation_m, other.translation_m)

    def angle_rad(self, other: Pose) -> float:
        """Return the smallest angle between the two rotations, from 0 to pi."""
        w, x, y, z = _product(Pose((0.0, 0.0, 0.0), self.rotation).inverse().rotation, other.rotation)
        return 2.0 * math.atan2(math.hypot(x, y, z), abs(w))


IDENTITY = Pose()


@dataclass(slots=True)
class _MutablePose:
    """The fields of a pose, in the same order, before it becomes immutable."""

    translation_m: Vector
    rotation: Quaternion


def _new_pose(translation_m: Vector, rotation: Quaternion) -> Pose:
    """Return a pose in half the time of its constructor: a frozen class sets each of its fields by a call."""
    pose: Any = _MutablePose(translation_m, rotation)
    pose.__class__ = Pose
    frozen_pose: Pose = pose
    return frozen_pose


def compose_poses(poses: Sequence[Pose]) -> Pose:
    """Return the composition of one or more poses, the innermost first; each is given in the frame of the next."""
    (x, y, z), rotation = poses[0].translation_m, poses[0].rotation
    for pose in poses[1:]:
        next_rotation, (tx, ty, tz) = pose.rotation, pose.translation_m
        x, y, z = _rotated_vector(next_rotation, (x, y, z))
        x, y, z = tx + x, ty + y, tz + z
        rotation = _product(next_rotation, rotation)
    return _new_pose((x, y, z), rotation)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _rotated_vector(rotation: Quaternion, v: Vector) -> Vector:
    """Return a vector turned by a unit quaternion: v + 2 w (u x v) + 2 u x (u x v)."""
    w, x, y, z = rotation
    vx, vy, vz = v
    cx, cy, cz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return (vx + w * cx + y * cz - z * cy, vy + w * cy + z * cx - x * cz, vz + w * cz + x * cy - y * cx)


def _slerp(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    cosine = aw * bw + ax * bx + ay * by + az * bz
    sign = -1.0 if cosine < 0.0 else 1.0  # q and -q are the same rotation: use the shorter turn
    cosine = abs(cosine)
    if cosine > _NEARLY_PARALLEL_COSINE:
        weight_a, weight_b = 1.0 - share, share
    else:
        angle_rad = math.acos(cosine)
        sine = math.sin(angle_rad)
        weight_a, weight_b = math.sin((1.0 - share) * angle_rad) / sine, math.sin(share * angle_rad) / sine
    weight_b *= sign
    return _normalized_quaternion(
        (
            weight_a * aw + weight_b * bw,
            weight_a * ax + weight_b * bx,
            weight_a * ay + weight_b * by,
            weight_a * az + weight_b * bz,
        )
    )


def _normalized_quaternion(quaternion: Quaternion) -> Quaternion:
    w, x, y, z = quaternion
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not norm > _SMALLEST_NORM:
        raise ValueError("a rotation needs a quaternion that is not zero")
    return (w / norm, x / norm, y / norm, z / norm)


def _finite_numbers(numbers: Sequence[float], count: int, description: str) -> list[float]:
    try:
        floats = [float(number) for number in numbers]
    except (TypeError, ValueError, OverflowError):
        floats = []
    if len(floats) != count or not all(map(isfinite, floats)):
        raise ValueError(f"{description} has {count} finite numbers, not {numbers!r}")
    return floats


def _is_rigid(rows: list[list[float]]) -> bool:
    a, b, c = zip(*(row[:3] for row in rows[:3]), strict=True)
    lengths = [_dot(a, a) - 1.0, _dot(b, b) - 1.0, _dot(c, c) - 1.0]
    is_orthonormal = max(map(abs, (*lengths, _dot(a, b), _dot(b, c), _dot(c, a)))) < _ORTHONORMAL_TOLERANCE
    cross_product = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    is_right_handed = _dot(cross_product, c) > 0.0
    return is_orthonormal and is_right_handed and rows[3] == [0.0, 0.0, 0.0, 1.0]


def _quaternion_of(rows: list[list[float]]) -> Quaternion:
    """Return the quaternion of a rotation matrix, derived from its largest component to avoid cancellation."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _) = rows[:3]
    candidates = (
        (1 + a + e + i, h - f, c - g, d - b),
        (h - f, 1 + a - e - i, b + d, c + g),
        (c - g, b + d, 1 - a + e - i, f + h),
        (d - b, c + g, f + h, 1 - a - e + i),
    )
    return max(candidates, key=lambda candidate: _dot(candidate, candidate))


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))
