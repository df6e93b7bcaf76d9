"""Laboratories: the default is exactly that of the protocol, and other laboratories differ in their settings."""

from __future__ import annotations

import pickle
from dataclasses import replace
from hashlib import sha256
from itertools import pairwise
from math import pi
from random import Random

import numpy as np
import pytest

from codra_dsl.runtime import SimClock
from codra_papers.lab.gaze import observation_gaze
from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.layout import MACHINES, Part, machine_named, shaker, surveyed
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.robot import Robot, RotorPosition
from codra_papers.lab.simulator.camera import FrameSource, GreyFrameSource
from codra_papers.lab.simulator.disturbances import disturb
from codra_papers.lab.simulator.geometric_camera import GeometricCamera
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory, LidMoved, LightDown, Mount, PersonBefore
from codra_papers.lab.simulator.scene import mjcf, textures
from codra_papers.lab.simulator.truth import GroundTruth, truth_at
from codra_papers.lab.simulator.world import JointKey, LabState, LabWorld
from tests.papers.lab.perception.placing import SteadyHand

LID = "pcr_cycler_open"
LID_KEY = JointKey("pcr_cycler", Part.LID)


def digest(*lines: str) -> str:
    return sha256("\n".join(lines).encode()).hexdigest()[:16]


def world_after_work(seed: int) -> tuple[LabWorld, float]:
    """Return a world in which the robot has tended both machines, and the time when the robot had finished."""
    world, clock = LabWorld(seed), SimClock()
    robot = Robot(world, clock, Random(f"{seed} robot"))
    robot.drive_to("centrifuge")
    robot.unlock("centrifuge")
    robot.open_lid("centrifuge")
    robot.turn_rotor(RotorPosition.SECOND)
    robot.take_samples("centrifuge")
    robot.close_lid("centrifuge")
    if not robot.is_localized():
        robot.relocalize()
    robot.drive_to("pcr_cycler")
    robot.look_at("pcr_cycler", Part.LID)
    return world, clock.now_s()


def numbers_text(state: LabState) -> str:
    values = (*state.base, *state.eye_m, *state.target_m, state.reach, state.opening_m, state.light)
    return " ".join(
        f"{number:.6f}" for number in (*values, *(state.joints_rad[key] for key in sorted(state.joints_rad)))
    )


# The digests were computed with older code, in which the laboratory was described by constants of modules.


def test_the_default_scene_is_that_of_the_protocol() -> None:
    assert digest(mjcf()) == "b70fdd27810506a5"
    assert sorted(textures()) == sorted(["floor.png", "wall.png", *(f"tag_{tag_id}.png" for tag_id in TAG_IDS)])


TAG_IDS = [tag.tag_id for machine in MACHINES.values() for tag in machine.tags]


def test_the_default_laboratory_moves_as_that_of_the_protocol() -> None:
    world, end_s = world_after_work(3)
    states = [numbers_text(world.state(end_s * index / 200)) for index in range(201)]

    assert f"{end_s:.6f}" == "570.295602"
    assert digest(*states) == "12ff298c07269d8e"


def test_the_default_laboratory_has_the_same_truth() -> None:
    world, end_s = world_after_work(3)
    spans = [f"{span.start_s:.3f} {sorted(span.values.items())}" for span in GroundTruth(world).over(0.0, end_s)]

    assert digest(*spans) == "390a10b70f64c33e"


def test_the_default_camera_has_the_same_noise() -> None:
    pixels = [GreyFrameSource(LabWorld(3)).frame_at(instant_s).pixels for instant_s in (1.0, 2.5)]

    assert sha256(np.stack(pixels).tobytes()).hexdigest()[:16] == "61942d4f6e8cb77f"


def test_a_laboratory_is_plain_data_that_a_process_can_be_sent() -> None:
    laboratory = replace(
        LABORATORY.with_machines(shaker(5.3, 1.6, pi)), disturbances=(LightDown(at_s=1.0, lasts_s=2.0, light=0.1),)
    )
    received_laboratory = pickle.loads(pickle.dumps(laboratory))

    assert repr(received_laboratory) == repr(laboratory)
    assert " at 0x" not in repr(laboratory)
    assert mjcf(received_laboratory) == mjcf(laboratory) != mjcf()


