"""Detected tags, and their corners compared with the exactly known corners of painted pictures."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from math import pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_papers.lab.perception.layout import MACHINES
from codra_papers.lab.perception.tags import FAMILY_SIZE, detect, tag_image
from tests.papers.lab.perception.painted import (
    INTRINSICS,
    before_the_camera,
    cluttered_wall,
    frame_of,
    lone_tag,
    painted,
)

TAG_IDS = sorted(tag.tag_id for machine in MACHINES.values() for tag in machine.tags)
NOT_IN_THE_LABORATORY = 100


def chance(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


# Pictures of tags


def test_a_tag_has_a_white_border_around_a_black_one() -> None:
    picture = tag_image(17)

    assert picture.shape == (10, 10)
    assert picture.dtype == np.uint8
    assert (np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]]) == 255).all()
    inner_cells = picture[1:-1, 1:-1]
    assert (np.concatenate([inner_cells[0], inner_cells[-1], inner_cells[:, 0], inner_cells[:, -1]]) == 0).all()


def test_no_two_tags_of_the_laboratory_look_alike_however_they_are_turned() -> None:
    """The family promises that codes differ in 11 of 36 cells."""
    for one_id in TAG_IDS:
        for other_id in TAG_IDS:
            for turns in range(4):
                if (one_id, 0) != (other_id, turns):
                    assert np.count_nonzero(tag_image(one_id) != np.rot90(tag_image(other_id), turns)) >= 11


@pytest.mark.parametrize("tag_id", [-1, FAMILY_SIZE])
def test_a_tag_outside_the_family_is_refused_by_name(tag_id: int) -> None:
    with pytest.raises(ValueError, match=f"tag {tag_id} is not in the family 36h11, whose ids run from 0 to 586"):
        tag_image(tag_id)


# Detected tags


def test_all_tags_of_the_laboratory_are_detected_by_their_numbers() -> None:
    for tag_id in TAG_IDS:
        frame = frame_of(painted([(lone_tag(tag_id), before_the_camera(1.0))], random=chance(tag_id)))

        assert [detection.tag_id for detection in detect(frame)] == [tag_id]


def test_a_tag_of_the_family_outside_the_laboratory_is_not_detected() -> None:
    frame = frame_of(painted([(lone_tag(NOT_IN_THE_LABORATORY), before_the_camera(0.6))], random=chance()))

    assert detect(frame) == ()


def test_a_tag_detected_in_two_places_is_dropped() -> None:
    half_image = painted([(lone_tag(20), before_the_camera(1.0))], random=chance())[:, 160:480]

    assert detect(frame_of(np.hstack([half_image, half_image]))) == ()


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_no_tag_is_detected_on_an_empty_frame(grey: int) -> None:
    assert detect(frame_of(np.full((480, 640), grey, dtype=np.uint8))) == ()


def test_no_tag_is_detected_on_walls_without_tags() -> None:
    for seed in range(30):
        wall = cluttered_wall(chance(seed), contrast=60.0)

        assert detect(frame_of(painted([], random=chance(seed), background=wall))) == ()


# Corners


@settings(max_examples=40)
@given(
    tag_id=st.sampled_from(TAG_IDS),
    distance_m=st.floats(0.35, 1.4),
    tilt_rad=st.floats(0.0, radians(60)),
    tilt_axis_rad=st.floats(-pi, pi),
    roll_rad=st.floats(-pi, pi),
)
def test_corners_are_exact_to_a_third_of_a_pixel_in_the_order_of_the_tag(
    tag_id: int, distance_m: float, tilt_rad: float, tilt_axis_rad: float, roll_rad: float
) -> None:
    tag = lone_tag(tag_id)
    pose = before_the_camera(distance_m, tilt_rad=tilt_rad, tilt_axis_rad=tilt_axis_rad, roll_rad=roll_rad)
    (detection,) = detect(frame_of(painted([(tag, pose)], random=chance(tag_id))))

    offsets_px = detection.corners_px - INTRINSICS.project(pose.apply(tag.corners_m()))

    assert np.abs(offsets_px).max() < 1 / 3


def test_corners_are_pulled_neither_inwards_nor_outwards() -> None:
    """OpenCV's own refinement moves the corners of a single square inwards, by which far tags are centimetres off."""
    pulls_px = []
    for tag_id in TAG_IDS:
        tag, pose = lone_tag(tag_id), before_the_camera(1.0, tilt_rad=0.3, tilt_axis_rad=float(tag_id))
        corners_px = INTRINSICS.project(pose.apply(tag.corners_m()))
        (detection,) = detect(frame_of(painted([(tag, pose)], random=chance(tag_id))))
        outwards = (corners_px - corners_px.mean(axis=0)) / np.linalg.norm(
            corners_px - corners_px.mean(axis=0), axis=1, keepdims=True
        )
        pulls_px.append(((detection.corners_px - corners_px) * outwards).sum(axis=1).mean())

    assert abs(np.mean(pulls_px)) < 0.01


# Once per frame


def test_many_threads_that_ask_about_one_frame_share_one_search() -> None:
    frame = frame_of(painted([(lone_tag(20), before_the_camera(1.0))], random=chance()))

    with ThreadPoolExecutor(max_workers=8) as askers:
        answers = list(askers.map(detect, [frame] * 16))

    assert {id(answer) for answer in answers} == {id(answers[0])}


def test_old_frames_are_dropped_from_the_cache() -> None:
    """The cache is bounded: after many other frames the first is searched again, with the same result."""
    frames = [
        frame_of(painted([(lone_tag(20), before_the_camera(0.8 + step / 50))], random=chance())) for step in range(12)
    ]
    first = detect(frames[0])
    for frame in frames:
        detect(frame)
    again = detect(frames[0])

    assert again is not first
    assert np.array_equal(again[0].corners_px, first[0].corners_px)
