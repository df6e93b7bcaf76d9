"""`codra init` in real processes: the new project works without changes, and existing files are never touched."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from referencing import Registry, Resource

from codra_dsl.language.project import SCHEMA_COPY, SCHEMA_FILE
from tests.command_server import as_text, run_python
from tests.type_checker import run_mypy

WRITTEN = {
    ".codra/schema.json",
    ".codra/timeline.json",
    ".github/workflows/codra.yml",
    ".gitignore",
    ".pre-commit-config.yaml",
    "README.md",
    "arm_perception.py",
    "arm_program.py",
    "pyproject.toml",
    "requirements.txt",
    "specs/arm.yaml",
    "tests/arm.timeline.yaml",
    "tests/sensor_fails.yaml",
    "tests/test_arm.py",
}


def run(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a module with the interpreter that the project would use: it sees only installed packages and the project."""
    return as_text(run_python(("-m", *arguments), cwd, user_environment()))


def user_environment() -> dict[str, str]:
    unset = ("GITHUB_ACTIONS", "PYTHONPATH", "NO_COLOR", "FORCE_COLOR")
    return {name: value for name, value in os.environ.items() if name not in unset} | {"COLUMNS": "200"}


def codra(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    process = run("codra_dsl", *arguments, cwd=cwd)
    assert "Traceback" not in process.stdout + process.stderr
    return process


def run_successfully(*arguments: str, cwd: Path) -> str:
    process = run(*arguments, cwd=cwd)
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


def file_paths(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("projects") / "arm"
    assert codra("init", "arm", cwd=folder.parent).returncode == 0
    return folder


def test_a_new_project_lints_compiles_type_checks_and_passes_its_tests(tmp_path: Path) -> None:
    run_successfully("codra_dsl", "init", "arm", cwd=tmp_path)
    folder = tmp_path / "arm"

    assert file_paths(folder) == WRITTEN
    assert run_successfully("codra_dsl", "lint", "specs", "--fail-on", "warning", cwd=folder) == ""
    run_successfully("codra_dsl", "compile", "specs", "--fail-on", "warning", cwd=folder)
    assert run_successfully("codra_dsl", "compile", "specs", "--check", cwd=folder) == ""
    assert "7 passed" in run_successfully("pytest", "-p", "no:cacheprovider", cwd=folder)
    assert run_successfully("arm_program", cwd=folder) == "set the part down\n"
    assert "no issues found in 6 source files" in run_mypy(cwd=folder, environment=user_environment()).stdout


def test_its_program_also_runs_in_real_time(project: Path) -> None:
    run_successfully("codra_dsl", "compile", "specs", cwd=project)

    assert run_successfully("arm_program", "--real", cwd=project).endswith("set the part down\n")


@pytest.mark.parametrize("name", ["generated", "tests", "json", "A", "x" * 100])
def test_a_project_may_have_any_name_that_a_spec_may_have(name: str, tmp_path: Path) -> None:
    run_successfully("codra_dsl", "init", "--name", name, cwd=tmp_path)

    assert run_successfully("codra_dsl", "lint", "specs", "--fail-on", "warning", cwd=tmp_path) == ""
    run_successfully("codra_dsl", "compile", "specs", cwd=tmp_path)
    assert run_successfully(f"{name}_program", cwd=tmp_path) == "set the part down\n"


def test_it_explains_itself(tmp_path: Path) -> None:
    assert codra("init", "--help", cwd=tmp_path).stdout.startswith("Usage: codra init [OPTIONS] [DIR]\n")
    assert "\n  init " in codra("--help", cwd=tmp_path).stdout


def test_it_prints_the_next_commands(tmp_path: Path) -> None:
    process = codra("init", "some robots/my-arm", cwd=tmp_path)

    first, *commands = process.stdout.splitlines()
    assert first == "Next:"
    assert commands[0] == "  cd 'some robots/my-arm'"
    assert commands[-1] == "  python my_arm_program.py"
    assert process.stderr == "my_arm: 14 files written\n"


def test_a_folder_that_holds_other_files_keeps_them(tmp_path: Path) -> None:
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/door.yaml").write_text("mine")
    (tmp_path / "setup.cfg").write_text("mine")

    process = codra("init", "--name", "arm", cwd=tmp_path)

    assert process.returncode == 0
    assert "cd " not in process.stdout
    assert file_paths(tmp_path) == WRITTEN | {"specs/door.yaml", "setup.cfg"}
    assert (tmp_path / "specs/door.yaml").read_text() == (tmp_path / "setup.cfg").read_text() == "mine"


def test_all_conflicts_are_named_at_once_and_no_file_is_written(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "README.md").write_text("mine")
    (tmp_path / "specs").write_text("no folder")
    (tmp_path / ".github").symlink_to(tmp_path / "elsewhere")
    (tmp_path / ".gitignore").symlink_to("nowhere")
    before = file_paths(tmp_path)

    process = codra("init", "--name", "arm", cwd=tmp_path)

    assert (process.returncode, process.stdout) == (1, "")
    assert process.stderr.splitlines() == [
        "codra: nothing was written, because these files exist already:",
        "  .github",
        "  .gitignore",
        "  README.md",
        "  specs",
        "help: move these files away, or start in another folder, e.g.: codra init arm",
    ]
    assert file_paths(tmp_path) == before
    assert (tmp_path / "README.md").read_text() == "mine"


@pytest.mark.parametrize(("arguments", "other"), [([], "arm"), (["."], "arm"), (["sub"], "sub/sub")])
def test_the_suggested_folder_is_free(arguments: list[str], other: str, tmp_path: Path) -> None:
    folder = tmp_path / "arm"
    for place in (folder, folder / "sub"):
        place.mkdir()
        (place / "README.md").write_text("mine\n")

    process = codra("init", *arguments, cwd=folder)

    assert process.stderr.splitlines()[-1].endswith(f"e.g.: codra init {other}")
    assert codra("init", other, cwd=folder).returncode == 0


def test_a_second_run_changes_no_file(project: Path) -> None:
    before = {path: (project / path).read_bytes() for path in WRITTEN}

    process = codra("init", cwd=project)

    assert process.returncode == 1
    assert [line.strip() for line in process.stderr.splitlines()[1:-1]] == sorted(WRITTEN)
    assert {path: (project / path).read_bytes() for path in WRITTEN} == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--name", "my-arm"], "'my-arm' is not a name"),
        (["--name", "my-arm"], "write my_arm"),
        (["--name", "class"], "'class' is a keyword of Python: write class_robot"),
        (["--name", "known"], "'known' is a function of the condition language: write known_robot"),
        (["--name", "null"], "'null' is a literal: write null_robot"),
        (["--name", "x" * 101], "is longer than 100 letters"),
        (["--name", "../arm"], "write arm"),
        (["--name", ""], "'' is not a name"),
        (["2nd"], "the folder's name '2nd' gives no name: add --name"),
        (["--force"], "No such option"),
        (["taken"], "'taken' is not a folder"),
        (["taken/below"], "cannot write"),
    ],
)
def test_a_wrong_name_or_place_is_reported_with_help(arguments: list[str], message: str, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine")

    process = codra("init", *arguments, cwd=tmp_path)

    assert (process.returncode, process.stdout) == (1 if "below" in arguments[0] else 2, "")
    assert message in " ".join(process.stderr.split())
    assert file_paths(tmp_path) == {"taken"}


def test_in_a_subfolder_of_a_repository_it_warns_of_files_for_the_root(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()

    assert "The root of the repository is further up" in codra("init", "arm", cwd=tmp_path).stderr
    assert "The repository" not in codra("init", "--name", "arm", cwd=tmp_path).stderr


# The schema for editors


def test_editors_find_the_keys_of_timelines_beside_those_of_specs(project: Path) -> None:
    uri = (project / ".codra/timeline.json").as_uri()
    registry: Registry[Any] = Registry(retrieve=lambda at: Resource.from_contents(json.loads(Path(at[7:]).read_text())))
    validator = Draft202012Validator({"$ref": uri}, registry=registry)
    moment = {"believes": {"part_held": True}}

    assert validator.is_valid({"codra": 1, "timeline": "arm", "stories": {"message": {"1 s": moment}}})
    assert not validator.is_valid({"codra": 1, "timeline": "arm", "stories": {"message": {"1 s": {"beleives": {}}}}})


def test_a_stale_copy_of_the_schema_is_reported_and_renewed(tmp_path: Path) -> None:
    run_successfully("codra_dsl", "init", "--name", "arm", cwd=tmp_path)
    run_successfully("codra_dsl", "compile", "specs", cwd=tmp_path)
    (tmp_path / SCHEMA_COPY).write_text("{}")

    check_process = codra("compile", "specs", "--check", "--format", "concise", cwd=tmp_path)
    assert check_process.returncode == 1
    assert ".codra/schema.json:1:1: error[CDR6003]" in check_process.stdout
    assert "renew it with 'codra compile'" in check_process.stdout
    assert (tmp_path / SCHEMA_COPY).read_text() == "{}"

    run_successfully("codra_dsl", "compile", "specs", cwd=tmp_path)
    assert (tmp_path / SCHEMA_COPY).read_bytes() == SCHEMA_FILE.read_bytes()
    assert run_successfully("codra_dsl", "compile", "specs", "--check", cwd=tmp_path) == ""
    assert sorted(path.name for path in (tmp_path / ".codra").iterdir()) == ["schema.json", "timeline.json"]


def test_a_project_without_a_copy_gets_none(tmp_path: Path) -> None:
    run_successfully("codra_dsl", "init", "--name", "arm", cwd=tmp_path)
    (tmp_path / SCHEMA_COPY).unlink()

    run_successfully("codra_dsl", "compile", "specs", cwd=tmp_path)
    run_successfully("codra_dsl", "compile", "specs", "--check", cwd=tmp_path)

    assert not (tmp_path / SCHEMA_COPY).exists()


@pytest.mark.parametrize("link", [".codra", SCHEMA_COPY])
def test_a_copy_behind_a_link_is_left_alone(link: str, tmp_path: Path) -> None:
    project, elsewhere = tmp_path / "arm", tmp_path / "elsewhere"
    run_successfully("codra_dsl", "init", "arm", cwd=tmp_path)
    (project / ".codra").rename(elsewhere)
    (elsewhere / "schema.json").write_text("not ours")
    (project / link).parent.mkdir(exist_ok=True)
    (project / link).symlink_to(elsewhere if link == ".codra" else elsewhere / "schema.json")

    run_successfully("codra_dsl", "compile", "specs", cwd=project)

    assert (elsewhere / "schema.json").read_text() == "not ours"
    assert sorted(path.name for path in elsewhere.iterdir()) == ["schema.json", "timeline.json"]
