"""Draw the detected tags into frames, for people to look at."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.tags import detect

_OUTLINE_COLOUR = (0, 200, 0)
_TEXT_COLOUR = (0, 0, 255)
_SCALE = 2


def draw_detections(frame: Frame, path: Path) -> None:
    """Write a frame as PNG, enlarged to twice its size. Each detected tag is outlined and labelled with its id."""
    picture = cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2BGR)
    picture = cv2.resize(picture, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_NEAREST)
    for detection in detect(frame):
        corners = np.round((detection.corners_px + 0.5) * _SCALE).astype(np.int32)
        cv2.polylines(picture, [corners.reshape(-1, 1, 2)], isClosed=True, color=_OUTLINE_COLOUR, thickness=2)
        label_place = (int(corners[:, 0].min()), int(corners[:, 1].max()) + 22)
        cv2.putText(picture, str(detection.tag_id), label_place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, _TEXT_COLOUR, 2)
    stamp = f"{frame.stamp_s:.2f} s"
    cv2.putText(picture, stamp, (10, picture.shape[0] - 12), cv2.FONT_HERSHEY_SIMPLEX, 0.7, _TEXT_COLOUR, 2)
    if not cv2.imwrite(str(path), picture):
        raise OSError(f"cannot write {path}")
