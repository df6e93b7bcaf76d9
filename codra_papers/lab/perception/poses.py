"""Rigid transforms between frames. A pose with the name `map_from_base` transforms points from `base` to `map`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A proper rotation followed by a translation.

    Attributes:
        rotation: shape (3, 3), orthonormal, determinant 1.
        translation_m: shape (3,).
    """

    rotation: Array
    translation_m: Array

    @staticmethod
    def identity() -> Pose:
        """Return the pose that does not move points."""
        return Pose(np.eye(3), np.zeros(3))

    @staticmethod
    def planar(x_m: float, y_m: float, heading_rad: float) -> Pose:
        """Return a pose in the plane z = 0, turned counter-clockwise about z."""
        sine, cosine = 0.0 + float(np.sin(heading_rad)), 1.0 - (1.0 - float(np.cos(heading_rad)))
        rotation = np.array([[cosine, 0.0 - sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return Pose(rotation, np.array([x_m, y_m, 0.0]))

    def __matmul__(self, other: Pose) -> Pose:
        """Chain two poses: `(a_from_b @ b_from_c)` is `a_from_c`."""
        rotate = self.rotation.dot  # for such small arrays, `@` takes twice as long
        return Pose(rotate(other.rotation), rotate(other.translation_m) + self.translation_m)

    def inverse(self) -> Pose:
        """Return the inverse transform."""
        return Pose(self.rotation.T, (-self.rotation.T).dot(self.translation_m))

    def apply(self, points_m: Array) -> Array:
        """Transform points of shape (n, 3) or (3,)."""
        moved: Array = points_m.dot(self.rotation.T) + self.translation_m
        return moved


def rotation_about(axis: tuple[float, float, float], angle_rad: float) -> Array:
    """Return the right-handed rotation, shape (3, 3), about an axis (Rodrigues)."""
    cross, squared_matrix = _cross_matrices(axis)
    rotation: Array = _IDENTITY + np.sin(angle_rad) * cross + (1.0 - np.cos(angle_rad)) * squared_matrix
    return rotation


def looking_at(eye_m: Array, target_m: Array) -> Pose:
    """Return `map_from_camera` for a camera at `eye_m` that looks at `target_m` with the horizon level.

    The camera frame is OpenCV's: x right, y down, z forward. The map's z points up.
    """
    forward = _unit(target_m - eye_m)
    right = _unit(cross(forward, _UP))
    return Pose(columns(right, cross(forward, right), forward), np.asarray(eye_m, dtype=np.float64))


@lru_cache(maxsize=64)
def planar(x_m: float, y_m: float, heading_rad: float) -> Pose:
    """Return the result of `Pose.planar`, from a cache for repeated places. The pose is read-only."""
    return _made_read_only(Pose.planar(x_m, y_m, heading_rad))


@lru_cache(maxsize=64)
def camera_at(eye_m: tuple[float, float, float], target_m: tuple[float, float, float]) -> Pose:
    """Return the result of `looking_at` for points given as tuples, from a cache for a camera at rest.

    The pose is read-only.
    """
    return _made_read_only(looking_at(np.array(eye_m), np.array(target_m)))


def _made_read_only(pose: Pose) -> Pose:
    pose.rotation.setflags(write=False)
    pose.translation_m.setflags(write=False)
    return pose


_IDENTITY = np.eye(3)
_UP = np.array([0.0, 0.0, 1.0])


@lru_cache(maxsize=64)
def _cross_matrices(axis: tuple[float, float, float]) -> tuple[Array, Array]:
    """Return the cross-product matrix, shape (3, 3), of an axis's direction, and the square of this matrix."""
    x, y, z = _unit(np.asarray(axis, dtype=np.float64))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return cross, cross @ cross


def _unit(vector: Array) -> Array:
    unit: Array = vector / length(vector)
    return unit


def columns(x: Array, y: Array, z: Array) -> Array:
    """Return the result of `np.column_stack` for three vectors of shape (3,), in a third of the time."""
    stacked = np.empty((3, 3))
    stacked[:, 0], stacked[:, 1], stacked[:, 2] = x, y, z
    return stacked


def length(vector: Array) -> float:
    """Return the result of `np.linalg.norm` for a vector, in a fifth of the time."""
    return sqrt(vector.dot(vector))


def cross(left: Array, right: Array) -> Array:
    """Return the result of `np.cross` for two vectors of shape (3,), in a tenth of the time."""
    (a, b, c), (d, e, f) = left.tolist(), right.tolist()
    return np.array([b * f - c * e, c * d - a * f, a * e - b * d])
