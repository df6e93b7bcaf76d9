"""Sub-pixel corners of square tags, from the lines of their edges.

OpenCV's own sub-pixel search (`CORNER_REFINE_SUBPIX`) moves the corners of a single square inwards. For a tag of 80 mm
at a distance of 1 m, this moves the measured position by 9 mm. The sides of a square have far more pixels than its
corners. So a line is fitted to each side, through the points where brightness changes most along the normals of the
side. The corners are the points where these lines meet.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.poses import Array

_ROUNDS = 2
"""Number of rounds. The first round replaces the detector's rough corners; the second round measures along the true
normals."""

_STATION_COUNT = 24
"""Number of places along a side where the edge is measured."""

_SIDE_MARGIN = 0.08
"""Share of a side's length, at each end of the side, in which nothing is measured, because the neighbouring side blurs
the edge near the corner."""

_OFFSET_COUNT = 15
"""Number of samples along a normal."""

_REACH_CELLS = 0.8
"""The largest distance from a side at which samples are taken along a normal, in cells of the tag. It does not go
beyond the tag's white and black borders."""

_REACH_PX = (1.5, 4.0)
"""Limits, in pixels, of the distance that `_REACH_CELLS` gives. The errors of the detector's corners are smaller than
this distance."""

_MAX_MOVE_PX = 8.0
"""If a corner moves farther than this, the refinement failed, and the detector's rough corners of the tag are used."""

_OUTLIER_PX = 0.7
"""Edge points that are farther than this from a side's first line are dropped for the second line, because the edge is
covered at these points."""

