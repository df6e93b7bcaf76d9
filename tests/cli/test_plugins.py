"""Worlds and commands of other distributions: found by entry points, without a change of codra."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
import typer

from codra_dsl.cli.plugins import WORLDS_GROUP, load_plugin
from codra_dsl.tooling.installation import pip_install
from tests.cli.test_commands import environment
from tests.command_server import as_text, run_codra

DOOR_SPEC = """\
codra: 1
name: door
context:
  door_open: {type: bool, source: main_execution}
"""
ARENA_MODULE = '''\
"""A third party's world."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from codra_dsl.cli.console import write_result
from codra_dsl.cli.worlds import RunRequest

Wind = Annotated[float, typer.Option("--wind", help="In m/s.")]


def arena(request: RunRequest, *, wind: Wind = 0.0) -> None:
    """An arena with wind."""
    from codra_dsl.integrations.inspection import compile_and_load
    from codra_dsl.runtime import SimClock

    with tempfile.TemporaryDirectory() as folder:
        compiled = compile_and_load(request.plan, Path(folder))
        clock = SimClock()
        handles = {resource.name: object() for resource in compiled.spec.resources}
        with compiled.start(clock=clock, resources=handles, seed=request.seed):
            clock.sleep(request.duration_s or 1.0)
        write_result(f"{compiled.spec.name}: seed {request.seed}, wind {wind:g}, {clock.now_s():g} s\\n")


def greet(name: Annotated[str, typer.Argument(help="Whom.")], loud: bool = False) -> None:
    """Greet somebody."""
    write_result(f"hello {name.upper() if loud else name}\\n")


def jealous(request: RunRequest, *, seed: int = 2) -> None:
    """A world with an option that all worlds already have."""
