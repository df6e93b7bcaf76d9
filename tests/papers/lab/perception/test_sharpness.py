"""The sharpness of painted walls, and that of drawn frames, which is compared with the tags that are detected."""

from __future__ import annotations

from math import cos, pi, radians, sin
from random import Random

import cv2
import numpy as np
import pytest

from codra_papers.lab.perception.layout import MACHINES, Part
from codra_papers.lab.perception.poses import Array
from codra_papers.lab.perception.sharpness import _modulo_pi, _percentile, sharpness
from codra_papers.lab.perception.tags import detect
from codra_papers.lab.simulator.camera import FrameSource, GreyFrameSource
from codra_papers.lab.simulator.geometric_camera import GeometricCamera
from codra_papers.lab.simulator.world import LabWorld, Quantity
from tests.papers.lab.perception.painted import cluttered_wall, frame_of, painted
from tests.papers.lab.perception.placing import place_robot_before, put, set_joint

ENOUGH_SHARPNESS = 0.5
"""The threshold in the `accept_when` of the spec."""


def chance(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def sharpness_of(picture: Array, *, noise: float = 2.0) -> float:
    return sharpness(frame_of(painted([], random=chance(), background=picture, noise=noise)))


def moved(picture: Array, length_px: float, direction_rad: float) -> Array:
    """Return the picture of a camera that turns while its shutter is open."""
    steps = np.linspace(-length_px / 2, length_px / 2, 4 * int(length_px) + 1)
    shifts = [np.array([[1, 0, step * cos(direction_rad)], [0, 1, step * sin(direction_rad)]]) for step in steps]
    exposures = [cv2.warpAffine(picture, shift, (640, 480), borderMode=cv2.BORDER_REFLECT) for shift in shifts]
    return np.asarray(np.mean(exposures, axis=0))


# Painted walls


@pytest.mark.parametrize("grey", [0.0, 60.0, 128.0, 255.0])
@pytest.mark.parametrize("noise", [0.0, 2.0, 6.0])
def test_a_frame_without_contrast_has_no_sharpness(grey: float, noise: float) -> None:
    assert sharpness_of(np.full((480, 640), grey), noise=noise) == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_a_sharp_wall_without_any_tag_is_sharp(seed: int) -> None:
    assert sharpness_of(cluttered_wall(chance(seed))) > 0.6


@pytest.mark.parametrize("direction_rad", [step * pi / 8 for step in range(8)])
def test_a_motion_in_any_direction_shows(direction_rad: float) -> None:
    wall = cluttered_wall(chance())
    qualities = [sharpness_of(moved(wall, length_px, direction_rad)) for length_px in (1.0, 4.0, 8.0, 12.0)]

    assert qualities[0] > ENOUGH_SHARPNESS
    assert qualities[0] > qualities[1] > qualities[2]
    assert qualities[2] < ENOUGH_SHARPNESS
    assert qualities[3] < ENOUGH_SHARPNESS


@pytest.mark.parametrize("direction_degrees", [0, 2, 20, 45, 90, 132])
def test_sharp_streaks_of_a_motion_over_a_speckled_floor_do_not_count_as_sharpness(
    direction_degrees: int,
) -> None:
    speckles = cv2.GaussianBlur(chance().normal(150.0, 37.0, (480, 640)), (0, 0), 0.7)

    assert sharpness_of(speckles) > 0.7
    for length_px in (8.0, 12.0, 20.0):
        assert sharpness_of(moved(speckles, length_px, radians(direction_degrees))) < ENOUGH_SHARPNESS


def test_a_lens_out_of_focus_shows() -> None:
    assert sharpness_of(cv2.GaussianBlur(cluttered_wall(chance()), (0, 0), 2.5)) < ENOUGH_SHARPNESS


def test_a_dark_frame_shows_less_and_less() -> None:
    wall = cluttered_wall(chance())
    day, dusk, evening, night = (sharpness_of(wall * light) for light in (1.0, 0.2, 0.1, 0.03))

    assert day > dusk > evening >= night
    assert evening < ENOUGH_SHARPNESS < day
    assert night < 0.1


def test_noise_that_hides_a_tag_lowers_it() -> None:
    wall = cluttered_wall(chance())

    assert sharpness_of(wall, noise=20.0) < ENOUGH_SHARPNESS < sharpness_of(wall, noise=3.0)


def test_a_frame_that_is_mostly_too_bright_shows_little() -> None:
    assert sharpness_of(cluttered_wall(chance(), brightness=250.0, contrast=60.0)) < ENOUGH_SHARPNESS


def test_stripes_in_one_direction_do_not_show_a_motion_along_them() -> None:
    stripes = np.tile(np.where(np.arange(640) // 20 % 2, 60.0, 180.0), (480, 1))

    assert sharpness_of(stripes) == 0.0


# Drawn frames


def look_around(world: LabWorld, count: int, random: Random) -> list[float]:
    """Let the robot look at machines and past them, by day and in dim light, at rest and while it turns."""
    instants_s = []
    for start_s in (10.0 * step for step in range(count)):
        machine = random.choice(sorted(MACHINES))
        looks_past = random.random() < 0.3
        target = (random.uniform(1.5, 3.0), random.uniform(-2.0, 2.0), 0.3) if looks_past else (0.1, 0.0, 0.3)
        eye = (random.uniform(0.6, 1.4), random.uniform(-0.3, 0.3), random.uniform(0.5, 1.0))
        place_robot_before(world, machine, (*eye, *target), at_s=start_s)
        set_joint(world, machine, Part.LID, random.choice((0.0, 1.35)), at_s=start_s)
        put(world, Quantity.LIGHT, random.choice((1.0, random.uniform(0.05, 1.0))), at_s=start_s)
        x_m, y_m, heading_rad = world.state(start_s + 1.0).base
        turned_rad = random.choice((0.0, random.uniform(-0.8, 0.8)))
        turn = world.moves_to(start_s + 1.0, Quantity.BASE, (x_m, y_m, heading_rad + turned_rad), 1.0)
        world.schedule(start_s + 1.0, [turn])
        instants_s.append(start_s + 1.5)
    return instants_s


def test_in_a_sharp_frame_every_complete_tag_is_detected() -> None:
    """The spec relies on this: above the threshold, an undetected tag is absent; below it, the tag may be there."""
    world, geometry = LabWorld(1), GeometricCamera()
    is_detected: dict[bool, list[bool]] = {True: [], False: []}
    with FrameSource(world) as source:
        for instant_s in look_around(world, 150, Random(4)):
            frame = source.frame_at(instant_s)
            detected_ids = {detection.tag_id for detection in detect(frame)}
            views = geometry.tags_in_view(world.state(instant_s))
            is_detected[sharpness(frame) >= ENOUGH_SHARPNESS] += [
                view.tag_id in detected_ids for view in views if view.is_resolved()
            ]

    assert len(is_detected[True]) > 150
    assert np.mean(is_detected[True]) >= 0.99
    assert len(is_detected[False]) > 50
    assert np.mean(is_detected[False]) < 0.9


def test_still_frames_in_daylight_are_sharp_enough_with_and_without_a_machine_in_view() -> None:
    world, random = LabWorld(1), Random(2)
    with FrameSource(world) as source:
        qualities = []
        for start_s in (10.0 * step for step in range(40)):
            target = (random.choice((0.1, random.uniform(1.5, 3.0))), random.uniform(-1.0, 1.0), 0.3)
            place_robot_before(world, random.choice(sorted(MACHINES)), (1.1, 0.0, 0.8, *target), at_s=start_s)
            qualities.append(sharpness(source.frame_at(start_s + 1.0)))

    assert np.mean(np.array(qualities) >= ENOUGH_SHARPNESS) >= 0.95


def test_a_percentile_equals_that_of_numpy() -> None:
    random = np.random.default_rng(4)
    for count in (1, 2, 3, 40, 41, 1000):
        values = random.normal(100.0, 30.0, count).astype(np.float32)
        for percent in (0, 10, 25, 50, 95, 100):
            assert _percentile(values, percent) == float(np.percentile(values, percent))


def test_an_angle_modulo_half_a_turn_equals_that_of_numpy() -> None:
    half_turn = np.float32(pi)
    edges = np.array([-2, -1.5, -1, -0.5, -0.0, 0, 0.5, 1, 1.5], dtype=np.float32) * half_turn
    angles_rad = np.random.default_rng(5).uniform(-2 * half_turn, 2 * half_turn, 10_000).astype(np.float32)
    angles_rad = np.concatenate((angles_rad, edges, np.nextafter(edges, half_turn), np.nextafter(edges, -half_turn)))
    angles_rad = angles_rad[np.abs(angles_rad) < 2 * half_turn]

    folded_rad = _modulo_pi(angles_rad)

    assert folded_rad.dtype == np.float32
    assert np.array_equal(folded_rad, np.mod(angles_rad, half_turn))


def test_a_covered_lens_has_no_sharpness() -> None:
    assert sharpness(GreyFrameSource(LabWorld(1)).frame_at(1.0)) == 0.0
