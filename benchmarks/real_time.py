"""A robot with two thousand observers at 1 Hz in real time, on one core: `python benchmarks/real_time.py [SECONDS]`.

No peer does this work, so this is not a row of `results.json`. The script prints how many variables are known, the age
of their evidence (median, 99th percentile), and the CPU time of the process as a share of the elapsed time. Then it
withdraws all variables, declares a thousand of them in one call each, and prints when all of them are known.

The figures depend on the other work of the machine: run the script when nothing else runs.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from forests import OBSERVERS_PER_CHAIN
from running import compile_forest, last_door_variable, near_variable

from codra_dsl.runtime import WallClock

CHAIN_COUNT = 200
CHAINS_AT_ONCE = 100
SAMPLE_COUNT = 10
LONGEST_SETTLING_S = 30.0
REFRESH_S = 5.0


def main(duration_s: float) -> None:
    """Measure and print."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory(prefix="codra-bench-") as scratch:
        package = compile_forest(Path(scratch), CHAIN_COUNT)
        with WallClock() as clock, package.start(clock=clock, resources={"camera": None}) as codra:
            _declare(codra, range(CHAIN_COUNT), pause_s=1.0 / CHAIN_COUNT)
            _pass_time(codra, clock, 3.0)
            cpu_s, start_s = time.process_time(), clock.now_s()
            known_counts, ages_s = list[int](), list[float]()
            for _ in range(SAMPLE_COUNT):
                _pass_time(codra, clock, duration_s / SAMPLE_COUNT)
                known_readings = _known_readings(codra, range(CHAIN_COUNT))
                known_counts.append(len(known_readings))
                ages_s += [reading.age_s(clock.now_s()) for reading in known_readings]
            share = (time.process_time() - cpu_s) / (clock.now_s() - start_s)
            _report_steady(known_counts, ages_s, share)
            for chain in range(CHAIN_COUNT):
                codra.withdraw(last_door_variable(chain))
        with WallClock() as clock, package.start(clock=clock, resources={"camera": None}) as codra:
            _report_settling(codra, clock)


def _declare(codra: Any, chains: Iterable[int], pause_s: float = 0.0) -> None:
    for chain in chains:
        _refresh(codra, [chain])
        codra.declare(last_door_variable(chain))
        if pause_s:
            time.sleep(pause_s)


def _refresh(codra: Any, chains: Iterable[int]) -> None:
    """Write the variables of the main execution, which the observers need and which are valid for 20 s."""
    for chain in chains:
        codra.set(f"bay_{chain:05}_is_lit", True)
        codra.set(near_variable(chain), True)


def _pass_time(codra: Any, clock: WallClock, duration_s: float) -> None:
    end_s = clock.now_s() + duration_s
    while clock.now_s() < end_s:
        clock.sleep(min(REFRESH_S, end_s - clock.now_s()))
        _refresh(codra, range(CHAIN_COUNT))


def _known_readings(codra: Any, chains: Iterable[int]) -> list[Any]:
    names = [f"bay_{chain:05}_door_{number}_open" for chain in chains for number in range(OBSERVERS_PER_CHAIN)]
    return [reading for reading in map(codra.get, names) if reading.known]


def _report_steady(known_counts: list[int], ages_s: list[float], share: float) -> None:
    count = CHAIN_COUNT * OBSERVERS_PER_CHAIN
    print(f"{count} observers at 1 Hz: at least {min(known_counts)} known")
    print(f"age of the evidence: median {statistics.median(ages_s):.2f} s, p99 {_percentile(ages_s):.2f} s")
    print(f"CPU: {share:.0%} of one core")


def _report_settling(codra: Any, clock: WallClock) -> None:
    count, start_s = CHAINS_AT_ONCE * OBSERVERS_PER_CHAIN, clock.now_s()
    _declare(codra, range(CHAINS_AT_ONCE))
    while len(_known_readings(codra, range(CHAINS_AT_ONCE))) < count and clock.now_s() < start_s + LONGEST_SETTLING_S:
        clock.sleep(0.05)
    known_count = len(_known_readings(codra, range(CHAINS_AT_ONCE)))
    print(f"{count} observers declared at once: {known_count} known after {clock.now_s() - start_s:.2f} s")


def _percentile(values: list[float]) -> float:
    return statistics.quantiles(values, n=100)[98]


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
