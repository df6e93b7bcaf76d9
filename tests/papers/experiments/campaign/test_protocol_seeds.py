"""The seeds of the factorial trials are those that the commands on the page of the protocol derive from its commit."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from codra_papers.experiments.campaign.experiment import Experiment, Settings
from codra_papers.experiments.studies import lab_robustness, lab_sensitivity
from codra_papers.experiments.studies.factors.design import SEEDS_PER_CELL, is_factorial

ROOT = Path(__file__).parents[4]
PAGE = (ROOT / "docs" / "papers" / "protocol.md").read_text(encoding="utf-8")


def first_seed(experiment: str) -> int:
    """Return what the shell command of the page prints for the commit of the page and an experiment."""
    (commit,) = re.findall(r"The protocol of the design is in commit `([0-9a-f]{40})`", PAGE)
    (command,) = re.findall(r"`(echo \$\(\(.*?\)\))`", PAGE)
    command = command.replace("COMMIT", commit).replace("lab-robustness", experiment)
    return int(subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True).stdout)


@pytest.mark.parametrize("experiment", [lab_robustness.EXPERIMENT, lab_sensitivity.EXPERIMENT])
def test_the_trials_of_the_design_have_the_seeds_that_the_shell_derives_from_the_commit(
    experiment: Experiment, tmp_path: Path
) -> None:
    settings = Settings(spec=ROOT / "specs" / "lab.yaml", seeds=experiment.seeds, folder=tmp_path)
    seeds = sorted({trial.seed for trial in experiment.trials(settings) if is_factorial(trial.name)})
    start = first_seed(experiment.name)

    assert seeds == list(range(start, start + SEEDS_PER_CELL))
