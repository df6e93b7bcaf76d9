"""What the main execution does where a whole loop would take too long."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.worlds.lab.mission import CENTRIFUGE, PCR_CYCLER, Mission


@dataclass(frozen=True, slots=True, kw_only=True)
class Tending:
    """Drive to machines, one after the other, and open and close each.

    Attributes:
        machines: by name; one may be named again.
    """

    machines: tuple[str, ...]

    def __call__(self, mission: Mission) -> None:
        """Do it."""
        for machine in self.machines:
            mission.open_and_close(machine, times=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiting:
    """Open a machine, wait beside it, and close it.

    Attributes:
        until_s: the instant when the robot begins to close it.
    """

    machine: str
    until_s: float

    def __call__(self, mission: Mission) -> None:
        """Do it."""
        mission.wait_beside(self.machine, self.until_s)


BOTH_AND_BACK = Tending(machines=(CENTRIFUGE, PCR_CYCLER, CENTRIFUGE))
"""The centrifuge, the PCR-cycler, and the centrifuge again, of which the robot must know what it knew: 35 minutes."""
