"""Two folders with the same project: one is compiled with results of earlier runs, the other without any."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from random import Random

from typer.testing import CliRunner

from codra_dsl.cli.app import app
from codra_dsl.compiler import lint_paths, plan_paths
from codra_dsl.workspace.cache import FOLDER, SpecResults, result_key
from tests.campaigns.edits.changes import Edit, random_edit

FOLDERS = ("specs", "sites")
COMMANDS = (
    ("compile", "specs"),
    ("compile", "specs"),
    ("compile", "specs", "--check", "--format", "json"),
    ("compile", "specs", "--out", "elsewhere"),
    ("compile", "specs/gate.yaml"),
    ("compile", "specs", "--site", "sites/dock.yaml", "--out", "dock"),
    ("compile", "specs/hatch.yaml", "--site", "sites/yard.yaml"),
    ("compile", "specs", "--site", "sites/dock.yaml", "--site", "sites/yard.yaml", "--out", "dock", "--check"),
    ("lint", "specs", "sites", "--format", "json"),
    ("lint", "specs", "--format", "json"),
    ("lint", "specs", "--format", "json"),
    ("lint", "specs/hatch.yaml", "--fail-on", "warning"),
    ("lint", "specs/parts", "specs/gate.yaml"),
    ("lint", "specs", "--diff"),
)


class DifferenceError(Exception):
    """A run with results of earlier runs differs from a run without them."""


class Comparison:
    """Edits both projects in the same way, and compares runs on them.

    Attributes:
        edit_counts: how often each kind of edit was made.
        reused_count: how many results of specs were used again in memory; `result_count` counts all of them.
    """

    def __init__(self, initial_files: Mapping[str, str], folder: Path, seed: int) -> None:
        self.edit_counts: dict[str, int] = {}
        self.reused_count = self.result_count = 0
        self._chance = Random(seed)
        self._initial_files = self._files = dict(initial_files)
        self._warm, self._cold = (folder / name / "project" for name in ("warm", "cold"))
        self._results: SpecResults = {}
        for project in (self._warm, self._cold):
            _write(project, self._files)

    def step(self) -> None:
        """Make one edit, and compare a command on disk, and a lint in memory before the edit is saved.

        Raises:
            DifferenceError: if a result differs. The message has the edit and both results.
        """
        name, edit = random_edit(self._files, self._initial_files, self._chance)
        self.edit_counts[name] = self.edit_counts.get(name, 0) + 1
        self._compare_unsaved(edit)
        for project in (self._warm, self._cold):
            _write(project, edit)
        self._files = {file: text for file, text in {**self._files, **edit}.items() if text is not None}
        self._edit_output()
        self._compare_command(self._chance.choice(COMMANDS), f"{name} {edit}")

    def _compare_unsaved(self, edit: Edit) -> None:
        """Compare the findings about texts that are not on disk, as an editor asks for them."""
        texts = {file: text.encode() for file, text in edit.items() if text is not None and file in self._files}
        arguments = [folder for name in FOLDERS if (folder := self._warm / name).exists()], self._warm, texts
        before = dict(self._results)
        warm = lint_paths(*arguments, results=self._results)
        cold = plan_paths(*arguments)
        keys = [result_key(self._warm / spec, self._warm) for spec in warm.specs]
        self.result_count += len(keys)
        self.reused_count += sum(before.get(key) is self._results[key] for key in keys)
        if warm.diagnostics != cold.diagnostics or (warm.files, warm.modules) != (cold.files, cold.modules):
            raise DifferenceError(f"unsaved {edit}\n{warm.diagnostics}\n{cold.diagnostics}")

    def _edit_output(self) -> None:
        """Sometimes delete or change a generated file."""
        outputs = sorted(file for file in _content(self._cold) if file.startswith("generated/"))
        if outputs and self._chance.random() < 0.1:
            edit = {self._chance.choice(outputs): self._chance.choice([None, "edited = True\n"])}
            for project in (self._warm, self._cold):
                _write(project, edit)

    def _compare_command(self, command: tuple[str, ...], edit_text: str) -> None:
        warm, cold = _run(self._warm, *command), _run(self._cold, *command, "--no-cache")
        if warm != cold:
            raise DifferenceError(f"{command} after {edit_text}\n{warm}\n{cold}")
        if _content(self._warm) != _content(self._cold):
            raise DifferenceError(f"{command} after {edit_text}: other files")


def _run(folder: Path, *arguments: str) -> tuple[int, str, str]:
    """Run a command in a folder, in this process."""
    previous_folder = Path.cwd()
    os.chdir(folder)
    try:
        result = CliRunner().invoke(app, arguments)
    finally:
        os.chdir(previous_folder)
    return result.exit_code, result.stdout, result.stderr


def _write(project: Path, files: Mapping[str, str | None]) -> None:
    for path, text in files.items():
        file = project / path
        if text is None:
            file.unlink(missing_ok=True)
        else:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, "utf-8")


def _content(folder: Path) -> dict[str, bytes]:
    """Return every file of a project except those of the cache."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and FOLDER not in path.parts)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
