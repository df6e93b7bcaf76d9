"""Findings of `codra lint` and `codra compile` in each format, in real processes, as CI systems would run them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.command_server import as_text, run_codra

ROOT = Path(__file__).parents[2]
DOOR = """\
codra: 1
name: door
context:
  door_open: {type: bool, source: main_execution}
skills:
  pass_door:
    preview: [door_open]
"""
MISSPELT = f"{DOOR}    chnges: [door_open]\n"
WITH_WARNING = DOOR.replace("skills:", "  unused: {type: bool, source: main_execution}\nskills:")
FORMS = ["full", "concise", "json", "sarif", "github", "junit"]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    folder = tmp_path / "robot"
    (folder / "specs").mkdir(parents=True)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "specs/door.yaml").write_text(MISSPELT)
    return folder


def codra(*arguments: str, cwd: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("GITHUB_")}
    settings_of_process = {**kept, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", **settings}
    process = as_text(run_codra(arguments, cwd, settings_of_process))
    assert "Traceback" not in process.stdout + process.stderr
    return process


# GitHub Actions


def test_in_github_actions_findings_are_annotations_by_default(project: Path) -> None:
    process = codra("lint", "specs", cwd=project, GITHUB_ACTIONS="true")

    assert process.returncode == 1
    assert process.stdout == codra("lint", "specs", "--format", "github", cwd=project).stdout
    assert process.stdout.startswith("::error file=specs/door.yaml,line=8,")


@pytest.mark.parametrize(
    ("options", "settings"),
    [
        (["--format", "concise"], {"GITHUB_ACTIONS": "true"}),
        (["--output", "findings.txt"], {"GITHUB_ACTIONS": "true"}),
        ([], {"GITHUB_ACTIONS": "false"}),
        ([], {}),
    ],
)
def test_annotations_go_only_to_the_log_of_github(project: Path, options: list[str], settings: dict[str, str]) -> None:
    process = codra("lint", "specs", *options, cwd=project, **settings)

    written = project / "findings.txt"
    shown = written.read_text() if written.exists() else process.stdout
    assert "::error" not in shown
    assert shown.startswith("specs/door.yaml:8:5: error[CDR2003]")


def test_annotations_have_the_paths_of_the_repository(project: Path) -> None:
    process = codra("lint", "specs", cwd=project, GITHUB_ACTIONS="true", GITHUB_WORKSPACE=str(project.parent))

    assert process.stdout.startswith("::error file=robot/specs/door.yaml,line=8,")


def test_the_summary_of_the_step_gets_the_findings_of_every_command(project: Path, tmp_path: Path) -> None:
    summary = tmp_path / "summary.md"
    summary.write_text("before")

    for command in ("lint", "compile"):
        codra(command, "specs", cwd=project, GITHUB_ACTIONS="true", GITHUB_STEP_SUMMARY=str(summary))

    text = summary.read_text()
    assert text.startswith("before\n### codra lint\\: 1 error\n")
    assert "\n### codra compile\\: 1 error\n" in text
    assert text.count("| specs/door.yaml:8:5 | error CDR2003 | unknown key 'chnges'") == 2


def test_a_summary_that_cannot_be_written_does_not_affect_the_command(project: Path, tmp_path: Path) -> None:
    process = codra("lint", "specs", cwd=project, GITHUB_ACTIONS="true", GITHUB_STEP_SUMMARY=str(tmp_path))

    assert process.returncode == 1
    assert process.stdout.startswith("::error ")
    assert "codra: cannot write the summary of the step" in process.stderr


@pytest.mark.parametrize("form", FORMS)
def test_in_github_actions_no_form_holds_a_command_from_a_spec(project: Path, form: str) -> None:
    (project / "specs/door.yaml").write_text(f'{DOOR}    changes: ["##[add-mask]door"]\n')

    process = codra("lint", "specs", "--format", form, cwd=project, GITHUB_ACTIONS="true")

    shown = [line for line in process.stdout.splitlines() if not line.startswith("::error ")]
    assert process.returncode == 1
    assert "add-mask" in process.stdout
    assert [line for line in shown if "##[" in line] == []


# Reports


def test_clean_specs_give_a_report_too(project: Path) -> None:
    (project / "specs/door.yaml").write_text(DOOR)

    junit = codra("lint", "specs", "--format", "junit", cwd=project)
    sarif = codra("lint", "specs", "--format", "sarif", cwd=project)

    assert (junit.returncode, sarif.returncode) == (0, 0)
    assert [test.attrib["name"] for test in ElementTree.fromstring(junit.stdout).iter("testcase")] == [
        "specs/door.yaml"
    ]
    assert json.loads(sarif.stdout)["runs"][0]["results"] == []


@pytest.mark.parametrize(("options", "failures"), [([], "0"), (["--fail-on", "warning"], "1")])
def test_a_report_of_tests_fails_when_the_command_does(project: Path, options: list[str], failures: str) -> None:
    (project / "specs/door.yaml").write_text(WITH_WARNING)

    process = codra("lint", "specs", "--format", "junit", *options, cwd=project)

    root = ElementTree.fromstring(process.stdout)
    assert root.attrib["failures"] == failures == str(process.returncode)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("command", ["lint", "compile"])
def test_every_form_can_go_to_a_file(project: Path, command: str, form: str) -> None:
    shown = codra(command, "specs", "--format", form, cwd=project)

    written = codra(command, "specs", "--format", form, "--output", "findings", cwd=project)

    assert (written.returncode, written.stdout) == (1, "")
    assert written.stderr.startswith("1 error")
    assert (project / "findings").read_text() == shown.stdout != ""


@pytest.mark.parametrize("form", FORMS)
def test_an_ascii_locale_breaks_no_format(project: Path, form: str) -> None:
    (project / "specs/door.yaml").write_text(DOOR.replace("[door_open]", "[mönitér_戸]"), "utf-8")

    process = codra("lint", "specs", "--format", form, cwd=project, PYTHONIOENCODING="ascii:strict", LC_ALL="C")

    assert process.returncode == 1
    assert process.stdout.isascii()
    if form == "junit":
        assert "mönitér_戸" in "".join(ElementTree.fromstring(process.stdout).itertext())
    if form in ("json", "sarif"):
        last = process.stdout.splitlines()[-1] if form == "json" else process.stdout
        assert "mönitér_戸" in json.dumps(json.loads(last), ensure_ascii=False)


# Stale output


@pytest.mark.parametrize("form", FORMS)
def test_stale_output_is_a_finding_in_every_format(project: Path, form: str) -> None:
    (project / "specs/door.yaml").write_text(DOOR)
    codra("compile", "specs", cwd=project)
    (project / "generated/door/__init__.py").write_text("x = 1\n")

    process = codra("compile", "specs", "--check", "--format", form, cwd=project)

    assert (process.returncode, process.stderr) == (1, "1 error\n")
    assert "CDR6003" in process.stdout
    assert "generated/door/__init__.py" in process.stdout
    assert ("-x = 1" in process.stdout) == (form == "full"), "the difference is for people"


def test_findings_about_output_name_files_from_the_root(project: Path) -> None:
    (project / "specs/door.yaml").write_text(DOOR)
    (project / "build/made").mkdir(parents=True)
    (project / "build/made/robot.py").write_text("x = 1\n")

    process = codra("compile", "specs", "--out", "build/made", "--format", "concise", cwd=project)

    assert process.stdout.startswith("build/made:1:1: error[CDR6002]")


def test_warnings_fail_a_compilation_only_when_asked(project: Path) -> None:
    (project / "specs/door.yaml").write_text(WITH_WARNING)

    codes = [codra("compile", "specs", *options, cwd=project).returncode for options in ([], ["--fail-on", "warning"])]

    assert codes == [0, 1]


# Output that cannot be written


@pytest.mark.parametrize(
    "command", [["lint", "specs"], ["compile", "specs"], ["graph", "specs"], ["diff", "specs", "."]]
)
def test_no_result_is_written_over_a_spec(project: Path, command: list[str]) -> None:
    process = codra(*command, "--output", "specs/door.yaml", cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert "may be a spec" in process.stderr
    assert (project / "specs/door.yaml").read_text() == MISSPELT


@pytest.mark.parametrize("options", [["--diff", "specs"], ["--fix", "-"]])
def test_a_full_disk_is_not_a_usage_error(project: Path, options: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        process = subprocess.run(
            [sys.executable, "-m", "codra_dsl", "lint", *options],
            cwd=project,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            input=MISSPELT.encode(),
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )

    assert (process.returncode, process.stderr) == (
        1,
        b"codra: cannot write to standard output: No space left on device\n",
    )


def test_no_line_of_a_patch_is_a_command_of_github(project: Path) -> None:
    (project / "specs/door.yaml").write_text(MISSPELT + "# ##[error]no\n")

    process = codra("lint", "specs", "--diff", cwd=project, GITHUB_ACTIONS="true")

    assert "## [error]no" in process.stdout


def test_a_deleted_folder_is_not_reported_as_a_bug(project: Path) -> None:
    (project / "gone").mkdir()
    here = "import os, sys; os.rmdir(os.getcwd()); sys.argv[1:] = ['lint', '.']; from codra_dsl.cli import main; main()"

    process = subprocess.run(
        [sys.executable, "-c", here],
        cwd=project / "gone",
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        text=True,
        capture_output=True,
        check=False,
    )

    assert (process.returncode, process.stderr) == (
        2,
        "codra: the current folder does not exist any more: change to another folder\n",
    )


# Paths that cannot be read as files


def test_pipes_among_specs_do_not_block(project: Path) -> None:
    os.mkfifo(project / "specs/pipe.yaml")

    below = codra("lint", "specs", "--format", "concise", cwd=project)
    named = codra("lint", "specs/pipe.yaml", cwd=project)

    assert below.stdout.count("\n") == 1
    assert "'specs/pipe.yaml' is not a file" in named.stdout


def test_a_path_that_leads_through_a_file_is_a_usage_error(project: Path) -> None:
    process = codra("lint", "specs/door.yaml/more.yaml", cwd=project)

    assert process.returncode == 2
    assert "'specs/door.yaml/more.yaml' cannot be reached: Not a directory" in process.stderr
