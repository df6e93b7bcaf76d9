"""Reading any spec never runs code, opens files outside of the project, starts processes, or crashes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COUNT = 400

WATCHED = """
import sys
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
    arguments: list[str], tmp_path: Path
) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs" / "door.yaml").write_text(SPEC)
    compile_first = [sys.executable, "-m", "codra_dsl", "compile", "specs"]
    subprocess.run(compile_first, cwd=tmp_path, check=True, capture_output=True, env=_environment())

    done = subprocess.run(
        [sys.executable, "-c", WATCHED, str(tmp_path), *arguments],
        cwd=tmp_path,
        env=_environment(),
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr
    assert not (tmp_path / "owned").exists()


def test_hostile_inputs_only_give_findings() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.campaigns.hostile", str(COUNT), "1"],
        cwd=ROOT,
        env=_environment(),
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stdout + done.stderr


def _environment() -> dict[str, str]:
    return {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1", "HOME": "/nonexistent"}
