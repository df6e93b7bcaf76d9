"""Rigid motions, compared with scipy's rotations and numpy's matrices."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation, Slerp

from codra_dsl.runtime.geometry import IDENTITY, Pose

lengths = some.floats(-100.0, 100.0)
vectors = some.tuples(lengths, lengths, lengths)
parts = some.floats(-1.0, 1.0)
quaternions = some.tuples(parts, parts, parts, parts).filter(lambda numbers: math.hypot(*numbers) > 0.01)
poses = some.builds(Pose.of, vectors, quaternions)


def matrix(pose: Pose) -> Any:
    return np.array(pose.matrix())


def scipys(pose: Pose) -> Rotation:
    w, x, y, z = pose.rotation
    return Rotation.from_quat([x, y, z, w])


def near(a: Any, b: Any) -> None:
    np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


@given(pose=poses)
def test_the_matrix_of_a_pose_has_its_rotation_and_translation(pose: Pose) -> None:
    near(matrix(pose)[:3, :3], scipys(pose).as_matrix())
    near(matrix(pose)[:3, 3], pose.translation_m)
    near(matrix(Pose.from_matrix(pose.matrix())), matrix(pose))


@given(outer=poses, inner=poses, point=vectors)
def test_poses_chain_as_matrices_do(outer: Pose, inner: Pose, point: tuple[float, float, float]) -> None:
    near(matrix(outer @ inner), matrix(outer) @ matrix(inner))
    near(outer.apply(point), (matrix(outer) @ (*point, 1.0))[:3])


@given(pose=poses)
def test_a_pose_and_its_inverse_cancel_out(pose: Pose) -> None:
    near(matrix(pose.inverse() @ pose), np.eye(4))
    near(matrix(pose @ pose.inverse()), np.eye(4))


@given(a=poses, b=poses, share=some.floats(0.0, 1.0))
def test_interpolated_rotations_follow_the_geodesic(a: Pose, b: Pose, share: float) -> None:
    between = a.towards(b, share)
    turn = scipys(a).inv() * scipys(b)
    if turn.magnitude() > math.pi - 1e-6:
        return  # there are two shortest turns
    near(
        scipys(between).as_matrix(), Slerp([0.0, 1.0], Rotation.concatenate([scipys(a), scipys(b)]))(share).as_matrix()
    )
    near(between.translation_m, (1 - share) * np.array(a.translation_m) + share * np.array(b.translation_m))


@given(a=poses, b=poses)
def test_the_angle_between_two_poses_is_that_of_their_relative_rotation(a: Pose, b: Pose) -> None:
    assert a.angle_rad(b) == pytest.approx((scipys(a).inv() * scipys(b)).magnitude(), abs=1e-6)
    assert a.distance_m(b) == pytest.approx(np.linalg.norm(np.subtract(a.translation_m, b.translation_m)))


@given(axis=vectors.filter(lambda axis: math.hypot(*axis) > 0.01), angle_rad=some.floats(-3.0, 3.0))
def test_a_rotation_about_an_axis_follows_the_right_hand_rule(
    axis: tuple[float, float, float], angle_rad: float
) -> None:
    expected = Rotation.from_rotvec(np.array(axis) / np.linalg.norm(axis) * angle_rad)
    near(scipys(Pose.about(axis, angle_rad)).as_matrix(), expected.as_matrix())


@given(a=poses, rate=some.floats(-0.5, 0.5), share=some.floats(1.0, 3.0))
def test_beyond_the_second_pose_the_motion_is_extrapolated_at_its_rate(a: Pose, rate: float, share: float) -> None:
    turn = Pose.about((0.0, 0.0, 1.0), rate, (0.1, 0.0, 0.0))
    b = Pose(tuple(np.add(a.translation_m, (0.1, 0.2, 0.3))), (turn @ a).rotation)  # type: ignore[arg-type]
    beyond = a.towards(b, share)
    near(scipys(beyond).as_matrix(), (Rotation.from_rotvec([0.0, 0.0, rate * share]) * scipys(a)).as_matrix())
    near(beyond.translation_m, np.add(a.translation_m, share * np.array((0.1, 0.2, 0.3))))


WRONG = {
    "a translation has 3 finite numbers": lambda: Pose.of((1.0, 2.0)),
    "a quaternion has 4 finite numbers": lambda: Pose.of((0, 0, 0), (1.0, 0.0, 0.0, math.nan)),
    "a rotation needs a quaternion that is not zero": lambda: Pose.of((0, 0, 0), (0.0, 0.0, 0.0, 0.0)),
    "an axis needs a direction": lambda: Pose.about((0.0, 0.0, 0.0), 1.0),
    "a rigid motion is a 4 x 4 matrix": lambda: Pose.from_matrix(2 * np.eye(4)),
    "a rigid motion is a 4 x 4 matrix: a rotation": lambda: Pose.from_matrix(np.diag([1.0, 1.0, -1.0, 1.0])),
    "a rigid motion is a 4 x 4": lambda: Pose.from_matrix(np.eye(4)[:3]),
}


@pytest.mark.parametrize("message", WRONG)
def test_numbers_that_are_not_a_rigid_motion_are_refused(message: str) -> None:
    with pytest.raises(ValueError, match=message):
        WRONG[message]()


def test_the_identity_moves_nothing() -> None:
    assert IDENTITY.apply((1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)
    assert IDENTITY @ IDENTITY == IDENTITY
