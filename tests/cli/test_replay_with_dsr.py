"""`codra replay` of a run whose graph began with a DSR file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.projects import run_project
from tests.cli.test_commands import codra

SPEC = """\
codra: 1
name: shop
knowledge:
  types: {battery: {attributes: {load: {type: float, unit: percent, source: navigation}}}}
  nodes: {world: world, robot: robot, battery: battery, dock: dock}
  edges:
    robot_pose: {label: RT, from: world, to: robot, source: navigation, valid_for: 2 s}
    dock_pose: {label: RT, from: world, to: dock, static: true}
agents:
  navigation: {wakes: battery.load < 20 percent}
"""

DSR = """\
{"DSRModel": {"symbols": {
  "1": {"id": "1", "name": "world", "type": "world", "links": [
    {"src": "1", "dst": "2", "label": "RT", "linkAttribute": {
    "rt_translation": {"type": 3, "value": [2000.0, 1000.0, 0.0]},
    "rt_rotation_euler_xyz": {"type": 3, "value": [0.0, 0.0, 0.0]}}}]},
  "2": {"id": "2", "name": "robot", "type": "robot"},
  "3": {"id": "3", "name": "battery", "type": "battery", "attribute": {"load": {"type": 2, "value": 80.0}}}
}}}
"""

PROGRAM = """\
from codra_dsl.runtime import Journal, SimClock
from codra_dsl.runtime.knowledge.exchange import import_dsr, read_dsr
from generated import shop
from generated.shop.knowledge import KNOWLEDGE

clock = SimClock()
start = import_dsr(KNOWLEDGE, read_dsr("shop.json"))
assert not start.skipped_parts, start.skipped_parts
with shop.Shop(shop.MODEL, clock=clock, resources={}, record=Journal("run.mcap"), knowledge=start.model) as codra:
    codra.agent("navigation").graph.set("battery", "load", 79.5)
    clock.sleep(1.0)
    assert codra.knowledge.transform("world", "robot").pose.translation_m == (2.0, 1.0, 0.0)
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project whose program began with a DSR file and has written the journal `run.mcap`."""
    folder = tmp_path_factory.mktemp("project")
    run_project(folder, {"specs/shop.yaml": SPEC, "shop.json": DSR, "program.py": PROGRAM})
    return folder


def test_a_run_that_began_with_a_file_is_equal_only_if_the_replay_begins_with_it(project: Path) -> None:
    as_declared = codra("replay", "run.mcap", cwd=project)
    assert as_declared.returncode == 1
    assert as_declared.stdout.startswith("differs at event ")
    begun = codra("replay", "run.mcap", "--dsr", "shop.json", cwd=project)
    assert (begun.returncode, len(begun.stderr.splitlines())) == (0, 1)
    assert begun.stdout.startswith("equal: ")
    in_metres = codra("replay", "run.mcap", "--dsr", "shop.json", "--dsr-unit-m", "1", cwd=project)
    assert in_metres.returncode == 1
    assert "world -robot_pose-> robot" in in_metres.stdout


def test_a_wrong_dsr_file_and_a_spec_without_knowledge_are_reported(project: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    broken = codra("replay", "run.mcap", "--dsr", str(tmp_path / "broken.json"), cwd=project)
    assert broken.returncode == 2
    assert "broken.json" in broken.stderr
    missing = codra("replay", "run.mcap", "--dsr", "nothing.json", cwd=project)
    assert missing.returncode == 2
    spec = "codra: 1\nname: shop\ncontext:\n  near: {type: bool, source: main_execution, valid_for: 1 s}\n"
    (tmp_path / "plain.yaml").write_text(spec)
    plain = codra("replay", "run.mcap", "--dsr", "shop.json", "--spec", str(tmp_path / "plain.yaml"), cwd=project)
    assert plain.returncode == 2
    assert "the spec declares no knowledge" in plain.stderr
