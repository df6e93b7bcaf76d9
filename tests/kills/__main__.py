"""Kills writers of journals and says what was lost: `python -m tests.kills WRITERS SEED ROBOTS`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from random import Random

from tests.kills.robot_trial import robot_trial
from tests.kills.trial import trial


def main(trials: int, seed: int) -> int:
    """Run the trials; return 1 if a journal lost what its writer had told of."""
    chance = Random(seed)
    with tempfile.TemporaryDirectory(prefix="codra-kills-") as folder:
        outcomes = [trial(Path(folder), chance) for _ in range(trials)]
    begun = [each for each in outcomes if each.acknowledged is not None]
    beyond = [(each.written or 0) - (each.acknowledged or 0) for each in begun]
    wrong = [mistake for each in outcomes for mistake in each.mistakes]
    torn = sum(each.torn for each in begun)
    print(f"{trials} writers killed, seed {seed}: {len(begun)} had begun, {torn} journals torn")
    print(f"{sum(each.messages for each in outcomes)} messages recovered")
    print(f"writes held beyond the last acknowledged one: {min(beyond, default=0)} to {max(beyond, default=0)}")
    print(f"mistakes: {len(wrong)}")
    for mistake in wrong[:20]:
        print(f"  {mistake}")
    return 1 if wrong else 0


def robots(trials: int, seed: int) -> int:
    """Kill robots that run in processes of their own; return 1 if a journal lost more than the last second."""
    chance, outcomes = Random(seed), []
    for _ in range(trials):
        with tempfile.TemporaryDirectory(prefix="codra-kills-") as folder:
            outcomes.append(robot_trial(Path(folder), chance))
    wrong = [mistake for each in outcomes for mistake in each.mistakes]
    lived = [each.lived_s for each in outcomes]
    print(f"{trials} robots killed, seed {seed}, after {min(lived):.2f} s to {max(lived):.2f} s")
    print(f"{sum(each.messages for each in outcomes)} messages recovered")
    print(f"lost at most: {max(each.lost_s for each in outcomes):.3f} s")
    print(f"mistakes: {len(wrong)}")
    for mistake in wrong[:20]:
        print(f"  {mistake}")
    return 1 if wrong or any(each.lost_s > 1.0 for each in outcomes) else 0


if __name__ == "__main__":
    writers, seed, robots_killed = (int(each) for each in sys.argv[1:4])
    failed = main(writers, seed)
    sys.exit(failed or (robots(robots_killed, seed) if robots_killed else 0))
