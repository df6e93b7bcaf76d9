"""`codra fuzzy` checks and draws files of fuzzy engines without a spec."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app
from tests.language.fuzzy.test_reading import GOOD, of_version_5

OLD_WARNING = (
    "old.fll:12:3: warning[CDR2214]: an engine of FuzzyLite 5: it is read as if it were converted to version 6"
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_ACTIONS", raising=False)
    (tmp_path / "fan.fll").write_text(GOOD)
    (tmp_path / "old.fll").write_text(of_version_5(GOOD))
    return tmp_path


def codra(*arguments: str, exit_code: int = 0) -> tuple[str, str]:
    """Run a command and return its standard output and its standard error."""
    result = CliRunner().invoke(app, ["fuzzy", *arguments])
    assert result.exit_code == exit_code, (result.output, result.exception)
    return result.stdout, result.stderr


def test_check_accepts_engines_of_both_versions_and_names_the_words_of_the_old_one() -> None:
    output, counts = codra("check", "fan.fll", "old.fll", "--format", "concise")

    assert output.startswith(f"{OLD_WARNING} (in version 6, write 'aggregation' for 'accumulation'; ")
    assert output.count("\n") == 1
    assert counts == "2 engines in 2 files: 1 warning\n"
    codra("check", "old.fll", "--fail-on", "warning", exit_code=1)


def test_check_reports_all_mistakes_of_all_files_at_their_places(folder: Path) -> None:
    (folder / "bad.fll").write_text(GOOD.replace("Ramp 0.6", "Rmp 0.6").replace("is hot or", "is hto or"))
    (folder / "empty.fll").write_text("")

    output, counts = codra("check", "bad.fll", "empty.fll", "fan.fll", "--format", "json", exit_code=1)
    findings = [json.loads(line) for line in output.splitlines()]
    assert [(finding["file"], finding["line"], finding["code"]) for finding in findings] == [
        ("bad.fll", 6, "CDR2207"),
        ("bad.fll", 25, "CDR2211"),
        ("empty.fll", 1, "CDR2212"),
    ]
    assert counts == "1 engine in 3 files: 3 errors\n"


def test_a_folder_is_refused_with_what_to_name_instead(folder: Path) -> None:
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "engines").mkdir()

    output, _ = codra("check", "engines", "--format", "concise", exit_code=1)

    assert output == "engines:1:1: error[CDR0001]: 'engines' is not a file (write the path of a regular file)\n"


def test_check_obeys_the_settings_of_the_project_and_comments(folder: Path) -> None:
    old = of_version_5(GOOD)
    comment = "  # codra: ignore[CDR2214] the robot has FuzzyLite 5\n"
    (folder / "old.fll").write_text(old.replace("  accumulation", f"{comment}  accumulation"))
    assert codra("check", "old.fll") == ("", "1 engine in 1 file: no findings\n")

    (folder / "old.fll").write_text(old)
    (folder / "pyproject.toml").write_text('[tool.codra.lint]\nignore = ["CDR2214"]\n')
    assert codra("check", "old.fll") == ("", "1 engine in 1 file: no findings\n")


def test_draw_shows_every_variable_and_term_in_the_format_of_the_ending(folder: Path) -> None:
    picture, problems = codra("draw", "fan.fll")
    assert problems == ""
    for name in ("heat", "speed", "cold", "hot", "slow", "fast"):
        assert f"<!-- {name} -->" in picture
    codra("draw", "fan.fll", "--output", "fan.png")
    assert (folder / "fan.png").read_bytes().startswith(b"\x89PNG")


def test_draw_shows_only_the_chosen_variables_and_the_findings_beside_them() -> None:
    picture, problems = codra("draw", "old.fll", "--variable", "speed")

    assert "<!-- speed -->" in picture
    assert "<!-- heat -->" not in picture
    assert problems.startswith(OLD_WARNING)


def test_a_variable_without_a_finite_range_is_not_drawn(folder: Path) -> None:
    (folder / "fan.fll").write_text(GOOD.replace("  range: 0.0 1.0\n", ""))

    picture, problems = codra("draw", "fan.fll")
    assert "<!-- speed -->" in picture
    assert problems == "codra: 'heat' is not drawn: its range must be finite and not empty\n"
    _, problems = codra("draw", "fan.fll", "--variable", "heat", exit_code=1)
    assert problems.endswith("codra: there is no variable to draw\n")


def test_an_engine_with_more_variables_than_a_picture_has_room_for_is_drawn_in_parts(folder: Path) -> None:
    variables = "".join(f"InputVariable: v{n}\n  range: 0 1\n  term: low Ramp 1 0\n" for n in range(31))
    (folder / "large.fll").write_text(GOOD.replace("RuleBlock:", f"{variables}RuleBlock:"))

    _, problems = codra("draw", "large.fll", exit_code=2)
    assert "at most 30 variables" in problems
    picture, _ = codra("draw", "large.fll", "--variable", "v7")
    assert "<!-- v7 -->" in picture


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("draw", "fan.fll", "--variable", "haet"), "there is no variable 'haet'"),
        (("draw", "fan.fll", "--output", "fan.dot"), "no picture has the ending '.dot': use --format, or one of .svg"),
        (("check", "none.fll"), "'none.fll' does not exist"),
    ],
)
def test_a_wrong_argument_is_a_usage_error(arguments: tuple[str, ...], message: str) -> None:
    _, problems = codra(*arguments, exit_code=2)

    assert message in " ".join(problems.replace("│", " ").split())


HOSTILE = {
    "bytes": bytes(range(256)),
    "nothing": b"",
    "UTF-16": GOOD.encode("utf-16"),
    "a null character": b"Engine: a\0",
    "size": b"#" * 2_000_000,
    "code": GOOD.replace("Ramp 0.6 0.1", "Function __import__('os').system('id')").encode(),
    "depth": b"Engine: a\nInputVariable: v\nterm: t Function " + b"(" * 400 + b"x" + b")" * 400,
    "controls": b"Engine: \x1b[31m\n\x1b]0;x\x07: y\n",
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("command", ["check", "draw"])
def test_a_hostile_file_is_refused_with_a_finding(command: str, name: str, folder: Path) -> None:
    (folder / "hostile.fll").write_bytes(HOSTILE[name])

    output, problems = codra(command, "hostile.fll", exit_code=1)
    assert "error[CDR" in output + problems
    assert "\x1b" not in output + problems


def test_a_link_out_of_the_project_is_refused_and_nothing_of_its_target_is_shown(folder: Path) -> None:
    project = folder / "project"
    project.mkdir()
    (project / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "secret.fll").write_text("secret")
    (project / "link.fll").symlink_to(folder / "secret.fll")

    output, _ = codra("check", "project/link.fll", exit_code=1)
    assert "leads out of the project" in output
    assert "'secret'" not in output
