"""Projects that were made to stop codra: each command answers with findings or one line, in little memory."""

from __future__ import annotations

import multiprocessing
import os
import py_compile
import resource
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import cache_from_source
from multiprocessing.queues import Queue
from pathlib import Path
from py_compile import PycInvalidationMode

import pytest
from typer.testing import CliRunner

from codra_dsl.cli.app import app, command_line

Manager = multiprocessing.get_context("fork")
DOOR = """\
codra: 1
name: door
context:
  door_open: {type: bool, source: main_execution, valid_for: 5 s}
skills:
  pass_door: {preview: [door_open]}
"""
MAX_SECONDS = 60
"""A command that reads one of these files without a limit never ends."""

MAX_MEMORY_BYTES = 400 << 20


def limited_codra(*arguments: str) -> tuple[int, str]:
    """Run a command in a process that may take little more memory than this one; return its exit code and output."""
    results = Manager.Queue()
    process = Manager.Process(target=_run_limited, args=(arguments, results))
    process.start()
    try:
        return results.get(timeout=MAX_SECONDS)
    finally:
        process.kill()
        process.join()


def _run_limited(arguments: tuple[str, ...], results: Queue[tuple[int, str]]) -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + MAX_MEMORY_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    result = CliRunner().invoke(app, arguments)
    error = "" if result.exception is None or isinstance(result.exception, SystemExit) else repr(result.exception)
    results.put((result.exit_code, result.output + error))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "project"
    (folder / "specs").mkdir(parents=True)
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "specs/door.yaml").write_text(DOOR)
    monkeypatch.chdir(folder)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return folder


