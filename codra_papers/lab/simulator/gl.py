"""The choice of an OpenGL backend that draws frames without a screen, and OpenGL contexts of this backend."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from enum import StrEnum
from typing import Protocol

_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><visual><quality offsamples='0' shadowsize='0'/></visual><worldbody><geom size='1'/></worldbody></mujoco>"
)
with mujoco.Renderer(model, 8, 8) as renderer:
    renderer.update_scene(mujoco.MjData(model))
    renderer.render()
"""
_PROBE_TIMEOUT_S = 60.0

_known_backends: list[str] = []
"""The backend that draws on this computer; the list is empty until this backend is known."""


class Backend(StrEnum):
    """The ways to draw without a screen, the best one first."""

    EGL = "egl"
    OSMESA = "osmesa"


class GraphicsUnavailableError(Exception):
    """This computer cannot draw frames. The message names the packages to install."""


class Context(Protocol):
    """An OpenGL context, which belongs to the thread that made it current."""

    def make_current(self) -> None:
        """Direct this thread's OpenGL calls to this context."""
        ...

    def free(self) -> None:
        """Free the context's memory."""
        ...


def choose_backend() -> str:
    """Return the first backend, "egl" or "osmesa", that draws on this computer.

    The environment variable MUJOCO_GL is set to this backend for later imports of MuJoCo. Each backend is tried in a
    separate process, because a process in which a backend failed cannot try another backend. If MUJOCO_GL is already
    the name of a backend, only this backend is tried. The result is remembered.

    Raises:
        GraphicsUnavailableError: no backend draws.
    """
    if not _known_backends:
        use_backend(_first_working_backend())
    return _known_backends[0]


def use_backend(backend: str) -> None:
    """Let `choose_backend` return this backend without a trial, because it drew in another process of this program."""
    os.environ["MUJOCO_GL"] = backend
    _known_backends[:] = [backend]


def _first_working_backend() -> str:
    """Return the first backend that draws on this computer."""
    requested_name = os.environ.get("MUJOCO_GL", "").strip().lower()
    candidates = [backend for backend in Backend if backend == requested_name] or list(Backend)
    failures: list[str] = []
    for backend in candidates:
        failure = _failure_of(backend)
        if failure is None:
            return backend.value
        failures.append(f"{backend.value}: {failure}")
    raise GraphicsUnavailableError(
        "no OpenGL that draws without a screen was found; install one with"
        " 'apt-get install libosmesa6' or 'apt-get install libegl1 libgl1-mesa-dri'"
        f" ({'; '.join(failures)})"
    )


def make_context(backend: str, width: int, height: int) -> Context:
    """Return a new context for images of this size. MuJoCo may have been imported before the backend was chosen.

    Unless LP_NUM_THREADS is set, Mesa's software renderer draws in the calling thread. The images are small, so more
    threads would only take cores from other processes.
    """
    os.environ.setdefault("LP_NUM_THREADS", "0")
    context: Context = importlib.import_module(f"mujoco.{Backend(backend)}").GLContext(width, height)
    return context


def _failure_of(backend: Backend) -> str | None:
    """Return, in one line, why a backend does not draw on this computer, or None if it draws."""
    environment = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
    environment["MUJOCO_GL"] = backend.value
    command = [sys.executable, "-c", _PROBE]
    try:
        probe = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=_PROBE_TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        return f"no frame after {_PROBE_TIMEOUT_S:g} s"
    if probe.returncode == 0:
        return None
    lines = [line.strip() for line in probe.stderr.splitlines() if line.strip() and "ignored" not in line]
    return lines[-1] if lines else f"the trial ended with code {probe.returncode}"
