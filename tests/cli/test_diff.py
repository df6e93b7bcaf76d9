"""`codra diff` in real processes and real git repositories."""

from __future__ import annotations

import json
import os
import stat
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.command_server import as_text, run_codra

ROOT = Path(__file__).parents[2]
DOOR = """\
codra: 1
name: door
context:
  robot_is_localized: {type: bool, source: main_execution, valid_for: 1 min}
  door_open: {type: bool, valid_for: 5 s}
perception:
  measure_door:
    call: some_robot.doors:measure
    timeout: 2 s
    returns:
      gap: {type: float, unit: m}
    observable_when:
      - robot_is_localized
    accept_when:
      - gap < 3 m
    identifies:
      door_open: gap > 40 cm
skills:
  pass_door:
    preview: [door_open]
"""
WEAKER = DOOR.replace("gap < 3 m", "gap < 4 m")
SLOWER = DOOR.replace("timeout: 2 s", "timeout: 3 s")
WITH_ERROR = DOOR.replace("preview: [door_open]", "preview: [door_opn]")
MACHINES = """\
codra: 1
context:
  shelf_full: {type: bool, source: main_execution}
"""


def environment(**settings: str) -> dict[str, str]:
    dropped = ("NO_COLOR", "FORCE_COLOR", "GITHUB_ACTIONS", "GITHUB_WORKSPACE", "GITHUB_STEP_SUMMARY")
    kept = {name: value for name, value in os.environ.items() if name not in dropped and not name.startswith("GIT_")}
    return {**kept, "PYTHONPATH": str(ROOT), "COLUMNS": "120", "GIT_CONFIG_GLOBAL": os.devnull, **settings}


def codra(*arguments: str, cwd: Path, **settings: str) -> subprocess.CompletedProcess[str]:
    process = as_text(run_codra(("diff", *arguments), cwd, environment(**settings)))
    assert "Traceback" not in process.stdout + process.stderr
    assert "internal error" not in process.stderr
    return process


def git(*arguments: str, cwd: Path, stdin: bytes = b"") -> str:
    who = ("-c", "user.name=me", "-c", "user.email=me@example.org")
    process = subprocess.run(
        ["git", *who, *arguments], cwd=cwd, env=environment(), input=stdin, capture_output=True, check=False
    )
    assert process.returncode == 0, process.stderr
    return process.stdout.decode().strip()