def test_perception_knows_the_machines_of_the_laboratory_that_its_robot_works_in() -> None:
    with surveyed(LABORATORY.with_tags(0.5).with_machines(shaker(5.3, 1.6, pi)).machines):
        assert machine_named("shaker").tags_on(Part.LATCH)[0].size_m == 0.056
        assert machine_named("centrifuge").tags_on(Part.LID)[0].size_m == 0.05
        with pytest.raises(RuntimeError, match="already works"), surveyed(LABORATORY.machines):
            pass
    with pytest.raises(ValueError, match="its machines are centrifuge, pcr_cycler"):
        machine_named("shaker")


def detected_and_resolved_ids(laboratory: Laboratory, machine: str, part: Part) -> tuple[set[int], set[int]]:
    """Return the tags that are detected when the robot looks at a part, and the tags that are resolved by geometry."""
    world, clock = LabWorld(1, laboratory), SimClock()
    robot = Robot(world, clock, SteadyHand())
    robot.drive_to(machine)
    robot.look_at(machine, part)
    with surveyed(laboratory.machines), FrameSource(world) as frames:
        detected_ids = {detection.tag_id for detection in detect(frames.frame_at(clock.now_s()))}
    views = GeometricCamera(laboratory).tags_in_view(world.state(clock.now_s()))
    return detected_ids, {view.tag_id for view in views if view.is_resolved()}


def test_a_third_machine_of_another_shape_shows_all_its_tags() -> None:
    laboratory = LABORATORY.with_machines(shaker(5.3, 1.6, pi))
    detected_ids, resolved_ids = detected_and_resolved_ids(laboratory, "shaker", Part.LID)

    assert {30, 31, 32, 33, 34, 35} <= detected_ids
    assert resolved_ids <= detected_ids


def test_another_machine_of_the_same_shape_is_another_machine() -> None:
    second_machine = LABORATORY.machine("pcr_cycler").named("second", 40).at_place(5.3, 1.6, pi)
    laboratory = LABORATORY.with_machines(second_machine)
    detected_ids, _ = detected_and_resolved_ids(laboratory, "second", Part.LID)

    assert set(range(40, 48)) <= detected_ids
    assert second_machine.map_from_base.translation_m.tolist() == [5.3, 1.6, 0.72]
    assert truth_at(LabWorld(1, laboratory), 0.0)["second_locked"] is True


def test_small_tags_are_not_detected_from_the_waiting_pose() -> None:
    assert detected_and_resolved_ids(LABORATORY.with_tags(0.25), "pcr_cycler", Part.LID)[0] == set()


def test_a_moved_machine_is_tended_at_its_new_place() -> None:
    laboratory = LABORATORY.with_machine_at("pcr_cycler", 5.3, 1.6, pi)
    detected_ids, _ = detected_and_resolved_ids(laboratory, "pcr_cycler", Part.LID)

    assert set(range(20, 28)) <= detected_ids


def disturbed_world(*disturbances: LidMoved | PersonBefore | LightDown) -> tuple[LabWorld, SimClock]:
    world, clock = LabWorld(1, replace(LABORATORY, disturbances=disturbances)), SimClock()
    disturb(world, clock)
    return world, clock


def test_a_person_opens_a_lid_and_truth_follows() -> None:
    world, clock = disturbed_world(LidMoved(at_s=10.0, machine="pcr_cycler", open_share=1.0))
    clock.sleep(20.0)

    assert [truth_at(world, instant_s)[LID] for instant_s in (9.0, 14.0)] == [False, True]


def test_a_person_does_not_move_a_lid_while_the_robots_hand_is_extended() -> None:
    world, clock = disturbed_world(LidMoved(at_s=110.0, machine="pcr_cycler", open_share=0.5))
    robot = Robot(world, clock, SteadyHand())
    robot.drive_to("pcr_cycler")
    robot.unlock("pcr_cycler")
    end_s = clock.now_s()
    clock.sleep(10.0)

    assert world.state(110.0).reach > 0.0
    assert world.state(end_s).joints_rad[LID_KEY] == 0.0
    assert world.state(end_s + 10.0).joints_rad[LID_KEY] == pytest.approx(1.15 / 2)


