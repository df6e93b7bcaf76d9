"""The complete laboratory: its compiled observers on rendered frames, while the mission runs."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_dsl.runtime import ContextManager, SimClock
from codra_dsl.runtime.journal import Kind
from codra_papers.experiments.lab.arms import NAIVE, Arm, Need, Observers, observers
from codra_papers.experiments.lab.run import OBSERVED, LabRun, LabSettings, Loops, run_lab
from codra_papers.experiments.lab.scoring import Score
from codra_papers.lab.mission import Expect
from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.layout import Part
from codra_papers.lab.robot import Localization, Robot, Station
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource, GreyFrameSource
from codra_papers.lab.simulator.world import LabWorld
from generated import lab

SPEC = Path(__file__).parents[4] / "specs" / "lab.yaml"
CONTEXT_DRIVEN = Arm(name="context-driven", need=Need.ANNOUNCED)
FROM_PIXELS = (
    "centrifuge_base_in_FOV",
    "centrifuge_lid_in_FOV",
    "centrifuge_open",
    "centrifuge_locked",
    "centrifuge_rotor_in_pos_1",
    "centrifuge_rotor_in_pos_2",
    "pcr_cycler_base_in_FOV",
    "pcr_cycler_lid_in_FOV",
    "pcr_cycler_open",
    "pcr_cycler_locked",
)
FROM_THE_ROBOT_ITSELF = (
    "centrifuge_in_observable_distance",
    "centrifuge_in_manipulation_distance",
    "pcr_cycler_in_observable_distance",
    "pcr_cycler_in_manipulation_distance",
)


@pytest.fixture(scope="module")
def run_of_both_arms(tmp_path_factory: pytest.TempPathFactory) -> LabRun:
    """Return a run of two simulated minutes with both arms."""
    folder = tmp_path_factory.mktemp("compiled")
    arms = [observers(arm, read_spec(SPEC), folder / arm.name) for arm in (CONTEXT_DRIVEN, NAIVE)]
    return run_lab(arms, settings())


def settings(duration_s: float = 120.0, expect: Expect = Expect.ONE_AHEAD, seed: int = 2) -> LabSettings:
    return LabSettings(seed=seed, duration_s=duration_s, work=Loops(), answering_arm=CONTEXT_DRIVEN.name, expect=expect)


def run_alone(run_settings: LabSettings) -> LabRun:
    return run_lab([Observers(arm=CONTEXT_DRIVEN, start=lab.start)], run_settings)


@cache
def short_run(expect: Expect = Expect.ONE_AHEAD, seed: int = 2) -> LabRun:
    return run_alone(settings(expect=expect, seed=seed))


def test_the_same_seed_gives_the_same_record_also_with_another_arm_beside_it(run_of_both_arms: LabRun) -> None:
    run_of_one_arm = short_run()

    assert run_of_one_arm.arms[0].record.text() == run_of_both_arms.arms[0].record.text()
    assert len(run_of_one_arm.arms[0].record) > 100


def test_another_seed_gives_another_record(run_of_both_arms: LabRun) -> None:
    assert short_run(seed=4).arms[0].record.text() != run_of_both_arms.arms[0].record.text()


def preview_decisions(run: LabRun) -> Counter[tuple[str, str]]:
    return Counter((event.name, event.what) for event in run.arms[0].record.of(Kind.DECISION))


def test_a_preview_is_answered_from_context_when_it_was_expected_and_falls_back_when_it_was_not() -> None:
    expected_answers, unexpected_answers = (
        preview_decisions(short_run(expect)) for expect in (Expect.ONE_AHEAD, Expect.NOTHING)
    )

    assert expected_answers["centrifuge_locked", "answered"] >= 1
    assert expected_answers["centrifuge_locked", "fell_back"] == 0
    assert unexpected_answers["centrifuge_locked", "fell_back"] >= 1


def test_an_expected_preview_is_answered_without_waiting() -> None:
    first_decision = next(
        event for event in short_run().arms[0].record.of(Kind.DECISION) if event.name == "centrifuge_locked"
    )

    assert (first_decision.what, first_decision.instant_s) == ("answered", first_decision.details["asked_s"])


def test_the_naive_arm_has_no_conditions_and_starts_again_as_soon_as_it_is_done(run_of_both_arms: LabRun) -> None:
    context, naive = run_of_both_arms.arms

    assert (context.name, naive.name) == (CONTEXT_DRIVEN.name, NAIVE.name)
    assert all(naive.jobs[name] >= 10 for name in naive.jobs)
    jobs = [event for event in naive.record.of(Kind.JOB) if event.name == "measure_centrifuge_distance"]
    ends = [event.instant_s for event in jobs if event.what == "returned"]
    starts_again = [event.instant_s for event in jobs if event.what == "started"][1:]
    assert ends[: len(starts_again)] == starts_again


def test_right_wrong_and_unknown_seconds_of_every_variable_add_up_to_the_run(run_of_both_arms: LabRun) -> None:
    assert run_of_both_arms.duration_s == 120.0
    for arm in run_of_both_arms.arms:
        assert {name: round(sum(spans_s), 6) for name, *spans_s in map(seconds, arm.scores)} == dict.fromkeys(
            run_of_both_arms.truth, 120.0
        )


def seconds(variable_score: Score) -> tuple[Any, ...]:
    return variable_score.name, variable_score.right_s, variable_score.wrong_s, variable_score.unknown_s


def test_a_value_of_the_main_execution_itself_does_not_count_as_observed(run_of_both_arms: LabRun) -> None:
    assert run_of_both_arms.decisions["robot_is_localized"] == {"answered": 2}
    locked = run_of_both_arms.decisions["centrifuge_locked"]
    assert locked["answered"] == locked[OBSERVED] >= 1


def test_a_run_ends_at_its_instant_while_the_main_execution_waits_for_observers() -> None:
    waiting_decision = next(
        event
        for event in run_alone(settings(240.0)).arms[0].record.of(Kind.DECISION)
        if event.instant_s > event.details["asked_s"]
    )
    middle_s = (waiting_decision.instant_s + waiting_decision.details["asked_s"]) / 2

    assert run_alone(settings(middle_s)).duration_s == middle_s


def test_the_handles_of_perception_cannot_command_the_robot() -> None:
    offered_names = {name for handle in (ArmCamera, Localization) for name in dir(handle) if not name.startswith("_")}

    assert offered_names == {"capture", "processing_s", "believed_map_from_base"}


class ListeningCamera:
    """An arm's camera that records the frames that it returned."""

    def __init__(self, camera: ArmCamera) -> None:
        self._camera = camera
        self.frames: dict[float, Frame] = {}

    def capture(self) -> Frame:
        frame = self._camera.capture()
        self.frames[frame.stamp_s] = frame
        return frame

    def processing_s(self, mean_s: float) -> float:
        return self._camera.processing_s(mean_s)


