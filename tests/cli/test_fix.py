"""`codra lint --fix` and `--diff`, settings and suppression comments, in real processes on real files."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from codra_dsl.cli.fixes import fix, input_from_files
from codra_dsl.compiler import Planned
from codra_dsl.language.load.yaml.source import MAX_BYTES
from codra_dsl.tooling.report.findings import MAX_SHOWN
from codra_dsl.workspace.cache import SpecResults
from codra_dsl.workspace.timings import UNTIMED
from tests.command_server import run_codra

ROOT = Path(__file__).parents[2]
SPEC = b"""\
codra: 1\r
name: door\t\t\r
context:   # kept \xc3\xa4s is  \r
  door_open: {type: bool,  source: main_execution}\r
skills:\r
  pass_door:\r
    perview: [door_open]\r
"""
RIGHT = SPEC.replace(b"perview", b"preview")
BROKEN = RIGHT.replace(b"[door_open]", b"[door_open, window]")
UNREACHED = RIGHT.replace(b"skills:", b"  lamp_lit: {type: bool, source: main_execution}\r\nskills:")


@pytest.fixture
def project(tmp_path: Path) -> Path:
    root = tmp_path / "project"
    (root / "specs").mkdir(parents=True)
    (root / "pyproject.toml").write_text("[tool.codra]\n")
    (root / "specs/door.yaml").write_bytes(SPEC)
    return root


def codra(*arguments: str, cwd: Path, stdin: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    kept = {name: value for name, value in os.environ.items() if name not in ("FORCE_COLOR", "GITHUB_ACTIONS")}
    process = run_codra(arguments, cwd, {**kept, "PYTHONPATH": str(ROOT), "COLUMNS": "120"}, stdin)
    assert b"Traceback" not in process.stdout + process.stderr
    return process


def spec_of(project: Path) -> bytes:
    return (project / "specs/door.yaml").read_bytes()


# Files


def test_lint_reports_the_number_of_fixes_and_applies_none(project: Path) -> None:
    process = codra("lint", "specs", cwd=project)

    assert process.returncode == 1
    assert process.stderr == b"1 error; --fix can fix 1\n"
    assert spec_of(project) == SPEC


def test_fix_changes_no_byte_outside_of_the_errors(project: Path) -> None:
    process = codra("lint", "--fix", "specs", cwd=project)

    assert (process.returncode, process.stdout, process.stderr) == (0, b"", b"fixed 1; no findings left\n")
    assert spec_of(project) == RIGHT


def test_findings_without_a_fix_are_shown_and_fail(project: Path) -> None:
    (project / "specs/door.yaml").write_bytes(BROKEN.replace(b"preview", b"perview"))

    process = codra("lint", "--fix", "specs", "--format", "concise", cwd=project)

    assert process.returncode == 1
    assert process.stdout.startswith(b"specs/door.yaml:7:26: error[CDR3101]")
    assert process.stderr == b"fixed 1; 1 error left\n"
    assert spec_of(project) == BROKEN


def test_fixing_specs_without_findings_writes_no_file(project: Path) -> None:
    path = project / "specs/door.yaml"
    path.write_bytes(RIGHT)
    before = path.stat()

    process = codra("lint", "--fix", "specs", cwd=project)

    assert process.stderr == b"fixed 0; no findings left\n"
    assert (path.stat().st_ino, path.stat().st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


def test_the_mode_of_a_file_is_preserved(project: Path) -> None:
    path = project / "specs/door.yaml"
    path.chmod(0o640)

    codra("lint", "--fix", "specs", cwd=project)

    assert spec_of(project) == RIGHT
    assert path.stat().st_mode & 0o7777 == 0o640
    assert sorted(entry.name for entry in path.parent.iterdir()) == ["door.yaml"]


def test_a_file_that_is_saved_while_codra_looks_for_fixes_is_not_lost(project: Path) -> None:
    path = project / "specs/door.yaml"
    looks = 0
    work = input_from_files([project / "specs"], UNTIMED)

    def lint(texts: Mapping[str, bytes], results: SpecResults) -> Planned:
        nonlocal looks
        looks += 1
        if looks == 3:
            path.write_bytes(SPEC + b"# saved meanwhile\r\n")
        return work.lint(texts, results)

    outcome = fix(replace(work, lint=lint), write=True)

    assert spec_of(project) == SPEC + b"# saved meanwhile\r\n"
    assert outcome.fixed_count == 0
    assert [diagnostic.message for diagnostic in outcome.diagnostics if diagnostic.code == "CDR6004"] == [
        "cannot write 'specs/door.yaml': it has changed in the meantime"
    ]


def test_if_one_of_two_files_is_refused_the_other_one_counts(project: Path) -> None:
    (project / "specs/gate.yaml").write_bytes(SPEC.replace(b"name: door", b"name: gate"))
    work = input_from_files([project / "specs"], UNTIMED)

    def lint(texts: Mapping[str, bytes], results: SpecResults) -> Planned:
        if texts:
            (project / "specs/gate.yaml").write_bytes(RIGHT.replace(b"name: door", b"name: gate"))
        return work.lint(texts, results)

    outcome = fix(replace(work, lint=lint), write=True)

    assert (outcome.fixed_count, spec_of(project)) == (1, RIGHT)


def test_a_link_that_leads_out_of_the_project_is_not_followed(project: Path) -> None:
    outside = project.parent / "outside.yaml"
    outside.write_bytes(SPEC)
    (project / "specs/door.yaml").unlink()
    (project / "specs/door.yaml").symlink_to(outside)

    process = codra("lint", "--fix", "specs", cwd=project)

    assert process.returncode == 1
    assert outside.read_bytes() == SPEC


def test_a_link_within_the_project_is_kept_and_its_target_is_fixed(project: Path) -> None:
    (project / "real.yaml").write_bytes(SPEC)
    (project / "specs/door.yaml").unlink()
    (project / "specs/door.yaml").symlink_to("../real.yaml")

    process = codra("lint", "--fix", "specs", cwd=project)

    assert process.returncode == 0
    assert (project / "specs/door.yaml").is_symlink()
    assert (project / "real.yaml").read_bytes() == RIGHT


def test_parts_are_fixed_only_if_their_folder_was_named(project: Path) -> None:
    part = b"codra: 1\ncontxt:\n  window: {type: bool, source: main_execution}\n"
    (project / "parts").mkdir()
    (project / "parts/window.yaml").write_bytes(part)
    including = RIGHT.replace(b"name: door", b"name: door\r\ninclude: [../parts/window.yaml]").replace(
        b"[door_open]", b"[door_open, window]"
    )
    (project / "specs/door.yaml").write_bytes(including)

    left = codra("lint", "--fix", "specs", cwd=project)
    named = codra("lint", "--fix", ".", cwd=project)

    assert (left.returncode, left.stderr) == (1, b"fixed 0; 1 error left; 1 more can be fixed if you lint '.'\n")
    assert (named.returncode, named.stderr) == (0, b"fixed 1; no findings left\n")
    assert (project / "parts/window.yaml").read_bytes() == part.replace(b"contxt", b"context")


# Differences


DIFF = b"""\
--- specs/door.yaml
+++ specs/door.yaml
@@ -4,4 +4,4 @@
   door_open: {type: bool,  source: main_execution}\r
 skills:\r
   pass_door:\r
