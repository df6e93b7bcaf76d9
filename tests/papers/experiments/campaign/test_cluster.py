"""Trials on a Dask cluster: a real scheduler and real workers on this machine."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import pytest

from codra_papers.experiments.campaign.campaign import TRIALS, Progress, run_campaign
from codra_papers.experiments.campaign.cluster import run_on_cluster
from codra_papers.experiments.campaign.workers import ClusterError, TrialError
from tests.papers.experiments.campaign.dask_cluster import ROOT, DaskProcess, scheduler, worker
from tests.papers.experiments.campaign.test_campaign import files, run, trial
from tests.papers.experiments.workloads import HoldsOnce, Raises

TWO_TRIALS = (replace(trial(301), duration_s=2.0), replace(trial(302), duration_s=2.0))


@dataclass
class Cluster:
    """A scheduler with workers, and the messages about them."""

    folder: Path
    scheduler: DaskProcess
    workers: dict[str, DaskProcess] = field(default_factory=dict)
    messages: list[str] = field(default_factory=list)

    def add_worker(self, **environment: str) -> DaskProcess:
        process = worker(self.folder, self.scheduler.address, environment)
        self.workers[process.address] = process
        return process

    def run(self, folder: Path, trials: tuple[object, ...]) -> list[Progress]:
        reports: list[Progress] = []
        runner = partial(run_on_cluster, address=self.scheduler.address, notify=self.messages.append)
        run_campaign(trials, folder, run=runner, progress=reports.append)  # type: ignore[arg-type]
        return reports

    def kill(self) -> None:
        for process in (*self.workers.values(), self.scheduler):
            process.kill()


@pytest.fixture(scope="module")
def local_files(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, bytes]:
    """Return the files of two trials that local processes ran."""
    folder = tmp_path_factory.mktemp("local")
    run(folder, TWO_TRIALS)
    return files(folder / TRIALS)


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """Yield a scheduler without workers."""
    (tmp_path / "cluster").mkdir()
    cluster = Cluster(tmp_path / "cluster", scheduler(tmp_path / "cluster"))
    yield cluster
    cluster.kill()


def wait_for(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 240.0
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.02)


def lives(number: int) -> bool:
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def holding_trial(folder: Path, seed: int = 303) -> tuple[object, Path]:
    """Return a trial that holds until its process is killed, and the file with the number of this process."""
    return replace(trial(seed, HoldsOnce(folder / f"held-{seed}")), duration_s=2.0), folder / f"held-{seed}"


def add_other_worker(cluster: Cluster, folder: Path) -> DaskProcess:
    """Add a worker with one more module in the code of codra, in a folder of its own."""
    for package in ("codra_dsl", "codra_papers"):
        shutil.copytree(ROOT / package, folder / package)
    (folder / "codra_papers/more.py").write_text("A = 1\n")
    return cluster.add_worker(PYTHONPATH=str(folder))


def test_workers_make_the_same_files_as_local_processes(
    cluster: Cluster, tmp_path: Path, local_files: Mapping[str, bytes]
) -> None:
    cluster.add_worker()
    cluster.add_worker()
    reports = cluster.run(tmp_path / "cluster", TWO_TRIALS)

    assert files(tmp_path / "cluster" / TRIALS) == local_files
    assert any(name.endswith(".png") for name in local_files)
    assert [(report.done, report.total) for report in reports] == [(0, 2), (1, 2), (2, 2)]
    assert cluster.messages == []


def test_the_trial_of_a_killed_worker_is_run_again_on_another_and_reported(cluster: Cluster, tmp_path: Path) -> None:
    held_trial, file = holding_trial(tmp_path)
    first_worker = cluster.add_worker()

    def kill_the_first_worker() -> None:
        wait_for(file.exists)
        cluster.add_worker()
        first_worker.kill()

    thread = threading.Thread(target=kill_the_first_worker)
    thread.start()
    cluster.run(tmp_path / "cluster", (held_trial,))
    thread.join()
    run(tmp_path / "local", (held_trial,))  # type: ignore[arg-type]

    assert cluster.messages[-1] == f"worker '{first_worker.address}' was lost: trial 'seed 303' is run again"
    assert files(tmp_path / "cluster" / TRIALS) == files(tmp_path / "local" / TRIALS)
    wait_for(lambda: not lives(int(file.read_text())))


def test_after_the_scheduler_is_killed_the_same_command_continues(
    cluster: Cluster, tmp_path: Path, local_files: Mapping[str, bytes]
) -> None:
    held_trial, file = holding_trial(tmp_path)
    trials = (TWO_TRIALS[0], held_trial)
    first_scheduler = cluster.scheduler
    for _ in trials:
        cluster.add_worker()
    first_record = tmp_path / "kept" / TRIALS / "seed 301.json"

    def kill_the_scheduler() -> None:
        wait_for(lambda: file.exists() and first_record.exists())
        first_scheduler.kill()

    thread = threading.Thread(target=kill_the_scheduler)
    thread.start()
    with pytest.raises(ClusterError, match=f"the scheduler at '{first_scheduler.address}' was lost"):
        cluster.run(tmp_path / "kept", trials)
    thread.join()
    wait_for(lambda: not lives(int(file.read_text())))
    number = first_record.stat().st_ino

    cluster.scheduler = scheduler(cluster.folder)
    cluster.add_worker()
    reports = cluster.run(tmp_path / "kept", trials)

    assert [(report.done, report.reused_trial_count) for report in reports] == [(1, 1), (2, 1)]
    assert first_record.stat().st_ino == number
    kept_files = files(tmp_path / "kept" / TRIALS)
    assert {name: content for name, content in local_files.items() if "301" in name}.items() <= kept_files.items()
    assert "seed 303.json" in kept_files


def test_a_failed_trial_is_named_with_its_worker_and_ends_the_trials_that_still_run(
    cluster: Cluster, tmp_path: Path
) -> None:
    held_trial, file = holding_trial(tmp_path)
    for _ in range(2):
        cluster.add_worker()

    raising_trial = replace(trial(7, Raises()), duration_s=2.0)
    with pytest.raises(TrialError) as error_info:
        cluster.run(tmp_path / "kept", (held_trial, raising_trial))

    assert str(error_info.value).startswith("trial 'seed 7' (seed 7): ZeroDivisionError: no robot at Mission (")
    assert error_info.value.reason.endswith("')")
    assert any(f"(on worker '{address}')" in error_info.value.reason for address in cluster.workers)
    assert error_info.value.details == tmp_path / "kept" / TRIALS / "seed 7.error"
    assert "Traceback" in error_info.value.details.read_text()
    wait_for(lambda: not file.exists() or not lives(int(file.read_text())))


def test_a_worker_with_other_code_is_refused_and_the_others_run_the_trials(cluster: Cluster, tmp_path: Path) -> None:
    other_worker = add_other_worker(cluster, tmp_path / "other")
    worker = cluster.add_worker()
    cluster.run(tmp_path / "kept", TWO_TRIALS)
    assert len(list((tmp_path / "kept" / TRIALS).glob("*.json"))) == 2
    worker.kill()
    with pytest.raises(ClusterError, match="all workers are refused"):
        cluster.run(tmp_path / "none", TWO_TRIALS)
    assert len(cluster.messages) == 2
    for message in cluster.messages:
        assert message.startswith(f"worker '{other_worker.address}' is refused: it has other code of codra (")


def test_an_updated_worker_need_not_be_started_again(cluster: Cluster, tmp_path: Path) -> None:
    other_worker = add_other_worker(cluster, tmp_path / "other")
    with pytest.raises(ClusterError, match="all workers are refused"):
        cluster.run(tmp_path / "kept", TWO_TRIALS[:1])
    (tmp_path / "other/codra_papers/more.py").unlink()
    cluster.run(tmp_path / "kept", TWO_TRIALS[:1])

    assert [path.name for path in (tmp_path / "kept" / TRIALS).glob("*.json")] == ["seed 301.json"]
    assert other_worker.address in cluster.messages[0]
