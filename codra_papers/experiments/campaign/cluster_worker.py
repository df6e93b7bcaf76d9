"""The task of a worker of a Dask cluster: it starts a process for a trial and passes bytes on.

A worker imports nothing else of codra. So importing takes no time, and a worker that was started before an update of
codra runs the new code.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from distributed import Worker, get_worker

_RESULT = "result"
_PROGRAM = f"from codra_papers.experiments.campaign.cluster_trial import main; main({_RESULT!r})"
_POLL_PERIOD_S = 0.2


def run_parcel(parcel: bytes, worker_id: str, environment: Mapping[str, str]) -> bytes | int | None:
    """Run a trial in a new process, as a task of a worker. The process is killed if the task is cancelled.

    Args:
        parcel: a `Parcel` as `pickle` writes it.
        worker_id: the identity of the worker that may run the trial.
        environment: further environment variables of the process.

    Returns:
        A `MadeRecord`, `Failure` or `Refusal` of `cluster_trial` as `pickle` writes it; the exit code of the process
        if it reported nothing; None if another worker has taken the address of the worker.
    """
    worker = get_worker()
    if worker.id != worker_id:
        return None
    key = worker.get_current_task()
    with tempfile.TemporaryDirectory(prefix="codra-") as folder:
        process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM],
            cwd=folder,
            env={**os.environ, **environment},
            stdin=subprocess.PIPE,
        )
        with process:
            assert process.stdin is not None
            with contextlib.suppress(BrokenPipeError):  # it has ended: its exit code is reported
                process.stdin.write(parcel)
                process.stdin.flush()
            while not _has_ended(process):
                task = worker.state.tasks.get(key)
                if task is None or task.state != "executing":
                    process.kill()
        result = Path(folder, _RESULT)
        return result.read_bytes() if process.returncode == 0 and result.exists() else process.returncode


def identity_of(dask_worker: Worker) -> str:
    """Return the identity of the worker that runs this function; a worker that is started again has another one."""
    return str(dask_worker.id)


def _has_ended(process: subprocess.Popen[bytes]) -> bool:
    """Wait for a moment for a process to end, and return whether it has ended."""
    try:
        process.wait(_POLL_PERIOD_S)
    except subprocess.TimeoutExpired:
        return False
    return True
