"""Writers that are killed in the midst of it; `make kills` kills two thousand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_a_killed_writer_loses_nothing_that_it_had_told_of() -> None:
    """Each journal recovers, opens in the reader of MCAP's makers, has no gap, and its replay equals it."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.kills", "40", "7", "0"], cwd=ROOT, check=False, text=True, capture_output=True
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert "mistakes: 0\n" in done.stdout
    figures = re.search(r"(\d+) had begun, (\d+) journals torn", done.stdout)
    assert figures is not None
    assert min(map(int, figures.groups())) >= 10, "most writers must die while they write"


def test_a_killed_robot_loses_less_than_a_second_and_its_journal_can_be_replayed() -> None:
    """A journal stripped of variables and decisions gives them back; an edited precondition is named with its line."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.kills", "1", "3", "2"], cwd=ROOT, check=False, text=True, capture_output=True
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 robots killed" in done.stdout
    assert done.stdout.endswith("mistakes: 0\n")
