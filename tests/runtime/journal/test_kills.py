"""Writers of journals that are killed while they write; `make kills` kills two thousand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def test_a_killed_writer_loses_no_acknowledged_write() -> None:
    """Each journal is recovered, opens in MCAP's own reader, has no gap, and equals its replay."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns.kills", "24", "7", "0"],
        cwd=ROOT,
        check=False,
        text=True,
        capture_output=True,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert "mistakes: 0\n" in done.stdout
    figures = re.search(r"(\d+) had begun, (\d+) journals torn", done.stdout)
    assert figures is not None
    assert min(map(int, figures.groups())) >= 6, "most writers must die while they write"


def test_a_killed_robot_loses_less_than_a_second_and_its_journal_can_be_replayed() -> None:
    """Replay derives removed events of variables and decisions again, and reports an edited precondition's line."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns.kills", "1", "3", "1"],
        cwd=ROOT,
        check=False,
        text=True,
        capture_output=True,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 robots killed" in done.stdout
    assert done.stdout.endswith("mistakes: 0\n")
