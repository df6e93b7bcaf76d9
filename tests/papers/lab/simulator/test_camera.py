"""Frames: drawn once, the same for all callers, and consistent with the geometry."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from math import hypot, pi
from random import Random

import cv2
import mujoco
import numpy as np
import pytest

from codra_dsl.runtime.clock import SimClock
from codra_papers.lab.gaze import grip_gaze, observation_gaze
from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.layout import INTRINSICS, MACHINES, Part
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.simulator import camera, gl
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource, GreyFrameSource, exposed_states
from codra_papers.lab.simulator.geometric_camera import GeometricCamera
from codra_papers.lab.simulator.laboratory import LABORATORY, NOISE_GREYS
from codra_papers.lab.simulator.scene import CAMERA_NAME, Stage
from codra_papers.lab.simulator.world import JointKey, LabWorld, Quantity
from tests.papers.lab.perception.placing import place_robot_before, put, set_joint

SEED = 5
OVERVIEW = observation_gaze("pcr_cycler", Part.LID)


@pytest.fixture
def world() -> LabWorld:
    world = LabWorld(SEED)
    place_robot_before(world, "pcr_cycler", OVERVIEW)
    return world


@pytest.fixture
def source(world: LabWorld) -> Iterator[FrameSource]:
    with FrameSource(world) as source:
        yield source


@pytest.fixture(scope="module")
def still_source() -> Iterator[FrameSource]:
    """Return the source of a scene that no test changes."""
    still_world = LabWorld(SEED)
    place_robot_before(still_world, "pcr_cycler", OVERVIEW)
    with FrameSource(still_world) as source:
        yield source


def detail_level(frame: Frame) -> float:
    """Return how much a frame changes from column to column, without noise."""
    grey = cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2GRAY)
    return float(np.percentile(np.abs(cv2.Sobel(cv2.blur(grey, (1, 9)), cv2.CV_64F, 1, 0, ksize=3)), 98))


# One frame for all callers


def test_a_frame_is_drawn_once_for_many_callers(source: FrameSource) -> None:
    first_frame, repeated_frame = source.frame_at(1.0), source.frame_at(1.0)

    assert repeated_frame is first_frame
    assert source.rendered == 1


def test_threads_that_ask_at_the_same_instant_get_the_same_frame(source: FrameSource) -> None:
    with ThreadPoolExecutor(max_workers=8) as askers:
        frames = list(askers.map(source.frame_at, [1.0, 2.0] * 8))

    assert {id(frame) for frame in frames} == {id(frames[0]), id(frames[1])}
    assert source.rendered == 2


def test_the_same_seed_and_instant_give_the_same_pixels(world: LabWorld, still_source: FrameSource) -> None:
    with FrameSource(world) as other:
        other.frame_at(0.5)

        assert np.array_equal(other.frame_at(1.0).pixels, still_source.frame_at(1.0).pixels)


def test_earlier_frames_do_not_change_a_frame(world: LabWorld, source: FrameSource) -> None:
    put(world, Quantity.LIGHT, 0.4, at_s=2.0)
    set_joint(world, "pcr_cycler", Part.LID, 1.0, at_s=3.0)
    world.schedule(4.0, [world.moves_to(4.0, camera_key(), (0.0,), 1.0)])

    for instant_s in (1.0, 1.5, 2.5, 3.5, 4.5, 6.0, 1.2):
        with FrameSource(world) as other:
            assert np.array_equal(source.frame_at(instant_s).pixels, other.frame_at(instant_s).pixels)


START_AT_ONCE = """\
import sys
from threading import Barrier, Thread, enumerate
from codra_papers.lab.simulator import camera, gl

gl.use_backend(sys.argv[1])
barrier = Barrier(8)
starts = [Thread(target=lambda: (barrier.wait(), camera._drawing_thread())) for _ in range(8)]
for start in starts:
    start.start()
for start in starts:
    start.join()
