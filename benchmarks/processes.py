"""Run commands in separate processes, and measure each process from start to end."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """The cost of a process.

    Attributes:
        wall_s: the time from the start to the end of the process.
        cpu_s: the processor time of the process.
        peak_bytes: the peak memory of the process.
    """

    wall_s: float
    cpu_s: float
    peak_bytes: int


def run(command: Sequence[str | Path], folder: Path) -> Cost:
    """Run a command in a folder, require that it succeeds, and return its cost."""
    start_s = time.perf_counter()
    environment = {name: value for name, value in os.environ.items() if name != "CI"}  # with CI there is no cache
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    stderr_output = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - start_s
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    if process.returncode != 0:
        raise RuntimeError(f"{command}: {stderr_output.decode(errors='replace')}")
    return Cost(wall_s=wall_s, cpu_s=usage.ru_utime + usage.ru_stime, peak_bytes=usage.ru_maxrss * 1024)


def in_turns(run_count: int, *measurements: Callable[[], Cost]) -> list[Cost]:
    """Run measurements in turns, so that a slower machine affects all of them, and return their medians."""
    costs_by_side: list[list[Cost]] = [[] for _ in measurements]
    for _ in range(run_count):
        for costs, measure in zip(costs_by_side, measurements, strict=True):
            costs.append(measure())
    return [
        Cost(
            wall_s=statistics.median(cost.wall_s for cost in costs),
            cpu_s=statistics.median(cost.cpu_s for cost in costs),
            peak_bytes=int(statistics.median(cost.peak_bytes for cost in costs)),
        )
        for costs in costs_by_side
    ]
