"""`codra serve` as a program: what it says, and how it ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PLAIN = "codra: 1\nname: plain\ncontext: {near: {type: bool, source: main_execution}}\n"


@pytest.mark.parametrize("runs_all", [True, False], ids=["without loops", "with loops"])
def test_serving_ends_cleanly_as_soon_as_it_is_stopped_and_states_that_loops_do_not_run(
    runs_all: bool, tmp_path: Path
) -> None:
    spec, listen = tmp_path / "plain.yaml", tmp_path / "socket"
    spec.write_text(PLAIN, encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n", encoding="utf-8")
    path, folder = (spec, tmp_path) if runs_all else (ROOT / "specs/store.yaml", ROOT)
    command = [sys.executable, "-m", "codra_dsl", "serve", str(path), "--listen", str(listen)]
    with subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True) as program:
        assert program.stderr is not None
        first_line = program.stderr.readline()
        program.send_signal(signal.SIGTERM)
        other_lines = program.stderr.readlines()
    assert first_line == f"serving '{path.stem}' at {listen}\n"
    assert program.returncode == 0
    assert ["the loops of the spec do not run" in line for line in other_lines] == ([] if runs_all else [True])
    assert not listen.exists()
