"""`codra replay --spec` with copies of a spec: the names of files change no event, and an edit is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.projects import run_project
from tests.cli.test_commands import codra
from tests.cli.test_poses import PROGRAM, SPEC

MIDDLE = """\
context:
  middle_open: {type: bool}
perception:
  look_at_middle:
    call: eyes:look
    returns: {gap: {type: float, unit: m}}
    observable_when: ["distance(robot, right) < 2 m"]
    identifies: {middle_open: gap > 1 cm}
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project whose spec includes a part with conditions over poses; its program has run."""
    folder = tmp_path_factory.mktemp("copies")
    before, _, templates_and_uses = SPEC.partition("templates:\n")
    templates, _, uses = templates_and_uses.partition("use:\n")
    spec = f"{before}use:\n{uses}".replace("name: bay\n", "name: bay\ninclude: [parts/machine.yaml]\n")
    spec = spec.replace("preview: [left_open,", "preview: [middle_open, left_open,")
    (folder / "specs/parts").mkdir(parents=True)
    files = {"specs/bay.yaml": spec, "specs/parts/machine.yaml": f"codra: 1\ntemplates:\n{templates}{MIDDLE}"}
    run_project(
        folder, {**files, "eyes.py": 'def look(*, job):\n    return {"gap": 0.3}\n', "program.py": PROGRAM}, "run.mcap"
    )
    return folder


@pytest.mark.parametrize("name", ["a", "left", "machine", "zzz"])
def test_a_copy_of_a_spec_under_any_name_gives_the_same_events(project: Path, name: str) -> None:
    copy = project / f"specs/{name}.yaml"
    copy.write_text((project / "specs/bay.yaml").read_text())
    process = codra("replay", "run.mcap", "--spec", f"specs/{name}.yaml", cwd=project)
    copy.unlink()

    assert process.stdout.startswith("equal: 95 events\n")
    assert process.returncode == 0


def test_an_edited_distance_in_a_copy_is_named_with_its_place(project: Path) -> None:
    (project / "specs/zzz.yaml").write_text((project / "specs/bay.yaml").read_text().replace("50 cm", "40 cm"))
    process = codra("replay", "run.mcap", "--spec", "specs/zzz.yaml", cwd=project)

    changes = [line for line in process.stdout.splitlines() if line.startswith("  the spec differs: ")]
    assert [change.split("  [")[0].split(" [")[0].removeprefix("  the spec differs: ") for change in changes] == [
        "distance(robot, right) < 40 cm, type: bool",
        "distance(robot, right) < 50 cm, type: none; the run had bool",
        "look_at_right, observable_when: distance(robot, right) < 40 cm",
    ]
