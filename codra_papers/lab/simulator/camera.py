"""The arm camera: its frame at any instant, which one thread draws for all callers.

A frame is a function of the world's state within the exposure and of (the world's seed, the camera, the instant). It
shows the blur by motion within the exposure, the room's light, the blur of the lens, and noise.
"""

from __future__ import annotations

import atexit
import os
from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import fields
from functools import cache, lru_cache
from math import ceil, radians, tan
from operator import attrgetter
from random import Random
from threading import Lock
from typing import Any, ClassVar, Protocol

import cv2
import mujoco
import numpy as np
from numpy.random import default_rng
from numpy.typing import NDArray

from codra_papers.lab.perception.frame import Frame
from codra_papers.lab.perception.layout import INTRINSICS
from codra_papers.lab.perception.poses import Pose, rotation_about
from codra_papers.lab.perception.processing import Computer
from codra_papers.lab.simulator import gl
from codra_papers.lab.simulator.geometric_camera import image_motion_px
from codra_papers.lab.simulator.laboratory import Laboratory
from codra_papers.lab.simulator.scene import CAMERA_NAME, Stage
from codra_papers.lab.simulator.world import LabState, LabWorld

EXPOSURE_S = 0.012
"""How long the shutter is open. The stamp of a frame is the end of this time."""

LENS_BLUR_PX = 0.7

_SHARP_BELOW_PX = 0.2
"""If the motion within the exposure is smaller than this, the frame is as sharp as a frame of a still scene."""

_SUBFRAMES = 6
"""The largest number of instants of an exposure that are averaged for one frame."""

_TOUCH_TOLERANCE_M = 1e-6
_RADIUS_FACTOR = 1.001
_UNDRAWN_GROUP = 2
"""The number of a group of geoms that no drawing option shows."""

_FRAME_CACHE_SIZE = 32
_NOISE_BANK_PX = 1024
_UNDRAWN_FEATURES = (
    mujoco.mjtRndFlag.mjRND_SHADOW,
    mujoco.mjtRndFlag.mjRND_REFLECTION,
    mujoco.mjtRndFlag.mjRND_SKYBOX,
)
"""Features that MuJoCo draws by default. With them, drawing costs three times as much, and shadows disturb the poses of
tags."""

_INVISIBLE_FIELDS = frozenset({"t_s", "light", "is_localized", "laboratory"})
"""The fields of a state that do not affect a picture of the room in ordinary light."""

_read_visible_fields = attrgetter(*(field.name for field in fields(LabState) if field.name not in _INVISIBLE_FIELDS))
"""Returns all values of a state that a picture of the room shows."""

Pixels = NDArray[np.uint8]

_start_lock = Lock()
"""Held while the drawing thread starts: `cache` alone would let two threads start it twice."""


class ReadableClock(Protocol):
    """A clock that can be read."""

    def now_s(self) -> float:
        """Return the current time in seconds."""
        ...


class FramesByInstant(Protocol):
    """A source that has a frame for every instant, and a computer that processes the frames.

    Attributes:
        computer: the computer that processes the frames.
    """

    computer: Computer

    def frame_at(self, instant_s: float) -> Frame:
        """Return the frame whose exposure ends at an instant."""
        ...


def drawn_frame_count() -> int:
    """Return how many frames of the laboratory this process has drawn."""
    return _Renderer.frames_of_process


class ArmCamera:
    """The handle that perception functions get as `camera`: it takes frames at the clock's current time."""

    def __init__(self, frames: FramesByInstant, clock: ReadableClock) -> None:
        self._frames = frames
        self._clock = clock

    def capture(self) -> Frame:
        """Take a frame now."""
        return self._frames.frame_at(self._clock.now_s())

    def processing_s(self, mean_s: float) -> float:
        """Return the duration of work that the camera's computer begins now, given the mean duration of such work."""
        return self._frames.computer.processing_s(self._clock.now_s(), mean_s)


