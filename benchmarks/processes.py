"""Runs commands in processes of their own and says what each took: the whole process, from start to end."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Spent:
    """What a process took.

    Attributes:
        wall_s: from its start to its end.
        peak_bytes: the most memory that it held.
    """

    wall_s: float
    peak_bytes: int


def spend(command: Sequence[str | Path], folder: Path) -> Spent:
    """Run a command in a folder, require that it succeeds, and return what it took."""
    began_s = time.perf_counter()
    environment = {name: value for name, value in os.environ.items() if name != "CI"}  # with it there is no cache
    process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    assert process.stderr is not None
    told = process.stderr.read()
    _, status, used = os.wait4(process.pid, 0)
    wall_s = time.perf_counter() - began_s
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    if process.returncode != 0:
        raise RuntimeError(f"{command}: {told.decode(errors='replace')}")
    return Spent(wall_s=wall_s, peak_bytes=used.ru_maxrss * 1024)


def in_turns(runs: int, *measurements: Callable[[], Spent]) -> list[Spent]:
    """Measure several things in turns, so that what slows the machine down hits all; return the median of each."""
    found: list[list[Spent]] = [[] for _ in measurements]
    for _ in range(runs):
        for spent, measure in zip(found, measurements, strict=True):
            spent.append(measure())
    return [
        Spent(
            wall_s=statistics.median(each.wall_s for each in spent),
            peak_bytes=int(statistics.median(each.peak_bytes for each in spent)),
        )
        for spent in found
    ]
