"""`codra serve` before it waits: what it says, and how it ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(("spec", "runs_loops"), [("store", False), ("kitchen", True)])
def test_serving_states_that_the_loops_of_a_spec_do_not_run(spec: str, runs_loops: bool, tmp_path: Path) -> None:
    program = subprocess.Popen(
        [sys.executable, "-m", "codra_dsl", "serve", f"specs/{spec}.yaml", "--listen", str(tmp_path / "socket")],
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert program.stderr is not None
    lines = [program.stderr.readline()]
    program.send_signal(signal.SIGTERM)
    lines += program.stderr.readlines()
    assert program.wait() == 0
    assert lines[0] == f"serving '{spec}' at {tmp_path / 'socket'}\n"
    assert any("the loops of the spec do not run" in line for line in lines) is not runs_loops