assert sum(thread.name.startswith("codra-camera") for thread in enumerate()) == 1
"""


def test_threads_that_open_the_first_sources_at_once_share_one_drawing_thread() -> None:
    subprocess.run([sys.executable, "-c", START_AT_ONCE, gl.choose_backend()], check=True)


def test_open_sources_of_different_rooms_draw_what_each_draws_alone(world: LabWorld) -> None:
    other_world = LabWorld(SEED, LABORATORY.with_tags(0.5))
    place_robot_before(other_world, "centrifuge", observation_gaze("centrifuge", Part.LID))
    pictures_alone = []
    for one_world in (world, other_world):
        with FrameSource(one_world) as source:
            pictures_alone.append([source.frame_at(instant_s).pixels for instant_s in (1.0, 2.0)])

    with FrameSource(world) as source, FrameSource(other_world) as other:
        pictures = [[one.frame_at(instant_s).pixels for one in (source, other)] for instant_s in (1.0, 2.0)]

    assert np.array_equal(np.swapaxes(pictures, 0, 1), pictures_alone)


def test_noise_depends_on_seed_and_instant(still_source: FrameSource) -> None:
    other_world = LabWorld(SEED + 1)
    place_robot_before(other_world, "pcr_cycler", OVERVIEW)
    with FrameSource(other_world) as other:
        frames = [still_source.frame_at(1.0), still_source.frame_at(2.0), other.frame_at(1.0)]

    for one_index, other_index in ((0, 1), (0, 2)):
        difference = frames[one_index].pixels.astype(float) - frames[other_index].pixels
        assert 1.3 * NOISE_GREYS < difference.std() < 1.5 * NOISE_GREYS


def test_the_handle_takes_its_frames_now(still_source: FrameSource) -> None:
    clock = SimClock()
    handle = ArmCamera(still_source, clock)
    clock.sleep(3.25)

    frame = handle.capture()

    assert frame.stamp_s == 3.25
    assert frame is still_source.frame_at(3.25)


def test_pixels_cannot_be_written(still_source: FrameSource) -> None:
    with pytest.raises(ValueError, match="read-only"):
        still_source.frame_at(1.0).pixels[0, 0] = 0


def test_all_frames_of_the_process_are_counted(source: FrameSource) -> None:
    before = camera.drawn_frame_count()

    source.frame_at(1.0)
    source.frame_at(1.0)

    assert camera.drawn_frame_count() == before + 1


def test_a_closed_camera_gives_no_frames_and_closes_again(source: FrameSource) -> None:
    source.close()
    source.close()

    with pytest.raises(RuntimeError, match="closed"):
        source.frame_at(1.0)


def test_the_robot_believes_its_camera_near_where_it_is(world: LabWorld, still_source: FrameSource) -> None:
    believed_pose = still_source.frame_at(1.0).believed_map_from_camera
    true_pose = world.state(1.0).map_from_camera()
    off_m = float(np.linalg.norm(believed_pose.translation_m - true_pose.translation_m))

    assert 0.001 < off_m < 0.06
    assert np.trace(believed_pose.rotation.T @ true_pose.rotation) > 1 + 2 * np.cos(0.03)


# Effects of light and motion


def test_a_frame_of_a_still_scene_is_one_exposure(world: LabWorld) -> None:
    assert len(exposed_states(world, 1.0)) == 1


def test_turning_blurs_a_frame(world: LabWorld, source: FrameSource) -> None:
    x_m, y_m, heading_rad = world.state(1.0).base
    world.schedule(2.0, [world.moves_to(2.0, Quantity.BASE, (x_m, y_m, heading_rad + 1.0), 1.0)])

    assert len(exposed_states(world, 2.3)) > 2
    assert detail_level(source.frame_at(2.3)) < 0.6 * detail_level(source.frame_at(1.9))


def test_a_lid_that_moves_blurs_only_itself(world: LabWorld, source: FrameSource) -> None:
    frame_before = source.frame_at(1.0)
    world.schedule(2.0, [world.moves_to(2.0, camera_key(), (1.35,), 0.4)])
    frame = source.frame_at(2.2)

    assert {detection.tag_id for detection in detect(frame)} >= {20, 21, 22, 23}
    assert not {24, 25, 26} & {detection.tag_id for detection in detect(frame)}
    difference = np.abs(frame.pixels.astype(float) - frame_before.pixels)[400:, :].mean()
    assert difference < 1.5 * NOISE_GREYS


def test_a_move_slower_than_a_pixel_does_not_blur(world: LabWorld) -> None:
    x_m, y_m, heading_rad = world.state(1.0).base
    world.schedule(2.0, [world.moves_to(2.0, Quantity.BASE, (x_m, y_m + 0.05, heading_rad), 60.0)])

    assert len(exposed_states(world, 32.0)) == 1


def test_every_body_on_a_line_of_sight_through_the_picture_is_drawn(world: LabWorld) -> None:
    stage, random = Stage(), Random(SEED)
    view = camera._View(stage, stage.model.camera(CAMERA_NAME).id)
    spots_px = np.stack(np.meshgrid(np.linspace(0, 639, 65), np.linspace(0, 479, 49)), axis=-1).reshape(-1, 2)
    sight = np.column_stack((spots_px, np.ones(len(spots_px)))) @ np.linalg.inv(INTRINSICS.matrix()).T
    drawn_shares = []

    for at_s in range(60):
        put(
            world, Quantity.BASE, random.uniform(0.8, 5.8), random.uniform(0.8, 5.2), random.uniform(-pi, pi), at_s=at_s
        )
        put(world, Quantity.GAZE, *(random.uniform(0.3, 1.5) for _ in range(6)), at_s=at_s)
        state = world.state(at_s + 0.5)
        stage.place(state)
        view.leave_out_unseen()
        eye = state.map_from_camera()
        met = np.empty(len(sight), dtype=np.int32)
        rays, far = sight @ eye.rotation.T, np.empty(len(sight))
        mujoco.mj_multiRay(
            stage.model, stage.data, eye.translation_m, rays.ravel(), None, True, -1, met, far, None, len(sight), 1e6
        )
        is_drawn = stage.model.geom_group != camera._UNDRAWN_GROUP
        assert is_drawn[met[met >= 0]].all()
        drawn_shares.append(is_drawn.mean())

    assert np.mean(drawn_shares) < 0.6, "most of the room lies beside the picture"


def test_in_the_dark_no_tag_is_detected(world: LabWorld, source: FrameSource) -> None:
    put(world, Quantity.LIGHT, 0.0, at_s=2.0)

    assert {detection.tag_id for detection in detect(source.frame_at(1.0))} >= set(range(20, 28))
    assert detect(source.frame_at(3.0)) == ()
    assert source.frame_at(3.0).pixels.mean() < 5


def test_a_covered_lens_gives_grey_frames_without_detections(world: LabWorld) -> None:
    frame = GreyFrameSource(world).frame_at(1.0)

    assert detect(frame) == ()
    assert frame.stamp_s == 1.0
    assert abs(frame.pixels.mean() - 128) < 1
    assert frame.pixels.std() < 1.2 * NOISE_GREYS


# The camera without pixels and the camera with pixels


def camera_key() -> JointKey:
    return JointKey("pcr_cycler", Part.LID)


def wander(world: LabWorld, steps: int, random: Random) -> list[float]:
    """Let the robot look from near and far, at closed and open lids, with and without its hand in view."""
    instants = []
    for step in range(steps):
        start_s = 10.0 * step
        machine = random.choice(sorted(MACHINES))
        eye = (random.uniform(0.45, 1.5), random.uniform(-0.35, 0.35), random.uniform(0.35, 1.0))
        target = (0.1, random.uniform(-0.2, 0.2), random.uniform(0.1, 0.5))
        place_robot_before(world, machine, (*eye, *target), at_s=start_s)
        set_joint(world, machine, Part.LID, random.uniform(0.0, 1.35), at_s=start_s)
        set_joint(world, machine, Part.LATCH, random.uniform(0.0, 1.0), at_s=start_s)
        set_joint(world, "centrifuge", Part.ROTOR, random.uniform(0.0, 2 * pi), at_s=start_s)
        put(world, Quantity.REACH, random.choice((0.0, 1.0)), at_s=start_s)
        instants.append(start_s + 5.0)
    return instants


def test_detected_tags_are_those_that_geometry_resolves() -> None:
    """Resolved tags are detected, detected tags are in view, and the corners of resolved tags agree with geometry."""
    world, geometry = LabWorld(SEED), GeometricCamera()
    resolved_count = detected_count = 0
    with FrameSource(world) as source:
        for instant_s in wander(world, 60, Random(1)):
            views = {view.tag_id: view for view in geometry.tags_in_view(world.state(instant_s))}
            detections = {detection.tag_id: detection for detection in detect(source.frame_at(instant_s))}
            resolved_ids = {tag_id for tag_id, view in views.items() if view.is_resolved()}

            assert resolved_ids <= set(detections), instant_s
            assert set(detections) <= set(views), instant_s
            for tag_id in resolved_ids:
                offsets_px = detections[tag_id].corners_px - views[tag_id].corners_px
                assert max(hypot(x, y) for x, y in offsets_px) < 1.0, (instant_s, tag_id)
            resolved_count, detected_count = resolved_count + len(resolved_ids), detected_count + len(detections)

    assert resolved_count > 150
    assert resolved_count > 0.6 * detected_count


def test_a_tag_behind_the_fingers_is_covered() -> None:
    world, geometry = LabWorld(SEED), GeometricCamera()
    place_robot_before(world, "pcr_cycler", (0.55, 0.0, 0.40, 0.2, 0.0, 0.15))
    put(world, Quantity.REACH, 1.0, at_s=2.0)

    visible_tag_shares = {view.tag_id: view.covered for view in geometry.tags_in_view(world.state(1.0))}
    covered_shares = {view.tag_id: view.covered for view in geometry.tags_in_view(world.state(3.0))}

    assert visible_tag_shares[22] == 0.0
    assert covered_shares[22] > 0.1
    assert covered_shares[20] == 0.0


def test_while_the_hand_holds_the_lid_of_the_large_machine_hardly_a_tag_is_complete() -> None:
    world, geometry = LabWorld(SEED), GeometricCamera()
    put(world, Quantity.REACH, 1.0)
    for step, angle_rad in enumerate(np.linspace(0.0, 1.35, 8)):
        start_s = 10.0 * step
        place_robot_before(world, "centrifuge", grip_gaze(MACHINES["centrifuge"], Part.LID, angle_rad), at_s=start_s)
        set_joint(world, "centrifuge", Part.LID, float(angle_rad), at_s=start_s)

        views = geometry.tags_in_view(world.state(start_s + 5.0))

        assert sum(view.is_resolved() for view in views) <= 2
