"""The laboratory's perception functions on drawn frames: their measurements, their unknown results, and their inputs.

The inputs are pixels and the map, never the simulator.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import hypot, pi
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from codra_papers.lab.gaze import observation_gaze, ready_gaze
from codra_papers.lab.perception import functions as perception
from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.functions import (
    find_in_view,
    localize_lid,
    localize_lid_always,
    localize_rotor,
    measure_distance,
)
from codra_papers.lab.perception.layout import MACHINES, Part, machine_named
from codra_papers.lab.perception.poses import Pose
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.simulator.camera import FrameSource, GreyFrameSource
from codra_papers.lab.simulator.geometric_camera import GeometricCamera, TagInView
from codra_papers.lab.simulator.world import LabWorld, Quantity
from tests.papers.lab.asked import CameraWithComputer, FixedBase, OneFrameCamera, RecordedJob
from tests.papers.lab.perception.placing import place_robot_before, put, set_joint
from tests.papers.lab.stored import perceive, store

ROOT = Path(__file__).parents[4]
SEES_PIXELS = (find_in_view, localize_lid, localize_rotor)

PERCEIVE_WITHOUT_A_SIMULATOR = """
import sys
sys.modules["mujoco"] = None
import codra_papers.lab.perception.functions
print(" ".join(sorted(name for name in sys.modules if name.startswith(("mujoco", "codra_papers")))))
"""


class Laboratory:
    """A laboratory in which the robot jumps from pose to pose and takes frames."""

    def __init__(self) -> None:
        self.world = LabWorld(5)
        self.source = FrameSource(self.world)
        self.geometry = GeometricCamera()
        self.now_s = 0.0

    def place_robot(self, machine: str, gaze: tuple[float, ...] | None = None) -> None:
        self.now_s += 10.0
        gaze = observation_gaze(machine, Part.LID) if gaze is None else gaze
        place_robot_before(self.world, machine, gaze, at_s=self.now_s)

    def turn(self, machine: str, part: Part, angle_rad: float) -> None:
        self.now_s += 10.0
        set_joint(self.world, machine, part, angle_rad, at_s=self.now_s)

    def change(self, quantity: Quantity, value: float) -> None:
        self.now_s += 10.0
        put(self.world, quantity, value, at_s=self.now_s)

    def begin_again(self) -> None:
        """Close all lids and latches, draw back the hand, and switch on the light."""
        for machine in MACHINES.values():
            for joint in machine.joints:
                self.turn(machine.name, joint.part, 0.0)
        self.change(Quantity.REACH, 0.0)
        self.change(Quantity.LIGHT, 1.0)

    def frame(self) -> Frame:
        return self.source.frame_at(self.now_s + 1.0)

    def share(self, machine: str, part: Part) -> float:
        return 100.0 * self.geometry.visible_shares(self.world.state(self.now_s + 1.0), [(machine, part)])[0]

    def views(self) -> Mapping[int, TagInView]:
        return {view.tag_id: view for view in self.geometry.tags_in_view(self.world.state(self.now_s + 1.0))}


@pytest.fixture(scope="module")
def shared_lab() -> Iterator[Laboratory]:
    laboratory = Laboratory()
    yield laboratory
    laboratory.source.close()


@pytest.fixture
def lab(shared_lab: Laboratory) -> Laboratory:
    """Return the laboratory of all tests of this file in its first state: to begin to draw takes long."""
    shared_lab.begin_again()
    return shared_lab


def ask(function: Callable[..., Mapping[str, Any]], machine: str, frame: Frame) -> Mapping[str, Any]:
    return function(machine=machine, camera=OneFrameCamera(frame), job=RecordedJob())


# Lid and latch


@pytest.mark.parametrize("machine", sorted(MACHINES))
@pytest.mark.parametrize("angle_rad", [0.0, 0.3, 0.57, 0.63, 1.0, 1.35])
def test_the_lids_angle_is_measured_within_two_hundredths_of_a_radian(
    lab: Laboratory, machine: str, angle_rad: float
) -> None:
    lab.place_robot(machine)
    lab.turn(machine, Part.LID, angle_rad)

    measurement = ask(localize_lid, machine, lab.frame())

    assert measurement["lid_angle"] == pytest.approx(angle_rad, abs=0.02)
    assert measurement["markers"] >= 3


def test_with_enough_visible_markers_the_lids_angle_is_right_from_everywhere(lab: Laboratory) -> None:
    random, errors_rad = Random(3), []
    for _ in range(60):
        machine = random.choice(sorted(MACHINES))
        angle_rad = random.uniform(*MACHINES[machine].joint(Part.LID).range_rad)
        eye = (random.uniform(0.7, 1.4), random.uniform(-0.4, 0.4), random.uniform(0.45, 1.0))
        lab.place_robot(machine, (*eye, 0.1, random.uniform(-0.2, 0.2), 0.3))
        lab.turn(machine, Part.LID, angle_rad)
        measurement = ask(localize_lid, machine, lab.frame())
        if measurement["lid_angle"] is not None and measurement["markers"] >= 4:
            errors_rad.append(abs(measurement["lid_angle"] - angle_rad))

    assert len(errors_rad) > 30
    assert np.median(errors_rad) < 0.005
    assert max(errors_rad) < 0.05


@pytest.mark.parametrize("machine", sorted(MACHINES))
@pytest.mark.parametrize(("angle_rad", "latched"), [(0.0, True), (0.4, True), (0.6, False), (1.0, False)])
def test_the_lever_is_latched_in_the_half_nearer_to_locked(
    lab: Laboratory, machine: str, angle_rad: float, latched: bool
) -> None:
    lab.place_robot(machine)
    lab.turn(machine, Part.LATCH, angle_rad)

    assert ask(localize_lid, machine, lab.frame())["latched"] is latched


def test_a_lid_out_of_the_image_has_no_angle_while_the_base_counts_its_markers(lab: Laboratory) -> None:
    lab.place_robot("pcr_cycler", (0.75, 0.0, 0.25, 0.2, 0.0, 0.0))
    lab.turn("pcr_cycler", Part.LID, 1.35)

    measurement = ask(localize_lid, "pcr_cycler", lab.frame())

    assert measurement["lid_angle"] is None
    assert measurement["latched"] is True
    assert measurement["markers"] == 4


def test_the_localiser_that_always_answers_takes_an_unseen_lid_for_closed(lab: Laboratory) -> None:
    """P1, section 4.1: "incorrectly identified that the centrifuge lid was closed"."""
    lab.place_robot("pcr_cycler", (0.75, 0.0, 0.25, 0.2, 0.0, 0.0))
    lab.turn("pcr_cycler", Part.LID, 1.35)

    measurement = ask(localize_lid_always, "pcr_cycler", lab.frame())

    assert measurement == {**ask(localize_lid, "pcr_cycler", lab.frame()), "lid_angle": 0.0}


def test_the_localiser_that_always_answers_measures_a_lid_in_view_and_no_angle_without_the_base(
    lab: Laboratory,
) -> None:
    lab.place_robot("pcr_cycler")
    lab.turn("pcr_cycler", Part.LID, 1.0)
    assert ask(localize_lid_always, "pcr_cycler", lab.frame()) == ask(localize_lid, "pcr_cycler", lab.frame())

    lab.place_robot("centrifuge", (0.78, 0.0, 0.50, 0.45, 0.0, 0.34))
    assert ask(localize_lid_always, "centrifuge", lab.frame())["lid_angle"] is None


def test_without_the_base_neither_angle_nor_latch_is_known(lab: Laboratory) -> None:
    """The tags of latch and lid are seen, but no tag of the base as a reference."""
    lab.place_robot("centrifuge", (0.78, 0.0, 0.50, 0.45, 0.0, 0.34))

    measurement = ask(localize_lid, "centrifuge", lab.frame())

    assert {13, 14, 15} <= {detection.tag_id for detection in detect(lab.frame())}
    assert measurement == {"markers": 2, "lid_angle": None, "latched": None}


def test_one_machine_is_not_taken_for_the_other(lab: Laboratory) -> None:
    lab.place_robot("centrifuge")

    assert ask(localize_lid, "pcr_cycler", lab.frame()) == {"markers": 0, "lid_angle": None, "latched": None}


def test_a_hand_before_the_tags_costs_markers_and_not_truth(lab: Laboratory) -> None:
    lab.place_robot("pcr_cycler", (0.55, 0.0, 0.40, 0.2, 0.0, 0.15))
    free_measurement = ask(localize_lid, "pcr_cycler", lab.frame())
    lab.change(Quantity.REACH, 1.0)
    covered_measurement = ask(localize_lid, "pcr_cycler", lab.frame())

    assert covered_measurement["markers"] < free_measurement["markers"]
    assert covered_measurement["lid_angle"] == pytest.approx(0.0, abs=0.02)


# Rotor


@pytest.mark.parametrize(("angle_rad", "measured_rad"), [(0.0, 0.0), (0.15, 0.15), (pi, pi), (pi + 0.15, pi + 0.15)])
def test_the_rotors_angle_is_measured_through_the_open_lid(
    lab: Laboratory, angle_rad: float, measured_rad: float
) -> None:
    """The angles are near both indexed positions. Half a turn is never measured as minus half a turn."""
    lab.place_robot("centrifuge", observation_gaze("centrifuge", Part.ROTOR))
    lab.turn("centrifuge", Part.LID, 1.35)
    lab.turn("centrifuge", Part.ROTOR, angle_rad)

    measurement = ask(localize_rotor, "centrifuge", lab.frame())

    assert measurement["markers"] >= 1
    assert measurement["rotor_angle"] == pytest.approx(measured_rad, abs=0.05)


def test_a_closed_lid_hides_the_rotor(lab: Laboratory) -> None:
    lab.place_robot("centrifuge")

    assert ask(localize_rotor, "centrifuge", lab.frame()) == {"markers": 0, "rotor_angle": None}


@pytest.mark.parametrize("gaze", [*map(partial(observation_gaze, "centrifuge"), Part), ready_gaze("centrifuge")])
@pytest.mark.parametrize("rotor_rad", [0.0, 0.5, pi / 2])
def test_a_rotor_in_view_means_an_open_lid_if_the_lid_is_out_of_view(
    lab: Laboratory, gaze: tuple[float, ...], rotor_rad: float
) -> None:
    """A lid that is ajar, at most 0.6 rad, lets the camera see the rotor, but then the lid is in view as well."""
    lab.place_robot("centrifuge", gaze)
    lab.turn("centrifuge", Part.ROTOR, rotor_rad)
    for lid_rad in np.linspace(0.0, 1.35, 28):
        lab.turn("centrifuge", Part.LID, lid_rad)

        shows_rotor, shows_lid = (lab.share("centrifuge", part) for part in (Part.ROTOR, Part.LID))

        assert shows_rotor == 0.0 or shows_lid >= 50.0 or lid_rad > 0.6
    assert shows_rotor > 0.0


# View


def test_a_machine_that_is_wholly_in_view_has_full_shares(lab: Laboratory) -> None:
    lab.place_robot("pcr_cycler")

    measurement = ask(find_in_view, "pcr_cycler", lab.frame())

    assert (measurement["base_share"], measurement["lid_share"]) == (100.0, 100.0)
    assert measurement["sharpness"] >= 0.5


def test_a_machine_that_is_elsewhere_has_no_share_in_a_sharp_frame(lab: Laboratory) -> None:
    lab.place_robot("centrifuge")

    measurement = ask(find_in_view, "pcr_cycler", lab.frame())

    assert (measurement["base_share"], measurement["lid_share"]) == (0.0, 0.0)
    assert measurement["sharpness"] >= 0.5


def test_a_tag_that_the_edge_of_the_image_cuts_counts_with_the_corners_that_it_shows(lab: Laboratory) -> None:
    lab.place_robot("pcr_cycler", (0.75, 0.0, 0.5, 0.25, 0.0, 0.355))

    measurement = ask(find_in_view, "pcr_cycler", lab.frame())

    assert not {22, 23} & {detection.tag_id for detection in detect(lab.frame())}
    assert 50.0 < lab.share("pcr_cycler", Part.BASE) < 100.0
    assert measurement["base_share"] == pytest.approx(lab.share("pcr_cycler", Part.BASE))


def test_shares_agree_with_geometry_wherever_the_robot_looks(lab: Laboratory) -> None:
    """Small, slanted and half hidden tags are sometimes missed. Parts that are reported in view really are in view."""
    random, agreements, wrongly_seen_count = Random(8), [], 0
    for _ in range(80):
        machine = random.choice(sorted(MACHINES))
        eye = (random.uniform(0.6, 1.4), random.uniform(-0.4, 0.4), random.uniform(0.4, 1.0))
        lab.place_robot(machine, (*eye, 0.1, random.uniform(-0.4, 0.4), random.uniform(0.0, 0.6)))
        measurement = ask(find_in_view, machine, lab.frame())
        for part in (Part.BASE, Part.LID):
            is_reported, is_true = measurement[f"{part}_share"] >= 50.0, lab.share(machine, part) >= 50.0
            agreements.append(is_reported == is_true)
            wrongly_seen_count += is_reported and not is_true

    assert np.mean(agreements) > 0.9
    assert wrongly_seen_count <= 0.03 * len(agreements)


# Frames without content


@pytest.mark.parametrize("machine", sorted(MACHINES))
def test_grey_frames_give_no_measurements(machine: str) -> None:
    """The results do not satisfy any `accept_when` of the spec, so all ten variables from pixels stay unknown."""
    frame = GreyFrameSource(LabWorld(5)).frame_at(3.0)

    assert ask(find_in_view, machine, frame) == {"base_share": 0.0, "lid_share": 0.0, "sharpness": 0.0}
    assert ask(localize_lid, machine, frame) == {"markers": 0, "lid_angle": None, "latched": None}
    assert ask(localize_rotor, "centrifuge", frame) == {"markers": 0, "rotor_angle": None}


def test_in_the_dark_no_view_is_claimed_to_be_empty(lab: Laboratory) -> None:
    lab.place_robot("pcr_cycler")
    lab.change(Quantity.LIGHT, 0.02)

    measurement = ask(find_in_view, "pcr_cycler", lab.frame())

    assert measurement["base_share"] == 0.0
    assert measurement["sharpness"] < 0.5


def test_no_tag_is_detected_in_frames_without_tags(lab: Laboratory) -> None:
    random = Random(6)
    for _ in range(40):
        lab.place_robot("centrifuge", (1.2, 0.0, 0.8, random.uniform(1.8, 3.0), random.uniform(-1.5, 1.5), 0.2))

        assert {detection.tag_id for detection in detect(lab.frame())} <= set(lab.views())


# Distance


def test_the_distance_is_from_where_the_robot_believes_its_base_to_the_machine_in_the_map() -> None:
    machine = machine_named("centrifuge")
    x_m, y_m, _ = machine.map_from_base.translation_m
    base = FixedBase(Pose.planar(float(x_m) + 0.6, float(y_m) - 0.8, 1.0))

    assert measure_distance(machine="centrifuge", base=base, job=RecordedJob()) == {"distance": pytest.approx(1.0)}


def test_the_believed_distance_is_centimetres_off_the_true_one() -> None:
    world = LabWorld(5)
    place_robot_before(world, "pcr_cycler", observation_gaze("pcr_cycler", Part.LID), distance_m=0.9)
    base = FixedBase(world.believed_map_from_robot(2.0))

    measurement = measure_distance(machine="pcr_cycler", base=base, job=RecordedJob())

    assert measurement["distance"] == pytest.approx(0.9, abs=0.05)
    assert measurement["distance"] != 0.9


def test_an_error_names_a_missing_machine() -> None:
    with pytest.raises(ValueError, match="no machine 'fridge'"):
        measure_distance(machine="fridge", base=FixedBase(Pose.identity()), job=RecordedJob())


# Time


@pytest.mark.parametrize("function", SEES_PIXELS)
def test_evidence_is_closed_at_the_frames_stamp_before_processing_begins(
    lab: Laboratory, function: Callable[..., Mapping[str, Any]]
) -> None:
    lab.place_robot("centrifuge")
    frame, job = lab.frame(), RecordedJob()

    function(machine="centrifuge", camera=OneFrameCamera(frame), job=job)

    assert [what for what, _, _ in job.record] == ["evidence", "slept"]
    assert job.record[0][1:] == (frame.stamp_s, frame.stamp_s)
    assert job.record[1][2] > job.record[1][1]


def test_a_distance_is_evidence_of_the_instant_of_its_reading() -> None:
    job = RecordedJob(start_s=12.5)

    measure_distance(machine="centrifuge", base=FixedBase(Pose.identity()), job=job)

    assert [what for what, _, _ in job.record] == ["evidence", "slept"]
    assert job.record[0][1:] == (12.5, 12.5)


def mean_duration_s(function: Callable[..., Mapping[str, Any]], **handles: Callable[[RecordedJob], object]) -> float:
    job = RecordedJob(random=Random(2))
    arguments = {name: make(job) for name, make in handles.items()}
    for _ in range(400):
        function(machine="centrifuge", job=job, **arguments)
    durations_s = [after_s - before_s for name_of_call, before_s, after_s in job.record if name_of_call == "slept"]
    assert 2.0 < max(durations_s) / min(durations_s) < 8.0
    return float(np.mean(durations_s))


def test_a_naive_round_over_all_vision_calls_takes_as_long_as_a_trigger_in_the_paper() -> None:
    """P1, section 4.1: 10 hours of naive observers, 5006 triggers."""
    frame = GreyFrameSource(LabWorld(5)).frame_at(3.0)
    find_s, lid_s, rotor_s = (
        mean_duration_s(function, camera=lambda job: CameraWithComputer(frame, job)) for function in SEES_PIXELS
    )
    round_s = 2 * find_s + 2 * lid_s + rotor_s

    assert round_s == pytest.approx(10 * 3600 / 5006, rel=0.03)
    assert mean_duration_s(measure_distance, base=lambda _: FixedBase(Pose.identity())) == pytest.approx(
        perception.MEASURE_DISTANCE_S, rel=0.05
    )


def test_the_processing_time_does_not_depend_on_the_frame_or_the_caller(lab: Laboratory) -> None:
    lab.place_robot("pcr_cycler")
    jobs = [RecordedJob(random=Random(seed)) for seed in (1, 2)]

    for frame, job in zip((lab.frame(), GreyFrameSource(lab.world).frame_at(3.0)), jobs, strict=True):
        localize_lid(machine="pcr_cycler", camera=CameraWithComputer(frame, job), job=job)

    assert jobs[0].record[-1] == jobs[1].record[-1]


# Inputs of perception


def test_perception_runs_without_the_simulator() -> None:
    """The libraries of the simulator are blocked. Only the map and the perception of the laboratory are loaded."""
    done = subprocess.run(
        [sys.executable, "-c", PERCEIVE_WITHOUT_A_SIMULATOR], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    loaded = {name.removeprefix("codra_papers.lab.") for name in done.stdout.split()}

    assert "perception" in loaded
    assert not loaded & {"world", "truth", "scene", "camera", "sight", "robot", "mission", "gl"}
    assert not any(name.startswith("mujoco.") for name in loaded)


def test_stored_frames_give_the_same_evidence_in_another_process(lab: Laboratory, tmp_path: Path) -> None:
    expected = {}
    for index, (machine, lid_rad) in enumerate((("centrifuge", 0.0), ("centrifuge", 1.35), ("pcr_cycler", 0.9))):
        lab.place_robot(machine)
        lab.turn(machine, Part.LID, lid_rad)
        name = f"{index}.png"
        store(lab.frame(), tmp_path / name)
        expected[name] = perceive(lab.frame())

    done = subprocess.run(
        [sys.executable, "-m", "tests.papers.lab.stored", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)

    assert answer["mujoco"] is False
    assert answer["frames"] == json.loads(json.dumps(expected))
    assert expected["1.png"]["centrifuge localize_lid"]["lid_angle"] == pytest.approx(1.35, abs=0.02)


def test_the_order_of_callers_does_not_matter(lab: Laboratory) -> None:
    lab.place_robot("centrifuge")
    lab.turn("centrifuge", Part.LID, 1.0)
    first_results = [ask(function, "centrifuge", lab.frame()) for function in SEES_PIXELS]
    repeated_results = [ask(function, "centrifuge", lab.frame()) for function in reversed(SEES_PIXELS)]

    assert first_results == repeated_results[::-1]


def test_detections_lie_where_geometry_puts_the_tags(lab: Laboratory) -> None:
    lab.place_robot("centrifuge")
    views = lab.views()

    for detection in detect(lab.frame()):
        offsets_px = detection.corners_px - views[detection.tag_id].corners_px
        assert max(hypot(x, y) for x, y in offsets_px) < 0.5
