"""Camera frames for perception: pixels, intrinsics, the believed pose of the camera, and the instant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.poses import Array, Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class Intrinsics:
    """A pinhole camera without distortion. Pixel centres have integer coordinates."""

    width: int
    height: int
    focal_px: float

    def matrix(self) -> Array:
        """Return the camera matrix for OpenCV, shape (3, 3). The matrix is read-only."""
        return _matrix(self)

    def project(self, points_m: Array) -> Array:
        """Project points to pixels, shape (n, 2).

        Args:
            points_m: points in the camera frame (x right, y down, z forward), shape (n, 3), with z > 0.
        """
        image = points_m @ self.matrix().T
        pixels: Array = image[:, :2] / image[:, 2:]
        return pixels


@lru_cache(maxsize=16)
def _matrix(camera: Intrinsics) -> Array:
    matrix = np.array(
        [
            [camera.focal_px, 0.0, (camera.width - 1) / 2],
            [0.0, camera.focal_px, (camera.height - 1) / 2],
            [0.0, 0.0, 1.0],
        ]
    )
    matrix.setflags(write=False)
    return matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frame:
    """One camera image, as a robot's driver would deliver it. It contains no information that only a simulator has.

    Attributes:
        pixels: shape (height, width, 3), RGB, uint8, read-only.
        intrinsics: the camera's calibration.
        believed_map_from_camera: the camera's pose according to the robot's own localisation and joints, with the
            errors of both.
        stamp_s: when the shutter closed, in seconds of the world's clock.
    """

    pixels: NDArray[np.uint8]
    intrinsics: Intrinsics
    believed_map_from_camera: Pose
    stamp_s: float


class Camera(Protocol):
    """The handle that perception functions get as `camera`."""

    def capture(self) -> Frame:
        """Take a frame now."""
        ...

    def processing_s(self, mean_s: float) -> float:
        """Return the duration of work that the camera's computer begins now, given the mean duration of such work."""
        ...


@dataclass(frozen=True, slots=True)
class StillCamera:
    """A camera that always returns the same frame, and whose computer always takes the mean time."""

    frame: Frame

    def capture(self) -> Frame:
        """Return the frame."""
        return self.frame

    def processing_s(self, mean_s: float) -> float:
        """Return the mean time."""
        return mean_s


class Base(Protocol):
    """The handle that perception functions get as `base`: the mobile base's own state."""

    def believed_map_from_base(self) -> Pose:
        """Return the pose that the robot currently believes its base to have."""
        ...
