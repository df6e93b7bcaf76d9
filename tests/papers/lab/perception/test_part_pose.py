"""Poses of tags and parts, from exact corners and from disturbed ones."""

from __future__ import annotations

from math import acos, degrees, pi, radians

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codra_papers.lab.perception.layout import Part, Tag, machine_named
from codra_papers.lab.perception.part_pose import GATE_PX, part_pose, tag_poses
from codra_papers.lab.perception.poses import Pose
from codra_papers.lab.perception.tags import Detection
from tests.papers.lab.perception.painted import INTRINSICS, before_the_camera, lone_tag

BASE_TAGS = machine_named("pcr_cycler").tags_on(Part.BASE)
PANEL = BASE_TAGS[0].part_from_tag
"""A frame in the plane of the base's tags. The poses of the base follow from the camera's view of this frame."""


def exact_detection(tag: Tag, camera_from_part: Pose) -> Detection:
    corners_px = INTRINSICS.project(camera_from_part.apply(tag.corners_m()))
    return Detection(tag_id=tag.tag_id, corners_px=corners_px)


def spoilt_detection(detection: Detection, by_px: float) -> Detection:
    """Return a detection with one wrong corner, as if it were covered."""
    corners_px = detection.corners_px.copy()
    corners_px[1] += (-by_px, by_px)
    return Detection(tag_id=detection.tag_id, corners_px=corners_px)


def base_before_the_camera(distance_m: float, tilt_rad: float) -> Pose:
    return before_the_camera(distance_m, tilt_rad=tilt_rad) @ PANEL.inverse()


def degrees_between(one_pose: Pose, other_pose: Pose) -> float:
    return degrees(acos(min(1.0, (float(np.trace(one_pose.rotation.T @ other_pose.rotation)) - 1.0) / 2.0)))


MAX_ROLL_RAD = pi - 0.01
"""Nearer to pi, the pose from OpenCV's method for squares alone is less exact, and can be wrong."""


@pytest.mark.parametrize("roll_rad", [3.1415926535, 3.1415926535897927, pi])
def test_a_tag_that_is_turned_by_nearly_pi_is_localised(roll_rad: float) -> None:
    tag, pose = lone_tag(20), before_the_camera(0.5, tilt_rad=1.0, roll_rad=roll_rad)

    fitted_pose = part_pose([tag], [exact_detection(tag, pose)], INTRINSICS)

    assert fitted_pose is not None
    assert degrees_between(fitted_pose.camera_from_part, pose) < 0.01


@settings(max_examples=60)
@given(
    distance_m=st.floats(0.4, 1.4),
    tilt_rad=st.floats(radians(2), radians(70)),
    tilt_axis_rad=st.floats(-pi, pi),
    roll_rad=st.floats(-MAX_ROLL_RAD, MAX_ROLL_RAD),
)
@example(distance_m=0.5, tilt_rad=0.5, tilt_axis_rad=pi, roll_rad=3.140625)  # OpenCV rounds turns of nearly pi
@example(distance_m=1.25, tilt_rad=0.140625, tilt_axis_rad=0.0, roll_rad=0.625)  # IPPE divides by zero
def test_the_better_of_a_tags_poses_is_the_true_one_and_comes_first(
    distance_m: float, tilt_rad: float, tilt_axis_rad: float, roll_rad: float
) -> None:
    tag = lone_tag(20)
    pose = before_the_camera(distance_m, tilt_rad=tilt_rad, tilt_axis_rad=tilt_axis_rad, roll_rad=roll_rad)

    better_pose, *other_poses = tag_poses(exact_detection(tag, pose), tag.size_m, INTRINSICS)

    assert [better_pose.error_px <= other.error_px for other in other_poses] in ([True], [])
    assert better_pose.error_px < 0.01
    assert degrees_between(better_pose.camera_from_tag, pose) < 0.1
    assert np.allclose(better_pose.camera_from_tag.translation_m, pose.translation_m, atol=1e-4)


