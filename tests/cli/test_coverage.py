"""`codra coverage` reports which decisions of a main execution a spec covers, in all formats of findings."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app

SPEC = """\
codra: 1
name: door
context:
  vision_is_open_door: {type: bool, source: main_execution}
  bell_rings: {type: bool, source: main_execution}
skills:
  pass_door: {preview: [vision_is_open_door]}
"""
ROBOT = """\
def pass_door(vision):
    if not vision.is_open("door"):
        vision.say("closed")
    if vision.dark():
        vision.light()
"""
SUMMARY = "door: 1 of 2 decisions are covered (50 %); variables without a decision: 1\n"
OPTIONS = ("specs/door.yaml", "--of", "robot.py")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "robot.py").write_text(ROBOT)
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs/door.yaml").write_text(SPEC)
    return tmp_path


def codra(*arguments: str, exit_code: int = 0) -> tuple[str, str]:
    """Run the command and return its standard output and its standard error."""
    result = CliRunner().invoke(app, ["coverage", *arguments])
    assert result.exit_code == exit_code, (result.output, result.exception)
    return result.stdout, result.stderr


def test_uncovered_decisions_are_shown_in_the_source_and_variables_without_a_decision_in_the_spec() -> None:
    assert codra(*OPTIONS) == (
        """\
robot.py:4:8: warning[decision-not-covered]: skill 'pass_door' decides on 'vision_dark': the spec has no such variable
  |
4 |     if vision.dark():
  |        ^^^^^^^^^^^^^ help: declare it, and add it to 'preview' of skill 'pass_door'

specs/door.yaml:5:3: warning[variable-without-decision]: no decision of the main execution needs 'bell_rings'
  |
5 |   bell_rings: {type: bool, source: main_execution}
  |   ^^^^^^^^^^ help: remove it, or check the skill and the name under which the main execution decides on it
""",
        SUMMARY,
    )


def test_json_has_every_decision_with_its_place_and_its_variable() -> None:
    output, summary = codra(*OPTIONS, "--format", "json")

    assert summary == SUMMARY
    coverage = json.loads(output)
    assert (coverage["spec"], coverage["covered"], coverage["total"], coverage["covered_percent"]) == ("door", 1, 2, 50)
    assert coverage["decisions"][0] == {
        "name": "vision_is_open_door",
        "skill": "pass_door",
        "text": "vision.is_open('door')",
        "role": "precondition",
        "is_covered": True,
        "variable": "vision_is_open_door",
        "reason": None,
        "places": [{"file": "robot.py", "line": 2, "column": 12}],
    }
    assert coverage["decisions"][1]["reason"] == "the spec has no such variable"
    assert coverage["unused_variables"] == [
        {"name": "bell_rings", "place": {"file": "specs/door.yaml", "line": 5, "column": 3}}
    ]


def test_sarif_has_a_rule_and_a_result_for_each_finding() -> None:
    output, _ = codra(*OPTIONS, "--format", "sarif")

    (run,) = json.loads(output)["runs"]
    assert [rule["id"] for rule in run["tool"]["driver"]["rules"]] == [
        "decision-not-covered",
        "variable-without-decision",
    ]
    places = [result["locations"][0]["physicalLocation"] for result in run["results"]]
    assert [(place["artifactLocation"]["uri"], place["region"]["startLine"]) for place in places] == [
        ("robot.py", 4),
        ("specs/door.yaml", 5),
    ]


def test_a_smaller_share_than_demanded_fails() -> None:
    codra(*OPTIONS, "--fail-under", "50")
    _, error = codra(*OPTIONS, "--fail-under", "50.1", exit_code=1)
    assert error == SUMMARY + "less than 50.1 % (--fail-under)\n"
    codra(*OPTIONS, "--fail-under", "101", exit_code=2)


def test_a_source_without_decisions_is_not_covered(folder: Path) -> None:
    (folder / "robot.py").write_text("")

    _, error = codra(*OPTIONS, "--fail-under", "100", exit_code=1)

    assert "'robot.py' has no decision" in error


def test_the_graph_colours_decisions_and_variables_by_coverage(folder: Path) -> None:
    codra(*OPTIONS, "--graph", "coverage.dot")
    nodes = {
        line.split('"')[1]: line for line in (folder / "coverage.dot").read_text().splitlines() if "fillcolor" in line
    }
    assert {name: line.partition("fillcolor=")[2][1:8] for name, line in nodes.items() if "legend" not in name} == {
        "variable vision_is_open_door": "#b3e2d5",
        "variable vision_dark": "#f2b8a0",
        "skill pass_door": "#f9f4ae",
        "unused bell_rings": "#e4e4e4",
    }

    codra(*OPTIONS, "--graph", "coverage.svg")
    assert (folder / "coverage.svg").read_text().startswith("<svg")
    codra(*OPTIONS, "--graph", "coverage.png", exit_code=2)


def test_errors_of_the_spec_and_of_the_source_fail_before_anything_is_judged(folder: Path) -> None:
    (folder / "bad.yaml").write_text(SPEC.replace("preview", "preveiw"))
    assert "help: did you mean 'preview'?" in codra("bad.yaml", "--of", "robot.py", exit_code=1)[1]

    (folder / "bad.py").write_text("if")
    assert "bad.py:1:3: error[unreadable-source]" in codra("specs/door.yaml", "--of", "bad.py", exit_code=1)[1]


def test_a_folder_with_several_specs_is_refused(folder: Path) -> None:
    (folder / "specs/gate.yaml").write_text(SPEC.replace("name: door", "name: gate"))

    assert "name one spec" in codra("specs", "--of", "robot.py", exit_code=2)[1]
