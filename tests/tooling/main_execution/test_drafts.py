"""Each source in tests/cases/imports gives exactly the expected draft, which lints without errors and compiles.

Renew the drafts with `pytest tests/tooling/main_execution/test_drafts.py --renew-cases`, and read the diff.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_text
from codra_dsl.generation.build_plan import verify
from codra_dsl.generation.emit import emit
from codra_dsl.generation.emit.self_check import prove
from codra_dsl.tooling.main_execution.draft import draft
from codra_dsl.tooling.main_execution.sources import read_source

CASES = Path(__file__).parents[2] / "cases/imports"
SOURCES = sorted(path for path in CASES.iterdir() if path.suffix not in (".yaml", ""))
VARIABLES = {
    "asking.py": {"entrance_open", "exit_open", "people_near"},
    "patrol.py": {
        "navigator_battery_level",
        "navigator_get_feedback",
        "navigator_get_result",
        "navigator_is_task_complete",
        "navigator_people",
    },
    "waiter.py": {
        "base_is_at_door",
        "base_is_at_window",
        "battery_level",
        "detect_cup",
        "door_is_open",
        "is_holding",
        "is_occupied_door",
        "is_occupied_window",
        "robot_mode",
    },
    "cross_door.xml": {"door_locked", "force", "is_door_closed", "tool"},
    "inspect.xml": {"arm_ready", "distance", "mode", "object_visible_handle", "object_visible_valve", "tool"},
    "navigate.xml": {"global_updated_goal", "goal_updated", "is_battery_low_0_2", "is_path_valid", "recovery"},
}
"""The variables of the decisions in each source, listed by hand."""

PLACE = re.compile(r"# (\S+?):(\d+):(\d+)(?:: (.*))?$")


def draft_of(source: Path) -> str:
    main_execution, findings = read_source(source, [], CASES)
    assert main_execution is not None, findings
    return draft(main_execution, source.stem, source.name)


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_a_source_gives_exactly_the_expected_draft(source: Path, renew_cases: bool) -> None:
    expected = source.with_name(f"{source.name}.yaml")
    text = draft_of(source)
    if renew_cases:
        expected.write_text(text, "utf-8")

    assert text == expected.read_text("utf-8")


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_a_draft_has_one_variable_for_each_decision_and_no_others(source: Path, tmp_path: Path) -> None:
    (plan,) = plan_text(draft_of(source), "specs/draft.yaml", tmp_path).plans

    assert set(plan.checked.variables) == VARIABLES[source.name]


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_a_draft_lints_without_findings_and_its_plan_and_output_are_proven(source: Path, tmp_path: Path) -> None:
    result = plan_text(draft_of(source), "specs/draft.yaml", tmp_path)

    assert result.diagnostics == ()
    (plan,) = result.plans
    verify(plan, plan.checked)
    prove(emit(plan))


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.name)
def test_each_place_in_a_draft_is_in_the_source(source: Path) -> None:
    places = [match for line in draft_of(source).splitlines() if (match := PLACE.search(line))]

    assert places
    for file, line, column, _ in (place.groups() for place in places):
        texts = (CASES / file).read_text("utf-8").splitlines()
        assert texts[int(line) - 1][int(column) - 1 :].strip()