@pytest.mark.parametrize("roll_rad", [0.0, 0.5, 1.0, 2.0, pi])
@pytest.mark.parametrize("distance_m", [0.5, 1.0, 1.125, 1.25])
def test_a_tag_seen_right_from_the_front_is_localised(distance_m: float, roll_rad: float) -> None:
    """In these poses OpenCV's method for squares divides by zero or by nearly zero."""
    tag, pose = lone_tag(20), before_the_camera(distance_m, roll_rad=roll_rad)

    fitted_pose = part_pose([tag], [exact_detection(tag, pose)], INTRINSICS)

    assert fitted_pose is not None
    assert fitted_pose.error_px < 0.01
    assert degrees_between(fitted_pose.camera_from_part, pose) < 0.5


def test_all_tags_of_a_part_are_fitted_together() -> None:
    pose = base_before_the_camera(0.9, 0.4)

    fitted_pose = part_pose(BASE_TAGS, [exact_detection(tag, pose) for tag in BASE_TAGS], INTRINSICS)

    assert fitted_pose is not None
    assert fitted_pose.tag_ids == (20, 21, 22, 23)
    assert fitted_pose.error_px < 1e-3
    assert degrees_between(fitted_pose.camera_from_part, pose) < 0.01
    assert np.allclose(fitted_pose.camera_from_part.translation_m, pose.translation_m, atol=1e-5)


def test_tags_of_other_parts_are_ignored() -> None:
    pose = base_before_the_camera(0.9, 0.4)
    other_detections = [exact_detection(tag, pose) for tag in machine_named("pcr_cycler").tags_on(Part.LID)]

    fitted_pose = part_pose(BASE_TAGS, [*other_detections, exact_detection(BASE_TAGS[1], pose)], INTRINSICS)

    assert fitted_pose is not None
    assert fitted_pose.tag_ids == (21,)
    assert part_pose(BASE_TAGS, other_detections, INTRINSICS) is None


@pytest.mark.parametrize("index", range(4))
def test_a_tag_that_something_covers_in_part_does_not_spoil_the_pose_of_the_others(index: int) -> None:
    pose = base_before_the_camera(0.9, 0.4)
    detections = [exact_detection(tag, pose) for tag in BASE_TAGS]
    detections[index] = spoilt_detection(detections[index], 4.0)

    fitted_pose = part_pose(BASE_TAGS, detections, INTRINSICS)

    assert fitted_pose is not None
    assert fitted_pose.tag_ids == tuple(tag.tag_id for tag in BASE_TAGS if tag is not BASE_TAGS[index])
    assert degrees_between(fitted_pose.camera_from_part, pose) < 0.01


def test_a_lone_tag_that_something_covers_in_part_gives_no_pose() -> None:
    detection = spoilt_detection(exact_detection(BASE_TAGS[0], base_before_the_camera(0.7, 0.4)), 4.0)

    assert tag_poses(detection, BASE_TAGS[0].size_m, INTRINSICS)[0].error_px > GATE_PX
    assert part_pose(BASE_TAGS, [detection], INTRINSICS) is None


def test_without_detections_the_pose_is_none() -> None:
    assert part_pose(BASE_TAGS, [], INTRINSICS) is None


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), distance_m=st.floats(0.5, 1.3), tilt_rad=st.floats(0.1, 1.0))
@example(seed=2423, distance_m=1.25, tilt_rad=0.125)
def test_corners_that_are_a_tenth_of_a_pixel_off_leave_the_pose_of_a_part_within_a_degree(
    seed: int, distance_m: float, tilt_rad: float
) -> None:
    random = np.random.default_rng(seed)
    pose = base_before_the_camera(distance_m, tilt_rad)
    exact_detections = [exact_detection(tag, pose) for tag in BASE_TAGS]
    noisy_detections = [
        Detection(tag_id=detection.tag_id, corners_px=detection.corners_px + random.uniform(-0.1, 0.1, (4, 2)))
        for detection in exact_detections
    ]

    fitted_pose = part_pose(BASE_TAGS, noisy_detections, INTRINSICS)

    assert fitted_pose is not None
    assert degrees_between(fitted_pose.camera_from_part, pose) < 1.0
