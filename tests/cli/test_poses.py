"""Poses in conditions, from a spec with a template to a program, its journal, `codra replay` and `codra why`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.projects import run_project
from tests.cli.test_commands import codra

SPEC = """\
codra: 1
name: bay
context:
  left_open: {type: bool}
  right_open: {type: bool}
  speed: {type: float, unit: m/s, range: [0, 2], source: adaptation, valid_for: forever}
knowledge:
  types:
    camera: {view: {horizontal: 70 deg, vertical: 50 deg, farthest: 6 m}}
  nodes: {world: world, robot: robot, left: machine, right: machine, eye: camera}
  edges:
    robot_pose: {label: RT, from: world, to: robot, source: navigation, valid_for: 2 s}
    left_pose: {label: RT, from: world, to: left, static: true, pose: {x: 2 m}}
    right_pose: {label: RT, from: world, to: right, static: true, pose: {x: 4 m}}
    eye_pose: {label: RT, from: robot, to: eye, static: true, pose: {roll: -90 deg, yaw: -90 deg}}
agents:
  navigation: {phase: execute}
templates:
  machine:
    parameters: {reach: {type: quantity, default: 0.9 m}}
    perception:
      look_at_$(instance):
        call: eyes:look
        returns: {gap: {type: float, unit: m}}
        observable_when:
          - distance(robot, $(instance)) < $(reach)
          - in_view( $(instance) ,eye )
        identifies: {$(instance)_open: gap > 1 cm}
use:
  left: {template: machine}
  right: {template: machine, reach: 50 cm}
skills:
  work: {preview: [left_open, right_open], monitor: [speed]}
adaptation:
  limit: {set: speed, value: "0.3 m/s if distance(robot, left) < 1 m else 1 m/s", otherwise: 0.3 m/s}
loops:
  slow: {period: 1 s, adapt: [limit]}
"""

PROGRAM = """\
import sys
from codra_dsl.runtime import Journal, SimClock
from codra_dsl.runtime.geometry import Pose
from generated import bay

clock = SimClock()
with bay.start(clock=clock, resources={}, record=Journal(sys.argv[1])) as codra:
    with bay.loops(codra, clock=clock):
        codra.expect("work")
        navigation = codra.agent("navigation").graph
        for x_m in (0.0, 1.25, 1.5, 3.0, 3.75):
            navigation.place("world", "robot_pose", "robot", Pose.of((x_m, 0.0, 0.0)))
            clock.sleep(1.5)
            known = {name: codra.get(name).content for name in ("left_open", "right_open", "speed")}
            print(x_m, known)
        clock.sleep(1.5)
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project whose program has run and written the journal `run.mcap`."""
    folder = tmp_path_factory.mktemp("project")
    eyes = 'def look(*, job):\n    return {"gap": 0.3}\n'
    printed = run_project(folder, {"specs/bay.yaml": SPEC, "eyes.py": eyes, "program.py": PROGRAM}, "run.mcap")
    (folder / "printed").write_text(printed)
    return folder


def test_every_use_of_a_template_waits_for_poses_of_its_own(project: Path) -> None:
    assert (project / "printed").read_text().splitlines() == [
        "0.0 {'left_open': None, 'right_open': None, 'speed': 1.0}",
        "1.25 {'left_open': True, 'right_open': None, 'speed': 0.3}",
        "1.5 {'left_open': True, 'right_open': None, 'speed': 0.3}",
        "3.0 {'left_open': True, 'right_open': None, 'speed': 1.0}",
        "3.75 {'left_open': True, 'right_open': True, 'speed': 1.0}",
    ]


def test_replay_is_equal_and_why_names_who_placed_a_node(project: Path) -> None:
    replayed = codra("replay", "run.mcap", cwd=project)
    assert (replayed.returncode, replayed.stderr) == (0, "codra: the replay runs the package 'generated/bay'\n")
    assert replayed.stdout.startswith("equal: ")
    process = codra("why", "right_open", "--journal", "run.mcap", "--at", "7 s", cwd=project)
    assert process.returncode == 0
    assert process.stdout.splitlines()[6:14] == [
        "    distance(robot, right) < 50 cm is true at 7 s  [specs/bay.yaml:26 (used at specs/bay.yaml:31)]",
        "      determined by poses since 6 s",
        "      world -robot_pose-> robot is true at 7 s  [specs/bay.yaml:12]",
        "        inserted by agent navigation at 0 s, change 2",
        "        placed at (3.75, 0, 0) m by agent navigation at 6 s, change 13",
        "      world -right_pose-> right is true at 7 s  [specs/bay.yaml:14]",
        "        present from the start, 0 s",
        "        placed at (4, 0, 0) m from the start, 0 s",
    ]


def test_the_graph_shows_the_edges_that_a_comparison_reads(project: Path) -> None:
    graph = json.loads((project / "generated/bay/graph.json").read_text())
    read_ends = {(edge["source"], edge["target"]) for edge in graph["edges"] if edge["kind"] == "reads"}
    near = "bay/context/distance(robot, right) < 50 cm"
    assert {target for source, target in read_ends if source == near} == {"bay/edge/robot_pose", "bay/edge/right_pose"}
    required_ends = {(edge["source"], edge["target"]) for edge in graph["edges"] if edge["kind"] == "requires"}
    assert ("bay/perception/look_at_right", near) in required_ends
    assert ("bay/adaptation/limit", "bay/context/distance(robot, left) < 1 m") in read_ends
