"""`codra experiment` in the store, in real processes: a search, the trials that depend on it, and continuing both."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import codra_papers.experiments
from tests.cli.test_commands import ROOT, codra

TINY = ("experiment", "tiny_store:EXPERIMENT", "--spec", "specs/store.yaml", "--processes", "2")
SEARCHED = "grid-1.5m-15percent-full-1.json"
REPORTED = ("none-2.json", "ours-2.json", "random-2.json", "threshold-2.json")
FOLDER = Path("runs/tiny-store")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project with the store's spec after the experiment was run in it."""
    folder = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "specs", folder / "specs")
    shutil.copy(ROOT / "tests/papers/experiments/tiny_store.py", folder)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    done = codra(*TINY, cwd=folder)

    assert done.returncode == 0, done.stderr
    (folder / "stdout").write_text(done.stdout)
    return folder


def inodes(project: Path) -> dict[str, int]:
    return {path.name: path.stat().st_ino for path in (project / FOLDER / "trials").glob("*.json")}


def results(project: Path) -> Any:
    return json.loads((project / FOLDER / "results.json").read_text())


def test_the_thresholds_of_the_search_are_run_with_all_managers(project: Path) -> None:
    assert set(inodes(project)) == {SEARCHED, *REPORTED}
    assert results(project)["seeds"] == [1, 2]
    assert list(results(project)["results"]["managers"]) == ["none", "ours", "random", "threshold"]
    assert "Missions completed of a run: none " in (project / "stdout").read_text()


def test_the_data_has_the_published_form(project: Path) -> None:
    schema = json.loads((Path(codra_papers.experiments.__file__).parent / "campaign/results.schema.json").read_text())

    jsonschema.validate(results(project), schema)


def test_the_page_has_both_pictures_and_the_grid(project: Path) -> None:
    page = (project / FOLDER / "report.html").read_text()

    assert page.count("data:image/svg+xml") == 2
    assert "chosen" in page


def test_it_continues_where_it_stopped_in_the_search_and_after_it(project: Path, tmp_path: Path) -> None:
    copied = Path(shutil.copytree(project, tmp_path / "project"))
    before, was = inodes(copied), results(copied)["results"]
    for name in (SEARCHED, "ours-2.json"):
        (copied / FOLDER / "trials" / name).unlink()
    done = codra(*TINY, cwd=copied)

    assert done.returncode == 0, done.stderr
    assert {name for name, number in inodes(copied).items() if before[name] == number} == {
        *set(REPORTED) - {"ours-2.json"}
    }
    assert results(copied)["results"] == was
    assert "3 had been run before" in (copied / FOLDER / "report.html").read_text()


def test_a_trial_that_depends_on_the_search_is_run_alone_by_its_name(project: Path, tmp_path: Path) -> None:
    copied = Path(shutil.copytree(project, tmp_path / "project"))
    (copied / FOLDER / "trials" / "none-2.json").unlink()
    done = codra(*TINY, "--trial", "none-2", cwd=copied)

    assert done.returncode == 0, done.stderr
    assert done.stdout == "trial 'none-2' (seed 2): 12.0 s, 0 loops\n"


def test_a_spec_without_loops_is_reported_in_a_line(project: Path) -> None:
    done = codra("experiment", "tiny_store:EXPERIMENT", "--spec", "specs/lab.yaml", "--out", "runs/lab", cwd=project)

    assert done.returncode == 1
    assert "the spec has no loops, so no managers can be compared" in done.stderr
    assert "Traceback" not in done.stderr
