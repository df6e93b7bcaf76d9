"""The description of a laboratory as one frozen value: machines, light, camera noise, durations and disturbances.

The world, the scene, the truth and the robot use this value. The default is the laboratory of the protocol. A test
compares digests of the default with recorded digests. Some experiments use other laboratories.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from codra_papers.lab.perception.layout import MACHINES, Machine
from codra_papers.lab.simulator.durations import DURATIONS, Phase, Spread

NOISE_GREYS = 3.0
"""Standard deviation of the sensor's noise, in greys from 0 to 255. It is independent for each pixel and colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LidMoved:
    """A person opens or closes a machine's lid as soon as the robot's hand is away from the lid.

    Attributes:
        at_s: the earliest instant of the move.
        machine: the name of the machine.
        open_share: how far the lid is open afterwards: 0 is closed, 1 is completely open.
    """

    at_s: float
    machine: str
    open_share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonBefore:
    """A person steps between the camera and its target, and waits there.

    Attributes:
        at_s: when the person begins to step in.
        lasts_s: the time from `at_s` until the person steps away again.
    """

    at_s: float
    lasts_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LightDown:
    """The light in the room goes down, and later up again.

    Attributes:
        at_s: when the light begins to go down.
        lasts_s: the time from `at_s` until the light begins to go up again.
        light: the remaining light: 1 is that of an ordinary day, 0 is dark.
    """

    at_s: float
    lasts_s: float
    light: float


class Mount(StrEnum):
    """Where the camera of the observers is mounted. The robot has both cameras."""

    WRIST = "wrist"
    """On the arm, behind the hand: each movement of the arm moves the camera."""

    PAN_TILT = "pan-tilt"
    """On a mast of the base. The camera is pointed at the machine that the robot tends, regardless of the arm."""


Disturbance = LidMoved | PersonBefore | LightDown


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory:
    """A laboratory, with everything that experiments vary.

    Attributes:
        machines: the machines, with unique names and tags. The sample-processing workflow needs the two default
            machines.
        light: the light in the room: 1 is that of an ordinary day, 0 is dark.
        noise_greys: the standard deviation of the camera's noise, in greys from 0 to 255.
        durations: the duration of each phase of the robot's actions.
        camera: which camera the observers use. The main execution's own looks are always taken by the arm's camera.
        amplification_s: how long the PCR-cycler works on the samples.
        disturbances: the changes that the robot does not cause. Disturbances of the same kind must not overlap.
    """

    machines: tuple[Machine, ...] = tuple(MACHINES.values())
    light: float = 1.0
    noise_greys: float = NOISE_GREYS
    camera: Mount = Mount.WRIST
    durations: tuple[tuple[Phase, Spread], ...] = tuple(DURATIONS.items())
    amplification_s: float = 240.0
    disturbances: tuple[Disturbance, ...] = ()

    def machine(self, name: str) -> Machine:
        """Return a machine by its name.

        Raises:
            ValueError: the laboratory has no machine of that name.
        """
        for machine in self.machines:
            if machine.name == name:
                return machine
        names = ", ".join(machine.name for machine in self.machines)
        raise ValueError(f"there is no machine '{name}' in the laboratory; its machines are {names}")

    def duration(self, phase: Phase) -> Spread:
        """Return the duration of a phase of an action."""
        return next(spread for key, spread in self.durations if key is phase)

    def with_machines(self, *machines: Machine) -> Laboratory:
        """Return this laboratory with more machines."""
        return replace(self, machines=(*self.machines, *machines))

    def with_tags(self, scale: float) -> Laboratory:
        """Return this laboratory with all tags scaled by a factor."""
        return replace(self, machines=tuple(machine.with_tags(scale) for machine in self.machines))

    def with_machine_at(self, name: str, x_m: float, y_m: float, heading_rad: float) -> Laboratory:
        """Return this laboratory with one machine at another place."""
        machines = (
            machine.at_place(x_m, y_m, heading_rad) if machine.name == name else machine for machine in self.machines
        )
        return replace(self, machines=tuple(machines))


LABORATORY = Laboratory()
"""The laboratory of the protocol."""
