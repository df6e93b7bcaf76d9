"""What a laboratory is, as one value: machines, light, camera noise, how long things take, and what disturbs it.

The default is the laboratory that the protocol describes. Experiments ask about others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from codra_papers.lab.perception.layout import MACHINES, Machine
from codra_papers.lab.simulator.durations import DURATIONS, Phase, Spread

NOISE_GREYS = 3.0
"""Standard deviation of the sensor's noise, of 255, independent in each pixel and colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LidMoved:
    """Somebody else opens or closes a machine's lid, as soon as the robot keeps its hands off.

    Attributes:
        at_s: when, at the earliest.
        machine: its name.
        open_share: how far open the lid is then: 0 closed, 1 open.
    """

    at_s: float
    machine: str
    open_share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonBefore:
    """Somebody steps between the camera and what it looks at, and stands there.

    Attributes:
        lasts_s: how long.
    """

    at_s: float
    lasts_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LightDown:
    """The light goes down, and up again.

    Attributes:
        lasts_s: after how long it is up.
        light: what is left: 1 is an ordinary day, 0 is dark.
    """

    at_s: float
    lasts_s: float
    light: float


Disturbance = LidMoved | PersonBefore | LightDown


@dataclass(frozen=True, slots=True, kw_only=True)
class Laboratory:
    """A laboratory, and all of it that could be otherwise.

    Attributes:
        machines: by different names, with different tags. The sample-processing workflow needs the two of the default.
        light: 1 is an ordinary day, 0 is dark.
        noise_greys: standard deviation of the camera's noise, of 255.
        durations: of the robot's actions, for every phase.
        amplification_s: how long the PCR-cycler works on the samples.
        disturbances: what happens besides what the robot does; those of one kind do not overlap.
    """

    machines: tuple[Machine, ...] = tuple(MACHINES.values())
    light: float = 1.0
    noise_greys: float = NOISE_GREYS
    durations: tuple[tuple[Phase, Spread], ...] = tuple(DURATIONS.items())
    amplification_s: float = 240.0
    disturbances: tuple[Disturbance, ...] = ()

    def machine(self, name: str) -> Machine:
        """Return a machine.

        Raises:
            ValueError: there is none of that name.
        """
        for machine in self.machines:
            if machine.name == name:
                return machine
        names = ", ".join(machine.name for machine in self.machines)
        raise ValueError(f"there is no machine '{name}' in the laboratory; its machines are {names}")

    def duration(self, phase: Phase) -> Spread:
        """Return how long a phase of an action takes."""
        return next(spread for each, spread in self.durations if each is phase)

    def with_machines(self, *machines: Machine) -> Laboratory:
        """Return this laboratory with more machines."""
        return replace(self, machines=(*self.machines, *machines))

    def with_tags(self, scale: float) -> Laboratory:
        """Return this laboratory with all tags so many times as large."""
        return replace(self, machines=tuple(machine.with_tags(scale) for machine in self.machines))

    def with_standing(self, name: str, x_m: float, y_m: float, heading_rad: float) -> Laboratory:
        """Return this laboratory with one machine at another place."""
        moved = (each.standing(x_m, y_m, heading_rad) if each.name == name else each for each in self.machines)
        return replace(self, machines=tuple(moved))


LABORATORY = Laboratory()
"""The laboratory of the protocol."""