def codra(capfd: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    """Run a command in this process, as the command line does; return its exit code and what it wrote."""
    before, sys.argv = sys.argv, ["codra", *arguments]
    try:
        code = command_line()
    finally:
        sys.argv = before
    written = capfd.readouterr()
    return code, written.out + written.err


def make_link_to_zeros(path: Path) -> None:
    path.symlink_to("/dev/zero")


def make_pipe(path: Path) -> None:
    os.mkfifo(path)


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        before = Path.cwd()
        os.chdir(path.parent)
        listener.bind(path.name)
        os.chdir(before)


def make_huge_file(path: Path) -> None:
    with path.open("wb") as stream:
        stream.truncate(8 << 30)


@pytest.mark.parametrize("make", [make_link_to_zeros, make_pipe, make_socket, make_huge_file])
@pytest.mark.parametrize(
    "name",
    [
        "generated/door/manifest.json",
        "generated/other/manifest.json",
        "generated/__init__.py",
        "generated/door/door.py",
        "pyproject.toml",
        ".codra/schema.json",
        "specs/other.yaml",
    ],
)
def test_a_file_that_never_ends_is_answered(project: Path, name: str, make: Callable[[Path], None]) -> None:
    """Each of these names can be in a repository, as a link or in an archive."""
    assert CliRunner().invoke(app, ["compile", "specs", "--no-cache"]).exit_code == 0
    (project / name).unlink(missing_ok=True)
    (project / name).parent.mkdir(exist_ok=True)
    make(project / name)

    for command in (["compile", "specs", "--check"], ["compile", "specs"], ["lint", "specs"]):
        code, text = limited_codra(*command)

        assert code in (0, 1), text
        assert "Error(" not in text, text


def test_a_spec_that_is_a_link_out_of_the_project_is_refused_and_not_shown(
    project: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (project.parent / "secret.txt").write_text("password: [hunter2\n")
    (project / "specs/z.yaml").symlink_to("../../secret.txt")

    code, text = codra(capfd, "lint", "specs")

    assert code == 1
    assert "hunter2" not in text
    assert "specs/z.yaml:1:1: error[CDR0001]" in text
    assert "is a link that leads out of the project" in text
    assert "help: copy the file into the project" in text


@pytest.mark.parametrize("command", ["lint", "compile", "graph", "run", "sweep"])
def test_a_link_to_itself_is_a_finding(project: Path, command: str, capfd: pytest.CaptureFixture[str]) -> None:
    (project / "specs/y.yaml").symlink_to("y.yaml")

    code, text = codra(capfd, command, "specs")

    assert code in (1, 2)
    assert "internal error" not in text


@pytest.mark.parametrize("name", ["a" * 5000, "circle", "circle/inner", os.fsdecode(b"b\xff.yaml"), "pyproject.toml/x"])
@pytest.mark.parametrize(
    "command",
    [
        ["lint", "@"],
        ["lint", "specs", "--output", "@"],
        ["compile", "@"],
        ["compile", "specs", "--out", "@"],
        ["graph", "@"],
        ["diff", "specs", "@"],
        ["diff", "specs", "specs", "@"],
        ["init", "@"],
        ["why", "@", "door_open"],
        ["replay", "@"],
        ["journal", "recover", "@", "out"],
    ],
    ids=" ".join,
)
def test_every_error_of_the_system_is_a_finding_or_one_line(
    project: Path, command: list[str], name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (project / "circle").symlink_to("circle")
    (project / os.fsdecode(b"b\xff.yaml")).write_text("codra: 1\nname: [\n")

    code, text = codra(capfd, *(name if argument == "@" else argument for argument in command))

    assert text
    assert code in (1, 2), text
    assert "internal error" not in text


def test_a_tree_file_with_a_name_of_5000_letters_is_a_finding(project: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (project / "specs/door.yaml").write_text(DOOR + f"trees:\n  main: {{file: {'a' * 5000}.xml}}\n")

    code, text = codra(capfd, "lint", "specs")

    assert code == 1
    assert "CDR3308" in text


@pytest.mark.parametrize(
    ("where", "name", "problem"),
    [
        ("specs", "d", ""),
        ("specs", "deep", "error[CDR0001]: cannot read"),
        ("generated/door", "d", "orphan"),
        ("generated/door", "deep", "error[CDR6004]: cannot read"),
    ],
)
def test_1500_nested_folders_are_searched_or_reported(
    project: Path, where: str, name: str, problem: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """With four letters each, their path is longer than the system allows."""
    CliRunner().invoke(app, ["compile", "specs", "--no-cache"])
    with nested_folders(project / where, name, 1500):
        code, text = codra(capfd, "compile", "specs", "--check", "--format", "concise")

    assert (code, problem in text) == (1 if problem else 0, True), text


@contextmanager
def nested_folders(folder: Path, name: str, count: int) -> Iterator[None]:
    """Make folders in folders, with a file in the innermost one, and remove them, which pytest cannot."""
    descriptor = os.open(folder, os.O_RDONLY)
    for _ in range(count):
        os.mkdir(name, dir_fd=descriptor)
        inner = os.open(name, os.O_RDONLY, dir_fd=descriptor)
        os.close(descriptor)
        descriptor = inner
    os.close(os.open("note.txt", os.O_CREAT | os.O_WRONLY, dir_fd=descriptor))
    os.close(descriptor)
    yield
    subprocess.run(["rm", "-r", str(folder / name)], check=True)


@pytest.mark.parametrize("target", ["empty", "missing"])
def test_an_output_folder_that_is_a_link_is_refused(
    project: Path, target: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (project.parent / "empty").mkdir()
    (project / "generated").symlink_to(f"../{target}")

    for command in (["compile", "specs"], ["compile", "specs", "--check"]):
        code, text = codra(capfd, *command)

        assert code == 1
        assert "generated:1:1: error[CDR6002]: 'generated' is a link, so nothing is written there" in text
    assert list((project.parent / "empty").iterdir()) == []
    assert not (project.parent / "missing").exists()


def test_bytecode_that_python_would_run_instead_of_the_output_is_reported_and_removed(
    project: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert codra(capfd, "compile", "specs")[0] == 0
    source = project / "generated/door/__init__.py"
    for mode in (PycInvalidationMode.TIMESTAMP, PycInvalidationMode.CHECKED_HASH):
        py_compile.compile(str(source), invalidation_mode=mode)
        assert codra(capfd, "compile", "specs", "--check")[0] == 0, mode
    planted = Path(py_compile.compile(str(source), invalidation_mode=PycInvalidationMode.UNCHECKED_HASH))

    code, text = codra(capfd, "compile", "specs", "--check")

    assert code == 1
    assert f"error[CDR6003]: 'generated/door/__pycache__/{planted.name}' does not match the specs: orphan" in text
    assert codra(capfd, "compile", "specs")[0] == 0
    assert not planted.exists()
    assert source.exists()


def test_a_cache_of_bytecode_that_is_a_link_is_removed_and_its_target_is_kept(
    project: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert codra(capfd, "compile", "specs")[0] == 0
    (project.parent / "elsewhere").mkdir()
    source = project / "generated/door/__init__.py"
    planted = project.parent / "elsewhere" / Path(cache_from_source(str(source))).name
    py_compile.compile(str(source), str(planted), invalidation_mode=PycInvalidationMode.UNCHECKED_HASH)
    (project / "generated/door/__pycache__").symlink_to("../../../elsewhere")

    assert codra(capfd, "compile", "specs", "--check")[0] == 1
    assert codra(capfd, "compile", "specs")[0] == 0
    assert codra(capfd, "compile", "specs", "--check")[0] == 0
    assert planted.exists()


def test_a_report_overwrites_no_spec_and_follows_no_link_out_of_the_project(
    project: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (project.parent / "mine.txt").write_text("mine")
    (project / "inside.txt").write_text("")
    (project / "spec.sarif").symlink_to("specs/door.yaml")
    (project / "outside.sarif").symlink_to("../mine.txt")
    (project / "inside.sarif").symlink_to("inside.txt")

    for name, reason in (("spec", "may be a spec"), ("outside", "is a link that leads out of the project")):
        code, text = codra(capfd, "lint", "specs", "--format", "sarif", "--output", f"{name}.sarif")

        assert (code, reason in " ".join(text.split())) == (2, True)
    assert codra(capfd, "lint", "specs", "--format", "sarif", "--output", "inside.sarif")[0] == 0
    assert (project.parent / "mine.txt").read_text() == "mine"
    assert (project / "specs/door.yaml").read_text() == DOOR
    assert "sarif" in (project / "inside.txt").read_text()


@pytest.mark.usefixtures("project")
def test_a_closed_standard_input_is_an_empty_spec(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", None)

    code, text = codra(capfd, "lint", "-")
    sys.stdin.close()

    assert code == 1
    assert "-:1:1: error[CDR2001]" in text


@pytest.mark.usefixtures("project")
def test_too_little_memory_is_no_bug_of_codra(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("codra_dsl.cli.fixes.common_root", refuse)

    assert codra(capfd, "lint", "specs") == (1, "codra: there is not enough memory\n")
