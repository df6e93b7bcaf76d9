"""Completion in the shell, and the help of `codra`, in process."""

from __future__ import annotations

from pathlib import Path

from typer.testing import CliRunner

from codra_dsl.cli.app import app

EARLIER_JOURNAL = Path(__file__).parents[1] / "data/earlier_version.mcap"


def completions(*words: str) -> list[str]:
    """Return what bash offers for the last of some words after `codra`."""
    environment = {
        "_CODRA_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(["codra", *words]),
        "COMP_CWORD": str(len(words)),
    }
    return CliRunner().invoke(app, [], env=environment, prog_name="codra").output.split()


def test_codes_and_names_of_findings_are_completed() -> None:
    assert completions("explain", "CDR300") == [f"CDR300{number}" for number in range(1, 4)]
    assert completions("explain", "library-ref") == ["library-refuses-name", "library-refuses-children"]


def test_variables_of_the_given_journal_are_completed() -> None:
    assert completions("why", "--journal", str(EARLIER_JOURNAL), "door") == ["door_open"]
    assert completions("why", "--journal", str(EARLIER_JOURNAL), "x") == []
    assert completions("why", "--journal", "missing.mcap", "door") == []
    assert completions("why", "door") == []


def test_the_help_of_codra_shows_whole_summaries() -> None:
    commands = CliRunner().invoke(app, ["--help"], prog_name="codra").output.partition("Commands:")[2]

    assert "..." not in commands
    assert "compared with the ground truth." in " ".join(commands.split())
