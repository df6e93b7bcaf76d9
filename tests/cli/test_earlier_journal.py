"""A journal that an earlier version of codra recorded, before the layout of the packages changed.

`tests/data/earlier_version.mcap` was recorded by version 0.1.0 in the example of README.md, with 15 s more at its end.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from tests.cli.test_commands import codra

ROOT = Path(__file__).parents[2]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The example of README.md, beside the journal."""
    names_and_texts = re.findall(
        r"^```\w+ file=(\S+)\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE | re.DOTALL
    )
    for name, text in names_and_texts:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    shutil.copy(ROOT / "tests/data/earlier_version.mcap", tmp_path / "run.mcap")
    return tmp_path


def test_a_journal_of_an_earlier_version_is_replayed_to_the_same_events(project: Path) -> None:
    process = codra("replay", "run.mcap", "--spec", "specs/door.yaml", cwd=project)

    assert process.returncode == 0, process.stdout + process.stderr
    assert process.stdout.startswith("equal: 15 events\n")


def test_a_journal_of_an_earlier_version_explains_a_value(project: Path) -> None:
    process = codra("why", "door_open", "--journal", "run.mcap", "--at", "2", cwd=project)

    assert process.returncode == 0, process.stderr
    assert process.stdout.startswith("door_open is true at 2 s")
    assert "perception measure_door saw gap = 0.9 m (job 2)" in process.stdout
