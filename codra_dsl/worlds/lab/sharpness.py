"""Whether a frame is good enough that seeing no tag in it means that there is none: its light, blur and noise."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, hypot, pi, sqrt

import cv2
import numpy as np
from numpy.typing import NDArray

from codra_dsl.worlds.lab.frame import Frame

_BLUR_LIMIT_PX2 = 1.1
"""Variance of a blur, summed over both directions, under which the detector begins to miss tags of 20 to 30 pixels: a
motion of 4 to 5 pixels within the exposure."""

_NEEDED_NOISE = 12.0
"""How bright, in standard deviations of the noise, white must be for the detector to find such tags."""

_NEEDED_GREYS = 10.0
"""How bright white must be without any noise: the detector's own threshold."""

_SATURATED_GREYS = 250
_SATURATED_LIMIT = 0.2
"""Share of the pixels that are too bright to show anything, from which on a tag may be lost among them."""

_REACH_PX = 6
_LENS_BLUR_PX = 0.8
"""Deviation of the blur that is added, the same in all directions, before slopes are taken from noisy pixels."""

_NOISE_LEFT = 0.35
"""What that blur leaves of the noise; of the noise in a slope it leaves a quarter."""

_FLATTEST_EDGE = 1.5
_EDGE_OVER_NOISE = 6.0
"""An edge is steeper than this many deviations of a slope: in a frame of noise alone there is none."""

_AIM_RAD = pi / 12
"""How far the direction of an edge may be from the one that it is counted for."""

_FEWEST_EDGES = 40
_FEWER_SHARE = 0.2
"""Fewer edges than this share of those of the crossed direction: a motion may have wiped them out."""

_MOST_EDGES = 12_000
_SHARPER_PERCENTILE = 25
"""A frame is as sharp as the sharper quarter of its edges: round things and prints seen near have soft ones."""

_LINE_WIDENING = 0.3
"""A thin line looks sharper than a step under the same blur; that much of the width is added to make up for it."""

_BLOCK_PX = 16

_Picture = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Direction:
    """A direction across edges.

    Attributes:
        sharpest_px: width of edges across it in a frame of a still scene.
    """

    right: int
    down: int
    sharpest_px: float

    def stride_px(self) -> float:
        """Return the distance from one sample to the next."""
        return hypot(self.right, self.down)

    def angle_rad(self) -> float:
        """Return the angle from right, growing downwards."""
        return atan2(self.down, self.right)


_CROSSED_PAIRS = (
    (_Direction(right=1, down=0, sharpest_px=3.06), _Direction(right=0, down=1, sharpest_px=3.06)),
    (_Direction(right=1, down=1, sharpest_px=3.54), _Direction(right=-1, down=1, sharpest_px=3.54)),
)


@dataclass(frozen=True, slots=True, eq=False)
class _Edges:
    """Steep places of a picture: the picture, and the places' rows, columns and directions (rad, modulo pi)."""

    picture: _Picture
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    angles_rad: NDArray[np.float32]
    noise: float


def sharpness(frame: Frame) -> float:
    """Return how well a frame would show a small tag: 1 at best, 0 if it shows nothing.

    It is 1 / (1 + blur + darkness + glare), where each is 1 at the limit beyond which the detector begins to miss tags:
    blur by the widths of edges, in two crossed directions at least; darkness by the brightest parts against the noise;
    glare by the saturated share. Without enough edges to tell, as in a grey frame, it is 0.

    Why 0.5 is where seeing no tag begins to mean something: in 900 drawn frames with light from a twentieth of a day to
    a day and turns up to 1.5 rad/s, the detector found of the whole tags in view (20 pixels wide or more)

        sharpness   0-0.2  0.2-0.3  0.3-0.4  0.4-0.5  0.5-0.6  0.6-0.7  0.7-0.8  0.8-1
        found       58 %   80 %     75 %     87 %     100 %    99.8 %   100 %    99.8 %

    that is 1774 of 1776 from 0.5 on. All still frames of machines in daylight reach 0.5, of those without a machine 83
    of 84, but in a turn of over 0.6 rad/s (4 pixels within the exposure) only one in eleven.
    """
    grey = cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2GRAY).astype(np.float32)
    noise = _noise_greys(grey)
    blur_px2 = _blur_px2(_edges(grey, noise))
    if blur_px2 is None:
        return 0.0
    white_greys = max(float(np.percentile(grey[::4, ::4], 95)), 1.0)
    darkness = max(_NEEDED_GREYS, _NEEDED_NOISE * noise) / white_greys
    glare = float(np.mean(grey[::4, ::4] >= _SATURATED_GREYS)) / _SATURATED_LIMIT
    return 1.0 / (1.0 + blur_px2 / _BLUR_LIMIT_PX2 + darkness + glare)


