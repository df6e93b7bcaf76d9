"""`codra replay` of journals that name a package by a path: nothing outside the project runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.projects import run_project
from tests.cli.test_commands import codra

SPEC = "codra: 1\nname: shop\ncontext:\n  near: {type: bool, source: main_execution, valid_for: 1 s}\n"

PROGRAM = """\
import sys
from dataclasses import replace
from codra_dsl.runtime import Journal, SimClock
from generated import shop

model = replace(shop.MODEL, name=sys.argv[1])
with shop.Shop(model, clock=SimClock(), resources={}, record=Journal("run.mcap")) as codra:
    codra.set("near", True)
"""

PACKAGE_TEXT = "import pathlib\npathlib.Path({mark!r}).write_text('ran')\nMODEL = None\n"


def make_forged_project(folder: Path, spec: str) -> Path:
    """Make a project with a journal in which a text is the name of the spec. Return the project's folder."""
    run_project(folder / "project", {"specs/shop.yaml": SPEC, "program.py": PROGRAM}, spec)
    return folder / "project"


def plant_package(folder: Path, mark_file: Path) -> Path:
    """Write a package that creates the file `mark_file` when it is imported, and return its folder."""
    folder.mkdir(parents=True)
    (folder / "manifest.json").write_text("{}")
    (folder / "__init__.py").write_text(PACKAGE_TEXT.format(mark=str(mark_file)))
    return folder


@pytest.mark.parametrize("path_form", ["absolute", "../../outside", "shop/../../../outside", "."])
def test_a_journal_that_names_a_path_runs_no_package(path_form: str, tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    outside_folder = plant_package(tmp_path / "outside", tmp_path / "mark")
    project = make_forged_project(tmp_path, str(outside_folder) if path_form == "absolute" else path_form)

    process = codra("replay", "run.mcap", cwd=project)

    assert process.returncode == 2
    assert "which is not a name: use --package or --spec" in " ".join(process.stderr.replace("│", " ").split())
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize("name", ["a" * 5000, "class"])
def test_a_journal_with_a_name_that_no_spec_can_have_is_a_usage_error(name: str, tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    process = codra("replay", "run.mcap", cwd=make_forged_project(tmp_path, name))

    assert process.returncode == 2
    assert "which is not a name: use --package or --spec" in " ".join(process.stderr.replace("│", " ").split())


def test_a_replay_names_its_package_before_it_runs_the_package(tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    project = make_forged_project(tmp_path, "shop")
    (project / "generated/shop/__init__.py").write_text("raise SystemExit(3)\n")

    for arguments, package in (
        ((), "generated/shop"),
        (("--package", "generated/../generated/shop"), "generated/shop"),
    ):
        process = codra("replay", "run.mcap", *arguments, cwd=project)

        assert process.stderr.splitlines()[0] == f"codra: the replay runs the package '{package}'"
        assert process.returncode == 3


def test_a_package_that_is_a_link_out_of_the_project_does_not_run(tmp_path: Path) -> None:
    (tmp_path / "project").mkdir()
    outside_folder = plant_package(tmp_path / "outside", tmp_path / "mark")
    project = make_forged_project(tmp_path, "linked")
    (project / "generated/linked").symlink_to(outside_folder)

    process = codra("replay", "run.mcap", cwd=project)

    assert process.returncode == 2
    assert "is a link that leads out of the project" in " ".join(process.stderr.replace("│", " ").split())
    assert not (tmp_path / "mark").exists()
