"""Which OpenGL draws frames without a screen, and a context of it."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from enum import StrEnum
from typing import Protocol

_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
with mujoco.Renderer(model, 8, 8) as renderer:
    renderer.update_scene(mujoco.MjData(model))
    renderer.render()
"""
_PROBE_TIMEOUT_S = 60.0

_known: list[str] = []
"""What is known to draw here, once it is."""


class Backend(StrEnum):
    """The ways to draw without a screen, best first."""

    EGL = "egl"
    OSMESA = "osmesa"


class GraphicsUnavailableError(Exception):
    """This machine cannot draw frames; the message names what to install."""


class Context(Protocol):
    """An OpenGL context. It belongs to the thread that made it current."""

    def make_current(self) -> None:
        """Let this thread's OpenGL calls go here."""
        ...

    def free(self) -> None:
        """Give the context's memory back."""
        ...


def choose_backend() -> str:
    """Return "egl" or "osmesa", whichever draws here, and set MUJOCO_GL to it for whoever imports MuJoCo later.

    Each is tried in a process of its own, as a failed attempt spoils the process it is made in. If MUJOCO_GL names one
    of them already, only that one is tried. What drew once is not tried again.

    Raises:
        GraphicsUnavailableError: none of them draws.
    """
    if not _known:
        rely_on(_tried())
    return _known[0]


def rely_on(backend: str) -> None:
    """Let `choose_backend` return a backend that drew for another process of this program, and try none."""
    os.environ["MUJOCO_GL"] = backend
    _known[:] = [backend]


def _tried() -> str:
    """Return the first backend that draws."""
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    candidates = [backend for backend in Backend if backend == asked] or list(Backend)
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
    """Return a new context that can draw images of a size, whether or not MuJoCo was imported before the choice.

    Mesa's software draws them in the thread that asks, unless LP_NUM_THREADS says otherwise: the images are small, and
    threads of its own would only take the other cores from whoever runs there.
    """
    os.environ.setdefault("LP_NUM_THREADS", "0")
    context: Context = importlib.import_module(f"mujoco.{Backend(backend)}").GLContext(width, height)
    return context


def _failure_of(backend: Backend) -> str | None:
    """Return why a backend does not draw here, in one line, or None if it does."""
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
