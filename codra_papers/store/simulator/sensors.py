"""The robot's sensor values at an instant: a function of the seed, the sensor and the state only."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, lru_cache
from math import atan2, hypot, pi, radians, sin
from random import Random

import numpy as np
from numpy.random import default_rng

from codra_papers.store.body import (
    CAMERA_FARTHEST_M,
    CAMERA_NEAREST_M,
    CAMERA_POSE,
    CAMERA_VIEW_RAD,
    LASER_POSES,
    STEADY_BELOW_RAD_S,
    ObjectKind,
    Picture,
    Scan,
    Side,
    Sighting,
)
from codra_papers.store.geometry import Box, Disc, Point, Pose2D, Scene, wrapped
from codra_papers.store.simulator.people import PERSON_RADIUS_M
from codra_papers.store.simulator.state import SHELL, Container, StoreState

LASER_FARTHEST_M = 10.0
LASER_NOISE_M = 0.01
LASER_RAYS = {Side.FRONT_LEFT: 96, Side.FRONT_RIGHT: 96, Side.BACK: 191}
"""Numbers of rays: in front one every two degrees, and behind one every degree, because this laser must see wheels."""

LASER_VIEW_RAD = radians(190.0)
_BEARINGS_RAD = {side: np.linspace(-LASER_VIEW_RAD / 2, LASER_VIEW_RAD / 2, rays) for side, rays in LASER_RAYS.items()}

SMALLEST_VISIBLE_SHARE = 0.35
"""Objects with a smaller share in sight are never recognised."""

RAYS_PER_OBJECT = 9

LOCALISATION_WAVE_M = 0.015
"""Amplitude of each of the two slow waves of the localisation's error, along each axis."""


def scan(seed: int, state: StoreState, side: Side) -> Scan:
    """Return one scan of a laser: the lengths of the laser's rays, with noise of a centimetre."""
    mount = LASER_POSES[side]
    eye = Pose2D(*state.robot.at.point_at(mount.x_m, mount.y_m), state.robot.at.heading_rad + mount.heading_rad)
    rays, bearings = LASER_RAYS[side], _BEARINGS_RAD[side]
    obstacles = _obstacles(state.people_m, state.containers_on_floor(), sees_wheels=side is Side.BACK)
    ranges = obstacles.ranges_m(eye.point_m, bearings + eye.heading_rad, LASER_FARTHEST_M)
    entropy = (abs(seed), list(Side).index(side), state.step)
    random = default_rng(entropy if seed >= 0 else (*entropy, 1))  # `default_rng` takes no negative numbers
    noise = random.normal(0.0, LASER_NOISE_M, rays)
    noisy_ranges = np.where(ranges < LASER_FARTHEST_M, np.clip(ranges + noise, 0.0, LASER_FARTHEST_M), LASER_FARTHEST_M)
    return Scan(
        instant_s=state.instant_s,
        mount=mount,
        bearings_rad=bearings,
        ranges_m=noisy_ranges,
        farthest_m=LASER_FARTHEST_M,
    )


def picture(seed: int, state: StoreState) -> Picture:
    """Return the detections in the camera's picture, with noise. Far and half hidden objects are missed most often."""
    is_steady = abs(state.robot.turn_rate_rad_s) < STEADY_BELOW_RAD_S
    sightings = tuple(_sightings(seed, state)) if is_steady else ()
    return Picture(instant_s=state.instant_s, is_steady=is_steady, sightings=sightings)


def visible_share(state: StoreState, shape: Box | Disc) -> float:
    """Return the share of an object's breadth that is inside the camera's view and not hidden."""
    eye = _camera_pose(state)
    centre = shape.centre_m if isinstance(shape, Disc) else shape.centre.point_m
    if not CAMERA_NEAREST_M < hypot(centre[0] - eye.x_m, centre[1] - eye.y_m) < CAMERA_FARTHEST_M:
        return 0.0
    bearings = np.array(_bearings(eye, shape))
    is_inside = np.abs(bearings) <= CAMERA_VIEW_RAD / 2
    rays = bearings + eye.heading_rad
    own_scene = Scene((), (shape,)) if isinstance(shape, Disc) else Scene((shape,))
    own_ranges_m = own_scene.ranges_m(eye.point_m, rays, CAMERA_FARTHEST_M + 1.0)
    others_m = _other_objects(state, shape).ranges_m(eye.point_m, rays, CAMERA_FARTHEST_M + 2.0)
    return float((is_inside & (own_ranges_m < others_m)).mean())


