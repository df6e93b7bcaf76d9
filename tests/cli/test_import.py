"""`codra import` drafts a spec from a main execution, and refuses what it cannot read in one message."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app

ROBOT = """\
import vision

def pass_door():
    if not vision.is_open("door"):
        vision.say("closed")
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "robot.py").write_text(ROBOT)
    return tmp_path


def codra(*arguments: str, exit_code: int = 0) -> tuple[str, str]:
    """Run a command and return its standard output and its standard error."""
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == exit_code, (result.output, result.exception)
    return result.stdout, result.stderr


def test_the_draft_is_a_new_spec_that_lints_and_compiles(folder: Path) -> None:
    assert codra("import", "robot.py", "--as", "door") == ("", "door: 1 variable, 1 skill, 4 comments 'to do'\n")

    assert (folder / "specs/door.yaml").read_text().startswith("codra: 1\nname: door\n")
    assert codra("lint", "specs", "--fail-on", "warning") == ("", "no findings\n")
    codra("compile", "specs")
    assert (folder / "generated/door/__init__.py").is_file()


def test_an_existing_file_is_kept(folder: Path) -> None:
    (folder / "specs").mkdir()
    (folder / "specs/door.yaml").write_text("mine")

    _, error = codra("import", "robot.py", "--as", "door", exit_code=1)

    expected = "codra: 'specs/door.yaml' exists already, so nothing was written: name another file with --output\n"
    assert error == expected
    assert (folder / "specs/door.yaml").read_text() == "mine"


def test_a_dash_as_the_output_writes_the_draft_to_standard_output(folder: Path) -> None:
    output, _ = codra("import", "robot.py", "--as", "door", "--output", "-")

    assert "is_open_door:  # robot.py:4:12: vision.is_open('door')\n" in output
    assert not (folder / "specs").exists()


def test_another_output_is_written_there(folder: Path) -> None:
    codra("import", "robot.py", "--as", "door", "--output", "door.yaml")

    assert "name: door" in (folder / "door.yaml").read_text()


@pytest.mark.parametrize(
    ("file", "text", "place", "message"),
    [
        ("a.py", "if (:\n", "a.py:1:5", "this is not valid Python: invalid syntax"),
        ("a.py", "x = 1" + "+1" * 50_000, "a.py:1:1", "the code is nested too deeply"),
        ("a.py", "# coding: rot13\n", "a.py:1:1", "'rot13' is not a text encoding"),
        ("a.py", "\0", "a.py:1:1", "source code string cannot contain null bytes"),
        ("a.py", "#" * (1 << 20) + "\n", "a.py:1:1", "cannot read 'a.py': it has more than 1 MiB"),
        ("a.xml", "<root><BehaviorTree>", "a.xml:1:21", "invalid XML: no element found"),
        ("a.txt", "", "a.txt:1:1", "'a.txt' is no source of decisions that codra reads"),
    ],
)
def test_a_source_that_cannot_be_read_is_an_error_at_its_place(
    folder: Path, file: str, text: str, place: str, message: str
) -> None:
    (folder / file).write_text(text)

    _, error = codra("import", file, "--as", "robot", exit_code=1)

    assert error.startswith(f"{place}: error[")
    assert message in error
    assert "1 error" in error
    assert not (folder / "specs").exists()


def test_a_folder_without_trees_is_an_error(folder: Path) -> None:
    (folder / "robot").mkdir()

    _, error = codra("import", "robot", "--as", "door", exit_code=1)

    assert error.startswith("robot:1:1: error[unreadable-source]: there is no file of trees in 'robot' or below")


def test_a_source_without_decisions_gives_no_spec(folder: Path) -> None:
    (folder / "robot.py").write_text("import vision\nvision.say('hello')\n")

    _, error = codra("import", "robot.py", "--as", "door", exit_code=1)

    assert "'robot.py' has no decision: no branch on the result of a call" in error


def test_a_name_that_no_spec_may_have_is_refused() -> None:
    _, error = codra("import", "robot.py", "--as", "my-door", exit_code=2)

    assert "write my_door" in error


def test_nodes_of_trees_are_conditions_if_a_file_of_models_says_so(folder: Path) -> None:
    (folder / "a.xml").write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="T"><Sequence><Fine/><Go/></Sequence></BehaviorTree></root>'
    )
    (folder / "nodes.xml").write_text(
        '<root BTCPP_format="4"><TreeNodesModel><Condition ID="Fine"/><Action ID="Go"/></TreeNodesModel></root>'
    )

    codra("import", "a.xml", "--as", "go", exit_code=1)
    output, _ = codra("import", "a.xml", "--as", "go", "--models", "nodes.xml", "--output", "-")

    assert "      - fine  # a.xml:1:55\n" in output


def test_a_draft_whose_things_have_reserved_or_long_names_lints(folder: Path) -> None:
    calls = ("clock", "mape", "agent", "context", "pass_", "abs", "true", "Class", "codra", "values", "x" * 300)
    tests = "".join(f"    if robot.{name}() and {name}(): robot.go()\n" for name in calls)
    (folder / "robot.py").write_text(f"def class_():\n{tests}")

    codra("import", "robot.py", "--as", "names")
    codra("lint", "specs/names.yaml")


def test_a_name_for_which_the_draft_has_an_error_is_reported_and_nothing_is_written(folder: Path) -> None:
    _, error = codra("import", "robot.py", "--as", "clock", exit_code=1)

    assert error.startswith("specs/clock.yaml:2:7: error[CDR3002]: the generated class would be 'Clock'")
    assert not (folder / "specs").exists()
