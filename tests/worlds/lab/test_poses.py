"""Turns, and cameras that look at things."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.worlds.lab.poses import looking_at, rotation_about

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
    both = rotation_about(axis, first_rad) @ rotation_about(axis, second_rad)

    assert np.allclose(both, rotation_about(axis, first_rad + second_rad))
    assert np.allclose(both @ np.array(axis), axis)
