"""Sub-pixel corners of square tags, from the lines of their edges.

OpenCV's own sub-pixel search (`CORNER_REFINE_SUBPIX`) moves the corners of a single square inwards. At a distance of
1 m, this moves a tag of 80 mm by 9 mm. The sides of a square have far more pixels than its corners. So a line is fitted
to each side, through the points where brightness changes most along the normals of the side. The corners are the points
where these lines meet.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.poses import Array

_ROUNDS = 2
"""Number of rounds. The first round replaces the detector's rough corners; the second one measures along the true
normals."""

_STATIONS = 24
"""Number of places along a side where the edge is measured."""

_SIDE_MARGIN = 0.08
"""Share of a side, at each of its ends, where nothing is measured, because the neighbouring side blurs the edge
there."""

_OFFSETS = 15
"""Number of samples along a normal."""

_REACH_CELLS = 0.8
"""How far from the side samples are taken along a normal, in cells of the tag: not beyond its white and black
borders."""

_REACH_PX = (1.5, 4.0)
"""Smallest and largest reach along a normal. The errors of the detector's corners are smaller."""

_LOST_PX = 8.0
"""If a corner moves farther than this, the refinement failed. The detector's rough corners of the tag are then used."""

_OUTLIER_PX = 0.7
"""Edge points that are farther than this from a side's first line are dropped for the second line, because the edge is
covered there."""

_ALONG = np.linspace(_SIDE_MARGIN, 1 - _SIDE_MARGIN, _STATIONS)
_ACROSS = np.linspace(-1.0, 1.0, _OFFSETS)
_STEPS = np.arange(_OFFSETS - 1)
_NEAR = (np.abs(_STEPS - _STEPS[:, None]) <= _OFFSETS // 5).astype(np.float64)
"""One row for each possible steepest step along a normal: 1 for the steps near it, 0 for the others."""

_TURNED = np.array([1.0, -1.0])
"""A factor for (y, x). The product is the direction a quarter turn to the left of (x, y) in the image."""

_NEXT, _PREVIOUS = [1, 2, 3, 0], [3, 0, 1, 2]
"""For each of the four corners or sides, the indices of the next one and of the previous one."""


def refined_corners_px(grey: NDArray[np.uint8], corners_px: Array) -> Array:
    """Return corners of black squares on white, shape (n, 4, 2), refined from the detector's corners.

    Args:
        grey: shape (height, width).
        corners_px: the detector's corners, shape (n, 4, 2), clockwise in the image and wrong by some pixels at most.
    """
    refined = corners_px
    if not len(corners_px):
        return refined
    image = grey.astype(np.float32)
    for _ in range(_ROUNDS):
        refined = _meeting_points(*_lines(_edge_points(image, refined)))
    is_near = _lengths(refined - corners_px).max(axis=1) <= _LOST_PX
    return np.where(is_near[:, None, None], refined, corners_px)


def _edge_points(image: NDArray[np.float32], corners_px: Array) -> tuple[Array, Array]:
    """Return the places of steepest change along each side, and their weights.

    The shapes are (n, 4, stations, 2) and (n, 4, stations).
    """
    sides = corners_px.take(_NEXT, axis=1) - corners_px
    lengths = _lengths(sides)[..., None]
    outwards = sides[..., ::-1] * _TURNED / np.maximum(lengths, 1e-9)
    reach_px = np.clip(_depths_px(corners_px, lengths[..., 0]) * (_REACH_CELLS / 8), *_REACH_PX)
    offsets_px = _ACROSS * reach_px[..., None]
    stations = corners_px[:, :, None, :] + _ALONG[:, None] * sides[:, :, None, :]
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


def _depths_px(corners_px: Array, lengths_px: Array) -> Array:
    """Return the depth of the square behind each side in the image, shape (n, 4).

    If the square is seen at a slant, the depth behind two of its sides is small.
    """
    first, second = corners_px[:, 2] - corners_px[:, 0], corners_px[:, 3] - corners_px[:, 1]
    areas_px2 = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    depths_px: Array = areas_px2[:, None] / np.maximum(lengths_px, 1e-9)
    return depths_px


def _brightness(image: NDArray[np.float32], right_px: Array, down_px: Array) -> Array:
    """Return the brightness at sub-pixel places. All shapes are (n, 4, stations, offsets)."""
    right, down = (places.reshape(-1, _STATIONS * _OFFSETS).astype(np.float32) for places in (right_px, down_px))
    values = cv2.remap(image, right, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return values.reshape(right_px.shape).astype(np.float64)


def _steepness(brightness: Array) -> Array:
    """Return the squared increase in brightness from each sample to the next; 0 if it is not near the steepest step."""
    steps = np.maximum(brightness[..., 1:] - brightness[..., :-1], 0.0)
    weights: Array = steps * steps * _NEAR.take(steps.argmax(axis=3), axis=0)
    return weights


def _lines(edges: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return a point and a direction of the line of every side, both of shape (n, 4, 2)."""
    points, weights = edges
    centre, direction = _fit(points, weights)
    normal = direction[..., ::-1] * _TURNED
    away_px = np.abs(np.einsum("nski,nsi->nsk", points - centre[:, :, None, :], normal))
    return _fit(points, np.where(away_px <= _OUTLIER_PX, weights, 1e-6 * weights))


def _fit(points: Array, weights: Array) -> tuple[Array, Array]:
    """Return the centres and unit directions of lines fitted to weighted points (total least squares)."""
    total = np.maximum(weights.sum(axis=2), 1e-9)[..., None]
    centre = np.einsum("nski,nsk->nsi", points, weights) / total
    arms = points - centre[:, :, None, :]
    spread = np.einsum("nsk,nski,nskj->nsij", weights, arms, arms)
    return centre, np.linalg.eigh(spread).eigenvectors[..., 1]


def _meeting_points(centre: Array, direction: Array) -> Array:
    """Return the point where the line of each side meets the line of the previous side. There the side begins."""
    before, turn = centre.take(_PREVIOUS, axis=1), direction.take(_PREVIOUS, axis=1)
    gap = centre - before
    sine = turn[..., 0] * direction[..., 1] - turn[..., 1] * direction[..., 0]
    step = (gap[..., 0] * direction[..., 1] - gap[..., 1] * direction[..., 0]) / np.where(sine == 0.0, 1e-9, sine)
    meeting: Array = before + step[..., None] * turn
    return meeting