'''
BROKEN_MODULE = 'raise ImportError("no such simulator\\nhere")\n'
ENTRY_POINTS = """\
[codra.worlds]
arena = arena_world:arena
broken = arena_broken:world
jealous = arena_world:jealous

[codra.commands]
greet = arena_world:greet
shatter = arena_broken:command
lint = arena_world:greet
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder with a distribution that has a world and a command, as pip would install it."""
    folder = tmp_path / "site"
    dist_info = folder / "arena-1.0.dist-info"
    dist_info.mkdir(parents=True)
    (dist_info / "METADATA").write_text("Metadata-Version: 2.1\nName: arena\nVersion: 1.0\n")
    (dist_info / "entry_points.txt").write_text(ENTRY_POINTS)
    (folder / "arena_world.py").write_text(ARENA_MODULE)
    (folder / "arena_broken.py").write_text(BROKEN_MODULE)
    (tmp_path / "door.yaml").write_text(DOOR_SPEC)
    return folder


def codra(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    search_path = os.pathsep.join((str(site), environment()["PYTHONPATH"]))
    process = as_text(run_codra(arguments, site.parent, environment(PYTHONPATH=search_path)))
    assert "Traceback" not in process.stdout + process.stderr
    return process


# Worlds


def test_a_world_of_another_distribution_runs_a_spec(site: Path) -> None:
    process = codra(site, "run", "door.yaml", "--world", "arena", "--seed", "7", "--for", "2 s", "--wind", "3.5")

    assert (process.returncode, process.stdout) == (0, "door: seed 7, wind 3.5, 2 s\n"), process.stderr


def test_help_shows_the_options_of_the_world_and_those_of_all_worlds(site: Path) -> None:
    process = codra(site, "run", "--world=arena", "--help")

    assert process.returncode == 0
    assert "The world 'arena': An arena with wind." in process.stdout
    assert {"--wind", "--seed", "--pace", "--journal"} <= set(process.stdout.replace("=", " ").split())
    assert "--naive" not in process.stdout


def test_an_option_that_the_world_does_not_have_is_refused(site: Path) -> None:
    process = codra(site, "run", "door.yaml", "--world", "arena", "--winds", "2")

    assert (process.returncode, process.stdout) == (2, "")
    assert "--winds: the world 'arena' has no such option: did you mean --wind?" in process.stderr


def test_a_world_that_is_not_installed_is_refused_with_the_nearest_one(site: Path) -> None:
    process = codra(site, "run", "door.yaml", "--world", "arenas")

    assert (process.returncode, process.stdout) == (2, "")
    assert "the world 'arenas' is not installed: did you mean 'arena'?" in process.stderr


def test_a_broken_world_gives_one_line_and_leaves_the_others_alone(site: Path) -> None:
    process = codra(site, "run", "door.yaml", "--world", "broken")

    assert (process.returncode, process.stdout) == (1, "")
    message = "codra: the world 'broken' from arena cannot be loaded: ImportError: no such simulator here\n"
    assert process.stderr == message
    assert codra(site, "run", "door.yaml", "--world", "arena").returncode == 0


def test_a_world_whose_import_raises_a_hostile_exception_gives_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    error = "from tests.runtime.hostile_errors import hostile_error\nraise hostile_error('raises SystemExit')\n"
    (tmp_path / "hostile_world.py").write_text(error)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(typer.Exit):
        load_plugin(EntryPoint("hostile", "hostile_world:run", WORLDS_GROUP))
    message = "codra: the world 'hostile' cannot be loaded: RaisesSystemExit: its message cannot be shown\n"
    assert capsys.readouterr().err == message


def test_a_world_cannot_redefine_an_option_of_all_worlds(site: Path) -> None:
    process = codra(site, "run", "door.yaml", "--world", "jealous")

    assert (process.returncode, process.stdout) == (1, "")
    assert process.stderr == "codra: the world 'jealous' declares options that all worlds already have: seed\n"


def test_a_spec_with_errors_does_not_reach_the_world(site: Path) -> None:
    (site.parent / "door.yaml").write_text(DOOR_SPEC.replace("type: bool", "type: boool"))

    process = codra(site, "run", "door.yaml", "--world", "arena")

    assert process.returncode == 1
    assert "boool" in process.stdout
    assert "seed" not in process.stdout


PROGRAM_WITHOUT_PLUGINS = """
import importlib.metadata, sys
importlib.metadata.entry_points = lambda **_: importlib.metadata.EntryPoints()
import codra_dsl.cli
codra_dsl.cli.main()
"""


def test_without_any_world_the_command_names_the_distribution_that_has_some(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(DOOR_SPEC)
    command = [sys.executable, "-c", PROGRAM_WITHOUT_PLUGINS, "run", "door.yaml", "--world", "lab"]
    process = subprocess.run(command, cwd=tmp_path, env=environment(), text=True, capture_output=True, check=False)

    assert (process.returncode, process.stdout) == (1, "")
    command = pip_install("codra-papers", "lab,store")
    assert process.stderr == f"codra: 'run' needs a world, but no world is installed: {command} adds two\n"


# Commands


def test_a_command_of_another_distribution_runs(site: Path) -> None:
    process = codra(site, "greet", "Ada", "--loud")

    assert (process.returncode, process.stdout) == (0, "hello ADA\n")


def test_commands_are_listed_without_being_imported(site: Path) -> None:
    process = codra(site, "--help")

    assert process.returncode == 0
    help_lines = [line.strip() for line in process.stdout.partition("Commands:")[2].splitlines()]
    assert [line.split(maxsplit=1) for line in help_lines if line.startswith(("greet", "shatter"))] == [
        ["greet", "A command from arena."],
        ["shatter", "A command from arena."],
    ]


def test_the_help_of_a_command_is_that_of_its_function(site: Path) -> None:
    process = codra(site, "greet", "--help")

    assert process.stdout.startswith("Usage: codra greet [OPTIONS] {name}\n\n  Greet somebody.\n")


def test_a_broken_command_gives_one_line_and_leaves_the_others_alone(site: Path) -> None:
    process = codra(site, "shatter", "--any", "thing")

    assert (process.returncode, process.stdout) == (1, "")
    assert process.stderr == (
        "codra: the command 'shatter' from arena cannot be loaded: ImportError: no such simulator here\n"
    )
    assert codra(site, "greet", "Ada").returncode == 0


def test_a_command_that_raises_an_exception_without_a_message_gives_one_line(site: Path) -> None:
    (site / "arena_world.py").write_text(
        "class CurseError(Exception):\n    def __str__(self) -> str:\n        raise SystemExit(0)\n\n\n"
        'def greet() -> None:\n    """Curse."""\n    raise CurseError\n'
    )
    process = codra(site, "greet")

    assert process.returncode == 70
    assert process.stderr.startswith("codra: internal error: CurseError: its message cannot be shown (")


def test_no_distribution_replaces_a_command_of_codra(site: Path) -> None:
    process = codra(site, "lint", "door.yaml")

    assert "hello" not in process.stdout
    assert process.returncode == 0
