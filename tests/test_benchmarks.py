"""`benchmarks/bench.py` where the peer of a row has not been installed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_a_peer_that_is_not_there_is_told_on_one_line_and_the_next_rows_are_measured(tmp_path: Path) -> None:
    """In a copy of the project, which has no environment beside it; the next rows are those of the same group."""
    for folder in ("benchmarks", "tests/data/fuzzy"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    results = (tmp_path / "benchmarks/results.json").read_bytes()
    command = (sys.executable, "benchmarks/bench.py", "fuzzy", "fuzzy")
    environment = {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False, text=True)
    told = "fuzzy: FuzzyLite is not there: `make .venv-fuzzylite/.ready` installs it\n"
    assert (done.returncode, done.stderr) == (2, told * 2)
    assert done.stdout.split() == ["row", "ours", "peer", "ratio", "target"]
    assert (tmp_path / "benchmarks/results.json").read_bytes() == results


def test_the_target_that_a_missing_peer_names_is_one_of_make() -> None:
    command = ("make", "--dry-run", ".venv-fuzzylite/.ready")
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False, text=True)
    assert done.returncode == 0, done.stderr
