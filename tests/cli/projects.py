"""Projects whose programs have run."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.cli.test_commands import codra


def run_project(folder: Path, files: Mapping[str, str], *arguments: str) -> str:
    """Write a project, compile its specs and run its `program.py`; return what the program printed."""
    for name, text in {"pyproject.toml": "[tool.codra]\n", **files}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    process = codra("compile", "specs", cwd=folder)
    assert process.returncode == 0, process.stdout + process.stderr
    command = [sys.executable, "program.py", *arguments]
    return subprocess.run(command, cwd=folder, check=True, text=True, stdout=subprocess.PIPE).stdout
