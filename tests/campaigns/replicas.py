"""Replicas of a graph on a faulty network, with wrong clocks and crashes: do all converge, without losing a write?

python -m tests.campaigns.replicas RUNS SEED
"""

from __future__ import annotations

import sys

from tests.runtime.replication.fleet import Fleet


def main(run_count: int, first_seed: int) -> int:
    """Make some runs; return 1 if in one of them replicas differ, lose a write, or accept a foreign one."""
    commit_count = foreign_count = crash_count = 0
    for seed in range(first_seed, first_seed + run_count):
        fleet = Fleet(seed)
        failures = fleet.run()
        if failures:
            print(f"seed {seed}:", *failures, sep="\n")
            return 1
        commit_count += len(fleet.commits)
        foreign_count += fleet.foreign_count
        crash_count += fleet.crash_count
        if (seed - first_seed) % 1000 == 999:
            print(f"{seed - first_seed + 1} runs, {commit_count} commits, {crash_count} crashes", flush=True)
    print(
        f"{run_count} runs, {commit_count} commits, {foreign_count} of them foreign, {crash_count} crashes: all agree"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
