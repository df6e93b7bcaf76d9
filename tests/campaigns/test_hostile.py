"""Reading any input never runs code, opens files outside of the project, starts processes, or crashes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random

import pytest

from codra_dsl.cli import app as command_app
from tests.campaigns.hostile.kinds import KINDS
from tests.campaigns.hostile.reading import Answer, command
from tests.campaigns.hostile.running import Campaign
from tests.command_server import SETTINGS_OF_NEW_PROCESSES, as_text, run_codra, run_python

ROOT = Path(__file__).parents[2]
COUNT = 15
ENVIRONMENT = {"PYTHONPATH": str(ROOT), "HOME": "/nonexistent"}
FORKED_ENVIRONMENT = {
    **{name: value for name, value in os.environ.items() if name.startswith(SETTINGS_OF_NEW_PROCESSES)},
    **ENVIRONMENT,
}
"""The environment for commands that need no new process."""

WATCHED = """
import sys
sys.dont_write_bytecode = True
from tests.campaigns.hostile.watch import Watch
watch = Watch(root=sys.argv[1], out=sys.argv[1], armed=True)
sys.addaudithook(watch)
from codra_dsl.cli.app import command_line
sys.argv = ["codra", *sys.argv[2:]]
code = command_line()
watch.armed = False
print(*watch.breaches, sep="\\n", file=sys.stderr)
sys.exit(99 if watch.breaches else code)
"""

SPEC = """\
codra: 1
name: door
context:
  door_open: {type: bool, valid_for: 5 s, label: '"); __import__("os").system("touch owned"); ("'}
perception:
  measure_door:
    call: tests.campaigns.hostile.trap:measure
    with: {text: '{{ 7 * 7 }} `touch owned`'}
    timeout: 1 s
    returns: {gap: {type: float, unit: m}}
    identifies: {door_open: gap > 40 cm}
skills:
  pass_door: {preview: [door_open]}
"""


@pytest.fixture(scope="module")
def compiled_project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compiled")
    (folder / "pyproject.toml").write_text("[tool.codra]\n")
    (folder / "specs").mkdir()
    (folder / "specs" / "door.yaml").write_text(SPEC)
    compilation = as_text(run_codra(("compile", "specs"), folder, FORKED_ENVIRONMENT))
    assert compilation.returncode == 0, compilation.stdout + compilation.stderr
    return folder


@pytest.mark.parametrize(
    "arguments",
    [
        ["lint", "specs"],
        ["lint", "specs", "--format", "json"],
        ["compile", "specs"],
        ["compile", "specs", "--check"],
        ["graph", "specs", "--format", "dot"],
        ["graph", "specs", "--format", "json"],
        ["graph", "specs", "--format", "svg"],
    ],
    ids=" ".join,
)
def test_commands_that_read_specs_never_run_code_or_open_files_outside_or_start_processes(
    arguments: list[str], compiled_project: Path, tmp_path: Path
) -> None:
    shutil.copytree(compiled_project, tmp_path, dirs_exist_ok=True)

    done = as_text(run_python(("-c", WATCHED, str(tmp_path), *arguments), tmp_path, FORKED_ENVIRONMENT))

    assert done.returncode == 0, done.stdout + done.stderr
    assert not (tmp_path / "owned").exists()


def test_inputs_of_each_kind_are_accepted_or_refused(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns.hostile", str(COUNT), "--workers", "1", "--keep", str(tmp_path)],
        cwd=ROOT,
        env={**ENVIRONMENT, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    rows = [line.split() for line in done.stdout.splitlines()[1:]]
    assert {name: (inputs, failures) for name, inputs, *_, failures in filter(None, rows)} == dict.fromkeys(
        KINDS, (str(COUNT), "0")
    )


@pytest.mark.parametrize("name", KINDS)
def test_an_input_follows_from_seed_kind_and_number(name: str, tmp_path: Path) -> None:
    campaign = Campaign(KINDS, tmp_path, seed=1)
    first_files = [campaign.files(name, number) for number in range(8)]

    assert [campaign.files(name, number) for number in range(8)] == first_files
    assert campaign.files(name, 0) != campaign.files(name, 1)


# The limits of memory hold for a small process; one that has collected thousands of tests is above them.
CAMPAIGN = """
import json, sys
from pathlib import Path
from tests.campaigns import test_hostile
from tests.campaigns.hostile.reading import Kind
from tests.campaigns.hostile.running import Campaign

