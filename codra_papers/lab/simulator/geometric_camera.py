"""The camera's view by geometry only, without pixels: the places of tags in the image, and what hides them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from codra_papers.lab.perception.layout import INTRINSICS, TILE_PER_TAG, Machine, Part, Tag
from codra_papers.lab.perception.poses import Array, Pose
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory
from codra_papers.lab.simulator.scene import Stage
from codra_papers.lab.simulator.world import JointKey, LabState

_NEAREST_M = 0.05
"""Only points at least this far from the camera, measured along the camera's axis, are in front of the camera."""

_RAY_TOLERANCE_M = 0.003
_COVER_GRID = np.linspace(-0.5, 0.5, 5)
_REFERENCE_DISTANCE_M = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagInView:
    """One tag that faces the camera, with its middle inside the image.

    Attributes:
        tag_id: the id of the tag.
        corners_px: the corners, shape (4, 2), in the order of `Tag.corners_m`; some may lie outside the image.
        width_px: the smallest width of the black square in the image: the area of the square divided by its longest
            side.
        margin_px: the distance from the image's edge to the nearest corner; negative if a corner lies outside.
        covered: the share of the tile, from 0 to 1, that is hidden.
    """

    tag_id: int
    corners_px: Array
    width_px: float
    margin_px: float
    covered: float

    def is_resolved(self) -> bool:
        """Return whether a detector reliably detects the tag in a sharp frame in ordinary light.

        This was measured in 600 drawn frames: all 2,600 such tags were detected, with errors of corners below 1 px.
        Tags with a width of 16 to 20 px are also detected, but with errors of corners up to 2 px. Of tags with a width
        of 14 to 16 px, seven in eight are detected; of tags below 10 px, none.
        """
        return self.width_px >= 20.0 and self.margin_px >= 4.0 and self.covered == 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _PartTags:
    """The corners of n tags of one part, and for each corner the normal of its tag: arrays of shape (n * 4, 3)."""

    corners_m: Array
    normals: Array


@lru_cache(maxsize=256)
def _tags_in_map(machine: Machine, part: Part, angle_rad: float) -> _PartTags:
    """Return the tags of one part in the map. The result is cached, because parts are at rest most of the time."""
    map_from_part, part_tags = machine.map_from_part(part, angle_rad), _tags_of(machine, part)
    return _PartTags(
        corners_m=map_from_part.apply(part_tags.corners_m), normals=part_tags.normals @ map_from_part.rotation.T
    )


@lru_cache(maxsize=256)
def _tags_of(machine: Machine, part: Part) -> _PartTags:
    tags = machine.tags_on(part)
    return _PartTags(
        corners_m=np.concatenate([tag.corners_m() for tag in tags]),
        normals=np.repeat([tag.part_from_tag.rotation[:, 2] for tag in tags], 4, axis=0),
    )


class GeometricCamera:
    """Computes the view of the arm camera in a state. Only one thread may use it at a time."""

    def __init__(self, laboratory: Laboratory = LABORATORY) -> None:
        self._stage = Stage(laboratory)
        self._placed_state: LabState | None = None

    def visible_shares(self, state: LabState, parts: Sequence[tuple[str, Part]]) -> tuple[float, ...]:
        """Return, for each part, the share (0 to 1) of the corners of its tags that the camera sees.

        A corner is seen if it is inside the image, in front of the camera, on a tag that faces the camera, and not
        hidden.

        Args:
            state: the state of the laboratory.
            parts: pairs of a machine's name and one of its parts.
        """
        map_from_camera = state.map_from_camera()
        machine_parts = [(state.laboratory.machine(machine), part) for machine, part in parts]
        corners_m, normals = _corners_in_map(state, machine_parts)
        is_seen = _inside_image(map_from_camera.inverse().apply(corners_m))
        is_seen &= np.einsum("ij,ij->i", map_from_camera.translation_m - corners_m, normals) > 0
        if is_seen.any():
            is_seen[is_seen] = self._visible_points(state, map_from_camera.translation_m, corners_m[is_seen])
        ends = np.cumsum([len(_tags_of(machine, part).corners_m) for machine, part in machine_parts])
        return tuple(float(share.mean()) for share in np.split(is_seen, ends[:-1]))

    def tags_in_view(self, state: LabState) -> tuple[TagInView, ...]:
        """Return the tags that face the camera and have their middle inside the image, ordered by their ids."""
        views = [
            self._view(state, tag, state.map_from_part(machine.name, tag.part) @ tag.part_from_tag)
            for machine in state.laboratory.machines
            for tag in machine.tags
        ]
        return tuple(sorted((view for view in views if view is not None), key=lambda view: view.tag_id))

    def _view(self, state: LabState, tag: Tag, map_from_tag: Pose) -> TagInView | None:
        map_from_camera = state.map_from_camera()
        camera_from_tag = map_from_camera.inverse() @ map_from_tag
        corners_m = camera_from_tag.apply(_square(tag.size_m, _CORNERS))
        faces_camera = float(camera_from_tag.rotation[:, 2] @ camera_from_tag.translation_m) < 0
        is_middle_inside = _inside_image(map_from_camera.inverse().apply(map_from_tag.translation_m[np.newaxis]))[0]
        if not faces_camera or not is_middle_inside or corners_m[:, 2].min() < _NEAREST_M:
            return None
        corners_px = INTRINSICS.project(corners_m)
        grid_m = map_from_tag.apply(_square(tag.size_m * TILE_PER_TAG, _GRID))
        is_unhidden = self._visible_points(state, map_from_camera.translation_m, grid_m)
        last = np.array([INTRINSICS.width - 1.0, INTRINSICS.height - 1.0])
        return TagInView(
            tag_id=tag.tag_id,
            corners_px=corners_px,
            width_px=_width_px(corners_px),
            margin_px=float(min(corners_px.min(), (last - corners_px).min())),
            covered=1.0 - float(np.count_nonzero(is_unhidden)) / len(is_unhidden),
        )

    def _visible_points(self, state: LabState, eye_m: Array, points_m: Array) -> NDArray[np.bool_]:
        """Return a mask, shape (n,), of the points that a ray from the eye reaches. Points are given in the map."""
        if state is not self._placed_state:
            self._stage.place(state)
            self._placed_state = state
        shares = self._stage.first_hit(eye_m, points_m)
        distances_m = np.linalg.norm(points_m - eye_m, axis=1)
        is_reached: NDArray[np.bool_] = (shares < 0) | ((1.0 - shares) * distances_m < _RAY_TOLERANCE_M)
        return is_reached


