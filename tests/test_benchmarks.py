"""`benchmarks/bench.py`, if the peer of a row is not installed; and the specs that are measured."""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.generation.emit.records import graph_text, model_digest

ROOT = Path(__file__).parents[1]


def test_a_missing_peer_is_reported_on_one_line_and_the_next_rows_are_measured(tmp_path: Path) -> None:
    """It runs in a copy of the project without an environment beside it; the next rows are those of the same group."""
    for folder in ("benchmarks", "tests/data/fuzzy"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    results = (tmp_path / "benchmarks/results.json").read_bytes()
    command = (sys.executable, "benchmarks/bench.py", "fuzzy", "fuzzy")
    environment = {"PYTHONPATH": str(ROOT)}
    process = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False, text=True)
    message = "fuzzy: FuzzyLite is not installed: `make .venv-fuzzylite/.ready` installs it\n"
    assert (process.returncode, process.stderr) == (2, message * 2)
    assert process.stdout.split() == ["row", "ours", "peer", "ratio", "target"]
    assert (tmp_path / "benchmarks/results.json").read_bytes() == results


def test_the_expanded_spec_means_what_the_templated_spec_means(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    forests = importlib.import_module("forests")
    models = []
    for files in (forests.templated(25), forests.expanded(25)):
        folder = tmp_path / str(len(models))
        forests.write(files, folder)
        (plan,) = plan_paths([folder], folder).plans
        models.append((model_digest(plan), graph_text(plan)))

    assert models[0] == models[1]


def test_the_target_that_a_missing_peer_names_exists_in_the_makefile() -> None:
    command = ("make", "--dry-run", ".venv-fuzzylite/.ready")
    process = subprocess.run(command, cwd=ROOT, capture_output=True, check=False, text=True)
    assert process.returncode == 0, process.stderr
