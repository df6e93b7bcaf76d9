"""Sequential perception: the looks of the main execution when context cannot answer (P1, section 4.2).

The main execution moves the camera to a good pose, takes an image, localises parts and evaluates the result. It uses
the same perception functions as the observers, and the same vision slot, but with priority over observers.
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
"""The resource whose slot a look needs."""

MAX_LOOKS = 3
"""Number of looks after which the main execution gives up. Each look is from a new pose."""

OPEN_RAD = 0.6
ROTOR_TOLERANCE_RAD = 0.2
MANIPULATION_DISTANCE_M = 0.95

Measurement = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _SequentialJob:
    """The argument `job` of perception functions that the main execution calls itself and waits for."""

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
        """Do nothing: the main execution's own evidence is not checked."""


@dataclass(frozen=True, slots=True)
class _OwnCamera:
    """The camera, with processing times that are drawn for the main execution only, so that no job changes them."""

    camera: Camera
    random: Random

    def capture(self) -> Frame:
        """Take a frame now."""
        return self.camera.capture()

    def processing_s(self, mean_s: float) -> float:
        """Return a newly drawn time."""
        return processing_s(self.random, mean_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class _LookPlan:
    """How to answer one decision: where to look, which function to call, and how to get the answer from its result."""

    machine: str
    part: Part
    call: Callable[..., Measurement]
    answer: Callable[[Measurement], bool | None]


class SequentialPerception:
    """Looks for the value that a decision needs, one value at a time."""

    def __init__(self, robot: Robot, camera: Camera, codra: Context, clock: Clock, *, seed: int) -> None:
        self._robot = robot
        random = Random(f"{seed} main execution")
        self._camera = _OwnCamera(camera, random)
        self._codra = codra
        self._job = _SequentialJob(clock, random)

    def look_for(self, variable: str) -> bool | None:
        """Look, and return the value of a context-variable; None if no look shows the value."""
        if variable == "robot_is_localized":
            return self._robot.is_localized()
        machine = self._machine_of(variable)
        if variable.endswith("_in_manipulation_distance"):
            measurement = perception.measure_distance(machine=machine, base=self._robot, job=self._job)
            return bool(measurement["distance"] < MANIPULATION_DISTANCE_M)
        plan = _look_plans(machine)[variable.removeprefix(f"{machine}_")]
        answers = (self._look(plan) for _ in range(MAX_LOOKS))
        return next((answer for answer in answers if answer is not None), None)

    def _machine_of(self, variable: str) -> str:
        """Return the name of a variable's machine: the longest machine name with which the variable begins."""
        names = (machine.name for machine in self._robot.laboratory.machines)
        return max((name for name in names if variable.startswith(f"{name}_")), key=len)

    def _look(self, plan: _LookPlan) -> bool | None:
        self._robot.look_at(plan.machine, plan.part)
        with self._codra.slot(VISION):
            measurement = plan.call(machine=plan.machine, camera=self._camera, job=self._job)
        return plan.answer(measurement)


def _look_plans(machine: str) -> Mapping[str, _LookPlan]:
    def plan_lid_look(part: Part, answer: Callable[[Measurement], bool | None]) -> _LookPlan:
        return _LookPlan(machine=machine, part=part, call=perception.localize_lid, answer=answer)

    def plan_rotor_look(position_rad: float) -> _LookPlan:
        call = perception.localize_rotor
        return _LookPlan(
            machine=machine,
            part=Part.ROTOR,
            call=call,
            answer=lambda measurement: _is_at_position(measurement, position_rad),
        )

    return {
        "open": plan_lid_look(Part.LID, _is_open),
        "locked": plan_lid_look(Part.LATCH, lambda measurement: measurement["latched"]),
        "rotor_in_pos_1": plan_rotor_look(0.0),
        "rotor_in_pos_2": plan_rotor_look(pi),
    }


def _is_open(measurement: Measurement) -> bool | None:
    """Return whether a lid is open; None unless at least two tags are seen, one on the base and one on the lid."""
    angle_rad = measurement["lid_angle"]
    return None if angle_rad is None or measurement["markers"] < 2 else bool(angle_rad > OPEN_RAD)


def _is_at_position(measurement: Measurement, position_rad: float) -> bool | None:
    angle_rad = measurement["rotor_angle"]
    return None if angle_rad is None else bool(abs(angle_rad - position_rad) < ROTOR_TOLERANCE_RAD)
