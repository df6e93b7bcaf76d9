"""The laboratory over time: only scheduled moves determine its state."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_papers.lab.perception.layout import MACHINES, Part
from codra_papers.lab.simulator.world import HOME, JointKey, LabState, LabWorld, Move, Quantity, straight_path

LID = JointKey("centrifuge", Part.LID)


def lid_rad(world: LabWorld, t_s: float) -> float:
    return world.state(t_s).joints_rad[LID]


def opening(world: LabWorld, start_s: float, duration_s: float, to_rad: float = 1.35) -> Move:
    return world.moves_to(start_s, LID, (to_rad,), duration_s)


def test_the_day_begins_with_closed_locked_machines_and_the_robot_at_home() -> None:
    state = LabWorld(1).state(0.0)

    assert set(state.joints_rad.values()) == {0.0}
    assert set(state.joints_rad) == {
        JointKey(machine.name, joint.part) for machine in MACHINES.values() for joint in machine.joints
    }
    assert state.base == HOME
    assert (state.is_localized, state.is_holding, state.light) == (True, False, 1.0)


@given(start_s=st.floats(0, 1e4), duration_s=st.floats(0.1, 100), shares=st.lists(st.floats(0, 1), min_size=2))
def test_a_move_goes_from_here_to_there_without_turning_back(
    start_s: float, duration_s: float, shares: list[float]
) -> None:
    world = LabWorld(1)
    world.schedule(start_s, [opening(world, start_s, duration_s)])

    angles = [lid_rad(world, start_s + share * duration_s) for share in sorted(shares)]

    assert angles == sorted(angles)
    assert all(0.0 <= angle <= 1.35 for angle in angles)
    assert lid_rad(world, start_s) == 0.0
    assert lid_rad(world, start_s + duration_s) == pytest.approx(1.35, abs=1e-9)


def test_a_move_begins_and_ends_at_rest() -> None:
    world = LabWorld(1)
    world.schedule(10.0, [opening(world, 10.0, 4.0)])

    for end_s, inside_s in ((10.0, 10.01), (14.0, 13.99)):
        assert abs(lid_rad(world, inside_s) - lid_rad(world, end_s)) / 0.01 < 0.001
    assert (lid_rad(world, 12.01) - lid_rad(world, 11.99)) / 0.02 == pytest.approx(1.875 * 1.35 / 4.0, rel=1e-3)


def test_a_scheduled_move_does_not_change_earlier_states() -> None:
    world = LabWorld(1)
    world.schedule(0.0, [opening(world, 0.0, 5.0)])
    instants = np.linspace(0.0, 8.0, 50).tolist()
    before = [world.state(t_s) for t_s in instants]

    world.schedule(8.0, [world.moves_to(8.0, LID, (0.0,), 0.0), world.moves_to(8.0, Quantity.LIGHT, (0.2,), 3.0)])

    assert [world.state(t_s) for t_s in instants] == before


def test_a_jump_shows_right_after_its_instant() -> None:
    world = LabWorld(1)
    world.schedule(5.0, [world.moves_to(5.0, Quantity.HOLDING, (1.0,), 0.0)])

    assert not world.state(5.0).is_holding
    assert world.state(5.000001).is_holding


def test_reading_does_not_change_the_state() -> None:
    watched_world, unwatched_world = LabWorld(7), LabWorld(7)
    for world in (watched_world, unwatched_world):
        for step in range(5):
            start_s = 10.0 * step
            world.schedule(start_s, [opening(world, start_s, 8.0, to_rad=0.2 * step)])
            if world is watched_world:
                for t_s in np.linspace(0.0, start_s + 20.0, 40).tolist():
                    world.state(t_s)
                    world.believed_map_from_robot(t_s)

    assert [watched_world.state(t_s) for t_s in range(60)] == [unwatched_world.state(t_s) for t_s in range(60)]


def test_a_move_can_begin_later() -> None:
    world = LabWorld(1)
    world.schedule(1.0, [world.moves_to(1.0, LID, (1.0,), 2.0, delay_s=3.0)])

    assert (lid_rad(world, 4.0), lid_rad(world, 6.0)) == (0.0, 1.0)


def test_a_move_can_follow_any_path() -> None:
    world = LabWorld(1)
    world.schedule(0.0, [Move(channel=LID, path=lambda progress: (progress * (1.0 - progress),), duration_s=2.0)])

    assert [round(lid_rad(world, t_s), 9) for t_s in (0.0, 1.0, 2.0)] == [0.0, 0.25, 0.0]


def test_moves_in_the_past_are_refused() -> None:
    world = LabWorld(1)
    world.schedule(10.0, [opening(world, 10.0, 1.0)])

    with pytest.raises(ValueError, match="moves at 10 s are already scheduled"):
        world.schedule(9.0, [world.moves_to(9.0, Quantity.LIGHT, (0.0,), 1.0)])
    with pytest.raises(ValueError, match="negative delay"):
        world.schedule(20.0, [Move(channel=LID, path=straight_path((1.35,), (0.0,)), duration_s=1.0, delay_s=-5.0)])


def test_a_move_of_a_moving_part_is_refused_with_all_other_moves_of_the_call() -> None:
    world = LabWorld(1)
    world.schedule(0.0, [opening(world, 0.0, 10.0)])
    state_before: LabState = world.state(20.0)

    with pytest.raises(ValueError, match="still moving at 5 s"):
        world.schedule(5.0, [world.moves_to(5.0, Quantity.LIGHT, (0.0,), 1.0), opening(world, 5.0, 1.0, to_rad=0.0)])

    assert world.state(20.0).joints_rad == state_before.joints_rad
    assert world.state(20.0).light == 1.0


def test_moves_of_one_part_can_be_scheduled_one_after_the_other() -> None:
    world = LabWorld(1)
    move_there = Move(channel=LID, path=straight_path((0.0,), (1.0,)), duration_s=2.0)
    move_back = Move(channel=LID, path=straight_path((1.0,), (0.0,)), duration_s=2.0, delay_s=2.0)
    world.schedule(0.0, [move_there, move_back])

    assert [lid_rad(world, t_s) for t_s in (0.0, 2.0, 4.0)] == [0.0, 1.0, 0.0]
    with pytest.raises(ValueError, match="still moving"):
        world.schedule(9.0, [move_there, move_there])


def test_the_world_knows_when_something_moves() -> None:
    world = LabWorld(1)
    world.schedule(1.0, [opening(world, 1.0, 2.0), world.moves_to(1.0, Quantity.LIGHT, (0.5,), 4.0, delay_s=1.0)])
    world.schedule(8.0, [world.moves_to(8.0, Quantity.HOLDING, (1.0,), 0.0)])

    assert world.moving_spans() == ((1.0, 6.0), (8.0, 8.0))
    assert world.moves_within(0.0, 1.5)
    assert world.moves_within(5.9, 7.0)
    assert not world.moves_within(6.1, 8.0)
    assert world.moves_within(7.9, 8.1)
    assert not world.moves_within(8.1, 90.0)


@given(seed=st.integers(0, 500), t_s=st.floats(0, 1e5))
def test_the_believed_pose_is_a_few_centimetres_off_and_more_while_lost(seed: int, t_s: float) -> None:
    world = LabWorld(seed)
    true_pose = world.state(t_s).map_from_robot()
    believed_pose = world.believed_map_from_robot(t_s)
    world.schedule(t_s, [world.moves_to(t_s, Quantity.LOCALIZED, (0.0,), 0.0)])
    believed_pose_when_lost = world.believed_map_from_robot(t_s + 0.001)

    off_m = [
        hypot(*(pose.translation_m - true_pose.translation_m)[:2]) for pose in (believed_pose, believed_pose_when_lost)
    ]

    assert 0.0 < off_m[0] < 0.04
    assert 0.38 < off_m[1] < 0.52


def test_belief_drifts_slowly_and_differs_from_seed_to_seed() -> None:
    world, other = LabWorld(1), LabWorld(2)
    places = np.array([world.believed_map_from_robot(t_s).translation_m for t_s in range(600)])
    steps_m = np.linalg.norm(np.diff(places, axis=0), axis=1)

    assert steps_m.max() < 0.003
    assert np.ptp(places, axis=0).max() > 0.01
    assert not np.allclose(places[0], other.believed_map_from_robot(0.0).translation_m, atol=1e-4)
