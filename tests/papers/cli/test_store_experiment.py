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

TINY_COMMAND = ("experiment", "tiny_store:EXPERIMENT", "--spec", "specs/store.yaml", "--processes", "2")
THRESHOLD_RECORD = "threshold, person 1.5 m, battery 15 percent, load full, 1.json"
SEARCH_RECORDS = (THRESHOLD_RECORD, "ours tuned, crowding +0.2, battery +0 percent, hold of the spec, 1.json")
MANAGERS = ("course only", "none", "ours", "ours tuned", "speed only", "threshold")
REPORTED_RECORDS = tuple(f"{manager} 2.json" for manager in MANAGERS)
FOLDER = Path("runs/tiny-store")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project with the store's spec after the experiment was run in it."""
    folder = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "specs", folder / "specs")
    shutil.copy(ROOT / "tests/papers/experiments/tiny_store.py", folder)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    completed_process = codra(*TINY_COMMAND, cwd=folder)

    assert completed_process.returncode == 0, completed_process.stderr
    (folder / "stdout").write_text(completed_process.stdout)
    return folder


def inodes(project: Path) -> dict[str, int]:
    return {path.name: path.stat().st_ino for path in (project / FOLDER / "trials").glob("*.json")}


def results(project: Path) -> Any:
    return json.loads((project / FOLDER / "results.json").read_text())


def test_the_results_of_both_searches_are_run_with_all_managers(project: Path) -> None:
    assert set(inodes(project)) == {*SEARCH_RECORDS, *REPORTED_RECORDS}
    assert results(project)["seeds"] == [1, 2]
    assert tuple(results(project)["results"]["managers"]) == MANAGERS
    assert set(results(project)["results"]["chosen"]) == {"threshold", "ours tuned"}
    assert "Missions completed in an hour: none " in (project / "stdout").read_text()


def test_the_summary_begins_with_the_answer(project: Path) -> None:
    answer = results(project)["results"]["answers"][0]

    assert (project / "stdout").read_text().startswith(answer)
    assert answer.startswith("Compared with 'speed only', 'ours' brings, in an hour: no clear advantage;")


def test_the_data_has_the_published_form(project: Path) -> None:
    schema = json.loads((Path(codra_papers.experiments.__file__).parent / "campaign/results.schema.json").read_text())

    jsonschema.validate(results(project), schema)


def test_the_page_has_both_pictures_and_all_cells_of_both_searches(project: Path) -> None:
    page = (project / FOLDER / "report.html").read_text()

    assert page.count("data:image/svg+xml") == 2
    assert page.count("chosen") == 2
    assert "person 1.5 m, battery 15 percent, load full" in page
    assert "crowding +0.2, battery +0 percent, hold of the spec" in page


def test_it_continues_where_it_stopped_in_the_search_and_after_it(project: Path, tmp_path: Path) -> None:
    project_copy = Path(shutil.copytree(project, tmp_path / "project"))
    before, results_before = inodes(project_copy), results(project_copy)["results"]
    for name in (THRESHOLD_RECORD, "ours 2.json"):
        (project_copy / FOLDER / "trials" / name).unlink()
    completed_process = codra(*TINY_COMMAND, cwd=project_copy)

    assert completed_process.returncode == 0, completed_process.stderr
    assert {name for name, number in inodes(project_copy).items() if before[name] != number} == {
        THRESHOLD_RECORD,
        "ours 2.json",
    }
    assert results(project_copy)["results"] == results_before
    assert "6 had been run before" in (project_copy / FOLDER / "report.html").read_text()


def test_a_trial_that_depends_on_the_search_is_run_alone_by_its_name(project: Path, tmp_path: Path) -> None:
    project_copy = Path(shutil.copytree(project, tmp_path / "project"))
    (project_copy / FOLDER / "trials" / "none 2.json").unlink()
    completed_process = codra(*TINY_COMMAND, "--trial", "none 2", cwd=project_copy)

    assert completed_process.returncode == 0, completed_process.stderr
    assert completed_process.stdout == "trial 'none 2' (seed 2): 6.0 s, 0 loops\n"


def test_a_spec_without_loops_is_reported_in_a_line(project: Path) -> None:
    completed_process = codra(
        "experiment", "tiny_store:EXPERIMENT", "--spec", "specs/lab.yaml", "--out", "runs/lab", cwd=project
    )

    assert completed_process.returncode == 1
    assert "the spec has no loops, so no managers can be compared" in completed_process.stderr
    assert "Traceback" not in completed_process.stderr
