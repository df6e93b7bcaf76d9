"""Sites on the command line: `--site`, sites below the given paths, and differences between sites."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.projects import run_program
from tests.cli.test_commands import codra
from tests.test_compiler import DOOR

HALL_1 = "codra: 1\noverlays: door\ncontext:\n  door_open: {valid_for: 20 s}\n"
HALL_2 = "codra: 1\noverlays: door\nperception:\n  measure_door:\n    identifies: {door_open: gap > 60 cm}\n"
GATE = DOOR.replace("door", "gate")
LIT = """\
codra: 1
name: room
agents: {house: {}}
context:
  light: {type: float, unit: lux, source: house, valid_for: 1 min}
  room_empty: {type: bool}
resources: {camera: {}}
perception:
  look:
    call: room_world:look
    uses: {camera: read}
    returns: {people: {type: int}}
    observable_when: [light > 20 lux]
    identifies: {room_empty: people == 0}
skills: {clean: {preview: [room_empty]}}
"""
DARK_SITE = """\
codra: 1
overlays: room
perception: {look: {observable_when: [light > 80 lux]}}
resources: {camera: {call: room_world:Camera, with: {people: 0}}}
"""
MERGED = (
    LIT.replace("    returns:", "    with: {threshold: 2, count: 3}\n    returns:")
    + """\
knowledge:
  nodes: {world: world, lamp: lamp}
  edges: {lamp_pose: {label: RT, from: world, to: lamp, static: true, pose: {x: 3 m, y: 1 m}}}
templates:
  brightness:
    parameters: {limit: quantity}
    context:
      $(instance): {type: bool, derived: light > $(limit)}
      $(instance)_empty: {type: bool}
    skills: {leave_$(instance): {preview: [$(instance)_empty]}}
    perception:
      look_at_$(instance):
        call: room_world:look
        with: {threshold: 2, count: 3}
        returns: {people: {type: int}}
        identifies: {$(instance)_empty: people == 0}
use:
  bright_1: {template: brightness, limit: 50 lux}
"""
)
MERGED_SITE = """\
codra: 1
overlays: room
perception: {look: {with: {threshold: 4}}, look_at_bright_1: {with: {threshold: 4}}}
resources: {camera: {call: room_world:Camera, with: {people: 0}}}
knowledge: {edges: {lamp_pose: {pose: {x: 4 m}}}}
use: {bright_1: {limit: 60 lux}}
"""
ROOM_WORLD = """\
class Camera:
    def __init__(self, people):
        self.people = people


def look(*, camera, job):
    return {"people": camera.people}
"""
PROGRAM = """\
from codra_dsl.runtime import Journal, SimClock
from generated_dark import room

