"""Seeds of reports: they follow from the commit of the protocol and the name of the experiment."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from codra_papers.experiments.campaign.seeds import PROTOCOL_COMMITS, SEEDS_PER_EXPERIMENT, reported_seeds

ROOT = Path(__file__).parents[4]
COMMIT = "0123456789abcdef0123456789abcdef01234567"
EARLIER_SEEDS = range(1, 413)


def test_the_first_seed_is_that_of_the_command_on_the_page_of_the_protocol() -> None:
    page = (ROOT / "docs" / "papers" / "protocol.md").read_text(encoding="utf-8")
    _, _, rest = page.partition("`echo $((")
    command = f"echo $(({rest.partition('`')[0]}".replace("COMMIT", COMMIT)
    first_seed = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=True).stdout.strip()

    assert reported_seeds("lab-robustness", 3, COMMIT) == range(int(first_seed), int(first_seed) + 3)


def test_other_commits_and_other_experiments_have_other_seeds() -> None:
    first_seeds = {
        reported_seeds(experiment, 1, commit)[0]
        for experiment in ("lab-robustness", "lab-sensitivity")
        for commit in (COMMIT, COMMIT[::-1])
    }

    assert len(first_seeds) == 4
    assert all(seed % SEEDS_PER_EXPERIMENT == 0 for seed in first_seeds)
    assert min(first_seeds) > max(EARLIER_SEEDS)


def test_an_experiment_cannot_take_the_seeds_of_the_next_one() -> None:
    with pytest.raises(ValueError, match="1000 seeds, not 1001"):
        reported_seeds("lab-robustness", SEEDS_PER_EXPERIMENT + 1)


@pytest.mark.parametrize(
    ("page_name", "experiment"),
    [("protocol.md", "lab-robustness"), ("protocol.md", "lab-sensitivity"), ("store-experiment.md", "store")],
)
def test_the_page_of_a_protocol_names_its_commit_completely(page_name: str, experiment: str) -> None:
    page = (ROOT / "docs" / "papers" / page_name).read_text(encoding="utf-8")

    assert len(PROTOCOL_COMMITS[experiment]) == 40
    assert f"commit `{PROTOCOL_COMMITS[experiment]}`" in page


def test_the_seeds_of_a_report_follow_from_the_commit_of_its_protocol() -> None:
    for experiment, commit in PROTOCOL_COMMITS.items():
        assert reported_seeds(experiment, 20) == reported_seeds(experiment, 20, commit)
