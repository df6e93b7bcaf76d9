"""The robot's actions: their effects on the world, their durations, and their independence from observers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from random import Random
from statistics import fmean

import numpy as np
import pytest

from codra_dsl.runtime.clock import SimClock
from codra_papers.lab.gaze import observation_gaze
from codra_papers.lab.perception.functions import LOCALIZE_LID_S
from codra_papers.lab.perception.layout import MACHINES, Part
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.robot import SLIP_SHARE, LostError, OutOfReachError, Robot, RotorPosition, Station
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource
from codra_papers.lab.simulator.durations import DURATIONS, Phase, Spread
from codra_papers.lab.simulator.geometric_camera import GeometricCamera
from codra_papers.lab.simulator.scene import ARM_LENGTH_M, shoulder_to_wrist_m
from codra_papers.lab.simulator.truth import GroundTruth, truth_at
from codra_papers.lab.simulator.world import HOME, JointKey, LabWorld, Quantity
from tests.papers.lab.perception.placing import SteadyHand, put, set_joint

CENTRIFUGE, PCR_CYCLER = "centrifuge", "pcr_cycler"
LOOK_TAKES_S = LOCALIZE_LID_S
"""The duration of perception after the camera is at rest."""


class UnluckyHand(SteadyHand):
    """Random numbers with which every part slips, and every drive loses the localisation."""

    def random(self) -> float:
        return 0.0


@dataclass
class Lab:
    world: LabWorld
    clock: SimClock
    robot: Robot

    def truth(self, variable: str) -> bool:
        return truth_at(self.world, self.clock.now_s())[variable]

    def angle_rad(self, machine: str, part: Part) -> float:
        return self.world.state(self.clock.now_s()).joints_rad[JointKey(machine, part)]

    def seconds_of(self, action: Callable[[], None]) -> float:
        start_s = self.clock.now_s()
        action()
        return self.clock.now_s() - start_s


def lab(random: Random | None = None, seed: int = 1) -> Lab:
    world, clock = LabWorld(seed), SimClock()
    return Lab(world, clock, Robot(world, clock, random or SteadyHand(1)))


def lab_at(machine: str, random: Random | None = None, seed: int = 1) -> Lab:
    """Return a laboratory whose robot has just arrived in front of a machine."""
    lab_of_robot = lab(random, seed)
    lab_of_robot.robot.drive_to(Station(machine))
    put(lab_of_robot.world, Quantity.LOCALIZED, 1.0, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.clock.sleep(1.0)
    return lab_of_robot


# Driving


@pytest.mark.parametrize("machine", MACHINES)
def test_the_robot_arrives_within_reach_of_the_machine_facing_it(machine: str) -> None:
    lab_of_robot = lab_at(machine)
    state = lab_of_robot.world.state(lab_of_robot.clock.now_s())
    to_machine_m = MACHINES[machine].map_from_base.translation_m - state.map_from_robot().translation_m
    forward = state.map_from_robot().rotation[:, 0]

    assert lab_of_robot.truth(f"{machine}_in_manipulation_distance")
    assert forward @ to_machine_m / np.linalg.norm(to_machine_m[:2]) > 0.99
    assert MACHINES[machine].distance_m(state.map_from_robot()) == pytest.approx(0.85, abs=0.05)


def test_a_drive_between_the_machines_takes_tens_of_seconds() -> None:
    lab_of_robot = lab_at(CENTRIFUGE)

    assert 20 < lab_of_robot.seconds_of(lambda: lab_of_robot.robot.drive_to(Station.PCR_CYCLER)) < 60


def test_the_robot_drives_round_the_table_in_the_middle_of_the_room() -> None:
    lab_of_robot = lab_at(CENTRIFUGE)
    start_s = lab_of_robot.clock.now_s()
    lab_of_robot.robot.drive_to(Station.PCR_CYCLER)
    x_m, y_m, _ = MACHINES[PCR_CYCLER].map_from_base.translation_m
    for t_s in np.arange(start_s, lab_of_robot.clock.now_s(), 0.25):
        base_x_m, base_y_m, _ = lab_of_robot.world.state(t_s).base
        assert abs(base_x_m - x_m) > 0.6 + 0.3 or abs(base_y_m - y_m) > 0.35 + 0.3


def test_the_large_machine_is_in_the_background_where_the_compact_one_is_looked_at() -> None:
    """A detector detects tags far beyond the distance at which they give reliable measurements, but they are small."""
    lab_of_robot = lab_at(PCR_CYCLER)
    lab_of_robot.robot.look_at(PCR_CYCLER, Part.LID)
    with FrameSource(lab_of_robot.world) as source:
        seen = {detection.tag_id for detection in detect(source.frame_at(lab_of_robot.clock.now_s()))}

    assert seen & {tag.tag_id for tag in MACHINES[CENTRIFUGE].tags}
    assert not lab_of_robot.truth("centrifuge_in_observable_distance")


def test_the_robot_drives_home() -> None:
    lab_of_robot = lab_at(CENTRIFUGE)
    lab_of_robot.robot.drive_to(Station.HOME)

    x_m, y_m, heading_rad = lab_of_robot.world.state(lab_of_robot.clock.now_s()).base
    assert (x_m, y_m) == pytest.approx(HOME[:2], abs=0.05)
    assert heading_rad % (2 * pi) == pytest.approx(HOME[2], abs=0.05)


def test_the_robot_turns_the_short_way() -> None:
    lab_of_robot = lab()
    lab_of_robot.robot.drive_to(Station.PCR_CYCLER)
    headings = [lab_of_robot.world.state(float(t_s)).base[2] for t_s in range(int(lab_of_robot.clock.now_s()))]

    assert max(headings) - min(headings) < pi / 2


def test_a_robot_that_lost_its_way_relocalizes_before_it_drives_on() -> None:
    unlucky_lab = lab(UnluckyHand(1))
    unlucky_lab.robot.drive_to(Station.CENTRIFUGE)

    assert not unlucky_lab.robot.is_localized()
    with pytest.raises(LostError, match="relocalize"):
        unlucky_lab.robot.drive_to(Station.HOME)
    unlucky_lab.robot.relocalize()
    unlucky_lab.clock.sleep(0.1)
    assert unlucky_lab.robot.is_localized()
    unlucky_lab.robot.drive_to(Station.HOME)


def test_the_robot_returns_its_believed_pose() -> None:
    lab_of_robot = lab_at(CENTRIFUGE)
    believed_pose = lab_of_robot.robot.believed_map_from_base()

    assert MACHINES[CENTRIFUGE].distance_m(believed_pose) == pytest.approx(0.85, abs=0.03)


# Looking


def looks() -> list[tuple[str, Part]]:
    return [(CENTRIFUGE, Part.LID), (CENTRIFUGE, Part.LATCH), (CENTRIFUGE, Part.ROTOR), (PCR_CYCLER, Part.LID)]


@pytest.mark.parametrize(("machine", "part"), looks())
def test_a_look_shows_the_part_and_most_of_the_base(machine: str, part: Part) -> None:
    lab_of_robot = lab_at(machine, Random(3))
    set_joint(lab_of_robot.world, machine, Part.LID, 1.35, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.robot.look_at(machine, part)

    views = GeometricCamera().tags_in_view(lab_of_robot.world.state(lab_of_robot.clock.now_s()))
    resolved_ids = {view.tag_id for view in views if view.is_resolved()}

    assert resolved_ids >= {tag.tag_id for tag in MACHINES[machine].tags_on(part)}
    assert lab_of_robot.truth(f"{machine}_base_in_FOV")


def test_a_look_takes_as_long_as_in_the_paper_and_ends_at_rest() -> None:
    """P1, section 4.2: observers saved 15.8 and 16.9 s of each perception task, which is 87 and 89 %."""
    lab_of_robot = lab_at(PCR_CYCLER)
    took_s = [lab_of_robot.seconds_of(lambda: lab_of_robot.robot.look_at(PCR_CYCLER, Part.LID)) for _ in range(60)]

    assert 18.0 < fmean(took_s) + LOOK_TAKES_S < 19.0
    assert not lab_of_robot.world.moves_within(lab_of_robot.clock.now_s() - 1.0, lab_of_robot.clock.now_s() + 1.0)


@pytest.mark.parametrize(("is_localized", "low_m", "high_m"), [(1.0, 0.0, 0.06), (0.0, 0.3, 0.9)])
def test_the_robot_looks_from_its_believed_position(is_localized: float, low_m: float, high_m: float) -> None:
    lab_of_robot = lab_at(CENTRIFUGE)
    put(lab_of_robot.world, Quantity.LOCALIZED, is_localized, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.clock.sleep(1.0)
    lab_of_robot.robot.look_at(CENTRIFUGE, Part.LID)
    camera_m = lab_of_robot.world.state(lab_of_robot.clock.now_s()).map_from_camera().translation_m
    wanted_m = MACHINES[CENTRIFUGE].map_from_base.apply(np.array(observation_gaze(CENTRIFUGE, Part.LID)[:3]))

    assert low_m <= float(np.linalg.norm(camera_m - wanted_m)) < high_m


# Manipulating


@pytest.mark.parametrize("machine", MACHINES)
def test_a_machine_is_unlocked_opened_closed_and_locked(machine: str) -> None:
    lab_of_robot = lab_at(machine)
    locked_and_open = []
    for action in (
        lab_of_robot.robot.unlock,
        lab_of_robot.robot.open_lid,
        lab_of_robot.robot.close_lid,
        lab_of_robot.robot.lock,
    ):
        action(machine)
        locked_and_open.append((lab_of_robot.truth(f"{machine}_locked"), lab_of_robot.truth(f"{machine}_open")))

    assert locked_and_open == [(False, False), (False, True), (False, False), (True, False)]


def test_a_locked_lid_does_not_follow_the_hand() -> None:
    lab_of_robot = lab_at(PCR_CYCLER)
    lab_of_robot.robot.open_lid(PCR_CYCLER)

    assert lab_of_robot.angle_rad(PCR_CYCLER, Part.LID) == 0.0


@pytest.mark.parametrize("part", [Part.LATCH, Part.LID])
def test_a_part_that_slips_stops_on_its_way(part: Part) -> None:
    lab_of_robot = lab_at(PCR_CYCLER, UnluckyHand(1))
    if part is Part.LID:
        set_joint(lab_of_robot.world, PCR_CYCLER, Part.LATCH, 1.0, at_s=lab_of_robot.clock.now_s())
        lab_of_robot.clock.sleep(0.1)
        lab_of_robot.robot.open_lid(PCR_CYCLER)
    else:
        lab_of_robot.robot.unlock(PCR_CYCLER)

    _, end_rad = MACHINES[PCR_CYCLER].joint(part).range_rad
    assert lab_of_robot.angle_rad(PCR_CYCLER, part) == pytest.approx(SLIP_SHARE * end_rad)
    assert lab_of_robot.truth("pcr_cycler_open") is False


def test_the_rotor_turns_under_an_open_lid_only() -> None:
    lab_of_robot = lab_at(CENTRIFUGE)
    lab_of_robot.robot.turn_rotor(RotorPosition.SECOND)
    assert lab_of_robot.truth("centrifuge_rotor_in_pos_1")

    set_joint(lab_of_robot.world, CENTRIFUGE, Part.LID, 1.35, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.robot.turn_rotor(RotorPosition.SECOND)
    assert lab_of_robot.truth("centrifuge_rotor_in_pos_2")


def test_samples_go_in_and_out_through_an_open_lid_only() -> None:
    lab_of_robot = lab_at(PCR_CYCLER)
    lab_of_robot.robot.take_samples(PCR_CYCLER)
    assert not lab_of_robot.robot.is_carrying

    set_joint(lab_of_robot.world, PCR_CYCLER, Part.LID, 1.35, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.robot.take_samples(PCR_CYCLER)
    assert lab_of_robot.robot.is_carrying

    set_joint(lab_of_robot.world, PCR_CYCLER, Part.LID, 0.0, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.robot.bring_samples(PCR_CYCLER)
    assert lab_of_robot.robot.is_carrying

    set_joint(lab_of_robot.world, PCR_CYCLER, Part.LID, 1.35, at_s=lab_of_robot.clock.now_s())
    lab_of_robot.robot.bring_samples(PCR_CYCLER)
    assert not lab_of_robot.robot.is_carrying
    with pytest.raises(RuntimeError, match="no sample tray"):
        lab_of_robot.robot.bring_samples(PCR_CYCLER)


def test_the_tray_is_in_the_hand_only_between_machine_and_deck() -> None:
    lab_of_robot = lab_at(PCR_CYCLER)
    set_joint(lab_of_robot.world, PCR_CYCLER, Part.LID, 1.35, at_s=lab_of_robot.clock.now_s())
    start_s = lab_of_robot.clock.now_s()
    lab_of_robot.robot.take_samples(PCR_CYCLER)
    holding_samples = [
        lab_of_robot.world.state(t_s).is_holding for t_s in np.arange(start_s, lab_of_robot.clock.now_s(), 0.5)
    ]

    assert (holding_samples[0], holding_samples[-1]) == (False, False)
    assert 10 < sum(holding_samples) * 0.5 < 40


def test_a_machine_out_of_reach_is_neither_touched_nor_looked_at() -> None:
    lab_of_robot = lab_at(CENTRIFUGE)
    robot = lab_of_robot.robot

    for action in (robot.unlock, robot.lock, robot.open_lid, robot.close_lid, robot.take_samples):
        with pytest.raises(OutOfReachError, match=r"m from the pcr_cycler, and its arm reaches 0\.95 m"):
            action(PCR_CYCLER)
    with pytest.raises(OutOfReachError):
        robot.look_at(PCR_CYCLER, Part.LID)
    with pytest.raises(ValueError, match="no machine 'fridge'"):
        robot.unlock("fridge")


def test_opening_the_large_machine_leaves_hardly_a_complete_tag_in_view() -> None:
    """P1, section 4.1: too few markers are visible, because the hand works close to the machine."""
    lab_of_robot = lab_at(CENTRIFUGE)
    lab_of_robot.robot.unlock(CENTRIFUGE)
    before = GeometricCamera().tags_in_view(lab_of_robot.world.state(lab_of_robot.clock.now_s()))
    start_s = lab_of_robot.clock.now_s()
    lab_of_robot.robot.open_lid(CENTRIFUGE)
    hand_on_s = np.arange(start_s, lab_of_robot.clock.now_s(), 0.5)
    working_s = [t_s for t_s in hand_on_s if lab_of_robot.world.state(t_s).reach == 1.0]
    geometry = GeometricCamera()
    complete_tags = [
        sum(view.is_resolved() for view in geometry.tags_in_view(lab_of_robot.world.state(t_s))) for t_s in working_s
    ]

    assert sum(view.is_resolved() for view in before) >= 4
    assert fmean(complete_tags) < 1.0
    assert max(complete_tags) <= 3


def test_after_it_touched_the_compact_machine_the_arm_waits_with_a_complete_view_of_it() -> None:
    lab_of_robot = lab_at(PCR_CYCLER)
    lab_of_robot.robot.unlock(PCR_CYCLER)
    lab_of_robot.robot.open_lid(PCR_CYCLER)

    views = GeometricCamera().tags_in_view(lab_of_robot.world.state(lab_of_robot.clock.now_s()))

    assert {view.tag_id for view in views if view.is_resolved()} >= {tag.tag_id for tag in MACHINES[PCR_CYCLER].tags}


def test_no_gaze_is_farther_from_the_shoulder_than_the_arm_is_long() -> None:
    for machine in MACHINES:
        lab_of_robot = lab_at(machine)
        robot = lab_of_robot.robot
        for action in (robot.unlock, robot.open_lid, robot.take_samples, robot.bring_samples, robot.close_lid):
            action(machine)
        instants_s = np.arange(0.0, lab_of_robot.clock.now_s(), 0.5).tolist()

        assert max(shoulder_to_wrist_m(lab_of_robot.world.state(t_s)) for t_s in instants_s) < ARM_LENGTH_M


# Time


@pytest.mark.parametrize("phase", Phase)
def test_every_phase_has_a_duration_that_varies_around_its_mean(phase: Phase) -> None:
    drawn = [DURATIONS[phase].draw(random) for random in [Random(1)] for _ in range(500)]

    assert fmean(drawn) == pytest.approx(DURATIONS[phase].mean_s, rel=0.1)
    assert min(drawn) >= 0.4 * DURATIONS[phase].mean_s
    assert max(drawn) > 1.2 * DURATIONS[phase].mean_s


def test_no_duration_is_ever_much_shorter_than_its_mean() -> None:
    assert min(Spread(10.0, 50.0).draw(Random(seed)) for seed in range(100)) == 4.0


def process_samples(lab_of_robot: Lab) -> None:
    """Run P1's loop with a look before and after each manipulation."""
    robot, clock = lab_of_robot.robot, lab_of_robot.clock

    def drive_to(station: Station) -> None:
        if not robot.is_localized():
            robot.relocalize()
            clock.sleep(0.1)
        robot.drive_to(station)

    def looking(part: Part, machine: str, action: Callable[[str], None]) -> None:
        robot.look_at(machine, part)
        clock.sleep(LOOK_TAKES_S)
        action(machine)
        robot.look_at(machine, part)
        clock.sleep(LOOK_TAKES_S)

    def visit(machine: str, work: Callable[[str], None]) -> None:
        looking(Part.LATCH, machine, robot.unlock)
        looking(Part.LID, machine, robot.open_lid)
        work(machine)
        looking(Part.LID, machine, robot.close_lid)
        looking(Part.LATCH, machine, robot.lock)

    drive_to(Station.CENTRIFUGE)
    visit(CENTRIFUGE, robot.take_samples)
    drive_to(Station.PCR_CYCLER)
    visit(PCR_CYCLER, robot.bring_samples)
    visit(PCR_CYCLER, robot.take_samples)
    drive_to(Station.CENTRIFUGE)
    visit(CENTRIFUGE, robot.bring_samples)