def test_the_robot_grips_a_moved_lid_at_its_new_place() -> None:
    world, clock = disturbed_world(LidMoved(at_s=100.0, machine="pcr_cycler", open_share=0.5))
    robot = Robot(world, clock, SteadyHand())
    robot.drive_to("pcr_cycler")
    clock.sleep(99.0 - clock.now_s())
    robot.open_lid("pcr_cycler")  # the latch does not hold an open lid
    angles_rad = [world.state(98.0 + second).joints_rad[LID_KEY] for second in range(200)]

    assert angles_rad[-1] == pytest.approx(1.15)
    assert max(after - before for before, after in pairwise(angles_rad)) < 0.5


def before_and_meanwhile(*disturbances: PersonBefore | LightDown) -> tuple[Frame, Frame, LabWorld]:
    """Return frames of a robot at rest at the PCR-cycler, before a disturbance at 100 s and during the disturbance."""
    world, clock = disturbed_world(*disturbances)
    robot = Robot(world, clock, SteadyHand())
    robot.drive_to("pcr_cycler")
    clock.sleep(200.0)
    with FrameSource(world) as frames:
        return frames.frame_at(95.0), frames.frame_at(110.0), world


def test_a_person_before_the_camera_hides_all_tags_and_goes_away() -> None:
    before, meanwhile, world = before_and_meanwhile(PersonBefore(at_s=100.0, lasts_s=30.0))

    assert len(detect(before)) >= 8
    assert detect(meanwhile) == ()
    assert [truth_at(world, instant_s)["pcr_cycler_base_in_FOV"] for instant_s in (95.0, 110.0, 140.0)] == [
        True,
        False,
        True,
    ]


def test_in_the_dark_no_tag_is_detected_though_all_are_in_view() -> None:
    before, meanwhile, world = before_and_meanwhile(LightDown(at_s=100.0, lasts_s=30.0, light=0.02))

    assert len(detect(before)) >= 8
    assert detect(meanwhile) == ()
    assert truth_at(world, 110.0)["pcr_cycler_base_in_FOV"] is True
    assert world.state(140.0).light == 1.0


# The camera on the mast


def test_the_camera_on_the_mast_looks_at_the_machine_that_the_robot_tends_whatever_the_arm_does() -> None:
    world, clock = LabWorld(1, replace(LABORATORY, camera=Mount.PAN_TILT)), SimClock()
    robot = Robot(world, clock, SteadyHand(1))
    robot.drive_to("pcr_cycler")
    arrived = world.state(clock.now_s())
    robot.unlock("pcr_cycler")
    unlocked = world.state(clock.now_s() - 40.0)
    middle_m = machine_named("pcr_cycler").map_from_base.apply(np.array(observation_gaze("pcr_cycler", Part.LID)[3:]))
    middle_in_camera_m = arrived.map_from_camera().inverse().apply(middle_m)

    assert np.hypot(*middle_in_camera_m[:2]) < 0.01
    assert middle_in_camera_m[2] > 0.5
    assert arrived.eye_m != unlocked.eye_m
    assert arrived.map_from_camera().translation_m == pytest.approx(unlocked.map_from_camera().translation_m)
    assert arrived.map_from_camera().rotation == pytest.approx(unlocked.map_from_camera().rotation)


def test_both_cameras_show_the_same_world_and_only_the_one_on_the_mast_sees_the_arm() -> None:
    world, clock = LabWorld(1, replace(LABORATORY, camera=Mount.PAN_TILT)), SimClock()
    Robot(world, clock, SteadyHand(1)).drive_to("centrifuge")
    mast_state, wrist_state = (seen.state(clock.now_s()) for seen in (world, world.seen_by(Mount.WRIST)))

    assert replace(wrist_state, laboratory=mast_state.laboratory) == mast_state
    assert wrist_state.map_from_camera().translation_m == pytest.approx(
        (wrist_state.map_from_robot() @ wrist_state.robot_from_hand()).translation_m
    )
    hand_in_mast_camera_m = (mast_state.robot_from_camera().inverse() @ mast_state.robot_from_hand()).translation_m
    assert hand_in_mast_camera_m[2] > 0.2