def commit(folder: Path, message: str) -> None:
    git("add", "--all", cwd=folder)
    git("commit", "--quiet", "--allow-empty", "--message", message, cwd=folder)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A repository with one commit on `main`, its tag `v1`, and nothing changed since."""
    folder = tmp_path / "robot"
    (folder / "specs").mkdir(parents=True)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "specs/door.yaml").write_text(DOOR)
    git("init", "--quiet", "--initial-branch=main", cwd=folder)
    commit(folder, "door")
    git("tag", "v1", cwd=folder)
    return folder


def parse_review(process: subprocess.CompletedProcess[str]) -> dict[str, Any]:
    review = json.loads(process.stdout)
    assert isinstance(review, dict)
    return review


def change_texts(process: subprocess.CompletedProcess[str]) -> list[str]:
    return [f"{change['category']} {change['element']}" for change in parse_review(process)["changes"]]


# The compared versions


def test_a_revision_and_the_disk_are_the_same_without_changes(project: Path) -> None:
    process = codra("HEAD", "specs", cwd=project)

    assert (process.returncode, process.stdout, process.stderr) == (0, "verdict: same\n", "")


def test_a_change_on_the_disk_has_its_places_in_both_versions(project: Path) -> None:
    (project / "specs/door.yaml").write_text("# the front door\n" + WEAKER)

    process = codra("HEAD", ".", cwd=project)

    assert process.returncode == 1
    assert process.stdout == (
        "breaking[weaker]: door/perception/measure_door\n"
        "  'accept_when' holds more often\n"
        "    was 'gap < 3 m'  HEAD:specs/door.yaml:15:9\n"
        "    is  'gap < 4 m'  specs/door.yaml:16:9\n"
        "\n"
        "verdict: breaking (1 breaking)\n"
    )


def test_two_revisions_are_compared_in_the_projects_specs_from_any_folder_of_it(project: Path) -> None:
    (project / "specs/door.yaml").write_text(SLOWER)
    (project / "elsewhere.yaml").write_text(DOOR.replace("name: door", "name: other"))
    commit(project, "slower")

    for folder in (project, project / "specs"):
        process = codra("v1", "HEAD", "--format", "json", cwd=folder)
        assert change_texts(process) == ["slower door/perception/measure_door"]
        assert parse_review(process)["changes"][0]["before"]["file"] == "v1:specs/door.yaml"
        assert parse_review(process)["changes"][0]["after"]["file"] == "HEAD:specs/door.yaml"
        assert parse_review(process)["latencies"] == [
            {"element": "door/context/door_open", "before_s": 2.0, "after_s": 3.0}
        ]


def test_two_revisions_without_a_folder_of_specs_are_compared_entirely(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(DOOR)
    git("init", "--quiet", cwd=tmp_path)
    commit(tmp_path, "door")
    (tmp_path / "door.yaml").write_text(SLOWER)
    commit(tmp_path, "slower")

    assert change_texts(codra("HEAD~1", "HEAD", "--format", "json", cwd=tmp_path)) == [
        "slower door/perception/measure_door"
    ]


def test_paths_narrow_what_is_compared(project: Path) -> None:
    (project / "specs/window.yaml").write_text(DOOR.replace("name: door", "name: window"))
    (project / "specs/door.yaml").write_text(SLOWER)

    assert change_texts(codra("HEAD", ".", "specs/door.yaml", "--format", "json", cwd=project)) == [
        "slower door/perception/measure_door"
    ]
    assert change_texts(codra("HEAD", ".", "specs/window.yaml", "--format", "json", cwd=project)) == ["added window"]


def test_a_spec_of_one_version_is_added_or_removed(project: Path) -> None:
    (project / "specs/door.yaml").rename(project / "specs/gate.yaml")
    (project / "specs/gate.yaml").write_text(DOOR.replace("name: door", "name: gate"))

    assert change_texts(codra("HEAD", "specs", "--format", "json", cwd=project)) == ["removed door", "added gate"]
    assert change_texts(codra("HEAD", "specs/gate.yaml", "--format", "json", cwd=project)) == ["added gate"]


def test_an_empty_folder_is_a_version_without_specs(project: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()

    process = codra("../empty", "specs", "--format", "json", cwd=project)

    assert (process.returncode, change_texts(process), parse_review(process)["verdict"]) == (
        0,
        ["added door"],
        "compatible",
    )


def test_two_folders_need_no_git(tmp_path: Path) -> None:
    for name, text in (("old", DOOR), ("new", SLOWER)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "door.yaml").write_text(text)

    process = codra("old", "new", "--format", "concise", cwd=tmp_path, PATH="")

    assert process.stdout.startswith("new/door.yaml:9:14: caution[slower]: door/perception/measure_door: ")
    assert process.returncode == 0


def test_several_folders_without_a_project_are_compared_together(tmp_path: Path) -> None:
    for version, text in (("v1", DOOR), ("v2", WEAKER)):
        for folder, name in (("front", "door"), ("back", "back_door")):
            (tmp_path / version / folder).mkdir(parents=True)
            (tmp_path / version / folder / "door.yaml").write_text(text.replace("name: door", f"name: {name}"))

    process = codra("v1", "v2", "front", "back", "--format", "json", cwd=tmp_path)

    assert change_texts(process) == ["weaker back_door/perception/measure_door", "weaker door/perception/measure_door"]
    assert {change["after"]["file"] for change in parse_review(process)["changes"]} == {
        "v2/front/door.yaml",
        "v2/back/door.yaml",
    }


def test_a_path_goes_before_a_revision_of_the_same_name(project: Path) -> None:
    (project / "main").mkdir()
    (project / "main/door.yaml").write_text(SLOWER)

    assert codra("main", "specs", cwd=project).stdout != "verdict: same\n"
    assert codra("refs/heads/main", "specs", cwd=project).stdout == "verdict: same\n"


def test_moving_elements_to_a_part_is_no_difference_to_a_robot(project: Path) -> None:
    (project / "specs/parts").mkdir()
    head, _, rest = DOOR.partition("perception:")
    (project / "specs/door.yaml").write_text(head.replace("name: door", "name: door\ninclude: [parts/eyes.yaml]"))
    (project / "specs/parts/eyes.yaml").write_text(f"codra: 1\nperception:{rest}")

    process = codra("HEAD", "specs", "--format", "json", cwd=project)

    assert (process.returncode, parse_review(process)["verdict"], change_texts(process)) == (
        0,
        "compatible",
        ["layout door"],
    )


def test_parts_of_a_revision_are_read_with_any_suffix(project: Path) -> None:
    (project / "shared").mkdir()
    (project / "shared/machines.part").write_text(MACHINES)
    (project / "specs/door.yaml").write_text(
        DOOR.replace("name: door", "name: door\ninclude: [../shared/machines.part]")
    )
    commit(project, "parts")

    assert codra("HEAD", "specs", cwd=project).stdout == "verdict: same\n"


# Verdicts


@pytest.mark.parametrize(
    ("text", "options", "code"),
    [
        (WEAKER, [], 1),
        (WEAKER, ["--fail-on", "never"], 0),
        (WEAKER, ["--allow", "weaker"], 0),
        (WEAKER, ["--allow", "weaker:door/perception/measure_door"], 0),
        (WEAKER, ["--allow", "weaker:door/perception/other", "--allow", "slower"], 1),
        (SLOWER, [], 0),
        (SLOWER, ["--fail-on", "caution"], 1),
        (DOOR, ["--fail-on", "caution"], 0),
    ],
)
def test_ci_can_gate_on_the_verdict(project: Path, text: str, options: list[str], code: int) -> None:
    (project / "specs/door.yaml").write_text(text)

    assert codra("HEAD", "specs", *options, cwd=project).returncode == code


def test_allowed_changes_are_shown_as_allowed(project: Path) -> None:
    (project / "specs/door.yaml").write_text(WEAKER)

    process = codra("HEAD", "specs", "--allow", "weaker", "--format", "concise", cwd=project)

    assert "allowed[weaker]" in process.stdout
    assert process.stdout.endswith("verdict: same (1 allowed)\n")


def test_an_option_that_allows_no_change_is_reported(project: Path) -> None:
    process = codra("v1", "HEAD", "--allow", "weaker:door/perception/measure_dor", cwd=project)

    assert (process.returncode, process.stdout) == (0, "verdict: same\n")
    assert process.stderr == "codra: --allow weaker:door/perception/measure_dor accepts no change: remove it\n"


def test_errors_in_b_are_breaking_changes(project: Path) -> None:
    (project / "specs/door.yaml").write_text(WITH_ERROR)

    process = codra("HEAD", "specs", "--format", "concise", cwd=project)

    assert process.returncode == 1
    assert process.stdout.startswith(
        "specs/door.yaml:20:15: breaking[invalid]: door/skill/pass_door: unknown context-variable"
    )
    assert "[CDR3101]" in process.stdout


def test_a_repaired_spec_is_no_breaking_change_and_its_old_errors_go_to_standard_error(project: Path) -> None:
    (project / "specs/door.yaml").write_text(WITH_ERROR)
    commit(project, "mistake")
    (project / "specs/door.yaml").write_text(DOOR)

    process = codra("HEAD", "specs", "--format", "json", cwd=project)

    assert (process.returncode, change_texts(process)) == (0, ["repaired door"])
    assert "HEAD:specs/door.yaml:20:15: error[CDR3101]" in process.stderr


def test_a_file_that_is_no_yaml_pairs_with_the_spec_that_it_was(project: Path) -> None:
    (project / "specs/door.yaml").write_text("codra: 1\nname: door\ncontext: {\n")

    assert change_texts(codra("HEAD", "specs", "--format", "json", cwd=project)) == ["invalid specs/door.yaml"]


# Forms


def test_json_has_the_fields_of_the_reference(project: Path) -> None:
    (project / "specs/door.yaml").write_text(WEAKER)

    review = parse_review(codra("HEAD", "specs", "--format", "json", cwd=project))

    assert list(review) == ["verdict", "before", "after", "counts", "changes", "latencies"]
    assert review["counts"] == {"breaking": 1, "caution": 0, "compatible": 0, "allowed": 0}
    assert review["changes"] == [
        {
            "category": "weaker",
            "level": "breaking",
            "spec": "door",
            "element": "door/perception/measure_door",
            "key": "accept_when",
            "message": "'accept_when' holds more often",
            "allowed": False,
            "was": "'gap < 3 m'",
            "is": "'gap < 4 m'",
            "before": {"file": "HEAD:specs/door.yaml", "line": 15, "column": 9, "end_line": 15, "end_column": 18},
            "after": {"file": "specs/door.yaml", "line": 15, "column": 9, "end_line": 15, "end_column": 18},
        }
    ]


def test_markdown_escapes_text_from_specs(project: Path) -> None:
    label = "<img src=x> | [here](http://x) @all **now**"
    (project / "specs/door.yaml").write_text(DOOR.replace("valid_for: 5 s", f"valid_for: 5 s, label: '{label}'"))

    process = codra("HEAD", "specs", "--format", "markdown", "--output", "comment.md", cwd=project)

    text = (project / "comment.md").read_text("utf-8")
    assert (process.returncode, process.stdout) == (0, "")
    assert text.startswith("### codra diff: compatible\n")
    assert "\\<img src\\=x\\> \\| \\[here\\]\\(http\\://x\\) \\@all \\*\\*now\\*\\*" in text


def test_on_github_changes_are_annotations_and_the_summary_of_the_step(project: Path, tmp_path: Path) -> None:
    (project / "specs/door.yaml").write_text(WEAKER.replace("timeout: 2 s", "timeout: 3 s"))
    summary = tmp_path / "summary.md"

    process = codra("HEAD", "specs", cwd=project, GITHUB_ACTIONS="true", GITHUB_STEP_SUMMARY=str(summary))

    lines = process.stdout.splitlines()
    assert lines[0].startswith(
        "::error file=specs/door.yaml,line=15,endLine=15,col=9,endColumn=18,title=codra diff weaker::"
    )
    assert lines[1].startswith("::warning file=specs/door.yaml,line=9,")
    assert lines[-1] == "verdict: breaking (1 breaking, 1 caution)"
    assert "### codra diff: breaking" in summary.read_text("utf-8")


# Usage


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["nowhere", "specs"], "neither a path here nor a revision"),
        (["mian", "specs"], "did you mean 'main'?"),
        (["v1..main", "specs"], "give both ends, 'v1 main'"),
        (["main:specs", "specs"], "give the path after both versions"),
        (["--", "-n", "specs"], "do not begin with '-'"),
        (["--", "--output=x", "specs"], "do not begin with '-'"),
        (["", "specs"], "neither a path"),
        (["main", "v1", "no-such-folder"], "neither version has"),
        (["main", "v1", "../../.."], "outside of the repository"),
        (["main", "v1", "/etc"], "must be relative"),
        (["specs/door.yaml", "main", "door.yaml"], "remove the paths below it"),
        (["main", "specs", "--allow", "wekaer"], "unknown category"),
        (["main"], "give the version after, or --site"),
    ],
)
def test_a_usage_error_exits_with_2_and_a_hint(project: Path, arguments: list[str], hint: str) -> None:
    process = codra(*arguments, cwd=project)

    assert (process.returncode, process.stdout) == (2, "")
    assert hint in " ".join(process.stderr.split())
    assert sorted(path.name for path in project.iterdir()) == [".git", "pyproject.toml", "specs"]


def test_a_repository_whose_working_tree_is_elsewhere_is_refused(project: Path) -> None:
    """A hostile repository can name any folder as its working tree."""
    git("config", "core.worktree", ".", cwd=project)

    process = codra("main", "specs", cwd=project)

    assert process.returncode == 2
    assert "outside of the repository" in " ".join(process.stderr.split())


def test_a_branch_that_only_the_remote_has_is_suggested(project: Path) -> None:
    git("update-ref", "refs/remotes/origin/feature", "HEAD", cwd=project)

    assert "did you mean 'origin/feature'?" in codra("feature", "specs", cwd=project).stderr


def test_a_history_that_is_too_short_is_reported(project: Path, tmp_path: Path) -> None:
    commit(project, "again")
    git("clone", "--quiet", "--depth=1", project.as_uri(), "shallow", cwd=tmp_path)

    assert "('HEAD' is a revision, but has no '~7')" in codra("HEAD~7", "HEAD", cwd=project).stderr
    assert "git fetch --unshallow" in codra("HEAD~1", "HEAD", cwd=tmp_path / "shallow").stderr


def test_a_partial_clone_is_compared_as_far_as_its_specs_are_here(project: Path, tmp_path: Path) -> None:
    for text in ("one", "two"):
        (project / "notes.txt").write_text(text)
        commit(project, text)
    (project / "specs/door.yaml").write_text(WEAKER)
    commit(project, "weaker")
    (project / "specs/door.yaml").write_text(DOOR)
    commit(project, "as before")
    git("config", "uploadpack.allowFilter", "true", cwd=project)
    git("clone", "--quiet", "--filter=blob:none", project.as_uri(), "partial", cwd=tmp_path)

    here = codra("HEAD~3", "HEAD", cwd=tmp_path / "partial")
    missing = codra("HEAD~1", "HEAD", cwd=tmp_path / "partial")

    assert (here.returncode, here.stdout) == (0, "verdict: same\n")
    assert (missing.returncode, missing.stdout) == (2, "")
    assert "git fetch --refetch --no-filter" in missing.stderr


def test_a_bare_repository_has_revisions_as_well(project: Path, tmp_path: Path) -> None:
    (project / "specs/door.yaml").write_text(WEAKER)
    commit(project, "weaker")
    git("clone", "--quiet", "--bare", str(project), "robot.git", cwd=tmp_path)

    process = codra("v1", "main", "--format", "json", cwd=tmp_path / "robot.git")

    assert change_texts(process) == ["weaker door/perception/measure_door"]


def test_a_submodule_in_a_revision_is_reported_and_not_read(project: Path, tmp_path: Path) -> None:
    git("init", "--quiet", "--initial-branch=main", "outer", cwd=tmp_path)
    outer = tmp_path / "outer"
    git("-c", "protocol.file.allow=always", "submodule", "--quiet", "add", str(project), "robot", cwd=outer)
    commit(outer, "robot")

    process = codra("HEAD", "main^0", cwd=outer)

    assert (process.returncode, process.stdout) == (0, "verdict: same\n")
    messages = [f"codra: {name}:robot is not read, because it is a submodule" for name in ("HEAD", "main^0")]
    assert process.stderr.splitlines() == messages


def test_a_revision_outside_of_every_repository_is_a_usage_error(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(DOOR)

    process = codra("HEAD", ".", cwd=tmp_path, GIT_CEILING_DIRECTORIES=str(tmp_path.parent))

    assert process.returncode == 2
    assert "no git repository" in " ".join(process.stderr.split())


def test_a_revision_without_git_is_a_usage_error(project: Path) -> None:
    process = codra("HEAD", "specs", cwd=project, PATH="")

    assert process.returncode == 2
    assert "git is not installed" in " ".join(process.stderr.split())


# Hostile repositories


def test_nothing_that_a_repository_configures_is_run(project: Path, tmp_path: Path) -> None:
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\necho \"$0 $*\" >> '{tmp_path}/ran'\ncat\n")
    program.chmod(0o755)
    for hook in ("post-checkout", "pre-commit", "post-index-change", "reference-transaction"):
        (project / ".git/hooks").mkdir(exist_ok=True)
        (project / ".git/hooks" / hook).write_text(program.read_text())
        (project / ".git/hooks" / hook).chmod(0o755)
    (project / ".gitattributes").write_text("*.yaml filter=evil diff=evil\n")
    settings = ("core.fsmonitor", "core.pager", "core.sshCommand", "core.editor", "diff.external", "core.askPass")
    for key in (*settings, "filter.evil.smudge", "filter.evil.process", "diff.evil.textconv", "diff.evil.command"):
        git("config", key, str(program), cwd=project)
    git("config", "pager.log", "true", cwd=project)

    process = codra("HEAD", "specs", cwd=project)

    assert (process.returncode, process.stdout) == (0, "verdict: same\n")
    assert not (tmp_path / "ran").exists()


def test_the_variables_of_git_that_a_hook_sets_do_not_lead_elsewhere(project: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    git("init", "--quiet", cwd=other)

    process = codra("HEAD", "specs", cwd=project, GIT_DIR=str(other / ".git"), GIT_WORK_TREE=str(other))

    assert process.stdout == "verdict: same\n"


def test_links_in_a_revision_are_not_followed(project: Path, tmp_path: Path) -> None:
    (tmp_path / "secret.yaml").write_text(DOOR.replace("name: door", "name: secret"))
    (project / "specs/secret.yaml").symlink_to(tmp_path / "secret.yaml")
    commit(project, "link")

    process = codra("HEAD", "v1", "--format", "json", cwd=project)

    assert parse_review(process)["verdict"] == "same"
    assert "HEAD:specs/secret.yaml is not read, because it is a symbolic link" in process.stderr


def test_paths_in_a_tree_never_lead_out_of_the_private_folder(project: Path, tmp_path: Path) -> None:
    blob = git("hash-object", "-w", "--stdin", cwd=project, stdin=DOOR.encode())
    inner = tree(project, b"escaped.yaml", blob, b"100644")
    outer = tree(project, b"..", inner, b"40000")
    hostile = git("commit-tree", "-m", "hostile", tree(project, b"..", outer, b"40000"), cwd=project)
    private = tmp_path / "private"
    private.mkdir()

    codra(hostile, "specs", cwd=project, TMPDIR=str(private))

    assert not list(tmp_path.rglob("escaped.yaml"))
    assert list(private.iterdir()) == []


def tree(folder: Path, name: bytes, object_name: str, mode: bytes) -> str:
    """Write a tree that git itself would refuse to write."""
    data = mode + b" " + name + b"\0" + bytes.fromhex(object_name)
    return git("hash-object", "-t", "tree", "-w", "--literally", "--stdin", cwd=folder, stdin=data)


def test_nothing_is_written_to_the_project_or_left_behind(project: Path, tmp_path: Path) -> None:
    def state() -> list[tuple[str, int, int]]:
        paths = sorted(path for path in project.rglob("*") if stat.S_ISREG(path.lstat().st_mode))
        return [(str(path), path.stat().st_mtime_ns, path.stat().st_size) for path in paths]

    (tmp_path / "temporary").mkdir()
    before = state()

    codra("HEAD", "v1", cwd=project, TMPDIR=str(tmp_path / "temporary"))

    assert state() == before
    assert list((tmp_path / "temporary").iterdir()) == []
