"""Frames painted without a renderer: tag pictures warped into a picture, so that every corner is known exactly."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.frame import Frame, Intrinsics
from codra_papers.lab.perception.layout import Part, Tag
from codra_papers.lab.perception.poses import Array, Pose, rotation_about
from codra_papers.lab.perception.tags import tag_image

INTRINSICS = Intrinsics(width=640, height=480, focal_px=554.0)
_OVERSAMPLING = 4
_PIXELS_PER_CELL = 16


def frame_of(grey: NDArray[np.uint8], *, stamp_s: float = 0.0) -> Frame:
    """Return a frame without colours, made of a grey image of shape (480, 640)."""
    pixels = np.repeat(grey[:, :, None], 3, axis=2)
    pixels.setflags(write=False)
    return Frame(pixels=pixels, intrinsics=INTRINSICS, believed_map_from_camera=Pose.identity(), stamp_s=stamp_s)


def cluttered_wall(random: np.random.Generator, *, brightness: float = 130.0, contrast: float = 25.0) -> Array:
    """Return a sharp picture of a wall with texture, shape (480, 640): patches of many sizes and no tag."""
    wall = np.full((480, 640), brightness)
    for cell in (16, 40, 120):
        patches = random.normal(0.0, contrast / 2, (480 // cell + 1, 640 // cell + 1))
        wall += np.kron(patches, np.ones((cell, cell)))[:480, :640]
    return wall


def painted(
    tags: Iterable[tuple[Tag, Pose]],
    *,
    random: np.random.Generator,
    background: Array | None = None,
    blur_px: float = 0.6,
    noise: float = 2.0,
) -> NDArray[np.uint8]:
    """Return an image, shape (480, 640), of tags that are given with their `camera_from_part`. None may face away."""
    start = np.full((480, 640), 120.0) if background is None else background
    canvas = np.kron(start, np.ones((_OVERSAMPLING, _OVERSAMPLING))).astype(np.float32)
    for tag, camera_from_part in sorted(tags, key=lambda tag_and_pose: -float(tag_and_pose[1].translation_m[2])):
        _paint(canvas, tag, camera_from_part @ tag.part_from_tag)
    image = cv2.resize(canvas, (640, 480), interpolation=cv2.INTER_AREA)
    image = cv2.GaussianBlur(image, (0, 0), blur_px) if blur_px else image
    return np.clip(image + random.normal(0.0, noise, image.shape), 0, 255).astype(np.uint8)


def _paint(canvas: NDArray[np.float32], tag: Tag, camera_from_tag: Pose) -> None:
    if camera_from_tag.rotation[:, 2] @ camera_from_tag.translation_m >= 0.0:
        return
    half_m = tag.size_m / 2 * 10 / 8
    square = np.array([[-half_m, half_m, 0.0], [half_m, half_m, 0.0], [half_m, -half_m, 0.0], [-half_m, -half_m, 0.0]])
    target = (INTRINSICS.project(camera_from_tag.apply(square)) + 0.5) * _OVERSAMPLING - 0.5
    side = 10 * _PIXELS_PER_CELL
    source = np.array([[0, 0], [side, 0], [side, side], [0, side]], dtype=np.float32) - 0.5
    cells = np.ones((_PIXELS_PER_CELL, _PIXELS_PER_CELL))
    picture = (np.kron(tag_image(tag.tag_id), cells) * 0.8 + 20.0).astype(np.float32)
    warp = cv2.getPerspectiveTransform(source, target.astype(np.float32))
    size = (canvas.shape[1], canvas.shape[0])
    cv2.warpPerspective(picture, warp, size, dst=canvas, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)


def lone_tag(tag_id: int, *, size_m: float = 0.08) -> Tag:
    """Return a tag in the middle of a part that has no other tag."""
    return Tag(tag_id=tag_id, part=Part.BASE, size_m=size_m, part_from_tag=Pose.identity())


def before_the_camera(
    distance_m: float, *, tilt_rad: float = 0.0, tilt_axis_rad: float = 0.0, roll_rad: float = 0.0
) -> Pose:
    """Return `camera_from_part` of a part on the optical axis, with its z axis to the camera, then tilted."""
    facing_rotation = np.diag([1.0, -1.0, -1.0])
    tilt = rotation_about((float(np.cos(tilt_axis_rad)), float(np.sin(tilt_axis_rad)), 0.0), tilt_rad)
    roll = rotation_about((0.0, 0.0, 1.0), roll_rad)
    return Pose(roll @ tilt @ facing_rotation, np.array([0.0, 0.0, distance_m]))