def watch(clock: SimClock, world: LabWorld, camera: Any, seed: int) -> ContextManager[Any, Any]:
    handles = {"camera": camera, "base": Localization(world, clock)}
    manager = lab.start(clock=clock, resources=handles, seed=seed)
    manager.set("robot_is_localized", True)
    for name in manager.modelled():
        manager.declare(name)
    return manager


def test_equal_instants_give_both_arms_equal_frames() -> None:
    clock, world = SimClock(), LabWorld(5)
    robot = Robot(world, clock, Random(5))
    with FrameSource(world) as frames:
        cameras = [ListeningCamera(ArmCamera(frames, clock)) for _ in range(2)]
        managers = [watch(clock, world, camera, seed) for camera, seed in zip(cameras, (1, 1), strict=True)]
        with ExitStack() as skills:
            for manager in managers:
                skills.enter_context(manager.skill("drive_to_centrifuge"))
            robot.drive_to(Station.CENTRIFUGE)
            clock.sleep(30.0)
        for manager in managers:
            manager.close()

    common_stamps_s = cameras[0].frames.keys() & cameras[1].frames.keys()

    assert len(common_stamps_s) >= 5
    for stamp_s in common_stamps_s:
        left_frame, right_frame = cameras[0].frames[stamp_s], cameras[1].frames[stamp_s]
        assert np.array_equal(left_frame.pixels, right_frame.pixels)
        assert np.array_equal(
            left_frame.believed_map_from_camera.rotation, right_frame.believed_map_from_camera.rotation
        )
    assert managers[0].record.text() == managers[1].record.text()


def test_with_grey_frames_only_the_four_variables_that_need_no_pixels_become_known() -> None:
    clock, world = SimClock(), LabWorld(6)
    robot = Robot(world, clock, Random(6))
    with watch(clock, world, ArmCamera(GreyFrameSource(world), clock), 6) as manager:
        robot.drive_to(Station.CENTRIFUGE)
        robot.look_at("centrifuge", Part.LID)
        clock.sleep(20.0)

        assert {name for name in FROM_PIXELS if manager.get(name).known} == set()
        assert all(not any(reading.known for reading in manager.history(name)) for name in FROM_PIXELS)
        assert all(manager.get(name).known for name in FROM_THE_ROBOT_ITSELF)
