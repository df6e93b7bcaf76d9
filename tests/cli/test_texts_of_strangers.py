"""Texts of journals and repositories that a terminal, a shell or a CI system would obey are only shown."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.runtime import ContextManager, ContextModel, Journal, SimClock, VariableModel, boolean
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.values.model import SkillModel
from tests.cli.test_completion import completions
from tests.cli.test_hostile_projects import DOOR, codra

HOSTILE = "\x1b]0;title\x07\x9b31m\u202e\n::error::"
OBEYED = ("\x1b", "\x07", "\x9b", "\u202e", "\n::")
NAME = f"open{HOSTILE}"
SKILL = f"pass{HOSTILE}"
HOSTILE_CLASSES = """\
class HostileError(ValueError):
    def __str__(self):
        raise SystemExit(0)


class Hostile:
    def __getattr__(self, name):
        raise HostileError


"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    return tmp_path


@pytest.fixture
def hostile_journal(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write a journal in which names, a version and a message of an error are hostile; return its path."""
    of_run = RunHeader.of_run

    def hostile_header(*arguments: Any, **settings: Any) -> RunHeader:
        return replace(of_run(*arguments, **settings), codra=HOSTILE, spec=NAME)

    monkeypatch.setattr(RunHeader, "of_run", hostile_header)
    variable = VariableModel(name=NAME, type=boolean(), label=NAME, sources=("main_execution",))
    model = ContextModel(
        name="door", variables=(variable,), observers=(), skills=(SkillModel(name=SKILL, preview=(NAME,)),)
    )
    journal = folder / "run.mcap"
    with ContextManager[str, str](model, clock=SimClock(), resources={}, record=Journal(journal)) as manager:
        manager.set(NAME, False)
        with manager.skill(SKILL):
            manager.decide(NAME, lambda: True, shadow=True)
    return journal


@pytest.mark.parametrize(
    "command",
    [
        ["journal", "show", "run.mcap"],
        ["why", NAME, "--journal", "run.mcap"],
        ["why", f"{NAME}s", "--journal", "run.mcap"],
        ["shadow", "run.mcap"],
        ["replay", "run.mcap", "--package", "package"],
    ],
    ids=["show", "why", "suggestion", "shadow", "replay"],
)
@pytest.mark.usefixtures("hostile_journal")
def test_a_name_in_a_journal_is_no_command_of_a_terminal_or_of_ci(
    folder: Path, command: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "package").mkdir()
    (folder / "package/__init__.py").write_text("MODEL = None\n")

    _, text = codra(capfd, *command)

    assert "\N{REPLACEMENT CHARACTER}]0;title" in text
    assert [letters for letters in OBEYED if letters in text] == []


@pytest.mark.parametrize(
    ("package", "problem"),
    [
        ("raise HostileError", "is not a package of codra that can be loaded"),
        ("MODEL = Hostile()", "the journal cannot be replayed"),
    ],
)
@pytest.mark.usefixtures("hostile_journal")
def test_an_exception_without_a_message_of_a_package_is_reported_in_one_line(
    folder: Path, package: str, problem: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "package").mkdir()
    (folder / "package/__init__.py").write_text(f"{HOSTILE_CLASSES}{package}\n")

    code, text = codra(capfd, "replay", "run.mcap", "--package", "package")

    assert code == 1
    assert f"{problem}: HostileError: its message cannot be shown\n" in text


def test_a_name_in_a_journal_that_a_shell_would_run_is_not_completed(hostile_journal: Path) -> None:
    """Completion of zsh evaluates what it is given."""
    assert completions("why", "--journal", str(hostile_journal), "op") == []


def test_a_link_in_a_revision_is_reported_without_commands(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (folder / "specs").mkdir()
    (folder / "specs/door.yaml").write_text(DOOR)
    (folder / f"specs/{HOSTILE}.yaml").symlink_to("elsewhere")
    for arguments in (["init"], ["add", "."], ["-c", "user.name=me", "-c", "user.email=me@here", "commit", "-m", "a"]):
        subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True)
    (folder / f"specs/{HOSTILE}.yaml").unlink()

    code, text = codra(capfd, "diff", "HEAD", "specs")

    assert code == 0
    assert "is not read, because it is a symbolic link" in text
    assert [letters for letters in OBEYED if letters in text] == []


def test_errors_of_an_older_revision_are_no_commands_of_ci(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (folder / "specs").mkdir()
    (folder / "specs/door.yaml").write_text(DOOR.replace("[door_open]", '["##[error]stopped"]'))
    for arguments in (["init"], ["add", "."], ["-c", "user.name=me", "-c", "user.email=me@here", "commit", "-m", "a"]):
        subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True)
    (folder / "specs/door.yaml").write_text(DOOR)

    _, text = codra(capfd, "diff", "HEAD", "specs")

    assert "HEAD has errors" in text
    assert "##[" not in text


@pytest.mark.usefixtures("hostile_journal")
def test_a_journal_is_recovered_only_to_a_regular_file(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(folder / "pipe")
    for target in ("pipe", "."):
        code, text = codra(capfd, "journal", "recover", "run.mcap", "--output", target)

        assert code == 1
        assert "is not a regular file" in text
    assert (folder / "pipe").is_fifo()


@pytest.mark.usefixtures("hostile_journal")
def test_a_recovery_neither_follows_a_planted_link_nor_removes_other_files(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "mine.txt").write_text("mine")
    (folder / "run.recovered.mcap.part").symlink_to("mine.txt")
    (folder / "other.mcap").write_text("no journal")
    (folder / "other.recovered.mcap.part").write_text("mine")

    assert codra(capfd, "journal", "recover", "run.mcap")[0] == 0
    assert codra(capfd, "journal", "recover", "other.mcap")[0] == 1

    assert (folder / "mine.txt").read_text() == "mine"
    assert (folder / "other.recovered.mcap.part").read_text() == "mine"
    assert (folder / "run.recovered.mcap").is_file()