-    perview: [door_open]\r
+    preview: [door_open]\r
"""


@pytest.mark.parametrize("options", [["--diff"], ["--fix", "--diff"]])
def test_diff_shows_the_fixes_and_writes_no_file(project: Path, options: list[str]) -> None:
    process = codra("lint", *options, "specs", cwd=project)

    assert (process.returncode, process.stdout) == (1, DIFF)
    assert process.stderr == b"would fix 1; no findings left\n"
    assert spec_of(project) == SPEC


def test_a_diff_can_be_applied_with_patch(project: Path) -> None:
    diff = codra("lint", "--diff", "specs", cwd=project).stdout

    subprocess.run(["git", "apply", "-p0"], cwd=project, input=diff, check=True)

    assert spec_of(project) == RIGHT


@pytest.mark.parametrize("name", ["a b.yaml", "a\nb.yaml", 'a"b\\c.yaml', "été.yaml", os.fsdecode(b"\xff.yaml")])
def test_a_diff_can_be_applied_to_files_of_any_name(project: Path, name: str) -> None:
    (project / "specs/door.yaml").rename(project / "specs" / name)
    patch = codra("lint", "specs", "--diff", cwd=project).stdout

    applied = subprocess.run(["git", "apply", "-p0"], cwd=project, input=patch, capture_output=True, check=False)

    assert (applied.returncode, applied.stderr) == (0, b"")
    assert (project / "specs" / name).read_bytes() == RIGHT


def test_without_anything_to_fix_the_diff_is_empty_and_succeeds(project: Path) -> None:
    (project / "specs/door.yaml").write_bytes(BROKEN)

    process = codra("lint", "--diff", "specs", cwd=project)

    assert (process.returncode, process.stdout) == (0, b"")
    assert process.stderr == b"would fix 0; 1 error left\n"


# Standard input


def test_standard_input_is_fixed_on_standard_output(project: Path) -> None:
    process = codra("lint", "--fix", "-", cwd=project, stdin=SPEC)

    assert (process.returncode, process.stdout) == (0, RIGHT)
    assert process.stderr == b"fixed 1; no findings left\n"


def test_findings_left_in_standard_input_go_to_standard_error(project: Path) -> None:
    process = codra("lint", "--fix", "-", "--format", "concise", cwd=project, stdin=BROKEN)

    assert (process.returncode, process.stdout) == (1, BROKEN)
    assert process.stderr.startswith(b"-:7:26: error[CDR3101]")
    assert process.stderr.endswith(b"fixed 0; 1 error left\n")


def test_a_text_that_is_too_large_is_not_truncated(project: Path) -> None:
    process = codra("lint", "--fix", "-", cwd=project, stdin=SPEC + b"#" * MAX_BYTES)

    assert (process.returncode, process.stdout) == (2, b"")
    assert b"the text has more than 32 MiB" in process.stderr


def test_bytes_that_are_not_text_are_returned_unchanged(project: Path) -> None:
    process = codra("lint", "--fix", "-", cwd=project, stdin=b"codra: 1\nname: \xff\n")

    assert (process.returncode, process.stdout) == (1, b"codra: 1\nname: \xff\n")


# All commands behave alike


@pytest.mark.parametrize("command", ["lint", "compile", "graph"])
def test_settings_and_comments_hold_for_every_command(project: Path, command: str) -> None:
    path = project / "specs/door.yaml"
    path.write_bytes(UNREACHED)
    raised = "[tool.codra.lint.severity]\nCDR7102 = 'error'\n"

    warned = codra(command, "specs", cwd=project)
    (project / "pyproject.toml").write_text(raised)
    failed = codra(command, "specs", cwd=project)
    path.write_bytes(UNREACHED.replace(b"  lamp_lit", b"  # codra: ignore[CDR7102] for the next demo\r\n  lamp_lit"))
    silenced = codra(command, "specs", cwd=project)

    assert (warned.returncode, failed.returncode, silenced.returncode) == (0, 1, 0)
    assert b"warning[CDR7102]" in warned.stdout + warned.stderr
    assert b"error[CDR7102]" in failed.stdout + failed.stderr
    assert b"CDR" not in silenced.stderr


def test_the_project_sets_what_fails_and_the_command_line_wins(project: Path) -> None:
    (project / "specs/door.yaml").write_bytes(UNREACHED)
    (project / "pyproject.toml").write_text('[tool.codra.lint]\nfail-on = "warning"\n')

    assert codra("lint", "specs", cwd=project).returncode == 1
    assert codra("compile", "specs", cwd=project).returncode == 1
    assert codra("lint", "specs", "--fail-on", "error", cwd=project).returncode == 0


@pytest.mark.parametrize(
    ("settings", "place"),
    [
        ("[tool.codra.lint]\nignroe = []\n", b"pyproject.toml:2:1: error[CDR0021]"),
        ("[tool.codra.lint]\nignore = []\nignore = []\n", b"pyproject.toml:3:12: error[CDR0020]"),
    ],
)
def test_errors_in_settings_are_findings_with_their_place(project: Path, settings: str, place: bytes) -> None:
    (project / "specs/door.yaml").write_bytes(RIGHT)
    (project / "pyproject.toml").write_text(settings)

    process = codra("lint", "specs", "--format", "concise", cwd=project)

    assert process.returncode == 1
    assert process.stdout.startswith(place)


def test_findings_that_a_report_does_not_show_are_counted_fixed_and_silenced(project: Path) -> None:
    count = MAX_SHOWN + 50
    variables = "".join(f"  v{number}: {{type: bool, source: main_execution}}\n" for number in range(count))
    last = "  last: {type: bool, source: main_execution}  # codra: ignore[CDR7102] for the next demo\n"
    skills = "".join(f"  s{number}: {{perview: [door_open]}}\n" for number in range(count))
    head = "codra: 1\nname: door\ncontext:\n  door_open: {type: bool, source: main_execution}\n"
    (project / "specs/door.yaml").write_text(f"{head}{variables}{last}skills:\n{skills}")

    broken = codra("lint", "specs", "--format", "concise", cwd=project)
    fixed = codra("lint", "specs", "--fix", "--format", "concise", cwd=project)

    assert (broken.returncode, fixed.returncode) == (1, 0)
    assert broken.stdout.count(b"error[CDR2003]") == MAX_SHOWN + 1
    assert f"{count} errors".encode() in broken.stderr
    assert f"fixed {count}; {count} warnings left".encode() in fixed.stderr
    assert fixed.stdout.count(b"warning[CDR7102]") == MAX_SHOWN + 1
    assert fixed.stdout.endswith(b"and 50 more findings of this rule in this file\n")
