"""Stored frames as small pictures for people, with the detected tags outlined."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.frame import Frame, Intrinsics
from codra_papers.lab.perception.poses import Pose
from codra_papers.lab.perception.tags import detect

_OUTLINE_BGR = (0, 200, 0)
_TEXT_BGR = (0, 0, 255)
_JPEG_QUALITY = (cv2.IMWRITE_JPEG_QUALITY, 80)
_COLOURS_OF_EVERY_PIXEL = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
_FRACTION_BITS = 4
"""The number of fraction bits in coordinates for `cv2.polylines`: the coordinates are in sixteenths of a pixel."""


class NoPictureError(Exception):
    """A file cannot be read, or is not a picture."""


def annotated_jpeg(path: Path) -> bytes:
    """Return a stored frame as JPEG in its original size, with each detected tag outlined and numbered.

    Raises:
        NoPictureError: if the file cannot be read or is not a picture.
    """
    picture = _read_picture(path)
    annotated_picture = picture.copy()
    for tag_id, corners_px in _detect_tags(picture):
        corners = np.round(corners_px * 2**_FRACTION_BITS).astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(annotated_picture, [corners], True, _OUTLINE_BGR, 1, cv2.LINE_AA, _FRACTION_BITS)
        text_origin = (int(corners_px[:, 0].min()), int(corners_px[:, 1].max()) + 14)
        cv2.putText(
            annotated_picture, str(tag_id), text_origin, cv2.FONT_HERSHEY_SIMPLEX, 0.45, _TEXT_BGR, 1, cv2.LINE_AA
        )
    _, data = cv2.imencode(".jpg", annotated_picture, (*_JPEG_QUALITY, *_COLOURS_OF_EVERY_PIXEL))
    return bytes(data)


def _read_picture(path: Path) -> NDArray[np.uint8]:
    try:
        data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise NoPictureError(f"'{path}' cannot be read: {error.strerror}") from error
    picture = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if picture is None:
        raise NoPictureError(f"'{path}' is not a picture")
    return np.asarray(picture, dtype=np.uint8)


def _detect_tags(picture: NDArray[np.uint8]) -> list[tuple[int, NDArray[np.float64]]]:
    """Return the ids and corners of the tags in a picture whose colours are in OpenCV's order.

    Detection uses only the pixels of a frame, so the intrinsics and the pose are placeholders.
    """
    height, width = picture.shape[:2]
    frame = Frame(
        pixels=np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), dtype=np.uint8),
        intrinsics=Intrinsics(width=width, height=height, focal_px=float(width)),
        believed_map_from_camera=Pose(rotation=np.eye(3), translation_m=np.zeros(3)),
        stamp_s=0.0,
    )
    return [(tag.tag_id, tag.corners_px) for tag in detect(frame)]
