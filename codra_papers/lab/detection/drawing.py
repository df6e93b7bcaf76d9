"""Draw the detected tags into frames, for people to look at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.tags import detect

_OUTLINE_COLOUR = (0, 200, 0)
_TEXT_COLOUR = (0, 0, 255)
_SCALE = 2
_LINE_PX = 30


def draw_detections(frame: Frame, path: Path, notes: Sequence[str] = ()) -> None:
    """Write a frame as PNG, enlarged to twice its size. Each detected tag is outlined and labelled with its id.

    Args:
        frame: the frame.
        path: the file of the picture.
        notes: lines of text that are written below the frame.
    """
    picture = cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2BGR)
    picture = cv2.resize(picture, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_NEAREST)
    for detection in detect(frame):
        corners = np.round((detection.corners_px + 0.5) * _SCALE).astype(np.int32)
        cv2.polylines(picture, [corners.reshape(-1, 1, 2)], isClosed=True, color=_OUTLINE_COLOUR, thickness=2)
        label_place = (int(corners[:, 0].min()), int(corners[:, 1].max()) + 22)
        cv2.putText(picture, str(detection.tag_id), label_place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, _TEXT_COLOUR, 2)
    stamp = f"{frame.stamp_s:.2f} s"
    cv2.putText(picture, stamp, (10, picture.shape[0] - 12), cv2.FONT_HERSHEY_SIMPLEX, 0.7, _TEXT_COLOUR, 2)
    if notes:
        frame_height_px, white = picture.shape[0], (255, 255, 255)
        picture = cv2.copyMakeBorder(picture, 0, _LINE_PX * len(notes) + 10, 0, 0, cv2.BORDER_CONSTANT, value=white)
        for line, note in enumerate(notes, start=1):
            place = (10, frame_height_px + _LINE_PX * line)
            cv2.putText(picture, note, place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, (0, 0, 0), 2, cv2.LINE_AA)
    if not cv2.imwrite(str(path), picture):
        raise OSError(f"cannot write {path}")