_STATION_SHARES = np.linspace(_SIDE_MARGIN, 1 - _SIDE_MARGIN, _STATION_COUNT)
_OFFSET_SHARES = np.linspace(-1.0, 1.0, _OFFSET_COUNT)
_STEP_INDICES = np.arange(_OFFSET_COUNT - 1)
_NEAR_STEPS = (np.abs(_STEP_INDICES - _STEP_INDICES[:, None]) <= _OFFSET_COUNT // 5).astype(np.float64)
"""One row for each possible steepest step along a normal: 1 for the steps near the steepest step, 0 for the other
steps."""

_QUARTER_TURN = np.array([1.0, -1.0])
"""A factor for (y, x). The product is the vector (x, y) turned by 90 degrees to the left in the image."""

_NEXT_INDICES, _PREVIOUS_INDICES = [1, 2, 3, 0], [3, 0, 1, 2]
"""For each of the four corners or sides, the index of the next corner or side, and of the previous one."""


def refined_corners_px(grey: NDArray[np.uint8], corners_px: Array) -> Array:
    """Return corners of black squares on white, shape (n, 4, 2), refined from the detector's corners.

    Args:
        grey: shape (height, width).
        corners_px: the detector's corners, shape (n, 4, 2), clockwise in the image and wrong by some pixels at most.
    """
    refined_px = corners_px
    if not len(corners_px):
        return refined_px
    image = grey.astype(np.float32)
    for _ in range(_ROUNDS):
        refined_px = _meeting_points(*_lines(_edge_points(image, refined_px)))
    is_near = _lengths(refined_px - corners_px).max(axis=1) <= _MAX_MOVE_PX
    return np.where(is_near[:, None, None], refined_px, corners_px)


def _edge_points(image: NDArray[np.float32], corners_px: Array) -> tuple[Array, Array]:
    """Return the places of steepest change along each side, and their weights.

    The shapes are (n, 4, stations, 2) and (n, 4, stations).
    """
    sides = corners_px.take(_NEXT_INDICES, axis=1) - corners_px
    lengths = _lengths(sides)[..., None]
    outwards = sides[..., ::-1] * _QUARTER_TURN / np.maximum(lengths, 1e-9)
    reach_px = np.clip(_extents_px(corners_px, lengths[..., 0]) * (_REACH_CELLS / 8), *_REACH_PX)
    offsets_px = _OFFSET_SHARES * reach_px[..., None]
    stations = corners_px[:, :, None, :] + _STATION_SHARES[:, None] * sides[:, :, None, :]
    right_px, down_px = (
        stations[..., axis, None] + (offsets_px * outwards[..., axis, None])[:, :, None, :] for axis in range(2)
    )
    weights = _steepness(_brightness(image, right_px, down_px))
    strength = weights.sum(axis=3)
    middles = (offsets_px[:, :, None, 1:] + offsets_px[:, :, None, :-1]) / 2
    shift_px = (weights * middles).sum(axis=3) / np.maximum(strength, 1e-9)
    return stations + shift_px[..., None] * outwards[:, :, None, :], strength


def _lengths(vectors: Array) -> Array:
    """Return the result of `np.linalg.norm` over the last axis, in half of the time."""
    lengths: Array = np.sqrt(np.add.reduce(vectors * vectors, axis=-1))
    return lengths


def _extents_px(corners_px: Array, lengths_px: Array) -> Array:
    """Return, for each side, how far the square extends from this side in the image, shape (n, 4).

    This is the area of the square divided by the length of the side. If the square is seen at a slant, it extends only
    a little from two of its sides.
    """
    first_diagonal, second_diagonal = corners_px[:, 2] - corners_px[:, 0], corners_px[:, 3] - corners_px[:, 1]
    areas_px2 = np.abs(first_diagonal[:, 0] * second_diagonal[:, 1] - first_diagonal[:, 1] * second_diagonal[:, 0]) / 2
    extents_px: Array = areas_px2[:, None] / np.maximum(lengths_px, 1e-9)
    return extents_px


def _brightness(image: NDArray[np.float32], right_px: Array, down_px: Array) -> Array:
    """Return the brightness at sub-pixel places. All shapes are (n, 4, stations, offsets)."""
    right, down = (
        places.reshape(-1, _STATION_COUNT * _OFFSET_COUNT).astype(np.float32) for places in (right_px, down_px)
    )
    values = cv2.remap(image, right, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return values.reshape(right_px.shape).astype(np.float64)


def _steepness(brightness: Array) -> Array:
    """Return the squared increase in brightness from each sample to the next; 0 far from the steepest step."""
    steps = np.maximum(brightness[..., 1:] - brightness[..., :-1], 0.0)
    weights: Array = steps * steps * _NEAR_STEPS.take(steps.argmax(axis=3), axis=0)
    return weights


def _lines(edges: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return a point on the line of every side, and the direction of this line. Both have the shape (n, 4, 2)."""
    points, weights = edges
    centre, direction = _fit(points, weights)
    normal = direction[..., ::-1] * _QUARTER_TURN
    distances_px = np.abs(np.einsum("nski,nsi->nsk", points - centre[:, :, None, :], normal))
    return _fit(points, np.where(distances_px <= _OUTLIER_PX, weights, 1e-6 * weights))


def _fit(points: Array, weights: Array) -> tuple[Array, Array]:
    """Return the centres and unit directions of lines fitted to weighted points (total least squares)."""
    total = np.maximum(weights.sum(axis=2), 1e-9)[..., None]
    centre = np.einsum("nski,nsk->nsi", points, weights) / total
    offsets = points - centre[:, :, None, :]
    spread = np.einsum("nsk,nski,nskj->nsij", weights, offsets, offsets)
    return centre, np.linalg.eigh(spread).eigenvectors[..., 1]


def _meeting_points(centre: Array, direction: Array) -> Array:
    """Return, for each side, the point where it begins: its line meets the line of the previous side at this point."""
    previous_centre, previous_direction = (
        centre.take(_PREVIOUS_INDICES, axis=1),
        direction.take(_PREVIOUS_INDICES, axis=1),
    )
    gap = centre - previous_centre
    sine = previous_direction[..., 0] * direction[..., 1] - previous_direction[..., 1] * direction[..., 0]
    step = (gap[..., 0] * direction[..., 1] - gap[..., 1] * direction[..., 0]) / np.where(sine == 0.0, 1e-9, sine)
    meeting: Array = previous_centre + step[..., None] * previous_direction
    return meeting
