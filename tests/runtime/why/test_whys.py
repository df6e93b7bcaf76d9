"""Supply the conditions that `codra why` reports as missing in a second run; `make whys` does so at 200 points."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_supplying_missing_conditions_makes_a_variable_observable_in_a_second_run() -> None:
    """Test at random points in runs of the laboratory's spec, of the kitchen's spec, and of random specs."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns.whys", "8", "500"],
        cwd=ROOT,
        check=False,
        text=True,
        capture_output=True,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("mistakes: 0\n")
    assert " 0 could not be observed" not in done.stdout
