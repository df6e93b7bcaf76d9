"""Coverage of the laboratory of P1: its workflow in plain Python and in RAFCON, all decisions and no others."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths, plan_text
from codra_dsl.tooling.main_execution.coverage import Coverage, coverage_of
from codra_dsl.tooling.main_execution.draft import draft
from codra_dsl.tooling.main_execution.model import MainExecution
from codra_dsl.tooling.main_execution.sources import read_source
from codra_papers.lab.mission import DECISION_VARIABLES, SKILLS

ROOT = Path(__file__).parents[3]
MISSION = ROOT / "codra_papers/lab/mission.py"
TENDING = ROOT / "examples/rafcon_lab/tend_pcr_cycler"
IMPORTS = ROOT / "tests/cases/imports"

TENDING_DECISIONS = {
    "drive_to_pcr_cycler": {"robot_is_localized"},
    "unlock_pcr_cycler": {"pcr_cycler_in_manipulation_distance", "pcr_cycler_locked"},
    "open_pcr_cycler": {"pcr_cycler_in_manipulation_distance", "pcr_cycler_locked", "pcr_cycler_open"},
    "close_pcr_cycler": {"pcr_cycler_in_manipulation_distance", "pcr_cycler_open"},
    "lock_pcr_cycler": {"pcr_cycler_in_manipulation_distance", "pcr_cycler_open", "pcr_cycler_locked"},
}
"""The decisions of the RAFCON state machine by skill, read from its states."""


def main_execution_of(source: Path) -> MainExecution:
    main_execution, findings = read_source(source, [], ROOT)
    assert main_execution is not None, findings
    return main_execution


def decisions_by_skill(main_execution: MainExecution) -> Mapping[str, set[str]]:
    decisions: dict[str, set[str]] = {}
    for decision in main_execution.decisions:
        decisions.setdefault(decision.skill, set()).add(decision.name)
    return decisions


@pytest.fixture(scope="module")
def lab_coverages() -> Mapping[str, Coverage]:
    (plan,) = plan_paths([ROOT / "specs/lab.yaml"], ROOT).plans
    sources = {"Python": MISSION, "RAFCON": TENDING}
    return {name: coverage_of(plan, main_execution_of(source)) for name, source in sources.items()}


def test_the_mission_in_plain_python_decides_on_exactly_its_decision_variables_in_its_skills() -> None:
    decisions = decisions_by_skill(main_execution_of(MISSION))

    assert set().union(*decisions.values()) == set(DECISION_VARIABLES)
    assert set(decisions) == set(SKILLS)


def test_the_mission_in_rafcon_decides_on_exactly_what_its_states_ask() -> None:
    assert decisions_by_skill(main_execution_of(TENDING)) == TENDING_DECISIONS


def test_a_decision_in_rafcon_is_at_the_state_that_asks() -> None:
    for decision in main_execution_of(TENDING).decisions:
        line = (ROOT / decision.place.span.file).read_text("utf-8").splitlines()[decision.place.span.line - 1]
        assert line[decision.place.span.column - 1 :].startswith('"state_id": "')
        assert "_ASKED" in line


@pytest.mark.parametrize("source", ["Python", "RAFCON"])
def test_the_lab_covers_all_decisions_of_both(source: str, lab_coverages: Mapping[str, Coverage]) -> None:
    coverage = lab_coverages[source]

    assert [judged.decision.name for judged in coverage.decisions if not judged.is_covered] == []
    assert coverage.covered_percent == 100
    assert all(judged.variable == judged.decision.name for judged in coverage.decisions)


def test_every_variable_of_the_lab_serves_the_mission_and_those_of_the_centrifuge_not_the_tending(
    lab_coverages: Mapping[str, Coverage],
) -> None:
    assert lab_coverages["Python"].unused_variables == ()
    unused = {variable.name for variable in lab_coverages["RAFCON"].unused_variables}
    assert {name.partition("_")[0] for name in unused} == {"centrifuge"}
    assert len(unused) == 8


@pytest.mark.parametrize(
    "source", [*sorted(IMPORTS.glob("*.py")), *sorted(IMPORTS.glob("*.xml")), TENDING], ids=lambda source: source.name
)
def test_a_draft_covers_every_decision_of_its_source_and_has_no_other_variable(source: Path, tmp_path: Path) -> None:
    main_execution = main_execution_of(source)
    (plan,) = plan_text(draft(main_execution, "robot", "source"), "robot.yaml", tmp_path).plans

    coverage = coverage_of(plan, main_execution)

    assert coverage.findings() == ()
    assert coverage.decisions


SPEC = """\
codra: 1
name: door
context:
  gate: {type: bool, source: main_execution, label: vision_is_open_door}
  light: {type: bool, source: main_execution}
  dark: {type: bool, derived: not light}
  bell: {type: bool, source: main_execution}
  seen: {type: bool, valid_for: 5 s}
  near: {type: bool, source: main_execution, valid_for: 5 s}
perception:
  look: {call: a.b:look, returns: {value: {type: bool}}, identifies: {seen: value}, observable_when: [near]}
skills:
  pass_door: {preview: [gate, dark, seen]}
  ring: {preview: [bell]}
"""
ROBOT = """\
def pass_door(robot, vision):
    if vision.is_open("door") and robot.is_dark("dark"):
        robot.ring()
    if robot.is_bright("light"):
        return
    if robot.listen("bell"):
        return
    if robot.hold():
        return

def other(robot):
    while robot.look("seen"):
        robot.step()
"""


@pytest.fixture
def door_coverage(tmp_path: Path) -> Coverage:
    (tmp_path / "robot.py").write_text(ROBOT)
    (plan,) = plan_text(SPEC, "door.yaml", tmp_path).plans
    main_execution, _ = read_source(tmp_path / "robot.py", [], tmp_path)
    assert main_execution is not None
    return coverage_of(plan, main_execution)


def test_a_variable_is_found_by_its_label_and_by_a_text_that_the_source_passes(door_coverage: Coverage) -> None:
    variables = {judged.decision.text: judged.variable for judged in door_coverage.decisions}

    assert variables == {
        "vision.is_open('door')": "gate",
        "robot.is_dark('dark')": "dark",
        "robot.is_bright('light')": "light",
        "robot.listen('bell')": "bell",
        "robot.hold()": "",
        "robot.look('seen')": "seen",
    }


def test_a_decision_needs_its_variable_and_a_skill_that_watches_it(door_coverage: Coverage) -> None:
    reasons = {judged.decision.text: judged.reason for judged in door_coverage.decisions if not judged.is_covered}

    assert reasons == {
        "robot.is_bright('light')": "skill 'pass_door' neither previews nor monitors 'light'",
        "robot.listen('bell')": "skill 'pass_door' neither previews nor monitors 'bell'",
        "robot.hold()": "the spec has no such variable",
    }
    assert door_coverage.covered_percent == 50


def test_a_variable_that_only_the_perception_of_another_one_needs_is_used(door_coverage: Coverage) -> None:
    assert door_coverage.unused_variables == ()