def _noise_greys(grey: _Picture) -> float:
    """Return the standard deviation of the noise where the picture is flattest (Immerkaer's mask, block by block)."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], dtype=np.float32) / 6
    rough = np.abs(cv2.filter2D(grey, -1, mask))
    blocks = cv2.resize(rough, (grey.shape[1] // _BLOCK_PX, grey.shape[0] // _BLOCK_PX), interpolation=cv2.INTER_AREA)
    return float(np.percentile(blocks, 10)) * sqrt(pi / 2)


def _edges(grey: _Picture, noise: float) -> _Edges:
    """Return places that are steeper than noise, evenly drawn from all if there are very many."""
    picture = np.asarray(cv2.GaussianBlur(grey, (0, 0), _LENS_BLUR_PX), dtype=np.float32)
    half_step = np.array([[-0.5, 0.0, 0.5]], dtype=np.float32)
    right, down = cv2.filter2D(picture, -1, half_step), cv2.filter2D(picture, -1, half_step.T)
    flattest = max(_FLATTEST_EDGE, _EDGE_OVER_NOISE * noise / 4)
    margin = _REACH_PX + 2
    rows, columns = np.nonzero(cv2.magnitude(right, down)[margin:-margin, margin:-margin] > flattest)
    drawn = slice(None, None, 1 + len(rows) // _MOST_EDGES)
    rows, columns = rows[drawn] + margin, columns[drawn] + margin
    angles_rad = np.arctan2(down[rows, columns], right[rows, columns]).astype(np.float32)
    return _Edges(picture, rows, columns, angles_rad, noise)


def _blur_px2(edges: _Edges) -> float | None:
    """Return the variance of the blur, summed over two crossed directions; None if there are too few edges to tell.

    A motion blurs the edges across it and leaves sharp streaks along it. Whatever its direction, it shows in the worse
    of the two pairs of crossed directions, or it has wiped out nearly all edges of one direction.
    """
    sums_px2: list[float] = []
    for pair in _CROSSED_PAIRS:
        fewer, more = sorted(np.count_nonzero(_faces(edges, direction)) for direction in pair)
        if more >= _FEWEST_EDGES and fewer < _FEWER_SHARE * more:
            return None
        added_px2 = [_added_blur_px2(edges, direction) for direction in pair]
        if None not in added_px2:
            sums_px2.append(sum(filter(None, added_px2)))
    return max(sums_px2, default=None)


def _added_blur_px2(edges: _Edges, direction: _Direction) -> float | None:
    """Return the variance of the blur across a direction, beyond that of the lens; None if there are too few edges."""
    width_px = _width_px(edges, direction)
    return None if width_px is None else max(width_px**2 - direction.sharpest_px**2, 0.0) / (2 * pi)


def _width_px(edges: _Edges, direction: _Direction) -> float | None:
    """Return how wide the sharper edges across a direction are, or None if there are too few to tell.

    A width is an edge's height over its slope; for a step under a Gaussian blur it is sqrt(2 pi) times the deviation.
    """
    reach = int(_REACH_PX / direction.stride_px())
    profiles = _profiles(edges, direction, reach)
    middle = reach + 1
    slopes = np.abs(profiles[:, 2:] - profiles[:, :-2]) / (2 * direction.stride_px())
    is_steepest = (slopes[:, reach] >= slopes[:, reach - 1]) & (slopes[:, reach] > slopes[:, reach + 1])
    profiles, steepest = profiles[is_steepest], slopes[is_steepest, reach]
    tops, feet = profiles[:, middle:-1].max(axis=1), profiles[:, 1 : middle + 1].min(axis=1)
    heights = np.maximum(tops - feet - 1.35 * _NOISE_LEFT * edges.noise, 0.0)  # the extremes of seven noisy values
    step_share = np.clip((profiles[:, -2] - profiles[:, 1]) / np.maximum(tops - feet, 1e-6), 0.0, 1.0)
    widths_px = heights / steepest * (1.0 + _LINE_WIDENING * (1.0 - step_share))
    widths_px = widths_px[tops < _SATURATED_GREYS]  # beyond, an edge is cut off and looks sharper than it is
    return None if len(widths_px) < _FEWEST_EDGES else float(np.percentile(widths_px, _SHARPER_PERCENTILE))


def _profiles(edges: _Edges, direction: _Direction, reach: int) -> NDArray[np.float32]:
    """Return the picture across the edges that face a direction, dark side first, shape (n, 2 * reach + 3)."""
    faces = _faces(edges, direction)
    steps = np.arange(-reach - 1, reach + 2)
    rows = edges.rows[faces, None] + direction.down * steps
    columns = edges.columns[faces, None] + direction.right * steps
    profiles: NDArray[np.float32] = edges.picture[rows, columns]
    is_rising = np.cos(edges.angles_rad[faces] - direction.angle_rad()) > 0
    return np.where(is_rising[:, None], profiles, profiles[:, ::-1])


def _faces(edges: _Edges, direction: _Direction) -> NDArray[np.bool_]:
    """Return which edges are crossed by a direction at nearly a right angle."""
    off_rad = np.mod(edges.angles_rad - direction.angle_rad() + pi / 2, pi) - pi / 2
    faces: NDArray[np.bool_] = np.abs(off_rad) < _AIM_RAD
    return faces
