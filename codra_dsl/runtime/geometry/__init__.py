"""Geometry over time: rigid motions on the edges of a tree of frames (P2, section 3.1)."""

from __future__ import annotations

from codra_dsl.runtime.geometry.frames import FrameError, Frames, Transform
from codra_dsl.runtime.geometry.motion import Motion, Outcome
from codra_dsl.runtime.geometry.pose import IDENTITY, Pose, Quaternion, Vector

__all__ = ["IDENTITY", "FrameError", "Frames", "Motion", "Outcome", "Pose", "Quaternion", "Transform", "Vector"]
