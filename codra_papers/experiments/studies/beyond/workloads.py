"""Workloads of the main execution for studies in which a complete loop would take too long."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.lab.arms import Arm
from codra_papers.experiments.lab.trials import Trial
from codra_papers.experiments.studies.beyond.arm_comparison import reported_seeds
from codra_papers.lab.mission import CENTRIFUGE, PCR_CYCLER, Mission


@dataclass(frozen=True, slots=True, kw_only=True)
class Tending:
    """Drive to machines, one after the other, and open and close each of them.

    Attributes:
        machines: the names of the machines; a machine can be listed several times.
        leaves_lids_open: whether a machine that is tended again later stays open until then.
    """

    machines: tuple[str, ...]
    leaves_lids_open: bool = False

    def __call__(self, mission: Mission) -> None:
        """Tend the machines."""
        for index, machine in enumerate(self.machines):
            is_left_open = self.leaves_lids_open and machine in self.machines[index + 1 :]
            mission.open_and_close(machine, times=1, leave_open=is_left_open)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waiting:
    """Open a machine, wait beside it, and close it.

    Attributes:
        until_s: when the robot begins to close the machine.
        draws_back: whether the arm returns to its ready pose before the robot waits. From this pose the camera sees an
            open centrifuge without its lid.
    """

    machine: str
    until_s: float
    draws_back: bool = False

    def __call__(self, mission: Mission) -> None:
        """Open the machine, wait and close it."""
        mission.wait_beside(self.machine, self.until_s, draw_back=self.draws_back)


def return_visit_trials(settings: Settings, arms: tuple[Arm, ...]) -> Sequence[Trial]:
    """Return one run of 35 minutes per seed. Each run has all arms.

    The robot tends the centrifuge, the PCR-cycler, and the centrifuge again. For the second visit to the
    centrifuge, knowledge from the first visit must be used.
    """
    work = Tending(machines=(CENTRIFUGE, PCR_CYCLER, CENTRIFUGE))
    return [
        Trial(name=f"run-{seed}", spec=settings.spec, seed=seed, arms=arms, work=work)
        for seed in reported_seeds(settings)
    ]
