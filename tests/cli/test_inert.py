"""`lint`, `compile` and `graph` are inert: according to Python's audit hooks they only read specs and write output."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tests.cli.test_commands import codra
from tests.command_server import as_text, run_python

ROOT = Path(__file__).parents[2]
SPEC = """\
codra: 1
name: door
context:
  door_open: {type: bool, valid_for: 5 s, label: 'QUOTES; import os; os.system("true") #'}
perception:
  measure_door:
    call: dangerous_robot:measure
    with: {text: '__import__("dangerous_robot")'}
    returns:
      gap: {type: float, unit: m}
    identifies:
      door_open: gap > 40 cm
""".replace("QUOTES", '"' * 3)
WATCH = """
import json, os, sys

sys.dont_write_bytecode = True
for name in [name for name in sys.modules if name.split(".")[0] in ("codra_dsl", "jinja2")]:
    del sys.modules[name]  # so that they are imported under watch, as in a new process

seen = []
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC

def watch(event, arguments):
    if event == "open":
        path, mode, flags = arguments
        writes = flags & WRITING if isinstance(flags, int) else any(letter in (mode or "") for letter in "wax+")
        if writes and isinstance(path, str):
            seen.append(("write", os.path.abspath(path)))
    elif event == "exec":
        seen.append(("exec", str(getattr(arguments[0], "co_filename", ""))))
    elif event == "import":
        seen.append(("import", str(arguments[0])))
    elif event.split(".")[0] in ("socket", "subprocess", "pty", "ctypes", "urllib") or event in (
        *("os.system", "os.exec", "os.fork", "os.forkpty", "os.spawn", "os.posix_spawn", "os.startfile"),
        *("os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.chmod", "shutil.rmtree"),
    ):
        path = str(arguments[0]) if arguments else ""
        seen.append((event, os.path.abspath(path) if event.startswith(("os.r", "os.m", "shutil")) else path))

sys.addaudithook(watch)
from codra_dsl.cli import main
try:
    main()
finally:
    events, seen = seen, []
    with open(os.environ["EVENTS"], "w") as stream:
        json.dump(events, stream)
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    (tmp_path / "project").mkdir()
    (tmp_path / "project/pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "project/door.yaml").write_text(SPEC)
    source = "raise SystemExit('it was imported')\n\n\ndef measure(text, job): ...\n"
    (tmp_path / "project/dangerous_robot.py").write_text(source)
    return tmp_path / "project"


def compile_project(project: Path) -> None:
    assert codra("compile", ".", "--no-cache", cwd=project).returncode == 0


def run_audited(project: Path, *arguments: str) -> list[tuple[str, str]]:
    """Run a command and return its actions, as far as Python's audit hooks report them."""
    events = project.parent / "events.json"
    path = f"{ROOT}{os.pathsep}{project}"
    environment = {
        **os.environ,
        "PYTHONPATH": path,
        "EVENTS": str(events),
        "XDG_CACHE_HOME": str(project.parent / "user-cache"),
    }
    process = as_text(run_python(("-c", WATCH, *arguments), project, environment))
    assert process.returncode == 0, process.stdout + process.stderr
    return [(event, what) for event, what in json.loads(events.read_text())]


WRITES = {"write", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "shutil.rmtree"}
COMMANDS = [
    ["lint", "."],
    ["lint", ".", "--diff"],
    ["compile", "."],
    ["compile", ".", "--check"],
    ["graph", "."],
    ["graph", ".", "--format", "json"],
    ["graph", ".", "--format", "svg"],
    ["graph", ".", "--format", "html"],
    ["graph", ".", "--format", "mermaid", "--select", "+door_open"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_command_only_reads_specs_and_writes_output(project: Path, command: list[str]) -> None:
    compile_project(project)
    if command != ["compile", ".", "--check"]:
        (project / "generated/door/door.py").unlink()

    seen = run_audited(project, *command, *(["--no-cache"] if command[0] in ("lint", "compile") else []))

    files = {path for event, path in seen if event in WRITES}
    code = {path for event, path in seen if event == "exec" and not Path(path).is_absolute() and path[:1] != "<"}
    imports = {name for event, name in seen if event == "import"}
    others = {event for event, _ in seen} - WRITES - {"exec", "import"}

    assert ("import", "codra_dsl.compiler") in seen
    assert {path for path in files if not f"{path}/".startswith(f"{project}/generated/")} == set()
    assert files == set() or command == ["compile", "."]
    assert code == set()
    assert "dangerous_robot" not in imports
    assert not any(name.split(".")[0] in ("generated", "door") for name in imports)
    assert others == set()


@pytest.mark.parametrize("command", [["lint", "."], ["compile", "."], ["compile", ".", "--check"]], ids=" ".join)
def test_with_the_cache_a_command_also_writes_only_there(project: Path, command: list[str]) -> None:
    compile_project(project)

    first, second = run_audited(project, *command), run_audited(project, *command)

    written = {path for event, path in first if event in WRITES}
    assert written
    allowed_folders = (f"{project}/.codra_cache/", f"{project.parent}/user-cache/")  # the second has the user's secret
    assert {path for path in written if not f"{path}/".startswith(allowed_folders)} == set()
    assert {path for event, path in second if event in WRITES} == set()
    assert ("import", "codra_dsl.compiler") not in second


def test_the_audit_sees_forbidden_actions(project: Path) -> None:
    (project / "door.yaml").write_text(SPEC.replace("gap > 40 cm", "gap > 50 cm"))

    seen = run_audited(project, "compile", ".", "--out", "elsewhere")

    assert any(event == "write" and "/elsewhere/.codra-" in path for event, path in seen)
    assert ("import", "jinja2") in seen
