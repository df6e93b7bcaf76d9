"""Sequential perception: how the main execution looks when context cannot answer (P1, section 4.2).

It moves the camera to a good pose, takes an image, localises and evaluates, with the same perception functions as the
observers and in the shared vision slot, before which it comes first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi
from random import Random
from typing import Any

from codra_papers.lab.context import Context
from codra_papers.lab.perception import functions as perception
from codra_papers.lab.perception.frame import Camera, Frame
from codra_papers.lab.perception.layout import Part
from codra_papers.lab.perception.processing import processing_s
from codra_papers.lab.robot import Clock, Robot

VISION = "vision"
"""The resource of which looking takes a slot."""

LOOKS = 3
"""How often it looks, each time from a pose taken anew, before it gives up."""

OPEN_RAD = 0.6
ROTOR_TOLERANCE_RAD = 0.2
MANIPULATION_DISTANCE_M = 0.95

Found = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _SequentialJob:
    """`job` for perception functions that the main execution calls itself: their time is its own."""

    clock: Clock
    random: Random
    index: int = 0

    @property
    def cancelled(self) -> bool:
        return False

    def now_s(self) -> float:
        return self.clock.now_s()

    def sleep(self, duration_s: float) -> None:
        self.clock.sleep(duration_s)

    def evidence(self, start_s: float, stamp_s: float) -> None:
        """Do nothing: nobody judges the main execution's own evidence."""


@dataclass(frozen=True, slots=True)
class _OwnCamera:
    """The camera, with processing times drawn for the main execution alone: no other job changes them."""

    camera: Camera
    random: Random

    def capture(self) -> Frame:
        """Take a frame now."""
        return self.camera.capture()

    def processing_s(self, mean_s: float) -> float:
        """Return a time drawn anew."""
        return processing_s(self.random, mean_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Way:
    """How to find out one thing: where to look, what to call, what its result means."""

    machine: str
    part: Part
    call: Callable[..., Found]
    answer: Callable[[Found], bool | None]


class SequentialPerception:
    """Looks for what a decision needs, on purpose and one thing at a time."""

    def __init__(self, robot: Robot, camera: Camera, codra: Context, clock: Clock, *, seed: int) -> None:
        self._robot = robot
        random = Random(f"{seed} main execution")
        self._camera = _OwnCamera(camera, random)
        self._codra = codra
        self._job = _SequentialJob(clock, random)

    def look_for(self, variable: str) -> bool | None:
        """Find out the value of a context-variable; None if it cannot be seen in several looks."""
        if variable == "robot_is_localized":
            return self._robot.is_localized()
        machine = self._machine_of(variable)
        if variable.endswith("_in_manipulation_distance"):
            found = perception.measure_distance(machine=machine, base=self._robot, job=self._job)
            return bool(found["distance"] < MANIPULATION_DISTANCE_M)
        way = _ways(machine)[variable.removeprefix(f"{machine}_")]
        answers = (self._look(way) for _ in range(LOOKS))
        return next((answer for answer in answers if answer is not None), None)

    def _machine_of(self, variable: str) -> str:
        """Return the machine that a variable is about: the longest name with which it begins."""
        names = (machine.name for machine in self._robot.laboratory.machines)
        return max((name for name in names if variable.startswith(f"{name}_")), key=len)

    def _look(self, way: _Way) -> bool | None:
        self._robot.look_at(way.machine, way.part)
        with self._codra.slot(VISION):
            found = way.call(machine=way.machine, camera=self._camera, job=self._job)
        return way.answer(found)


def _ways(machine: str) -> Mapping[str, _Way]:
    def lid(part: Part, answer: Callable[[Found], bool | None]) -> _Way:
        return _Way(machine=machine, part=part, call=perception.localize_lid, answer=answer)

    def rotor(position_rad: float) -> _Way:
        call = perception.localize_rotor
        return _Way(machine=machine, part=Part.ROTOR, call=call, answer=lambda found: _stands_at(found, position_rad))

    return {
        "open": lid(Part.LID, _is_open),
        "locked": lid(Part.LATCH, lambda found: found["latched"]),
        "rotor_in_pos_1": rotor(0.0),
        "rotor_in_pos_2": rotor(pi),
    }


def _is_open(found: Found) -> bool | None:
    """Two tags at least: one on each of base and lid."""
    angle_rad = found["lid_angle"]
    return None if angle_rad is None or found["markers"] < 2 else bool(angle_rad > OPEN_RAD)


def _stands_at(found: Found, position_rad: float) -> bool | None:
    angle_rad = found["rotor_angle"]
    return None if angle_rad is None else bool(abs(angle_rad - position_rad) < ROTOR_TOLERANCE_RAD)
