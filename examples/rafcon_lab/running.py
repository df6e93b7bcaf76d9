"""One run of the state machine in the laboratory, in simulated time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

from codra_dsl.integrations.rafcon import Answers, Ended, opened, run_in_simulated_time
from codra_dsl.runtime import Journal, SimClock
from codra_papers.lab.robot import Localization, Robot
from codra_papers.lab.sequential_perception import SequentialPerception
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource
from codra_papers.lab.simulator.world import LabWorld
from examples.rafcon_lab.comparison import Arm
from generated import lab

FOLDER = Path(__file__).parent / "tend_pcr_cycler"


def run(arm: Arm, seed: int, journal: Path) -> Ended:
    """Run the state machine once, and write the journal of the run."""
    observers, answers = (lab.MODEL.observers, Answers.CONTEXT) if arm is Arm.WITH else ((), Answers.SHADOW)
    clock, world = SimClock(), LabWorld(seed)
    with FrameSource(world) as frames, opened(FOLDER) as machine:
        camera = ArmCamera(frames, clock)
        robot = Robot(world, clock, Random(f"{seed} robot"))
        codra = lab.Lab(
            replace(lab.MODEL, observers=observers),
            clock=clock,
            resources={"camera": camera, "base": Localization(world, clock)},
            seed=seed,
            record=Journal(journal),
        )
        with codra:
            sequential_perception = SequentialPerception(robot, camera, codra, clock, seed=seed)
            handles = {"robot": robot, "eyes": sequential_perception}
            return run_in_simulated_time(machine, codra, clock, handles=handles, answers=answers)
