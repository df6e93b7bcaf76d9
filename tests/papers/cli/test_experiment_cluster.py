"""`codra experiment` on a cluster, quick experiments, and all experiments one after the other."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from pathlib import Path

import pytest

from codra_papers.experiments.campaign.registry import experiments
from tests.cli.test_commands import codra, environment
from tests.papers.cli.test_experiment import (
    CONSOLE_SCRIPT,
    TIMEOUT_S,
    TINY_EXPERIMENT,
    project_in,
    records,
    wait_for,
)
from tests.papers.experiments.campaign.dask_cluster import scheduler, worker


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "project").mkdir()
    return project_in(tmp_path / "project")


def test_the_experiment_of_a_project_runs_on_workers_that_do_not_have_the_project(
    project: Path, tmp_path: Path
) -> None:
    processes = [scheduler(tmp_path)]
    processes.append(worker(tmp_path, processes[0].address))
    arguments = ("experiment", TINY_EXPERIMENT, "--seeds", "1", "--cluster", processes[0].address)
    completed_process = codra(*arguments, cwd=project)
    page = (project / "runs/tiny/report.html").read_text()
    for process in processes:
        process.kill()
    local_process = codra("experiment", TINY_EXPERIMENT, "--seeds", "1", "--out", "local", cwd=project)

    assert (completed_process.returncode, completed_process.stderr) == (
        0,
        "runs/tiny/report.html\nruns/tiny/results.json\n",
    )
    assert completed_process.stdout == local_process.stdout
    (record,) = (project / "local/trials").glob("*.json")
    assert records(project)[record.name].read_bytes() == record.read_bytes()
    assert re.search(rf">Cluster</t[dh]>\s*<td[^>]*>{processes[0].address}<", page)


def test_a_cluster_that_does_not_answer_is_named_and_nothing_is_lost(project: Path) -> None:
    completed_process = codra("experiment", TINY_EXPERIMENT, "--cluster", "tcp://127.0.0.1:9", cwd=project)

    assert (completed_process.returncode, completed_process.stdout) == (1, "")
    assert completed_process.stderr.startswith("codra: no scheduler answers at 'tcp://127.0.0.1:9': ")
    assert completed_process.stderr.endswith("; 0 of 2 trials are kept: run the same command again to continue\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([TINY_EXPERIMENT, "--cluster", "tcp://127.0.0.1:9", "--processes", "2"], "have their own numbers of threads"),
        (["all", "--trial", "seed 301"], "'all' takes neither --trial nor --spec: name one experiment"),
        (["all", "--spec", "specs/lab.yaml"], "'all' takes neither --trial nor --spec: name one experiment"),
    ],
)
def test_options_that_contradict_each_other_are_refused(project: Path, arguments: list[str], message: str) -> None:
    completed_process = codra("experiment", *arguments, cwd=project)

    assert (completed_process.returncode, completed_process.stdout) == (2, "")
    assert message in " ".join(completed_process.stderr.replace("│", " ").split())


def test_a_quick_report_has_fewer_trials_and_a_folder_of_its_own_and_says_so(project: Path) -> None:
    completed_process = codra("experiment", TINY_EXPERIMENT, "--quick", cwd=project)

    assert (completed_process.returncode, completed_process.stderr) == (
        0,
        "runs/quick/tiny/report.html\nruns/quick/tiny/results.json\n",
    )
    note = "This is a quick report with few trials (1). It shows effects with wide intervals or none; "
    assert completed_process.stdout.startswith(note)
    assert note in (project / "runs/quick/tiny/report.html").read_text()
    assert [path.name for path in (project / "runs/quick/tiny/trials").glob("*.json")] == ["seed 301.json"]
    assert not (project / "runs/tiny").exists()


def test_all_experiments_begin_with_the_first_and_say_how_many_there_are(project: Path) -> None:
    first_name = next(iter(experiments()))
    process = subprocess.Popen(
        [CONSOLE_SCRIPT, "experiment", "all", "--quick", "--processes", "1"],
        cwd=project,
        env=environment(),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        process_group=0,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
    )
    assert process.stderr is not None
    shown_line = process.stderr.readline()
    wait_for(lambda: any((project / "runs/quick" / first_name / "trials").glob(".*/*")))
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=TIMEOUT_S)

    assert shown_line == f"1 of {len(experiments())}: {first_name}\n"
    assert (process.returncode, output) == (130, "")
    assert "run the same command again to continue" in errors


def test_quick_trials_are_fewer_than_those_of_the_complete_report(project: Path) -> None:
    from codra_papers.experiments.campaign.experiment import Settings

    for experiment in experiments().values():
        spec = project / "specs" / f"{experiment.world}.yaml"
        quick, complete = (
            experiment.trials(Settings(spec=spec, seeds=seeds, folder=project / "runs", is_quick=is_quick))
            for seeds, is_quick in ((experiment.quick_seeds, True), (experiment.seeds, False))
        )
        assert {trial.name for trial in quick} < {trial.name for trial in complete}
