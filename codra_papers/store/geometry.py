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
        x_m: the coordinate to the east.
        y_m: the coordinate to the north.
        heading_rad: the angle from east, counter-clockwise.
    """

    x_m: float
    y_m: float
    heading_rad: float = 0.0

    @property
    def point_m(self) -> Point:
        """Return the place without the heading."""
        return (self.x_m, self.y_m)

    def point_at(self, forward_m: float, left_m: float = 0.0) -> Point:
        """Return the point of the map that is `forward_m` ahead and `left_m` to the left of this pose."""
        cosine, sine = cos(self.heading_rad), sin(self.heading_rad)
        return (self.x_m + cosine * forward_m - sine * left_m, self.y_m + sine * forward_m + cosine * left_m)

    def relative_point(self, point_m: Point) -> Point:
        """Return how far ahead and how far to the left of this pose a point of the map is."""
        cosine, sine = cos(self.heading_rad), sin(self.heading_rad)
        dx_m, dy_m = point_m[0] - self.x_m, point_m[1] - self.y_m
        return (cosine * dx_m + sine * dy_m, cosine * dy_m - sine * dx_m)

    def pose_ahead(self, forward_m: float) -> Pose2D:
        """Return the pose with the same heading that is `forward_m` ahead, or behind if `forward_m` is negative."""
        return Pose2D(*self.point_at(forward_m), self.heading_rad)

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
        centre: the pose of the rectangle's middle, with the heading along the length.
    """

    centre: Pose2D
    length_m: float
    width_m: float

    @classmethod
    def between(cls, west_m: float, south_m: float, east_m: float, north_m: float) -> Box:
        """Return a rectangle along the axes of the map."""
        return cls(Pose2D((west_m + east_m) / 2, (south_m + north_m) / 2), east_m - west_m, north_m - south_m)

    def corners(self) -> tuple[Point, Point, Point, Point]:
        """Return the corners in their order around the rectangle."""
        a, b = self.length_m / 2, self.width_m / 2
        point_at = self.centre.point_at
        return (point_at(a, b), point_at(-a, b), point_at(-a, -b), point_at(a, -b))

    def distance_m(self, point_m: Point) -> float:
        """Return the distance of a point from the rectangle: 0 inside."""
        ahead_m, left_m = self.centre.relative_point(point_m)
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

    __slots__ = ("_centres", "_edge_vectors", "_radii", "_starts")

    def __init__(self, boxes: Iterable[Box] = (), discs: Iterable[Disc] = ()) -> None:
        """Create a scene from the edges of rectangles and from discs."""
        edges = [edge for box in boxes for edge in _edges(box)]
        self._starts = np.array([start for start, _ in edges], dtype=np.float64).reshape(-1, 2)
        self._edge_vectors = np.array([end for _, end in edges], dtype=np.float64).reshape(-1, 2) - self._starts
        disc_list = list(discs)
        self._centres = np.array([disc.centre_m for disc in disc_list], dtype=np.float64).reshape(-1, 2)
        self._radii = np.array([disc.radius_m for disc in disc_list], dtype=np.float64)

    def with_obstacles(self, boxes: Iterable[Box], discs: Iterable[Disc]) -> Scene:
        """Return a scene with further obstacles. Rays find all of them in one pass."""
        further, scene = Scene(boxes, discs), Scene()
        for name in Scene.__slots__:
            setattr(scene, name, np.concatenate((getattr(self, name), getattr(further, name))))
        return scene

    def ranges_m(self, eye_m: Point, bearings_rad: Floats, farthest_m: float) -> Floats:
        """Return the length of each ray until it hits an edge or a disc, at most `farthest_m`.

        Args:
            eye_m: the start of all rays.
            bearings_rad: directions of the rays in the map; shape (rays,).
            farthest_m: the length of a ray without a hit.
        """
        directions = np.stack((np.cos(bearings_rad), np.sin(bearings_rad)), axis=1)
        eye = np.array(eye_m)
        nearest: Floats = np.full(len(directions), farthest_m)
        if len(self._starts):
            nearest = np.minimum(nearest, _edge_ranges_m(eye, directions, self._starts, self._edge_vectors))
        if len(self._radii):
            nearest = np.minimum(nearest, _disc_ranges_m(eye, directions, self._centres, self._radii))
        return nearest


def wrapped(angle_rad: float) -> float:
    """Return the same direction as an angle from -pi to pi."""
    return remainder(angle_rad, 2 * pi)


def _edges(box: Box) -> Sequence[tuple[Point, Point]]:
    corners = box.corners()
    return list(zip(corners, (*corners[1:], corners[0]), strict=True))


def _is_apart(one: Box, other: Box) -> bool:
    """Return whether an axis of the first rectangle separates the two rectangles."""
    offsets = [one.centre.relative_point(corner) for corner in other.corners()]
    for axis, half_m in ((0, one.length_m / 2), (1, one.width_m / 2)):
        coordinates_m = [point[axis] for point in offsets]
        if min(coordinates_m) >= half_m or max(coordinates_m) <= -half_m:
            return True
    return False


def _edge_ranges_m(eye: Floats, directions: Floats, starts: Floats, edges: Floats) -> Floats:
    """Return the smallest t of each ray: solve eye + t direction = start + u edge; shape (rays,).

    Edges go counter-clockwise about their rectangle. Only edges that face the eye are used, because a ray from outside
    hits any other edge only behind an edge that faces the eye.
    """
    to_start = starts - eye
    is_facing = edges[:, 0] * to_start[:, 1] > edges[:, 1] * to_start[:, 0]
    start_x, start_y = to_start[is_facing].T[:, :, None]
    edge_x, edge_y = edges[is_facing].T[:, :, None]
    direction_x, direction_y = np.ascontiguousarray(directions.T)
    # t = numerators / cross and u = from_start / cross. The numerators are negative, so t >= 0 where cross < 0.
    cross = edge_y * direction_x - edge_x * direction_y
    from_start = start_x * direction_y - start_y * direction_x
    meets = (from_start <= 0.0) & (from_start >= cross) & (cross < 0.0)
    lengths_m: Floats = np.full(cross.shape, np.inf)
    np.divide(start_x * edge_y - start_y * edge_x, cross, out=lengths_m, where=meets)
    nearest: Floats = lengths_m.min(axis=0, initial=np.inf)
    return nearest


def _disc_ranges_m(eye: Floats, directions: Floats, centres: Floats, radii: Floats) -> Floats:
    """Return the smallest t of each ray: solve |eye + t direction - centre| = radius; 0 in a disc; shape (rays,)."""
    to_centre = centres - eye
    distances_along_ray_m = directions @ to_centre.T
    discriminant = distances_along_ray_m**2 - (to_centre**2).sum(axis=1) + radii**2
    half_chords = np.sqrt(np.maximum(discriminant, 0.0))
    meets = (discriminant >= 0.0) & (distances_along_ray_m + half_chords >= 0.0)
    lengths_m: Floats = np.where(meets, np.maximum(distances_along_ray_m - half_chords, 0.0), np.inf).min(axis=1)
    return lengths_m
