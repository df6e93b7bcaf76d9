"""AprilTags of family 36h11 in pixels: their pictures, and their detection in frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from threading import Lock

import cv2
import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.layout import known_tag_ids
from codra_papers.lab.perception.poses import Array
from codra_papers.lab.perception.refine import refined_corners_px

CELLS_ACROSS = 8
"""Number of cells along a side of the tag's black square: 6 cells of code, and a black cell at each end. The length of
this side is the tag's size."""

FAMILY_SIZE = 587
"""How many tags the family has. The ids begin at 0."""

_FRAME_CACHE_SIZE = 8
"""Number of frames whose detections are cached. Observers of several machines use the same frame at nearly the same
time, so a few frames are enough."""

_detection_lock = Lock()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Detection:
    """One tag in a frame.

    Attributes:
        tag_id: the number of the tag in the family.
        corners_px: the sub-pixel corners of the black square, shape (4, 2): top left, top right, bottom right and
            bottom left. This is the order on an upright tag, even if the tag is rotated in the image. Pixel centres
            have integer coordinates.
    """

    tag_id: int
    corners_px: Array


def tag_image(tag_id: int) -> NDArray[np.uint8]:
    """Return the picture of an upright tag, shape (10, 10), with one pixel per cell: 0 is black and 255 is white.

    The outer ring is the white border that detection needs. The black square, whose side is the tag's size, spans the
    inner 8 x 8 cells. Enlarge the picture without interpolation.

    Raises:
        ValueError: the family has no such tag.
    """
    if not 0 <= tag_id < FAMILY_SIZE:
        raise ValueError(f"tag {tag_id} is not in the family 36h11, whose ids run from 0 to {FAMILY_SIZE - 1}")
    square = cv2.aruco.generateImageMarker(_family(), tag_id, CELLS_ACROSS)
    return np.pad(square, 1, constant_values=255).astype(np.uint8)


def detect(frame: Frame) -> tuple[Detection, ...]:
    """Return the laboratory's tags that a frame shows, in ascending order of their ids.

    If several tags in a frame have the same id, all of them are dropped. A frame is searched once for all callers, even
    if they call from several threads. The same pixels give the same detections in every process.
    """
    with _detection_lock:
        return _detect_once(frame)


@lru_cache(maxsize=_FRAME_CACHE_SIZE)
def _detect_once(frame: Frame) -> tuple[Detection, ...]:
    grey = np.asarray(cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    known_ids = known_tag_ids()
    quads, indices, _ = _detector(known_ids).detectMarkers(grey)
    if indices is None:
        return ()
    tag_ids = [known_ids[int(index)] for index in np.asarray(indices).ravel()]
    corners_px = refined_corners_px(grey, np.asarray(quads, dtype=np.float64).reshape(-1, 4, 2))
    sorted_corners = sorted(zip(tag_ids, corners_px, strict=True), key=lambda pair: pair[0])
    return tuple(
        Detection(tag_id=tag_id, corners_px=corners) for tag_id, corners in sorted_corners if tag_ids.count(tag_id) == 1
    )


@lru_cache(maxsize=1)
def _family() -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)


@lru_cache(maxsize=1)
def _detector(tag_ids: tuple[int, ...]) -> cv2.aruco.ArucoDetector:
    """Return the shared detector for some tags.

    The detector finds tags with sides of 15 to 150 px, in light from that of a bright day down to an eighth of this
    light.
    """
    # Frames are small: more threads would cost more time than they save, and take cores from other processes.
    cv2.setNumThreads(1)
    # With all 587 codes, each candidate would take 1 ms.
    codes = np.ascontiguousarray(_family().bytesList[list(tag_ids)])
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin = 5
    parameters.adaptiveThreshWinSizeMax = 21
    parameters.adaptiveThreshWinSizeStep = 8
    parameters.adaptiveThreshConstant = 5
    parameters.minMarkerPerimeterRate = 0.06
    parameters.minDistanceToBorder = 1
    parameters.perspectiveRemovePixelPerCell = 8  # the default, 4, misses one small tag in twenty
    return cv2.aruco.ArucoDetector(
        cv2.aruco.Dictionary(codes, _family().markerSize, _family().maxCorrectionBits), parameters
    )
