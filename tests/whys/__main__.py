"""Asks why at random points, and does what it says: `python -m tests.whys POINTS [FIRST_SEED]`."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.whys.experiment import experiment


def main(points: int, first: int) -> int:
    """Run the experiments; return 1 if what was named did not help."""
    with tempfile.TemporaryDirectory(prefix="codra-whys-") as folder:
        outcomes = [experiment(seed, Path(folder)) for seed in range(first, first + points)]
    blocked = [each for each in outcomes if each.named]
    wrong = [each for each in outcomes if each.mistake]
    print(f"{points} unknown variables, seeds {first} to {first + points - 1}: {len(blocked)} could not be observed")
    print(f"things named as missing: {sum(each.named for each in blocked)}")
    print(f"an algorithm looked then, with nothing else done: {sum(each.looked is True for each in outcomes)}")
    idle = [each.point for each in outcomes if each.looked is False]
    print(f"none looked: {len(idle)}" + "".join(f"\n  {point}" for point in idle[:20]))
    print(f"mistakes: {len(wrong)}")
    for each in wrong[:20]:
        print(f"  {each.point}: {each.mistake}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0))
