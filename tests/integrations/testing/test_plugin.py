"""pytest in separate processes, in projects of users."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_server import as_text, run_python

SPEC = """\
codra: 1
name: gate
agents: {porter: {}}
context:
  gate_lit: {type: bool, source: porter, valid_for: 10 s}
  gate_open: {type: bool, valid_for: 5 s}
resources: {camera: {}}
perception:
  look_at_gate:
    call: gate_perception:look
    uses: {camera: read}
    timeout: 2 s
    returns: {angle: {type: float, unit: rad}}
    observable_when: [gate_lit]
    identifies: {gate_open: angle > 30 deg}
skills:
  pass_gate: {preview: [gate_open]}
"""
TIMELINE = """\
codra: 1
timeline: gate
start:
  agents: {porter: {gate_lit: true}}
  perception: {look_at_gate: {returns: {angle: 60 deg}}}
stories:
  the gate is seen while it is lit:
    0 s: {main_execution: {expect: [pass_gate]}}
    3 s: {believes: {gate_open: true}}
  the gate is still open in the dark:
    0 s: {main_execution: {expect: [pass_gate]}}
    20 s: {believes: {gate_open: true}}
"""
PERCEPTION = """\
class Camera:
    angle_rad = 0.0


def look(*, camera, job):
    return {"angle": camera.angle_rad}
"""
PROGRAM = """\
from generated import gate


def cross(clock, camera):
    with gate.start(clock=clock, resources={"camera": camera}) as codra:
        codra.expect("pass_gate")
        clock.sleep(2.0)
        with codra.skill("pass_gate"):
            return codra.decide("gate_open", otherwise=lambda: None)
"""
TESTS = """\
import gate_program
import pytest
from gate_perception import Camera


def test_a_program_is_given_the_start_of_a_story(codra_story, codra_clock, monkeypatch):
    run = codra_story("cross.yaml", "case")
    monkeypatch.setattr(gate_program.gate, "start", run.start)
    assert gate_program.cross(codra_clock, Camera()) is True
    run.check()


def test_a_program_runs_with_the_camera_of_the_project(codra_story):
    with codra_story("cross.yaml", "seen", resources={"camera": Camera()}) as run:
        run.codra.declare("gate_open")
        run.until(4.0)
        assert run.resources["camera"].angle_rad == 1.2


def test_an_unknown_story_is_reported(codra_story):
    with pytest.raises(ValueError, match="tests/cross.yaml has no story 'sen': did you mean 'seen'?"):
        codra_story("cross.yaml", "sen")
"""
CROSS = """\
codra: 1
timeline: gate
start: {agents: {porter: {gate_lit: true}}}
stories:
  case:
    0 s: {perception: {look_at_gate: {returns: {angle: 60 deg}}}}
    2 s: {decided: {gate_open: answered}}
  seen:
    2 s: {resources: {camera: {angle_rad: 1.2 rad}}}
    4 s: {believes: {gate_open: true}}
"""


def run(*command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return as_text(run_python(command, cwd, environment()))


def run_without_imports(*command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run Python in a new process, which has imported nothing yet."""
    return subprocess.run(
        [sys.executable, *command], cwd=cwd, env=environment(), text=True, capture_output=True, check=False
    )


def environment() -> dict[str, str]:
    unset = ("PYTHONPATH", "PYTEST_ADDOPTS", "PYTEST_CURRENT_TEST", "FORCE_COLOR", "GITHUB_ACTIONS", "CI")
    return {key: value for key, value in os.environ.items() if key not in unset} | {"COLUMNS": "100"}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    files = {
        "pyproject.toml": "[tool.codra]\n",
        "specs/gate.yaml": SPEC,
        "gate_perception.py": PERCEPTION,
        "gate_program.py": PROGRAM,
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "tests").mkdir()
    process = run("-m", "codra_dsl", "compile", "specs", cwd=tmp_path)
    assert process.returncode == 0, process.stderr
    return tmp_path


