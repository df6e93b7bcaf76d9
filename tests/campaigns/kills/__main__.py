"""Kill writers of journals and report the losses: `python -m tests.campaigns.kills WRITERS SEED ROBOTS`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from random import Random

from tests.campaigns.kills.robot_trial import robot_trial
from tests.campaigns.kills.trial import trial


def main(trials: int, seed: int) -> int:
    """Run the trials; return 1 if a journal lost an acknowledged write."""
    chance = Random(seed)
    with tempfile.TemporaryDirectory(prefix="codra-kills-") as folder:
        outcomes = [trial(Path(folder), chance) for _ in range(trials)]
    begun_outcomes = [outcome for outcome in outcomes if outcome.acknowledged is not None]
    unacknowledged_counts = [(outcome.written or 0) - (outcome.acknowledged or 0) for outcome in begun_outcomes]
    mistakes = [mistake for outcome in outcomes for mistake in outcome.mistakes]
    torn_count = sum(outcome.torn for outcome in begun_outcomes)
    print(f"{trials} writers killed, seed {seed}: {len(begun_outcomes)} had begun, {torn_count} journals torn")
    print(f"{sum(outcome.messages for outcome in outcomes)} messages recovered")
    print(
        f"writes held beyond the last acknowledged one: "
        f"{min(unacknowledged_counts, default=0)} to {max(unacknowledged_counts, default=0)}"
    )
    print(f"mistakes: {len(mistakes)}")
    for mistake in mistakes[:20]:
        print(f"  {mistake}")
    return 1 if mistakes else 0


def robots(trials: int, seed: int) -> int:
    """Kill robots that run in separate processes; return 1 if a journal lost more than the last second."""
    chance, outcomes = Random(seed), []
    for _ in range(trials):
        with tempfile.TemporaryDirectory(prefix="codra-kills-") as folder:
            outcomes.append(robot_trial(Path(folder), chance))
    mistakes = [mistake for outcome in outcomes for mistake in outcome.mistakes]
    lifetimes_s = [outcome.lived_s for outcome in outcomes]
    print(f"{trials} robots killed, seed {seed}, after {min(lifetimes_s):.2f} s to {max(lifetimes_s):.2f} s")
    print(f"{sum(outcome.messages for outcome in outcomes)} messages recovered")
    print(f"lost at most: {max(outcome.lost_s for outcome in outcomes):.3f} s")
    print(f"mistakes: {len(mistakes)}")
    for mistake in mistakes[:20]:
        print(f"  {mistake}")
    return 1 if mistakes or any(outcome.lost_s > 1.0 for outcome in outcomes) else 0


if __name__ == "__main__":
    writers, seed, robots_killed = (int(argument) for argument in sys.argv[1:4])
    failed = main(writers, seed)
    sys.exit(failed or (robots(robots_killed, seed) if robots_killed else 0))
