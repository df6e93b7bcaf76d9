"""A scheduler and workers of Dask on this machine, as processes that tests start and kill."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).parents[4]
_LISTENS = re.compile(r"(?:Scheduler|worker) at: +(tcp://\S+)")


class DaskProcess:
    """A scheduler or a worker."""

    def __init__(
        self,
        folder: Path,
        *arguments: str,
        environment: Mapping[str, str] | None = None,
        prefix: Sequence[str] = (),
    ) -> None:
        """Start the process in a folder, by a command that may have a prefix, and wait until it listens."""
        self._process = subprocess.Popen(
            [*prefix, sys.executable, "-m", "dask", *arguments, "--no-dashboard"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), **(environment or {})},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.address = self._announced_address()

    @property
    def number(self) -> int:
        """Return the number of the process."""
        return self._process.pid

    def kill(self) -> None:
        """Kill the process, if it still runs."""
        self._process.kill()
        self._process.wait()
        if self._process.stderr is not None:
            self._process.stderr.close()

    def _announced_address(self) -> str:
        lines = []
        assert self._process.stderr is not None
        for line in self._process.stderr:
            lines.append(line)
            if announcement := _LISTENS.search(line):
                return announcement[1]
        raise AssertionError("".join(lines))


def scheduler(folder: Path, port: int = 0) -> DaskProcess:
    """Start a scheduler; port 0 is any free port."""
    return DaskProcess(folder, "scheduler", "--host", "127.0.0.1", "--port", str(port))


def worker(folder: Path, address: str, environment: Mapping[str, str] | None = None) -> DaskProcess:
    """Start a worker with one thread, which ends with its scheduler."""
    arguments = ("--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--death-timeout", "30")
    return DaskProcess(folder, "worker", address, *arguments, environment=environment)