def test_a_timeline_is_collected_by_itself_and_a_failed_story_shows_why(project: Path) -> None:
    (project / "tests" / "gate.timeline.yaml").write_text(TIMELINE, "utf-8")
    process = run("-m", "pytest", "-v", "-W", "error", cwd=project)

    assert process.returncode == 1
    assert "tests/gate.timeline.yaml::the gate is seen while it is lit PASSED" in process.stdout
    assert "1 failed, 1 passed" in process.stdout
    failure_match = re.search(
        r"^tests/gate.timeline.yaml:12:34: .*?(?=^=====)", process.stdout, re.MULTILINE | re.DOTALL
    )
    assert failure_match is not None, process.stdout
    assert (
        failure_match[0]
        == """\
tests/gate.timeline.yaml:12:34: at 20 s gate_open should be true, but it is unknown (stale)
   |
12 |     20 s: {believes: {gate_open: true}}
   |                                  ^^^^
  gate_open is unknown (stale) at 20 s  [specs/gate.yaml:6]
    its evidence, taken at 9 s, was valid for 5 s
    it was true before, from look_at_gate at 9 s
    observer look_at_gate has been running since 0 s
    declared since 0 s for expected
    perception look_at_gate cannot look  [specs/gate.yaml:9]
      job 9 returned at 9 s
      gate_lit is unknown (stale) at 20 s  [specs/gate.yaml:14]
        its evidence, taken at 0 s, was valid for 10 s
        it was true before, from porter at 0 s
    missing: gate_lit = true
"""
    )


def test_a_timeline_with_mistakes_does_not_run_and_reports_all_of_them_once(project: Path) -> None:
    wrong_timeline = TIMELINE.replace("porter:", "portr:").replace("60 deg", "60")
    (project / "tests" / "gate.timeline.yaml").write_text(wrong_timeline, "utf-8")
    process = run("-m", "pytest", "-q", cwd=project)

    assert process.returncode == 1
    assert "Traceback" not in process.stdout
    assert "2 failed" in process.stdout.splitlines()[-1]
    reported_text = process.stdout.partition("short test summary")[0]
    assert reported_text.count("tests/gate.timeline.yaml:4:12: error[CDR2003]: spec 'gate' has no agent 'portr'") == 1
    assert "tests/gate.timeline.yaml:5:48: error[CDR2011]: 'angle' is in rad, and '60' has no unit" in process.stdout


@pytest.mark.parametrize("text", ["codra: 1\ntimeline: gate\nstories: [\n", "codra: 1\ntimeline: gate\n", ""])
def test_a_timeline_without_readable_names_of_stories_is_not_collected(project: Path, text: str) -> None:
    (project / "tests" / "gate.timeline.yaml").write_text(text, "utf-8")
    process = run("-m", "pytest", "-q", cwd=project)

    assert process.returncode == 2
    assert "tests/gate.timeline.yaml:" in process.stdout
    assert "error[CDR" in process.stdout
    assert "Traceback" not in process.stdout


def test_collecting_a_timeline_imports_neither_the_compiler_nor_the_runtime(project: Path) -> None:
    (project / "tests" / "gate.timeline.yaml").write_text(TIMELINE, "utf-8")
    (project / "tests" / "test_other.py").write_text(
        "import sys\n\n\ndef test_it() -> None:\n"
        "    heavy = ('compiler', 'generation', 'language', 'runtime', 'tooling')\n"
        "    packages = {name.split('.')[1] for name in sys.modules if name.startswith('codra_dsl.')}\n"
        "    assert not packages & set(heavy)\n",
        "utf-8",
    )
    process = run_without_imports("-m", "pytest", "-v", "-W", "error", "-k", "test_it", cwd=project)
    collected = run("-m", "pytest", "-q", "--collect-only", cwd=project)

    assert "1 passed, 2 deselected" in process.stdout, process.stdout
    assert "tests/gate.timeline.yaml::the gate is still open in the dark\n" in collected.stdout


def test_a_timeline_of_a_spec_that_was_not_compiled_again_is_reported(project: Path) -> None:
    (project / "specs" / "gate.yaml").write_text(SPEC.replace("30 deg", "20 deg"), "utf-8")
    (project / "tests" / "gate.timeline.yaml").write_text(TIMELINE, "utf-8")
    process = run("-m", "pytest", "-q", cwd=project)

    assert process.returncode == 1
    assert "'generated/gate' is out of date: it does not match 'specs/gate.yaml'" in process.stdout
    assert "compile it: codra compile specs/gate.yaml" in process.stdout


