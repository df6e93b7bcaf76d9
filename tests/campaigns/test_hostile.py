"""Reading any spec never runs code, opens files outside of the project, starts processes, or crashes."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_server import as_text, run_codra, run_python

ROOT = Path(__file__).parents[2]
COUNT = 200
ENVIRONMENT = {"PYTHONPATH": str(ROOT), "HOME": "/nonexistent"}

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
    compilation = as_text(run_codra(("compile", "specs"), folder, ENVIRONMENT))
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

    done = as_text(run_python(("-c", WATCHED, str(tmp_path), *arguments), tmp_path, ENVIRONMENT))

    assert done.returncode == 0, done.stdout + done.stderr
    assert not (tmp_path / "owned").exists()


def test_hostile_inputs_only_give_findings() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns.hostile", str(COUNT), "1"],
        cwd=ROOT,
        env={**ENVIRONMENT, "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
