"""Hosts with wrong clocks: does evidence count that the rules of one process would reject?

python -m tests.campaigns.wrong_clocks RUNS FIRST_SEED
"""

from __future__ import annotations

import sys

import pytest

from tests.runtime.remote.test_hosts import Verdicts, run_with_wrong_clock


def main(run_count: int, first_seed: int) -> int:
    """Make some runs; return 1 if evidence counted in one of them that must not count."""
    verdicts = Verdicts()
    with pytest.MonkeyPatch.context() as monkeypatch:
        verdicts.watch(monkeypatch)
        for seed in range(first_seed, first_seed + run_count):
            run_with_wrong_clock(seed, verdicts)
            if not all(verdicts.verdicts):
                print(f"seed {seed}: evidence counted that must not count")
                return 1
            if (seed - first_seed) % 1000 == 999:
                print(f"{seed - first_seed + 1} runs, {len(verdicts.verdicts)} values counted", flush=True)
    print(f"{run_count} runs, {len(verdicts.verdicts)} values counted, none that one process would reject")
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
