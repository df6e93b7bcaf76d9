"""Run a campaign on two Dask workers in network namespaces of their own, and compare the files with local ones.

Run it with `python -m tests.campaigns.cluster`. The program enters a network namespace in which no other network can be
reached. It needs `unshare` and `ip`, and either root or permission to make user namespaces.

A worker is killed while it runs a trial, and so is the scheduler. Then the same call continues.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Thread

from codra_papers.experiments.campaign.campaign import TRIALS, Progress, local_processes, run_campaign
from codra_papers.experiments.campaign.cluster import run_on_cluster
from codra_papers.experiments.campaign.workers import ClusterError
from codra_papers.experiments.lab.arms import NAIVE, NEED
from codra_papers.experiments.lab.run import Loops
from codra_papers.experiments.lab.trials import Trial
from tests.papers.experiments.campaign.dask_cluster import ROOT, DaskProcess
from tests.papers.experiments.workloads import HoldsOnce

_ENTERED = "CODRA_CLUSTER_NAMESPACE"
_PORT = 8786
_PATIENCE_S = 1200.0


def main() -> None:
    """Enter a network namespace, and run the campaign in it."""
    if _ENTERED not in os.environ:
        user_namespace = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
        command = ["unshare", *user_namespace, "--net", sys.executable, "-m", "tests.campaigns.cluster"]
        os.execvpe(command[0], command, {**os.environ, _ENTERED: "yes"})
    _run("ip", "link", "set", "lo", "up")
    with tempfile.TemporaryDirectory(prefix="codra-cluster-") as folder:
        _campaign(Path(folder))


def _campaign(folder: Path) -> None:
    held_file = folder / "held"
    trial = Trial(
        name="seed 301",
        spec=ROOT / "specs/lab.yaml",
        seed=301,
        arms=(NEED, NAIVE),
        work=Loops(),
        duration_s=20.0,
        frames_kept=5,
    )
    trials = (
        *(replace(trial, name=f"seed {seed}", seed=seed) for seed in (301, 302, 303)),
        replace(trial, name="held", work=HoldsOnce(held_file)),
        replace(trial, name="held again", work=HoldsOnce(folder / "held-again")),
    )
    scheduler, namespaces = _scheduler(folder), [_namespace(number) for number in (1, 2)]
    workers = [_worker(folder, namespace, number) for number, namespace in enumerate(namespaces, 1)]

    def kill_worker_and_scheduler() -> None:
        _wait_for(held_file.exists)
        holder = _parent_of(int(held_file.read_text()))
        lost = next(index for index, worker in enumerate(workers) if worker.number == holder)
        print(f"killed: the worker in namespace {lost + 1}", flush=True)
        workers[lost].kill()
        workers[lost] = _worker(folder, namespaces[lost], lost + 1)
        _wait_for(lambda: (folder / "held-again").exists() and len(_records(folder / "cluster")) >= 1)
        print("killed: the scheduler", flush=True)
        scheduler.kill()

    thread = Thread(target=kill_worker_and_scheduler)
    thread.start()
    try:
        _run_on_cluster(trials, folder)
    except ClusterError as error:
        print(f"ended: {error}", flush=True)
    else:
        raise SystemExit("the campaign did not notice that the scheduler was killed")
    thread.join()
    kept_records = _records(folder / "cluster")
    for worker in workers:
        worker.kill()
    processes = [_scheduler(folder), *(_worker(folder, *pair) for pair in zip(namespaces, (1, 2), strict=True))]
    _run_on_cluster(trials, folder)
    run_campaign(trials, folder / "local", run=local_processes(2), progress=_print_progress)
    for process in (*processes, *namespaces):
        process.kill()
    if not kept_records.items() <= _records(folder / "cluster").items():
        raise SystemExit("a kept trial was run again")
    if _files(folder / "cluster") != _files(folder / "local"):
        raise SystemExit("the files of the cluster differ from the local ones")
    print(f"{len(trials)} trials, {len(_files(folder / 'local'))} files: the same bytes as local ones")


def _run_on_cluster(trials: Sequence[Trial], folder: Path) -> None:
    runner = partial(run_on_cluster, address=f"tcp://10.77.1.1:{_PORT}", notify=lambda text: print(text, flush=True))
    run_campaign(trials, folder / "cluster", run=runner, progress=_print_progress)


def _print_progress(progress: Progress) -> None:
    print(f"{progress.done} of {progress.total}, {progress.reused_trial_count} from before", flush=True)


def _namespace(number: int) -> subprocess.Popen[bytes]:
    """Start a process in a new network namespace, which has a link to this one."""
    process = subprocess.Popen(["unshare", "--net", "sleep", "infinity"])
    own_namespace = Path("/proc/self/ns/net").readlink()
    _wait_for(lambda: Path(f"/proc/{process.pid}/ns/net").readlink() != own_namespace)
    _run("ip", "link", "add", f"hub{number}", "type", "veth", "peer", "name", "worker", "netns", str(process.pid))
    _run("ip", "address", "add", f"10.77.{number}.1/24", "dev", f"hub{number}")
    _run("ip", "link", "set", f"hub{number}", "up")
    _run(*_inside(process), "ip", "address", "add", f"10.77.{number}.2/24", "dev", "worker")
    _run(*_inside(process), "ip", "link", "set", "worker", "up")
    _run(*_inside(process), "ip", "link", "set", "lo", "up")
    return process


def _inside(namespace: subprocess.Popen[bytes]) -> Sequence[str]:
    return ("nsenter", f"--net=/proc/{namespace.pid}/ns/net")


def _scheduler(folder: Path) -> DaskProcess:
    """Start a scheduler that listens on all links of this namespace."""
    return DaskProcess(folder, "scheduler", "--host", "0.0.0.0", "--port", str(_PORT))


def _worker(folder: Path, namespace: subprocess.Popen[bytes], number: int) -> DaskProcess:
    arguments = ("worker", f"tcp://10.77.{number}.1:{_PORT}", "--nthreads", "1", "--no-nanny")
    return DaskProcess(folder, *arguments, prefix=_inside(namespace))


def _run(*command: str) -> None:
    subprocess.run(command, check=True)


def _wait_for(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + _PATIENCE_S
    while not condition():
        if time.monotonic() > end_s:
            raise SystemExit("nothing has happened for too long")
        time.sleep(0.05)


def _parent_of(number: int) -> int:
    return int(Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[1])


def _records(folder: Path) -> Mapping[str, int]:
    return {path.name: path.stat().st_ino for path in (folder / TRIALS).glob("*.json")}


def _files(folder: Path) -> Mapping[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


if __name__ == "__main__":
    main()
