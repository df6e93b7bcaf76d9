"""Files that users copy into their CI: hooks, workflows and problem matchers in the form that their readers require."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from codra_dsl.tooling.scaffold import starter_texts, write_new_files
from tests.test_docs import blocks, run

ROOT = Path(__file__).parents[1]
HOOKS: list[dict[str, Any]] = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text("utf-8"))
STARTER = starter_texts("arm", "codra-dsl==1")
WARNED = """\
codra: 1
name: door
context:
  door_open: {type: bool, source: main_execution}
  unused: {type: bool, source: main_execution}
skills:
  open_door:
    preview: [%s]
"""


def files_of_page(page: str) -> dict[str, str]:
    """Return the files that a page of the guide tells its readers to write."""
    page_blocks = blocks(ROOT / "docs/how-to" / page)
    return {block.options["file"]: block.body for block in page_blocks if "file" in block.options}


CI, EDITOR = files_of_page("ci.md"), files_of_page("editor.md")
WORKFLOWS = {
    "starter": yaml.safe_load(STARTER[".github/workflows/codra.yml"]),
    "docs": yaml.safe_load(CI[".github/workflows/codra.yml"]),
}


def steps(workflow: dict[Any, Any]) -> Iterator[dict[str, Any]]:
    for job in workflow["jobs"].values():
        yield from job["steps"]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A new project, compiled."""
    write_new_files(STARTER, tmp_path)
    assert run(["codra", "compile", "specs"], tmp_path)[0] == 0
    return tmp_path


# pre-commit


def test_the_hooks_have_what_pre_commit_requires() -> None:
    needed, optional = {"id", "name", "entry", "language"}, {"description", "args", "files"}

    assert [hook["id"] for hook in HOOKS] == ["codra-lint", "codra-compile-check"]
    for hook in HOOKS:
        assert hook.keys() == needed | optional | {"pass_filenames", "require_serial"}
        assert (hook["language"], hook["pass_filenames"], hook["require_serial"]) == ("python", False, True)


@pytest.mark.parametrize("hook", HOOKS, ids=lambda hook: hook["id"])
def test_a_hook_passes_on_a_new_project_and_fails_when_a_spec_is_wrong(hook: dict[str, Any], project: Path) -> None:
    command = [*shlex.split(hook["entry"]), *hook["args"]]

    assert run(command, project)[0] == 0
    (project / "specs/door.yaml").write_text(WARNED % "door_opn")
    assert run(command, project)[0] == 1


def test_only_the_second_hook_sees_generated_code_that_was_edited(project: Path) -> None:
    (project / "generated/arm/arm.py").write_text("")

    assert [run([*shlex.split(hook["entry"]), *hook["args"]], project)[0] for hook in HOOKS] == [0, 1]


@pytest.mark.parametrize(
    ("path", "ids"),
    [
        ("specs/door.yaml", ["codra-lint", "codra-compile-check"]),
        ("robot/specs/parts/machine.yml", ["codra-lint", "codra-compile-check"]),
        ("pyproject.toml", ["codra-lint", "codra-compile-check"]),
        ("generated/door/door.py", ["codra-compile-check"]),
        ("generated/door/graph.json", ["codra-compile-check"]),
        (".codra/schema.json", ["codra-compile-check"]),
        ("door_program.py", []),
        ("notes/pyproject.toml.txt", []),
        ("door.yaml.md", []),
    ],
)
def test_a_hook_runs_when_a_file_changes_that_it_depends_on(path: str, ids: list[str]) -> None:
    assert [hook["id"] for hook in HOOKS if re.search(hook["files"], path)] == ids


def test_the_guide_names_hooks_that_exist() -> None:
    (repository,) = yaml.safe_load(CI[".pre-commit-config.yaml"])["repos"]

    assert [hook["id"] for hook in repository["hooks"]] == [hook["id"] for hook in HOOKS]
    assert repository.keys() == {"repo", "rev", "hooks"}


def test_the_hooks_of_a_new_project_are_like_the_published_ones() -> None:
    (repository,) = yaml.safe_load(STARTER[".pre-commit-config.yaml"])["repos"]

    assert repository["repo"] == "local"
    for hook, published in zip(repository["hooks"], HOOKS, strict=True):
        same = ("id", "name", "language", "pass_filenames", "require_serial")
        assert [hook[key] for key in same] == [published[key] for key in same]
        assert re.search(hook["files"], "specs/arm.yaml")
        assert hook["entry"].split()[:2] == published["entry"].split()[:2]


# GitHub and GitLab


@pytest.mark.parametrize("workflow", WORKFLOWS.values(), ids=WORKFLOWS)
def test_a_workflow_has_the_form_that_github_requires_and_minimal_permissions(workflow: dict[Any, Any]) -> None:
    on = workflow[True]  # YAML 1.1 reads `on` as a boolean

    assert workflow.keys() == {"name", True, "permissions", "jobs"}
    assert on.keys() == {"push", "pull_request"}
    assert workflow["permissions"] == {"contents": "read"}
    for job in workflow["jobs"].values():
        assert {"runs-on", "timeout-minutes", "steps"} <= job.keys()
        assert job.keys() <= {"runs-on", "timeout-minutes", "steps", "permissions"}
    for step in steps(workflow):
        assert len(step.keys() & {"run", "uses"}) == 1
        assert step.keys() <= {"run", "uses", "with", "if", "continue-on-error"}