inputs, keep, *names = sys.argv[1:]
kinds = {name: Kind(test_hostile._make_one, getattr(test_hostile, name)) for name in names}
rows = Campaign(kinds, Path(inputs), seed=1, keep=Path(keep)).run(range(7, 9), workers=1)
outcomes = {row.name: [(outcome.answer.is_accepted, outcome.failure) for outcome in row.outcomes] for row in rows}
print("\\n" + json.dumps(outcomes))
"""


def _raise(_: Path) -> Answer:
    raise ValueError("a defect")


def _end_process(_: Path) -> Answer:
    os._exit(3)


def _read_outside(_: Path) -> Answer:
    Path("/etc/passwd").read_bytes()
    return Answer(is_accepted=True)


def _write_elsewhere(root: Path) -> Answer:
    (root / "elsewhere").write_bytes(b"")
    return Answer(is_accepted=True)


def _start_process(_: Path) -> Answer:
    subprocess.run(["true"], check=True)
    return Answer(is_accepted=True)


def _fail_internally(_: Path) -> Answer:
    command_app._run_app = lambda: 70
    return command("lint", "spec.yaml")


def _use_memory(_: Path) -> Answer:
    return Answer(is_accepted=(bytearray(b"x") * 400_000_000).isascii())


def _make_one(_: Random) -> dict[str, bytes]:
    return {"spec.yaml": b"codra: 1"}


def _accept(root: Path) -> Answer:
    return Answer(is_accepted=(root / "spec.yaml").read_bytes() == b"codra: 1")


FAILURES: Mapping[Callable[[Path], Answer], str] = {
    _raise: "ValueError",
    _end_process: "the process ended: exit code 3",
    _read_outside: "open '/etc/passwd'",
    _write_elsewhere: "changed 'elsewhere'",
    _start_process: "subprocess.Popen",
    _fail_internally: "exit 70",
    _use_memory: " MB",
}
"""What is reported of each reader that breaks a promise."""


@dataclass(frozen=True)
class ReadInputs:
    """The outcomes of two inputs by reader: whether they were accepted, and the failure."""

    outcomes: Mapping[str, list[tuple[bool, str]]]
    keep: Path


@pytest.fixture(scope="module")
def read_inputs(tmp_path_factory: pytest.TempPathFactory) -> ReadInputs:
    inputs, keep = (tmp_path_factory.mktemp(name) for name in ("inputs", "keep"))
    names = [read.__name__ for read in (_accept, *FAILURES)]
    process = as_text(run_python(("-c", CAMPAIGN, str(inputs), str(keep), *names), ROOT, ENVIRONMENT))
    assert process.returncode == 0, process.stderr
    return ReadInputs(json.loads(process.stdout.splitlines()[-1]), keep)


def test_a_reader_that_keeps_its_promises_has_no_failure(read_inputs: ReadInputs) -> None:
    assert read_inputs.outcomes["_accept"] == [[True, ""], [True, ""]]
    assert not list(read_inputs.keep.glob("_accept*"))


@pytest.mark.parametrize("read", FAILURES)
def test_a_reader_that_breaks_a_promise_is_a_failure_and_its_input_is_kept(
    read: Callable[[Path], Answer], read_inputs: ReadInputs
) -> None:
    name = read.__name__

    assert [FAILURES[read] in failure for _, failure in read_inputs.outcomes[name]] == [True, True]
    assert sorted(path.name for path in read_inputs.keep.glob(f"{name}-*")) == [f"{name}-1-7", f"{name}-1-8"]
    assert (read_inputs.keep / f"{name}-1-7/input/spec.yaml").read_bytes() == b"codra: 1"
