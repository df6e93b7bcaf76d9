"""Ask `codra why` at random points, and supply the missing conditions.

Run it with `python -m tests.campaigns.whys POINTS [FIRST_SEED]`.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from tests.campaigns.whys.experiment import experiment


def main(points: int, first: int) -> int:
    """Run the experiments; return 1 if supplying the missing conditions did not help."""
    with tempfile.TemporaryDirectory(prefix="codra-whys-") as folder:
        outcomes = [experiment(seed, Path(folder)) for seed in range(first, first + points)]
    blocked = [outcome for outcome in outcomes if outcome.named]
    wrong = [outcome for outcome in outcomes if outcome.mistake]
    print(f"{points} unknown variables, seeds {first} to {first + points - 1}: {len(blocked)} could not be observed")
    print(f"reported as missing: {sum(outcome.named for outcome in blocked)}")
    print(f"an algorithm looked then, without further changes: {sum(outcome.looked is True for outcome in outcomes)}")
    idle = [outcome.point for outcome in outcomes if outcome.looked is False]
    print(f"none looked: {len(idle)}" + "".join(f"\n  {point}" for point in idle[:20]))
    print(f"mistakes: {len(wrong)}")
    for outcome in wrong[:20]:
        print(f"  {outcome.point}: {outcome.mistake}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0))
