"""Geometry in the plane of the shop's floor: poses, boxes and rays. Lengths in metres, angles in radians."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import cos, hypot, pi, remainder, sin

import numpy as np
import numpy.typing as npt

Point = tuple[float, float]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pose2D:
    """A place in the map, with a heading.

    Attributes:
        x_m: to the east.
        y_m: to the north.
        heading_rad: counted from east, counter-clockwise.
    """

    x_m: float
    y_m: float
    heading_rad: float = 0.0

    @property
    def point_m(self) -> Point:
        """Return the place without the heading."""
        return (self.x_m, self.y_m)

    def out(self, forward_m: float, left_m: float = 0.0) -> Point:
        """Return the point of the map that is `forward_m` ahead and `left_m` to the left of this pose."""
        along, across = cos(self.heading_rad), sin(self.heading_rad)
        return (self.x_m + along * forward_m - across * left_m, self.y_m + across * forward_m + along * left_m)

    def seen_from_here(self, point_m: Point) -> Point:
        """Return how far ahead and how far to the left of this pose a point of the map is."""
        along, across = cos(self.heading_rad), sin(self.heading_rad)
        dx_m, dy_m = point_m[0] - self.x_m, point_m[1] - self.y_m
        return (along * dx_m + across * dy_m, along * dy_m - across * dx_m)

    def ahead(self, forward_m: float) -> Pose2D:
        """Return the pose with the same heading that is `forward_m` ahead, or behind if this is negative."""
        return Pose2D(*self.out(forward_m), self.heading_rad)

    def turned(self, angle_rad: float) -> Pose2D:
        """Return the same place with a turned heading."""
        return Pose2D(self.x_m, self.y_m, wrapped(self.heading_rad + angle_rad))

    def distance_m(self, other: Pose2D) -> float:
        """Return the distance between two places."""
        return hypot(other.x_m - self.x_m, other.y_m - self.y_m)


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle on the floor.

    Attributes:
        centre: the pose of its middle, with the heading along its length.
    """

    centre: Pose2D
    length_m: float
    width_m: float

    @classmethod
    def between(cls, west_m: float, south_m: float, east_m: float, north_m: float) -> Box:
        """Return a rectangle along the axes of the map."""
        return cls(Pose2D((west_m + east_m) / 2, (south_m + north_m) / 2), east_m - west_m, north_m - south_m)

    def corners(self) -> tuple[Point, Point, Point, Point]:
        """Return the corners, each next to the one before."""
        a, b = self.length_m / 2, self.width_m / 2
        out = self.centre.out
        return (out(a, b), out(-a, b), out(-a, -b), out(a, -b))

    def distance_m(self, point_m: Point) -> float:
        """Return the distance of a point from the rectangle: 0 inside."""
        ahead_m, left_m = self.centre.seen_from_here(point_m)
        return hypot(max(abs(ahead_m) - self.length_m / 2, 0.0), max(abs(left_m) - self.width_m / 2, 0.0))

    def overlaps(self, other: Box) -> bool:
        """Return whether two rectangles have more than an edge in common, by the test of separating axes."""
        return not (_is_apart(self, other) or _is_apart(other, self))


@dataclass(frozen=True, slots=True)
class Disc:
    """A disc on the floor."""

    centre_m: Point
    radius_m: float


class Scene:
    """Obstacles for rays: rectangles and discs, as arrays."""

    __slots__ = ("_centres", "_radii", "_starts", "_ways")

    def __init__(self, boxes: Iterable[Box] = (), discs: Iterable[Disc] = ()) -> None:
        """Create a scene from the edges of rectangles and from discs."""
        edges = [edge for box in boxes for edge in _edges(box)]
        self._starts = np.array([start for start, _ in edges], dtype=np.float64).reshape(-1, 2)
        self._ways = np.array([end for _, end in edges], dtype=np.float64).reshape(-1, 2) - self._starts
        disc_list = list(discs)
        self._centres = np.array([disc.centre_m for disc in disc_list], dtype=np.float64).reshape(-1, 2)
        self._radii = np.array([disc.radius_m for disc in disc_list], dtype=np.float64)

    def ranges_m(self, eye_m: Point, bearings_rad: Floats, farthest_m: float) -> Floats:
        """Return the length of each ray until it hits an edge or a disc, at most `farthest_m`.

        Args:
            eye_m: the start of all rays.
            bearings_rad: directions of the rays in the map; shape (rays,).
            farthest_m: the length of a ray without a hit.
        """
        ways = np.stack((np.cos(bearings_rad), np.sin(bearings_rad)), axis=1)
        eye = np.array(eye_m)
        nearest: Floats = np.full(len(ways), farthest_m)
        if len(self._starts):
            nearest = np.minimum(nearest, _to_edges(eye, ways, self._starts, self._ways))
        if len(self._radii):
            nearest = np.minimum(nearest, _to_discs(eye, ways, self._centres, self._radii))
        return nearest


def wrapped(angle_rad: float) -> float:
    """Return the same direction as an angle from -pi to pi."""
    return remainder(angle_rad, 2 * pi)


def _edges(box: Box) -> Sequence[tuple[Point, Point]]:
    corners = box.corners()
    return list(zip(corners, (*corners[1:], corners[0]), strict=True))


def _is_apart(one: Box, other: Box) -> bool:
    """Return whether an axis of the first rectangle separates the two."""
    seen = [one.centre.seen_from_here(corner) for corner in other.corners()]
    for axis, half_m in ((0, one.length_m / 2), (1, one.width_m / 2)):
        along = [point[axis] for point in seen]
        if min(along) >= half_m or max(along) <= -half_m:
            return True
    return False


def _to_edges(eye: Floats, ways: Floats, starts: Floats, edges: Floats) -> Floats:
    """Return the smallest t of each ray: solve eye + t way = start + u edge for edges that face the eye; shape (rays,).

    Edges go counter-clockwise about their rectangle. The other edges can be left out: rays from outside hit them behind
    those that face the eye.
    """
    to_start = starts - eye
    is_facing = edges[:, 0] * to_start[:, 1] > edges[:, 1] * to_start[:, 0]
    if not is_facing.any():
        return np.full(len(ways), np.inf)
    to_start, edges = to_start[is_facing], edges[is_facing]
    cross = ways[:, :1] * edges[:, 1] - ways[:, 1:] * edges[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (to_start[:, 0] * edges[:, 1] - to_start[:, 1] * edges[:, 0]) / cross
        u = (to_start[:, 0] * ways[:, 1:] - to_start[:, 1] * ways[:, :1]) / cross
        meets = (t >= 0.0) & (u >= 0.0) & (u <= 1.0)
    lengths_m: Floats = np.where(meets, t, np.inf).min(axis=1)
    return lengths_m


def _to_discs(eye: Floats, ways: Floats, centres: Floats, radii: Floats) -> Floats:
    """Return the smallest t of each ray: solve |eye + t way - centre| = radius, 0 within a disc; shape (rays,)."""
    to_centre = centres - eye
    along = ways @ to_centre.T
    room = along**2 - (to_centre**2).sum(axis=1) + radii**2
    half = np.sqrt(np.maximum(room, 0.0))
    meets = (room >= 0.0) & (along + half >= 0.0)
    lengths_m: Floats = np.where(meets, np.maximum(along - half, 0.0), np.inf).min(axis=1)
    return lengths_m
