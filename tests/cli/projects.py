"""Projects whose programs have run."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from tests.cli.test_commands import codra
from tests.command_server import as_text, run_python


def run_project(folder: Path, files: Mapping[str, str], *arguments: str) -> str:
    """Write a project, compile its specs and run its `program.py`; return what the program printed."""
    for name, text in {"pyproject.toml": "[tool.codra]\n", **files}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    process = codra("compile", "specs", cwd=folder)
    assert process.returncode == 0, process.stdout + process.stderr
    return run_program(folder, "program.py", *arguments)


def run_program(folder: Path, *arguments: str) -> str:
    """Run a Python program in a folder, without an error; return what it printed."""
    program = as_text(run_python(arguments, folder, os.environ))
    assert program.returncode == 0, program.stderr
    return program.stdout