@pytest.mark.parametrize("workflow", WORKFLOWS.values(), ids=WORKFLOWS)
def test_a_workflow_pins_actions_by_their_major_version_and_keeps_no_credentials(workflow: dict[Any, Any]) -> None:
    used = [step for step in steps(workflow) if "uses" in step]

    assert used
    for step in used:
        assert re.fullmatch(r"(actions/(checkout|setup-python)|github/codeql-action/upload-sarif)@v\d+", step["uses"])
        if "checkout" in step["uses"]:
            assert step["with"] == {"persist-credentials": False}


def test_only_the_job_that_uploads_may_write_and_only_findings() -> None:
    rights = {name: job.get("permissions") for name, job in WORKFLOWS["docs"]["jobs"].items()}

    assert rights == {
        "check": None,
        "code-scanning": {"contents": "read", "actions": "read", "security-events": "write"},
    }


def commands() -> list[str]:
    gitlab = yaml.safe_load(CI[".gitlab-ci.yml"])["codra"]["script"]
    lines = [*(step.get("run", "") for flow in WORKFLOWS.values() for step in steps(flow)), *gitlab]
    return [line for line in lines if line.startswith("codra ")]


@pytest.mark.parametrize("command", sorted({*commands()}))
def test_every_command_of_a_workflow_passes_in_a_new_project(command: str, project: Path) -> None:
    exit_code, output = run(shlex.split(command), project)

    assert exit_code == 0, output


def test_gitlab_gets_the_report_that_lint_writes(project: Path) -> None:
    job = yaml.safe_load(CI[".gitlab-ci.yml"])["codra"]
    (lint,) = (line for line in job["script"] if line.startswith("codra lint"))
    report = job["artifacts"]["reports"]["junit"]

    assert run(shlex.split(lint), project)[0] == 0
    assert (project / report).read_text("utf-8").startswith("<?xml")
    assert job["artifacts"]["when"] == "always"


# Problem matchers


def patterns() -> dict[str, dict[str, Any]]:
    (on_github,) = json.loads(CI[".github/codra-matcher.json"])["problemMatcher"]
    (task,) = json.loads(EDITOR[".vscode/tasks.json"])["tasks"]
    (pattern,) = on_github["pattern"]
    return {"ci.md": pattern, "editor.md": task["problemMatcher"]["pattern"]}


@pytest.mark.parametrize("page", ["ci.md", "editor.md"])
def test_a_problem_matcher_parses_every_finding(page: str, tmp_path: Path) -> None:
    """File names with blanks, colons and brackets; errors and warnings; and no other lines."""
    pattern = patterns()[page]
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    for file, variable in (("my specs/front door (1).yaml", "door_opn"), ("my specs/a:b.yaml", "door_open")):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text((WARNED % variable).replace("name: door", f"name: {variable}"))
    shown = run(["codra", "lint", "my specs", "--format", "concise"], tmp_path)[1].splitlines()
    lines = run(["codra", "lint", "my specs", "--format", "json"], tmp_path)[1].splitlines()

    matches = [match for line in shown if (match := re.search(pattern["regexp"], line))]
    findings = [json.loads(line) for line in lines if line.startswith("{")]
    groups = ("file", "line", "column", "severity", "code")

    assert len(matches) == len(shown) - 1, "all but the last line, which counts them"
    assert [[match[pattern[group]] for group in groups] for match in matches] == [
        [str(finding[group]) for group in groups] for finding in findings
    ]
    for match, finding in zip(matches, findings, strict=True):
        assert match[pattern["message"]].startswith(finding["message"])
    assert {(finding["file"], finding["severity"]) for finding in findings} >= {
        ("my specs/a:b.yaml", "warning"),
        ("my specs/front door (1).yaml", "error"),
    }


def test_both_problem_matchers_are_one() -> None:
    assert patterns()["ci.md"] == patterns()["editor.md"]


# Editors


def test_the_guide_maps_the_schema_from_where_it_is_kept() -> None:
    settings = json.loads(EDITOR[".vscode/settings.json"])
    first_line = STARTER["specs/arm.yaml"].splitlines()[0]

    assert list(settings["yaml.schemas"]) == [".codra/schema.json"]
    assert first_line == EDITOR["specs/door.yaml"].splitlines()[0]
    assert first_line == "# yaml-language-server: $schema=../.codra/schema.json"


def test_python_knows_where_the_schema_is_installed() -> None:
    program = "import codra_dsl, pathlib; print(pathlib.Path(codra_dsl.__file__).with_name('schema.json').is_file())"

    process = subprocess.run([sys.executable, "-c", program], text=True, capture_output=True, check=True)

    assert process.stdout == "True\n"
