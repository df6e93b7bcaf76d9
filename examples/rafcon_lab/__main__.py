"""Run the state machine with and without observers, and compare the journals.

python -m examples.rafcon_lab --seeds 3
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from tempfile import TemporaryDirectory

from examples.rafcon_lab.comparison import Arm, comparison_table
from examples.rafcon_lab.running import run


def main() -> None:
    """Run each seed in both arms and print the comparison of the journals."""
    parser = argparse.ArgumentParser(prog="python -m examples.rafcon_lab", description=__doc__)
    parser.add_argument(
        "--seeds", type=int, default=1, help="number of runs of each arm, each with its own random seed"
    )
    parser.add_argument("--journals", type=Path, help="the folder for the journals")
    arguments = parser.parse_args()
    logging.getLogger("rafcon").setLevel(logging.ERROR)
    with TemporaryDirectory() as temporary_folder:
        folder = arguments.journals or Path(temporary_folder)
        folder.mkdir(parents=True, exist_ok=True)
        runs = []
        for seed in range(1, arguments.seeds + 1):
            for arm in Arm:
                path = folder / f"seed-{seed}-{arm}-observers.mcap"
                runs.append((seed, arm, run(arm, seed, path).outcome, path))
        print(comparison_table(runs))


if __name__ == "__main__":
    main()
