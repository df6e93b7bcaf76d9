"""`codra why` and `codra journal recover` on the journal of a program that is still running or has been killed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.test_commands import ROOT, codra

ROBOT = """
import sys
from codra_dsl.runtime import Journal, WallClock
from generated import kitchen
from tests.campaigns.kills.robot import ROOM
from types import SimpleNamespace
with WallClock(start_s=100.0) as clock:
    codra = kitchen.start(clock=clock, resources={"kitchen": SimpleNamespace(**ROOM)}, record=Journal(sys.argv[1]))
    codra.declare("kettle_docked")
    for line in sys.stdin:
        if line == "localized\\n":
            codra.set("robot_is_localized", True)
            assert clock.wait_until(lambda: codra.get("kettle_docked").known, 60.0)
        print(clock.now_s(), flush=True)
"""


class Robot:
    """A program that waits for lines and answers each after it has executed it."""

    def __init__(self, journal: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", ROBOT, str(journal)],
            cwd=ROOT,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    def ask(self, what: str) -> str:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(f"{what}\n")
        self.process.stdin.flush()
        return self.process.stdout.readline()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    running = Robot(tmp_path / "run.mcap")
    yield running
    running.process.kill()
    running.process.communicate()


def test_the_journal_of_a_running_program_explains_the_knowledge_so_far(robot: Robot, tmp_path: Path) -> None:
    ask = ("why", "kettle_docked", "--journal", "run.mcap")
    robot.ask("wait")
    before = codra(*ask, cwd=tmp_path)
    robot.ask("localized")
    after = codra(*ask, cwd=tmp_path)

    assert (before.returncode, after.returncode) == (0, 0)
    assert before.stderr.startswith("codra: 'run.mcap' is still being written: it holds what happened up to 100")
    assert before.stdout.startswith("kettle_docked is unknown (never_observed) at 100")
    assert "missing: robot_is_localized = true" in before.stdout
    assert after.stdout.startswith("kettle_docked is true at 10")
    assert "perception ask_dock saw contact = true" in after.stdout


def test_a_running_program_keeps_its_journal_while_a_copy_is_repaired(robot: Robot, tmp_path: Path) -> None:
    robot.ask("localized")
    process = codra("journal", "recover", "run.mcap", cwd=tmp_path)

    assert process.returncode == 0
    assert "the program is still writing this journal: this is its content so far" in process.stdout
    assert codra("replay", "run.recovered.mcap", "--package", f"{ROOT}/generated/kitchen", cwd=tmp_path).returncode == 0
    robot.ask("wait")
    robot.process.kill()
    robot.process.wait()
    killed = codra("why", "kettle_docked", "--journal", "run.mcap", cwd=tmp_path)
    assert "codra: 'run.mcap' lacks its end" in killed.stderr
    assert killed.stdout.startswith("kettle_docked is true at 10")


def test_a_journal_without_a_run_is_reported_as_empty(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").touch()
    for command in (("why", "a", "--journal", "run.mcap"), ("replay", "run.mcap"), ("journal", "recover", "run.mcap")):
        process = codra(*command, cwd=tmp_path)

        assert (process.returncode, process.stdout) == (1, "")
        assert process.stderr == "codra: run.mcap is empty: its run had not begun, or the file was truncated\n"