clock = SimClock()
with room.start(clock=clock, resources={}, record=Journal("run.mcap")) as codra:
    codra.declare("room_empty")
    for light in (30.0, 90.0):
        codra.agent("house").set("light", light)
        clock.sleep(3)
        print(codra.get("room_empty").known)
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with two specs and two sites of one of them."""
    files = {
        "pyproject.toml": "[tool.codra]\n",
        "specs/door.yaml": DOOR,
        "specs/gate.yaml": GATE,
        "sites/hall_1.yaml": HALL_1,
        "sites/hall_2.yaml": HALL_2,
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_spec_is_compiled_for_each_site_into_a_package_of_the_same_name(project: Path) -> None:
    alone = codra("compile", "specs", cwd=project)
    hall_1 = codra("compile", "specs", "--site", "sites/hall_1.yaml", cwd=project)
    hall_2 = codra("compile", "specs", "--site", "sites/hall_2.yaml", "--out", "halls/second", cwd=project)
    folders = ("generated", "generated_hall_1", "halls/second")
    modules = [(project / folder / "door/door.py").read_text() for folder in folders]

    assert [process.returncode for process in (alone, hall_1, hall_2)] == [0, 0, 0]
    assert ["valid_for_s=10.0" in module for module in modules] == [True, False, True]
    assert ["> 0.6" in module for module in modules] == [False, False, True]
    assert "codra compile specs/door.yaml --site sites/hall_1.yaml" in modules[1]
    assert (project / "generated/gate/gate.py").read_text() == (project / "generated_hall_1/gate/gate.py").read_text()
    manifest = json.loads((project / "generated_hall_1/door/manifest.json").read_text())
    assert (manifest["spec"], manifest["site"]) == ("specs/door.yaml", "sites/hall_1.yaml")


def test_the_folder_of_a_site_can_be_imported(project: Path) -> None:
    (project / "sites/hall-3.site.yaml").write_text(HALL_1)
    compiled = codra("compile", "specs", "--site", "sites/hall-3.site.yaml", cwd=project)
    assert compiled.returncode == 0
    assert (project / "generated_hall_3_site/door/door.py").is_file()


def test_a_site_does_not_replace_the_packages_of_another_site_with_the_same_name(project: Path) -> None:
    other = project / "shops/hall-1.yaml"
    other.parent.mkdir()
    other.write_text(HALL_1)
    codra("compile", "specs", "--site", "sites/hall_1.yaml", cwd=project)
    compile_other = ("compile", "specs", "--site", "shops/hall-1.yaml")
    refused = codra(*compile_other, cwd=project)
    elsewhere = codra(*compile_other, "--out", "generated_shop", cwd=project)
    (project / "sites/hall_1.yaml").unlink()
    moved = codra(*compile_other, cwd=project)

    assert [process.returncode for process in (refused, elsewhere, moved)] == [2, 0, 0]
    message = "generated_hall_1 has the packages of the site 'sites/hall_1.yaml': choose another folder with --out"
    assert message in " ".join(refused.stderr.split())


def test_check_compares_the_package_of_a_site_and_notices_an_edited_site(project: Path) -> None:
    compile_site = ("compile", "specs", "--site", "sites/hall_1.yaml")
    codra(*compile_site, cwd=project)
    up_to_date = codra(*compile_site, "--check", cwd=project)
    (project / "sites/hall_1.yaml").write_text(HALL_1.replace("20 s", "25 s"))
    outdated = codra(*compile_site, "--check", cwd=project)

    assert (up_to_date.returncode, outdated.returncode) == (0, 1)
    assert "generated_hall_1/door/door.py" in outdated.stdout


@pytest.mark.parametrize("command", [("lint",), ("compile",), ("compile", "--check")])
def test_all_sites_below_the_paths_are_checked_with_their_specs(command: tuple[str, ...], project: Path) -> None:
    codra("compile", "specs", cwd=project)
    sound = codra(*command, "specs", "sites", cwd=project)
    (project / "sites/hall_2.yaml").write_text(HALL_2.replace("gap", "gpa"))
    wrong = codra(*command, "specs", "sites", "--format", "concise", cwd=project)

    assert (sound.returncode, sound.stdout) == (0, "")
    assert wrong.returncode == 1
    assert wrong.stdout.startswith("sites/hall_2.yaml:5:29: error[CDR3104]")
    assert not (project / "generated_hall_2").exists()


def test_a_kept_result_of_a_site_is_used_until_the_site_or_the_spec_changes(project: Path) -> None:
    lint = ("lint", "specs", "sites", "--format", "concise")
    assert [codra(*lint, cwd=project).stdout for _ in range(2)] == ["", ""]
    (project / "sites/hall_1.yaml").write_text(HALL_1.replace("door_open", "door_opn"))
    with_wrong_site = [codra(*lint, cwd=project).stdout for _ in range(2)]
    (project / "specs/door.yaml").write_text(DOOR.replace("door_open", "door_opn"))
    with_other_spec = codra(*lint, cwd=project).stdout

    assert with_wrong_site[0] == with_wrong_site[1]
    assert with_wrong_site[0].startswith("sites/hall_1.yaml:4:3: error[CDR3033]")
    assert with_other_spec.startswith("sites/hall_2.yaml:5:18: error[CDR3033]")


def test_a_site_given_without_its_spec_is_an_error(project: Path) -> None:
    process = codra("lint", "sites/hall_1.yaml", "--format", "concise", cwd=project)

    assert process.returncode == 1
    assert process.stdout == (
        "sites/hall_1.yaml:2:11: error[CDR3032]: there is no spec 'door' at or below the given paths"
        " (give the path of the spec as well)\n"
    )


def test_comments_in_sites_silence_findings(project: Path) -> None:
    short = HALL_1.replace("20 s}", "100 ms}  # codra: ignore[CDR7108] the door is slow here")
    before = codra("lint", "specs", "--site", "sites/hall_1.yaml", cwd=project)
    (project / "sites/hall_1.yaml").write_text(HALL_1.replace("20 s", "100 ms"))
    reported = codra("lint", "specs", "--site", "sites/hall_1.yaml", "--format", "concise", cwd=project)
    (project / "sites/hall_1.yaml").write_text(short)
    silenced = codra("lint", "specs", "sites", cwd=project)

    assert (before.stdout, silenced.stdout) == ("", "")
    assert reported.stdout.startswith("sites/hall_1.yaml:4:26: warning[CDR7108]")


def test_a_comment_for_the_spec_alone_is_not_called_unused_at_a_site(project: Path) -> None:
    comment = "  # codra: ignore[CDR7108] the door is slow"
    slow = DOOR.replace("valid_for: 10 s}", f"valid_for: 100 ms}}{comment}")
    (project / "specs/door.yaml").write_text(slow)
    at_site = codra("lint", "specs", "--site", "sites/hall_1.yaml", cwd=project)
    with_sites = codra("lint", "specs", "sites", cwd=project)

    assert (at_site.stdout, with_sites.stdout) == ("", "")


def test_a_safe_fix_changes_the_file_of_the_site(project: Path) -> None:
    (project / "sites/hall_1.yaml").write_text(f"overlays: door\n{HALL_1.partition('door' + chr(10))[2]}")
    process = codra("lint", "specs", "sites", "--fix", cwd=project)

    assert (process.returncode, process.stderr) == (0, "fixed 1; no findings left\n")
    assert (project / "sites/hall_1.yaml").read_text() == HALL_1


def test_diff_shows_what_a_site_changes_and_how_two_sites_differ(project: Path) -> None:
    site = ("--site", "sites/hall_1.yaml")
    from_spec = codra("diff", "specs", *site, "--format", "concise", cwd=project)
    between = codra("diff", "specs", *site, "--site", "sites/hall_2.yaml", "--format", "concise", cwd=project)

    assert from_spec.stdout == (
        "sites/hall_1.yaml:4:26: breaking[weaker]: door/context/door_open: 'valid_for' is longer: was 10 s, is 20 s\n"
        "verdict: breaking (1 breaking)\n"
    )
    assert between.stdout == (
        "specs/door.yaml:4:38: caution[stronger]: door/context/door_open: 'valid_for' is shorter: was 20 s, is 10 s\n"
        "sites/hall_2.yaml:5:29: caution[redefined]: door/perception/measure_door:"
        " identifies.door_open: the value is computed in another way: was 'gap > 40 cm', is 'gap > 60 cm'\n"
        "verdict: caution (2 caution)\n"
    )


def test_diff_shows_the_place_in_the_site_of_merged_values_handles_and_arguments(project: Path) -> None:
    (project / "specs/room.yaml").write_text(MERGED)
    (project / "sites/dark.yaml").write_text(MERGED_SITE)
    (project / "sites/darker.yaml").write_text(MERGED_SITE.replace("people: 0", "people: 1").replace("x: 4", "x: 5"))
    sites = ("--site", "sites/dark.yaml")
    from_spec = codra("diff", "specs", *sites, "--format", "concise", cwd=project)
    between = codra("diff", "specs", *sites, "--site", "sites/darker.yaml", "--format", "concise", cwd=project)

    places = {line.split(": ")[0]: line.split(": ")[2] for line in from_spec.stdout.splitlines()[:-1]}
    assert places == {
        "sites/dark.yaml:3:39": "room/perception/look",
        "sites/dark.yaml:3:81": "room/perception/look_at_bright_1",
        "sites/dark.yaml:4:28": "room/resource/camera",
        "sites/dark.yaml:5:43": "room/edge/lamp_pose",
        "sites/dark.yaml:6:25": "room/context/bright_1",
    }
    assert [line.split(": ")[0] for line in between.stdout.splitlines()[:-1]] == [
        "sites/darker.yaml:5:43",
        "sites/darker.yaml:4:28",
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("diff", "specs"), "give the version after, or --site to compare sites"),
        (("diff", "specs", "specs", "--site", "sites/hall_1.yaml"), "with --site, give one path"),
        (("diff", "specs", *3 * ("--site", "sites/hall_1.yaml")), "give at most two sites"),
        (("diff", "specs", "--site", "/dev/null"), "the specs belong to several projects"),
        (("lint", "-", "--site", "sites/hall_1.yaml"), "a site cannot be combined with a spec from standard input"),
        (("compile", "specs", "--site", "sites/hall_3.yaml"), "'sites/hall_3.yaml' does not exist"),
        (("replay", "sites/hall_1.yaml", "--site", "sites/hall_1.yaml"), "give --spec as well: the spec of this site"),
    ],
)
def test_a_wrong_use_of_sites_is_a_usage_error(arguments: tuple[str, ...], message: str, project: Path) -> None:
    process = codra(*arguments, cwd=project)

    assert process.returncode == 2
    assert message in " ".join(process.stderr.split())


def test_the_graph_of_a_site_has_its_values(project: Path) -> None:
    (project / "sites/hall_1.yaml").write_text("codra: 1\noverlays: door\nskills: {pass_door: {preview: []}}\n")
    alone = codra("graph", "specs", "--format", "json", cwd=project)
    at_site = codra("graph", "specs", "--format", "json", "--site", "sites/hall_1.yaml", cwd=project)

    assert "door/skill/pass_door" in alone.stdout
    assert alone.stdout != at_site.stdout


def test_a_run_at_a_site_is_explained_and_replayed_with_the_values_of_the_site(project: Path) -> None:
    files = {
        "specs/room.yaml": LIT,
        "sites/dark.yaml": DARK_SITE,
        "room_world.py": ROOM_WORLD,
        "program.py": PROGRAM,
    }
    for name, text in files.items():
        (project / name).write_text(text)
    codra("compile", "specs/room.yaml", "--site", "sites/dark.yaml", cwd=project)
    printed = run_program(project, "program.py")
    why = codra("why", "room_empty", "--journal", "run.mcap", "--at", "2", cwd=project)
    replay = codra("replay", "run.mcap", "--package", "generated_dark/room", cwd=project)

    with_site = codra("replay", "run.mcap", "--spec", "specs/room.yaml", "--site", "sites/dark.yaml", cwd=project)
    without_package = codra("replay", "run.mcap", cwd=project)
    codra("compile", "specs/room.yaml", cwd=project)
    with_other_package = codra("replay", "run.mcap", cwd=project)

    help_text = "the package that ran is 'generated_dark/room': select it with --package"
    assert (with_site.returncode, with_site.stdout) == (0, replay.stdout)
    assert (without_package.returncode, help_text in " ".join(without_package.stderr.split())) == (2, True)
    assert (with_other_package.returncode, f"codra: {help_text}\n" in with_other_package.stderr) == (1, True)
    assert printed == "False\nTrue\n"
    assert "light > 80 lux does not hold  [sites/dark.yaml:3 (replaces specs/room.yaml:13)]" in why.stdout
    assert "perception look cannot look  [specs/room.yaml:9 (changed at sites/dark.yaml:3)]" in why.stdout
    assert (replay.returncode, replay.stdout.partition(":")[0]) == (0, "equal")