def believed_pose(seed: int, state: StoreState) -> Pose2D:
    """Return the pose from the localisation: slow waves of some centimetres around the truth."""
    at, waves = state.robot.at, _waves(seed)
    x_m, y_m, turn_rad = (
        sum(size * sin(2 * pi * state.instant_s / period + phase) for period, phase, size in axis) for axis in waves
    )
    return Pose2D(at.x_m + x_m, at.y_m + y_m, wrapped(at.heading_rad + turn_rad))


@cache
def _waves(seed: int) -> list[list[tuple[float, float, float]]]:
    random = Random(f"{seed} localisation")
    sizes = (LOCALISATION_WAVE_M, LOCALISATION_WAVE_M, 0.005)
    return [[(random.uniform(60.0, 400.0), random.uniform(0.0, 2 * pi), size) for _ in range(2)] for size in sizes]


@lru_cache(maxsize=2)
def _obstacles(
    people_m: tuple[tuple[str, Point], ...], containers: tuple[Container, ...], *, sees_wheels: bool
) -> Scene:
    """Return the obstacles of a laser: shelves, walls, people, and the frames or the wheels of containers."""
    discs = [Disc(at_m, PERSON_RADIUS_M) for _, at_m in people_m]
    if not sees_wheels:
        return SHELL.with_obstacles([container.box() for container in containers], discs)
    return SHELL.with_obstacles([], [*discs, *(wheel for container in containers for wheel in container.wheels())])


def _camera_pose(state: StoreState) -> Pose2D:
    at = state.robot.at
    return Pose2D(*at.point_at(CAMERA_POSE.x_m, CAMERA_POSE.y_m), at.heading_rad)


def _bearings(eye: Pose2D, shape: Box | Disc) -> list[float]:
    """Return directions, relative to the eye's heading, that divide the breadth of an object evenly."""
    if isinstance(shape, Disc):
        ahead_m, left_m = eye.relative_point(shape.centre_m)
        middle, half = atan2(left_m, ahead_m), atan2(shape.radius_m, hypot(ahead_m, left_m))
        low, high = middle - half, middle + half
    else:
        middle = atan2(*reversed(eye.relative_point(shape.centre.point_m)))
        offsets = [wrapped(atan2(*reversed(eye.relative_point(corner))) - middle) for corner in shape.corners()]
        low, high = middle + min(offsets), middle + max(offsets)
    return [low + (high - low) * (index + 0.5) / RAYS_PER_OBJECT for index in range(RAYS_PER_OBJECT)]


def _other_objects(state: StoreState, shape: Box | Disc) -> Scene:
    boxes = [box for box in (container.box() for container in state.containers_on_floor()) if box != shape]
    discs = [disc for disc in (Disc(at_m, PERSON_RADIUS_M) for _, at_m in state.people_m) if disc != shape]
    return SHELL.with_obstacles(boxes, discs)


def _sightings(seed: int, state: StoreState) -> Iterator[Sighting]:
    objects: list[tuple[ObjectKind, str, Pose2D, Box | Disc]]
    objects = [(ObjectKind.PERSON, name, Pose2D(*at_m), Disc(at_m, PERSON_RADIUS_M)) for name, at_m in state.people_m]
    objects += [
        (ObjectKind.CONTAINER, container.name, container.at, container.box())
        for container in state.containers_on_floor()
    ]
    for kind, name, at, shape in objects:
        share = visible_share(state, shape)
        if share >= SMALLEST_VISIBLE_SHARE:
            random = Random(f"{seed} camera {state.step} {name}")
            yield from _detections(random, kind, _relative_pose(state.robot.at, at), share)


def _relative_pose(robot: Pose2D, at: Pose2D) -> Pose2D:
    return Pose2D(*robot.relative_point(at.point_m), wrapped(at.heading_rad - robot.heading_rad))


def _detections(random: Random, kind: ObjectKind, at: Pose2D, share: float) -> Iterator[Sighting]:
    """Yield the sighting of an object, or nothing if it is missed. Far and hidden objects are missed more often.

    Args:
        random: the random source for this object in this picture.
        kind: the kind of the object.
        at: the true pose of the object in the robot's frame.
        share: the share of the object that is in sight.
    """
    range_m = hypot(at.x_m, at.y_m)
    if random.random() < 0.03 + 0.25 * (range_m / CAMERA_FARTHEST_M) ** 2 + 0.3 * (1.0 - share):
        return
    spread_m = 0.01 + 0.003 * range_m**2
    x_m, y_m = random.gauss(at.x_m, spread_m), random.gauss(at.y_m, spread_m)
    facing_rad = wrapped(random.gauss(at.heading_rad, 0.03 + 0.01 * range_m))
    yield Sighting(kind=kind, at=Pose2D(x_m, y_m, 0.0 if kind is ObjectKind.PERSON else facing_rad), share=share)