def image_motion_px(before: LabState, after: LabState) -> float:
    """Return, for two states, the largest motion of a visible point in the image.

    The points are the corners of all tags, and the points at the image's corners and middle at a distance of 1 m.
    """
    camera = before.map_from_camera()
    reference_m = camera.apply(_reference_points())
    parts = [(machine, part) for machine in before.laboratory.machines for part in machine.parts()]
    points_before_m = camera.inverse().apply(np.concatenate((reference_m, _corners_in_map(before, parts)[0])))
    points_after_m = (
        after.map_from_camera().inverse().apply(np.concatenate((reference_m, _corners_in_map(after, parts)[0])))
    )
    is_in_both = _inside_image(points_before_m) & (points_after_m[:, 2] > _NEAREST_M)
    motions_px = INTRINSICS.project(points_after_m[is_in_both]) - INTRINSICS.project(points_before_m[is_in_both])
    return sqrt(np.add.reduce(motions_px * motions_px, axis=1).max())


@lru_cache(maxsize=1)
def _reference_points() -> Array:
    half_width = (INTRINSICS.width - 2) / 2 / INTRINSICS.focal_px
    half_height = (INTRINSICS.height - 2) / 2 / INTRINSICS.focal_px
    ends = [(0.0, 0.0)] + [(x, y) for x in (-half_width, half_width) for y in (-half_height, half_height)]
    return np.array([(x, y, 1.0) for x, y in ends]) * _REFERENCE_DISTANCE_M


_CORNERS = np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
_LAST_PX = np.array([INTRINSICS.width - 0.5, INTRINSICS.height - 0.5])
_GRID = np.array([[x, y] for y in _COVER_GRID for x in _COVER_GRID])


def _square(side_m: float, places: Array) -> Array:
    """Return points in a tag's plane, shape (n, 3), from places that are given in units of the tag's side."""
    return np.column_stack((places * side_m, np.zeros(len(places))))


def _width_px(corners_px: Array) -> float:
    """Return the area of a quadrilateral divided by its longest side. Its corners have the shape (4, 2)."""
    diagonals = corners_px[2:] - corners_px[:2]
    area = abs(diagonals[0, 0] * diagonals[1, 1] - diagonals[0, 1] * diagonals[1, 0]) / 2
    return float(area / np.linalg.norm(corners_px - np.roll(corners_px, 1, axis=0), axis=1).max())


def _corners_in_map(state: LabState, parts: Iterable[tuple[Machine, Part]]) -> tuple[Array, Array]:
    """Return all corners of tags on some parts, and for each corner the normal of its tag: shape (n, 3), in the map."""
    placed_tags = [
        _tags_in_map(machine, part, state.joints_rad.get(JointKey(machine.name, part), 0.0)) for machine, part in parts
    ]
    return np.concatenate([tags.corners_m for tags in placed_tags]), np.concatenate(
        [tags.normals for tags in placed_tags]
    )


def _inside_image(points_m: Array) -> NDArray[np.bool_]:
    """Return a mask, shape (n,), of the points in front of the camera and inside the image.

    Points have the shape (n, 3) and are given in the camera's frame.
    """
    is_inside: NDArray[np.bool_] = points_m[:, 2] > _NEAREST_M
    pixels = INTRINSICS.project(points_m[is_inside])
    is_inside[is_inside] = ((pixels >= -0.5) & (pixels <= _LAST_PX)).all(axis=1)
    return is_inside
