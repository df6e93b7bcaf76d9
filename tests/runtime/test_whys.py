"""What `codra why` names as missing is supplied in a second run; `make whys` does it at two hundred points."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_what_is_named_as_missing_makes_a_variable_observable_in_a_second_run() -> None:
    """At points by chance in runs of the laboratory's spec, of the kitchen's, and of specs by chance."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.whys", "20", "500"], cwd=ROOT, check=False, text=True, capture_output=True
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith("mistakes: 0\n")
    assert " 0 could not be observed" not in done.stdout
