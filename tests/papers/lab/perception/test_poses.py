"""Rotations, and the poses of cameras that look at a point."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from codra_papers.lab.perception.poses import Pose, columns, cross, length, looking_at, planar, rotation_about

PLACES_M = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)


@given(eye_m=PLACES_M, ahead_m=st.tuples(st.floats(0.1, 5.0), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)).map(np.array))
def test_a_camera_looks_at_its_target_with_the_horizon_level(eye_m: np.ndarray, ahead_m: np.ndarray) -> None:
    pose = looking_at(eye_m, eye_m + ahead_m)
    right, down, forward = pose.rotation.T

    assert np.allclose(np.cross(forward, ahead_m), 0.0, atol=1e-9)
    assert forward @ ahead_m > 0.0
    assert abs(right[2]) < 1e-12
    assert np.allclose(np.cross(right, down), forward)
    assert down[2] <= 0.0


@given(
    axis=st.tuples(st.floats(0.1, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    first_rad=st.floats(-4.0, 4.0),
    second_rad=st.floats(-4.0, 4.0),
)
def test_turns_about_one_axis_add_up(axis: tuple[float, float, float], first_rad: float, second_rad: float) -> None:
    both_turns = rotation_about(axis, first_rad) @ rotation_about(axis, second_rad)

    assert np.allclose(both_turns, rotation_about(axis, first_rad + second_rad))
    assert np.allclose(both_turns @ np.array(axis), axis)


@given(st.floats(-10.0, 10.0))
def test_a_planar_pose_equals_a_turn_about_the_vertical_axis_exactly(heading_rad: float) -> None:
    turn = rotation_about((0.0, 0.0, 1.0), heading_rad)

    assert Pose.planar(1.0, 2.0, heading_rad).rotation.tobytes() == turn.tobytes()
    assert planar(1.0, 2.0, heading_rad).rotation.tobytes() == turn.tobytes()


@given(PLACES_M, PLACES_M)
def test_fast_vector_functions_give_exactly_the_numbers_of_numpy(left: np.ndarray, right: np.ndarray) -> None:
    assert cross(left, right).tobytes() == np.cross(left, right).tobytes()
    assert columns(left, right, left).tobytes() == np.column_stack((left, right, left)).tobytes()
    assert length(left) == float(np.linalg.norm(left))
