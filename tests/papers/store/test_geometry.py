"""Rays and rectangles, compared with an independent computation that tests single points."""

from __future__ import annotations

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_papers.store.geometry import Box, Disc, Point, Pose2D, Scene, wrapped

STEP_M = 0.01
FARTHEST_M = 5.0

coordinates = st.floats(-4, 4)
poses = st.builds(Pose2D, coordinates, coordinates, st.floats(-pi, pi))
boxes = st.builds(Box, poses, st.floats(0.3, 2), st.floats(0.3, 2))
discs = st.builds(Disc, st.tuples(coordinates, coordinates), st.floats(0.1, 1))


def contains(shape: Box | Disc, point: Point) -> bool:
    """Whether a point lies in a shape: for a rectangle, on the inner side of all its edges."""
    if isinstance(shape, Disc):
        return hypot(point[0] - shape.centre_m[0], point[1] - shape.centre_m[1]) <= shape.radius_m
    corners = shape.corners()
    cross_products = [
        (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    ]
    return all(cross_product >= 0 for cross_product in cross_products)


def marched_m(shapes: list[Box | Disc], eye: Point, bearing_rad: float) -> float:
    for step in range(round(FARTHEST_M / STEP_M) + 1):
        distance_m = step * STEP_M
        point = (eye[0] + distance_m * cos(bearing_rad), eye[1] + distance_m * sin(bearing_rad))
        if any(contains(shape, point) for shape in shapes):
            return distance_m
    return FARTHEST_M


@settings(max_examples=150, deadline=None)
@given(
    st.lists(boxes, max_size=3), st.lists(discs, max_size=3), st.tuples(coordinates, coordinates), st.floats(-pi, pi)
)
def test_a_ray_ends_where_a_point_that_marches_along_it_first_hits_a_shape(
    some_boxes: list[Box], some_discs: list[Disc], eye: Point, bearing_rad: float
) -> None:
    shapes = [*some_boxes, *some_discs]
    if any(contains(shape, eye) for shape in shapes):
        return
    ray_m = float(Scene(some_boxes, some_discs).ranges_m(eye, np.array([bearing_rad]), FARTHEST_M)[0])
    walk_m = marched_m(shapes, eye, bearing_rad)

    assert ray_m <= walk_m + 1e-9
    if walk_m - ray_m > STEP_M + 1e-9:  # a corner or a rim that the march steps over
        before, after = (
            (eye[0] + distance_m * cos(bearing_rad), eye[1] + distance_m * sin(bearing_rad))
            for distance_m in (ray_m - 1e-6, ray_m + 1e-6)
        )
        assert not any(contains(shape, before) for shape in shapes)
        assert any(contains(shape, after) for shape in shapes) or touches(shapes, after)


def touches(shapes: list[Box | Disc], point: Point) -> bool:
    """Whether a shape is next to a point."""
    neighbours = [(point[0] + 1e-4 * cos(turn), point[1] + 1e-4 * sin(turn)) for turn in np.linspace(0, 2 * pi, 16)]
    return any(contains(shape, neighbour) for shape in shapes for neighbour in neighbours)


@settings(max_examples=150, deadline=None)
@given(boxes, boxes)
def test_rectangles_overlap_if_a_point_of_a_fine_grid_lies_in_both(one: Box, other: Box) -> None:
    shares = np.linspace(-0.499, 0.499, 41)
    grid = [one.centre.point_at(a * one.length_m, b * one.width_m) for a in shares for b in shares]

    if any(contains(other, point) for point in grid):
        assert one.overlaps(other)
    assert one.overlaps(other) == other.overlaps(one)
    if not one.overlaps(other):
        assert not any(other.distance_m(point) == 0.0 for point in grid)


@given(boxes, st.tuples(coordinates, coordinates))
def test_the_distance_to_a_rectangle_is_that_to_the_nearest_point_of_its_edges(box: Box, point: Point) -> None:
    corners = box.corners()
    shares = np.linspace(0, 1, 400)
    edges = zip(corners, (*corners[1:], corners[0]), strict=True)
    nearest = min(
        hypot(a[0] + (b[0] - a[0]) * s - point[0], a[1] + (b[1] - a[1]) * s - point[1])
        for a, b in edges
        for s in shares
    )

    assert box.distance_m(point) == 0.0 if contains(box, point) else abs(box.distance_m(point) - nearest) < 0.02


@given(poses, st.tuples(coordinates, coordinates))
def test_relative_point_is_the_inverse_of_point_at(pose: Pose2D, point: Point) -> None:
    same_point = pose.point_at(*pose.relative_point(point))

    assert hypot(same_point[0] - point[0], same_point[1] - point[1]) < 1e-9


@given(st.floats(-100, 100))
def test_a_wrapped_angle_is_the_same_direction(angle_rad: float) -> None:
    assert abs(wrapped(angle_rad)) <= pi
    assert abs(cos(angle_rad) - cos(wrapped(angle_rad))) < 1e-9


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bearing_rad", [5e-324, -5e-324, 1e-310])
def test_a_ray_that_is_almost_parallel_to_an_edge_passes_it_without_a_warning(bearing_rad: float) -> None:
    scene = Scene([Box(Pose2D(2, 0, 0), 1, 1)], [])

    assert scene.ranges_m((0, 2), np.array([bearing_rad]), FARTHEST_M) == [FARTHEST_M]