class FrameSource:
    """The arm camera of one world. Close it, or use it in a `with` statement.

    Attributes:
        computer: the computer that processes the frames.
        rendered: how many frames this source has drawn.
    """

    def __init__(self, world: LabWorld) -> None:
        """Create a renderer in the drawing thread.

        Raises:
            GraphicsUnavailableError: no backend on this computer can draw without a screen.
        """
        self.computer = Computer(world.seed)
        self._world = world
        self._optics = _Optics(world)
        self._frames: OrderedDict[float, Future[Frame]] = OrderedDict()
        self._lock = Lock()
        self._is_closed = False
        self._thread = _drawing_thread()
        self._renderer = self._thread.submit(_Renderer, world.laboratory).result()
        self.rendered = 0

    def __enter__(self) -> FrameSource:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the resources of the renderer. Repeated calls do nothing."""
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            release = self._thread.submit(self._renderer.free)
        release.result()

    def frame_at(self, instant_s: float) -> Frame:
        """Return the frame whose exposure ends at an instant. The frame is drawn in the first call for this instant.

        Raises:
            RuntimeError: the source is closed.
        """
        with self._lock:
            if self._is_closed:
                raise RuntimeError("the camera is closed")
            drawn_frame = self._frames.get(instant_s)
            if drawn_frame is None:
                drawn_frame = self._thread.submit(self._draw, instant_s)
                self._frames[instant_s] = drawn_frame
                if len(self._frames) > _FRAME_CACHE_SIZE:
                    self._frames.popitem(last=False)
        return drawn_frame.result()

    def _draw(self, instant_s: float) -> Frame:
        states = exposed_states(self._world, instant_s)
        picture = self._renderer.expose(states)
        self.rendered += 1
        _Renderer.count_frame()
        return self._optics.frame(picture, states[-1])


class GreyFrameSource:
    """A camera whose lens is covered by grey foil: its frames have the same instants and poses, but show nothing.

    Attributes:
        computer: the computer that processes the frames.
    """

    def __init__(self, world: LabWorld) -> None:
        self.computer = Computer(world.seed)
        self._world = world
        self._optics = _Optics(world)
        self._grey_picture = np.full((INTRINSICS.height, INTRINSICS.width, 3), 128, dtype=np.uint8)

    def frame_at(self, instant_s: float) -> Frame:
        """Return the grey frame of an instant."""
        return self._optics.frame(self._grey_picture, self._world.state(instant_s))


def exposed_states(world: LabWorld, instant_s: float) -> list[LabState]:
    """Return the states of the world whose pictures are averaged for a frame.

    If the image is still, this is one state; otherwise about one state per pixel of motion, but at most `_SUBFRAMES`.
    """
    end = world.state(instant_s)
    if not world.moves_within(instant_s - EXPOSURE_S, instant_s):
        return [end]
    motion_px = image_motion_px(world.state(instant_s - EXPOSURE_S), end)
    if motion_px < _SHARP_BELOW_PX:
        return [end]
    steps = min(_SUBFRAMES, ceil(motion_px) + 1)
    return [world.state(instant_s - EXPOSURE_S * step / (steps - 1)) for step in reversed(range(steps))]


def _drawing_thread() -> ThreadPoolExecutor:
    """Return the thread that draws the frames of all sources of this process, with the OpenGL context that they share.

    Mesa translates its shaders again for each context, which takes as long as drawing twenty frames.

    Raises:
        GraphicsUnavailableError: no backend on this computer can draw without a screen.
    """
    with _start_lock:
        return _start_drawing_thread()


@cache
def _start_drawing_thread() -> ThreadPoolExecutor:
    backend = gl.choose_backend()
    thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="codra-camera")
    context = thread.submit(gl.make_context, backend, INTRINSICS.width, INTRINSICS.height).result()
    thread.submit(context.make_current).result()
    atexit.register(context.free)
    return thread


def _forget_drawing_thread() -> None:
    """Let a child process start a thread of its own: it does not have the thread of its parent."""
    _start_drawing_thread.cache_clear()
    _start_lock.release()


os.register_at_fork(
    before=_start_lock.acquire, after_in_parent=_start_lock.release, after_in_child=_forget_drawing_thread
)


class _Renderer:
    """A MuJoCo renderer. It belongs to the drawing thread, in which it was created."""

    frames_of_process: ClassVar[int] = 0
    _count_lock: ClassVar[Lock] = Lock()

    @classmethod
    def count_frame(cls) -> None:
        """Count one more frame of this process, over all sources."""
        with cls._count_lock:
            cls.frames_of_process += 1

    def __init__(self, laboratory: Laboratory) -> None:
        self._stage = Stage(laboratory)
        self._context = mujoco.MjrContext(self._stage.model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        self._scene = mujoco.MjvScene(self._stage.model, maxgeom=500)
        for flag in _UNDRAWN_FEATURES:
            self._scene.flags[flag] = 0
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = self._stage.model.camera(CAMERA_NAME).id
        self._rectangle = mujoco.MjrRect(0, 0, INTRINSICS.width, INTRINSICS.height)
        self._contents_option, self._room_option = _drawing_order(self._stage)
        self._view = _View(self._stage, self._camera.fixedcamid)
        self._perturbation = mujoco.MjvPerturb()
        self._upside_down = np.empty((INTRINSICS.height, INTRINSICS.width, 3), dtype=np.uint8)
        self._still_values: tuple[Any, ...] = ()
        self._still_picture: Pixels = self._upside_down

    def expose(self, states: Sequence[LabState]) -> Pixels:
        """Return the average picture of the room in some states, in ordinary light and through a perfect lens.

        The picture of a single state is kept, and returned again if the next single state looks the same.
        """
        if len(states) > 1:
            return _average([self._draw(state) for state in states])
        visible_values: tuple[Any, ...] = _read_visible_fields(states[0])
        if visible_values != self._still_values:
            self._still_picture, self._still_values = self._draw(states[0]), visible_values
        return self._still_picture

    def _draw(self, state: LabState) -> Pixels:
        self._stage.place(state)
        self._view.leave_out_unseen()
        model, data, everything = self._stage.model, self._stage.data, mujoco.mjtCatBit.mjCAT_ALL.value
        mujoco.mjv_updateScene(
            model, data, self._contents_option, self._perturbation, self._camera, everything, self._scene
        )
        mujoco.mjv_addGeoms(model, data, self._room_option, self._perturbation, everything, self._scene)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        mujoco.mjr_readPixels(self._upside_down, None, self._rectangle, self._context)
        return np.asarray(cv2.flip(self._upside_down, 0), dtype=np.uint8)

    def free(self) -> None:
        """Free all resources. Call this method in the drawing thread."""
        self._context.free()


class _View:
    """The view frustum of the camera. Geoms outside it need not be drawn."""

    def __init__(self, stage: Stage, camera: int) -> None:
        model, data = stage.model, stage.data
        half_height = tan(radians(float(model.cam_fovy[camera])) / 2)
        half_width = half_height * INTRINSICS.width / INTRINSICS.height
        sides = np.array(
            [
                [1.0, 0.0, half_width],
                [-1.0, 0.0, half_width],
                [0.0, 1.0, half_height],
                [0.0, -1.0, half_height],
                [0.0, 0.0, 1.0],
            ]
        )
        self._sides = sides / np.linalg.norm(sides, axis=1, keepdims=True)
        self._current_groups, self._own_groups = model.geom_group, model.geom_group.copy()
        self._radii_m = np.where(
            model.geom_rbound > 0.0, model.geom_rbound * _RADIUS_FACTOR + _TOUCH_TOLERANCE_M, np.inf
        )
        self._middles_m, self._eye_m = data.geom_xpos, data.cam_xpos[camera]
        self._map_from_eye = data.cam_xmat[camera].reshape(3, 3)

    def leave_out_unseen(self) -> None:
        """Move geoms completely outside the picture to a group that is not drawn, and the others to their own group."""
        map_from_eye = self._map_from_eye
        # The camera looks along -z of its own frame.
        distances_m = (self._middles_m - self._eye_m) @ (map_from_eye @ self._sides.T)
        self._current_groups[:] = np.where(
            (distances_m > self._radii_m[:, None]).any(axis=1), _UNDRAWN_GROUP, self._own_groups
        )


class _Optics:
    """The steps from the room to a frame: light, lens, sensor, and the believed pose of the camera."""

    def __init__(self, world: LabWorld) -> None:
        self._world = world
        self._brightening_noise, self._darkening_noise = _noise_banks(world.laboratory.noise_greys)
        self._mounting = _mounting_error(world.seed)
        self._last_picture: Pixels | None = None
        self._last_light = 0.0
        self._last_image: Pixels = self._brightening_noise

    def frame(self, picture: Pixels, state: LabState) -> Frame:
        """Return the frame that the sensor makes of the room, given a picture of the room in ordinary light.

        Args:
            picture: the pixels, shape (height, width, 3). The caller must not change them afterwards.
            state: the state at the exposure's end.
        """
        noise_place = self._noise_place(state.t_s)
        brighter = cv2.add(
            self._image_behind_lens(picture, max(state.light, 0.0)), self._brightening_noise[noise_place]
        )
        pixels = np.asarray(cv2.subtract(brighter, self._darkening_noise[noise_place], dst=brighter), dtype=np.uint8)
        pixels.setflags(write=False)
        believed_pose = self._world.believed_map_from_robot(state.t_s) @ state.robot_from_camera() @ self._mounting
        return Frame(pixels=pixels, intrinsics=INTRINSICS, believed_map_from_camera=believed_pose, stamp_s=state.t_s)

    def _image_behind_lens(self, picture: Pixels, light: float) -> Pixels:
        """Return the image on the sensor. If picture and light are those of the last call, return the last image."""
        if picture is not self._last_picture or light != self._last_light:
            lit_image = picture if light == 1.0 else cv2.convertScaleAbs(picture, alpha=light)
            self._last_image = np.asarray(cv2.GaussianBlur(lit_image, (0, 0), LENS_BLUR_PX), dtype=np.uint8)
            self._last_picture, self._last_light = picture, light
        return self._last_image

    def _noise_place(self, instant_s: float) -> tuple[slice, slice]:
        """Return the rows and columns of the noise bank that (seed, camera, instant) determine."""
        random = Random(f"{self._world.seed} {CAMERA_NAME} {instant_s!r}")
        top = random.randrange(_NOISE_BANK_PX - INTRINSICS.height)
        left = random.randrange(_NOISE_BANK_PX - INTRINSICS.width)
        return slice(top, top + INTRINSICS.height), slice(left, left + INTRINSICS.width)


@lru_cache(maxsize=2)
def _noise_banks(noise_greys: float) -> tuple[Pixels, Pixels]:
    """Return the noise that brightens pixels and the noise that darkens pixels."""
    bank = default_rng(7).normal(0.0, noise_greys, (_NOISE_BANK_PX, _NOISE_BANK_PX, 3))
    noise = np.round(bank)
    brightening, darkening = (np.clip(side, 0, 255).astype(np.uint8) for side in (noise, -noise))
    for shared_bank in (brightening, darkening):
        shared_bank.setflags(write=False)
    return brightening, darkening


def _drawing_order(stage: Stage) -> tuple[mujoco.MjvOption, mujoco.MjvOption]:
    """Return two drawing options: one shows the contents of the room, the other the room itself.

    Draw the room last: OpenGL skips fragments behind geoms that are already drawn, and the floor and the walls lie
    behind everything. Fixed geoms that touch the floor also belong to the room, so that geoms which touch each other
    are drawn in the order of the model.
    """
    mujoco.mj_kinematics(stage.model, stage.data)
    is_fixed = (stage.model.body_weldid == 0) & (stage.model.body_mocapid < 0)
    reach_down_m = (np.abs(stage.data.geom_xmat[:, 6:9]) * stage.model.geom_size).sum(axis=1)
    is_room = is_fixed[stage.model.geom_bodyid] & (stage.data.geom_xpos[:, 2] - reach_down_m <= _TOUCH_TOLERANCE_M)
    stage.model.geom_group[:] = is_room
    options = mujoco.MjvOption(), mujoco.MjvOption()
    for group, option in enumerate(options):
        option.geomgroup[:] = [index == group for index in range(mujoco.mjNGROUP)]
    return options


def _average(pictures: list[Pixels]) -> Pixels:
    if len(pictures) == 1:
        return pictures[0]
    if len(pictures) == 2:
        return np.asarray(cv2.addWeighted(pictures[0], 0.5, pictures[1], 0.5, 0.0), dtype=np.uint8)
    total = np.zeros(pictures[0].shape, dtype=np.float32)
    for picture in pictures:
        cv2.accumulate(picture, total)
    return np.asarray(cv2.convertScaleAbs(total, alpha=1 / len(pictures)), dtype=np.uint8)


def _mounting_error(seed: int) -> Pose:
    """Return the calibration error of the camera's mounting on the arm: a few millimetres and milliradians."""
    random = Random(f"{seed} mounting")
    axis = (random.gauss(0.0, 1.0), random.gauss(0.0, 1.0), random.gauss(0.0, 1.0))
    offset_m = np.array([random.gauss(0.0, 0.002) for _ in range(3)])
    return Pose(rotation_about(axis, random.gauss(0.0, 0.003)), offset_m)
