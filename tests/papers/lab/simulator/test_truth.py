"""Ground truth: every context-variable of the laboratory's spec, by its definition."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime.clock import SimClock
from codra_papers.lab.gaze import Gaze, observation_gaze
from codra_papers.lab.perception.layout import Part
from codra_papers.lab.robot import Robot, Station
from codra_papers.lab.simulator.truth import SAMPLES_PER_S, GroundTruth, truth_at
from codra_papers.lab.simulator.world import LabWorld, Quantity
from tests.papers.lab.perception.placing import SteadyHand, place_robot_before, put, set_joint

SPECS = Path(__file__).parents[4] / "specs"
OVERVIEW = observation_gaze("pcr_cycler", Part.LID)
GAZE_AWAY: Gaze = (0.9, 0.0, 0.6, 2.0, 0.0, 0.6)


def before_the_cycler(gaze: Gaze = OVERVIEW, **place: float) -> LabWorld:
    world = LabWorld(1)
    place_robot_before(world, "pcr_cycler", gaze, **place)
    return world


def views(world: LabWorld, instant_s: float = 1.0) -> tuple[bool, bool]:
    truth = truth_at(world, instant_s)
    return truth["pcr_cycler_base_in_FOV"], truth["pcr_cycler_lid_in_FOV"]


def declared_variables() -> set[str]:
    lab: Mapping[str, Any] = yaml.safe_load((SPECS / "lab.yaml").read_text("utf-8"))
    part: Mapping[str, Any] = yaml.safe_load((SPECS / "parts" / "machine.yaml").read_text("utf-8"))
    return set(lab["context"]) | {
        name.replace("$(instance)", instance)
        for instance, use in lab["use"].items()
        for name in part["templates"][use["template"]]["context"]
    }


def test_truth_has_exactly_the_variables_of_the_spec() -> None:
    assert set(truth_at(LabWorld(1), 0.0)) == declared_variables()
    assert len(declared_variables()) == 15


@pytest.mark.parametrize(
    ("distance_m", "observable", "manipulable"),
    [(0.8, True, True), (0.94, True, True), (0.96, True, False), (1.59, True, False), (1.61, False, False)],
)
def test_distances_are_those_of_the_base_from_the_middle_of_the_machine(
    distance_m: float, observable: bool, manipulable: bool
) -> None:
    truth = truth_at(before_the_cycler(distance_m=distance_m), 1.0)

    assert truth["pcr_cycler_in_observable_distance"] is observable
    assert truth["pcr_cycler_in_manipulation_distance"] is manipulable
    assert truth["centrifuge_in_observable_distance"] is False


@settings(max_examples=40)
@given(lid_rad=st.floats(0, 1.35), latch_rad=st.floats(0, 1.0), rotor_rad=st.floats(-10, 10))
def test_angles_decide_about_lid_latch_and_rotor(lid_rad: float, latch_rad: float, rotor_rad: float) -> None:
    world = LabWorld(1)
    for part, angle_rad in ((Part.LID, lid_rad), (Part.LATCH, latch_rad), (Part.ROTOR, rotor_rad)):
        set_joint(world, "centrifuge", part, angle_rad)
    truth = truth_at(world, 1.0)

    assert truth["centrifuge_open"] is (lid_rad > 0.6)
    assert truth["centrifuge_locked"] is (latch_rad < 0.5)
    for variable, position_rad in (("centrifuge_rotor_in_pos_1", 0.0), ("centrifuge_rotor_in_pos_2", pi)):
        off_rad = (rotor_rad - position_rad + pi) % (2 * pi) - pi
        assert truth[variable] is (abs(off_rad) < 0.2)


def test_a_machine_is_in_view_from_where_the_robot_looks_with_its_lid_closed_and_open() -> None:
    world = before_the_cycler()
    assert views(world) == (True, True)

    set_joint(world, "pcr_cycler", Part.LID, 1.35, at_s=2.0)
    assert views(world, 3.0) == (True, True)


def test_parts_behind_the_camera_are_not_in_view() -> None:
    assert views(before_the_cycler(GAZE_AWAY)) == (False, False)


def test_tags_that_face_away_are_not_in_view() -> None:
    assert views(before_the_cycler((-1.0, 0.0, 0.6, 0.0, 0.0, 0.1))) == (False, False)


def test_a_part_with_less_than_half_in_the_image_is_not_in_view() -> None:
    half_way_gaze: Gaze = (0.7, 0.0, 0.35, 0.2, 0.28, 0.2)
    farther_gaze: Gaze = (0.7, 0.0, 0.35, 0.2, 0.42, 0.2)

    assert views(before_the_cycler(half_way_gaze)) == (True, True)
    assert views(before_the_cycler(farther_gaze)) == (False, False)


def test_a_part_hidden_by_the_hand_is_not_in_view() -> None:
    world = before_the_cycler((0.6, 0.0, 0.40, 0.2, 0.0, 0.25))
    assert views(world) == (True, True)

    put(world, Quantity.REACH, 1.0, at_s=2.0)
    put(world, Quantity.HOLDING, 1.0, at_s=2.0)
    assert views(world, 3.0) == (False, True)


def test_a_large_open_lid_leaves_the_view_of_a_near_camera() -> None:
    world = LabWorld(1)
    place_robot_before(world, "centrifuge", (0.85, 0.0, 0.78, 0.27, 0.0, 0.36))
    set_joint(world, "centrifuge", Part.LID, 1.35, at_s=2.0)

    assert truth_at(world, 1.0)["centrifuge_lid_in_FOV"]
    assert not truth_at(world, 3.0)["centrifuge_lid_in_FOV"]


def test_light_does_not_change_the_truth() -> None:
    world = before_the_cycler()
    truth_by_day = truth_at(world, 1.0)
    put(world, Quantity.LIGHT, 0.0, at_s=2.0)

    assert truth_at(world, 3.0) == truth_by_day


def test_the_belief_of_the_robot_changes_only_whether_it_is_localised() -> None:
    world = before_the_cycler()
    before = truth_at(world, 1.0)
    put(world, Quantity.LOCALIZED, 0.0, at_s=2.0)

    assert truth_at(world, 3.0) == {**before, "robot_is_localized": False}


def drive_and_open(world: LabWorld) -> float:
    clock = SimClock()
    robot = Robot(world, clock, SteadyHand(1))
    robot.drive_to(Station.PCR_CYCLER)
    robot.unlock("pcr_cycler")
    robot.open_lid("pcr_cycler")
    return clock.now_s()


def test_spans_cover_the_time_without_gaps_and_differ_from_their_neighbours() -> None:
    world = LabWorld(1)
    end_s = drive_and_open(world)

    spans = GroundTruth(world).over(0.0, end_s + 100.0)

    assert (spans[0].start_s, spans[-1].end_s) == (0.0, end_s + 100.0)
    assert all(first.end_s == second.start_s and first.values != second.values for first, second in pairwise(spans))
    assert len(spans) > 10


def test_spans_agree_with_the_truth_of_instants_up_to_one_sample() -> None:
    world = LabWorld(1)
    end_s = drive_and_open(world)
    truth = GroundTruth(world)
    spans = truth.over(10.0, end_s)

    for span in spans:
        for instant_s in (
            span.start_s + 1 / SAMPLES_PER_S,
            (span.start_s + span.end_s) / 2,
            span.end_s - 1 / SAMPLES_PER_S,
        ):
            if span.start_s + 1 / SAMPLES_PER_S <= instant_s <= span.end_s - 1 / SAMPLES_PER_S:
                assert truth.at(instant_s) == span.values


def test_a_resting_world_has_one_span() -> None:
    spans = GroundTruth(LabWorld(1)).over(0.0, 1e6)

    assert [(span.start_s, span.end_s) for span in spans] == [(0.0, 1e6)]


def test_a_jump_splits_the_time_where_it_happens() -> None:
    world = LabWorld(1)
    put(world, Quantity.LOCALIZED, 0.0, at_s=3.7)
    put(world, Quantity.LOCALIZED, 1.0, at_s=9.1)

    spans = GroundTruth(world).over(0.0, 20.0)

    assert [span.start_s for span in spans] == [0.0, 3.7, 9.1]
    assert [span.values["robot_is_localized"] for span in spans] == [True, False, True]


def test_an_empty_time_has_no_spans() -> None:
    assert GroundTruth(LabWorld(1)).over(5.0, 5.0) == ()