def test_a_loop_of_sample_processing_takes_as_long_as_in_the_paper() -> None:
    """P1, Table 2: the ten runs took from 1,128 to 6,880 s."""
    lab_of_robot = lab(SteadyHand(1))
    process_samples(lab_of_robot)

    assert 1128 < lab_of_robot.clock.now_s() < 6880
    assert not lab_of_robot.robot.is_carrying


def test_observers_do_not_change_the_actions_of_the_robot() -> None:
    watched_lab, unwatched_lab = lab(Random(4), seed=4), lab(Random(4), seed=4)
    unwatched_lab.robot.drive_to(Station.PCR_CYCLER)
    unwatched_lab.robot.look_at(PCR_CYCLER, Part.LID)
    unwatched_lab.robot.unlock(PCR_CYCLER)
    seen_ids: set[int] = set()
    with FrameSource(watched_lab.world) as source:
        handle = ArmCamera(source, watched_lab.clock)

        def watch() -> None:
            seen_ids.update(detection.tag_id for detection in detect(handle.capture()))
            watched_lab.clock.call_at(watched_lab.clock.now_s() + 2.0, watch)

        watch()
        watched_lab.robot.drive_to(Station.PCR_CYCLER)
        watched_lab.robot.look_at(PCR_CYCLER, Part.LID)
        watched_lab.robot.unlock(PCR_CYCLER)

    assert seen_ids >= {tag.tag_id for tag in MACHINES[PCR_CYCLER].tags}
    assert watched_lab.clock.now_s() == unwatched_lab.clock.now_s()
    for t_s in np.linspace(0.0, unwatched_lab.clock.now_s(), 200).tolist():
        assert watched_lab.world.state(t_s) == unwatched_lab.world.state(t_s)


def test_truth_follows_a_complete_visit() -> None:
    lab_of_robot = lab_at(PCR_CYCLER)
    for action in (
        lab_of_robot.robot.unlock,
        lab_of_robot.robot.open_lid,
        lab_of_robot.robot.close_lid,
        lab_of_robot.robot.lock,
    ):
        action(PCR_CYCLER)
    spans = GroundTruth(lab_of_robot.world).over(0.0, lab_of_robot.clock.now_s())
    changes = [span.values["pcr_cycler_open"] for span in spans]

    assert [value for value, before in zip(changes, [None, *changes], strict=False) if value != before] == [
        False,
        True,
        False,
    ]