def test_a_handle_that_cannot_be_made_is_reported_without_a_traceback(project: Path) -> None:
    timeline = f"{TIMELINE}resources: {{camera: {{call: gate_perception:Camra}}}}\n"
    (project / "tests" / "gate.timeline.yaml").write_text(timeline, "utf-8")
    process = run("-m", "pytest", "-q", cwd=project)

    assert "tests/gate.timeline.yaml:13: 'gate_perception:Camra': AttributeError" in process.stdout
    assert "Traceback" not in process.stdout
    assert "collecting.py" not in process.stdout


def test_a_timeline_tests_the_package_of_a_site_with_the_handles_that_the_site_states(project: Path) -> None:
    files = {
        "sites/yard.yaml": (
            "codra: 1\noverlays: gate\nresources: {camera: {call: yard:Camera, with: {angle: 60 deg}}}\n"
            "perception: {look_at_gate: {identifies: {gate_open: angle > 50 deg}}}\n"
        ),
        "yard.py": "class Camera:\n    def __init__(self, clock, angle):\n        self.angle_rad = angle\n",
        "tests/yard.timeline.yaml": (
            "codra: 1\ntimeline: gate\nfolder: generated_yard\nstories:\n  the camera of the yard sees the gate:\n"
            "    0 s:\n      agents: {porter: {gate_lit: true}}\n      main_execution: {expect: [pass_gate]}\n"
            "    3 s: {believes: {gate_open: true}, resources: {camera: {angle_rad: 45 deg}}}\n"
            "    6 s: {believes: {gate_open: false}}\n"
        ),
    }
    for name, text in files.items():
        (project / name).parent.mkdir(exist_ok=True)
        (project / name).write_text(text, "utf-8")
    before = run("-m", "pytest", "-q", "tests/yard.timeline.yaml", cwd=project)
    run("-m", "codra_dsl", "compile", "specs", "--site", "sites/yard.yaml", cwd=project)
    after = run("-m", "pytest", "-q", "tests/yard.timeline.yaml", cwd=project)

    assert "there is no compiled spec 'generated_yard/gate'" in before.stdout
    assert "1 passed" in after.stdout, after.stdout


def test_a_program_runs_in_stories_through_the_fixture(project: Path) -> None:
    (project / "tests" / "cross.yaml").write_text(CROSS, "utf-8")
    (project / "tests" / "test_gate.py").write_text(TESTS, "utf-8")
    process = run("-m", "pytest", "-q", "-W", "error", cwd=project)

    assert "3 passed" in process.stdout, process.stdout


def test_timelines_are_not_linted_as_specs(project: Path) -> None:
    (project / "specs" / "gate.timeline.yaml").write_text(TIMELINE, "utf-8")
    process = run("-m", "codra_dsl", "lint", "specs", cwd=project)

    assert (process.stderr, process.returncode) == ("no findings\n", 0)


# Other projects


def test_a_project_that_does_not_use_codra_loads_only_the_plugin(tmp_path: Path) -> None:
    (tmp_path / "test_other.py").write_text(
        "import sys\n\n\ndef test_it() -> None:\n"
        "    loaded = {name.split('.')[0] for name in sys.modules}\n"
        "    assert not loaded & {'yaml', 'jsonschema', 'py_trees', 'networkx', 'numpy', 'jinja2', 'typer'}\n"
        "    ours = sorted(name for name in sys.modules if name.startswith('codra_dsl'))\n"
        "    testing = 'codra_dsl.integrations.testing'\n"
        "    assert ours == ['codra_dsl', 'codra_dsl.integrations', testing, f'{testing}.plugin']\n",
        "utf-8",
    )
    process = run_without_imports("-m", "pytest", "-q", "-W", "error", "-p", "no:hypothesispytest", cwd=tmp_path)

    assert "1 passed" in process.stdout, process.stdout


def test_codra_works_without_pytest(project: Path) -> None:
    script = (
        "import sys; sys.modules['pytest'] = None; sys.argv[:] = ['codra', 'lint', 'specs']\n"
        "from generated import gate; from codra_dsl.cli import main; main()"
    )
    process = run_without_imports("-c", script, cwd=project)

    assert (process.stderr, process.returncode) == ("no findings\n", 0)
