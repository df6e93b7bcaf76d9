"""Previews with conditions: what the compiler plans and generates from them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_text
from codra_dsl.generation.emit import emit
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.runtime import PreviewOutcome, SimClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.tooling.diff import Category
from tests.tooling.diff.versions import review_edits

ROOT = Path(__file__).parents[3]
CASE = (ROOT / "tests/cases/valid/previews.yaml").read_text("utf-8")


def planned(text: str) -> tuple[Mapping[str, str], tuple[Diagnostic, ...]]:
    """Return the generated files of a spec, and its findings."""
    result = plan_text(text, "spec.yaml", ROOT)
    files = emit(result.plans[0]) if result.plans else {}
    return files, result.diagnostics


def test_the_generated_skill_states_each_condition_as_it_is_written() -> None:
    text = planned(CASE)[0]["cell/spec.py"]

    assert 'preview=("locked", "battery", "rotor_in_pos_1"),' in text
    assert 'PreviewCondition(text="locked == false", condition=~value("locked")),' in text
    assert 'PreviewCondition(text="battery > 20 percent", condition=value("battery") > 20),' in text


def test_a_variable_named_alone_beside_a_condition_must_be_known() -> None:
    text = planned(CASE)[0]["cell/spec.py"]

    assert 'text="rotor_in_pos_1"' in text
    assert 'condition=value("rotor_in_pos_1") == value("rotor_in_pos_1")' in text


@pytest.mark.parametrize("entry", ["(locked)", "' locked'", "((locked))"])
def test_a_name_in_parentheses_or_blanks_is_a_name_alone(entry: str) -> None:
    text = planned(CASE.replace("[locked == false, battery > 20 percent, rotor_in_pos_1]", f"[{entry}]"))[0]

    assert 'SkillModel(name="open_lid", preview=("locked",), changes=("locked",)),' in text["cell/spec.py"]


def test_the_skill_decides_on_the_variables_of_its_conditions_and_they_are_observed() -> None:
    files, _ = planned(CASE)
    edges = [(edge["source"], edge["target"]) for edge in json.loads(files["cell/graph.json"])["edges"]]
    targets = {target for source, target in edges if source == "cell/skill/close_lid"}

    assert ("cell/skill/open_lid", "cell/context/battery") in edges
    assert "def read_battery(" in files["cell/spec.py"]
    assert targets == {
        *("cell/context/gap", "cell/context/level", "cell/context/rotor_in_pos_1"),
        "cell/context/distance(robot, cell) < 1 m",
    }


def test_the_digest_of_a_spec_changes_with_a_condition_of_a_preview_only_if_there_is_one() -> None:
    def digest(text: str) -> str:
        return str(json.loads(planned(text)[0]["cell/manifest.json"])["model"])

    assert digest(CASE) == digest(f"# moved\n{CASE}")
    assert digest(CASE) != digest(CASE.replace("battery > 20", "battery > 30"))
    assert digest(CASE) != digest(CASE.replace("battery > 20 percent", "battery"))


@pytest.mark.parametrize(
    ("edit", "category", "message"),
    [
        (("battery > 20", "battery > 10"), Category.WEAKER, "'preview' holds more often"),
        (("battery > 20", "battery > 30"), Category.STRONGER, "'preview' holds less often"),
        (("locked == false", "locked == true"), Category.GUARD_CHANGED, "'preview' holds in other situations"),
        (("battery > 20 percent", "battery"), Category.WEAKER, "'preview' holds more often"),
        (("locked == false, ", ""), Category.UNDECLARED, "no longer previews 'locked'"),
    ],
)
def test_a_diff_states_how_a_preview_has_changed(edit: tuple[str, str], category: Category, message: str) -> None:
    changes = [change for change in review_edits(CASE, edit).changes if change.element == "cell/skill/open_lid"]
    assert (category, message) in [(change.category, change.message) for change in changes]


def test_a_preview_that_means_the_same_is_no_change() -> None:
    assert review_edits(CASE, ("locked == false", "not locked"), ("20 percent", "20.0 percent")).changes == ()


def test_a_misspelt_variable_in_a_condition_is_reported_once() -> None:
    _, diagnostics = planned(CASE.replace("battery > 20 percent", "batery > 20 percent"))

    assert [(finding.rule.code, finding.help) for finding in diagnostics] == [("CDR3101", "did you mean 'battery'?")]


def test_the_conditions_of_a_template_have_the_names_of_the_use() -> None:
    text = """\
codra: 1
name: doors
templates:
  door:
    parameters: {limit: quantity}
    context:
      $(instance)_gap: {type: float, unit: m, source: main_execution}
    skills:
      pass_$(instance):
        preview: [$(instance)_gap > $(limit)]
use:
  front: {template: door, limit: 60 cm}
  back: {template: door, limit: 50 cm}
"""
    files, diagnostics = planned(text)

    assert diagnostics == ()
    assert 'PreviewCondition(text="front_gap > 60 cm", condition=value("front_gap") > 0.6)' in files["doors/front.py"]
    assert 'PreviewCondition(text="back_gap > 50 cm", condition=value("back_gap") > 0.5)' in files["doors/back.py"]


def test_a_compiled_preview_with_a_comparison_of_poses_is_answered(tmp_path: Path) -> None:
    text = """\
codra: 1
name: approach
context:
  gap: {type: float, unit: m, source: main_execution}
skills:
  grasp:
    preview: ['distance(robot, cell) < 1 m', gap, gap < 3 cm or known(gap)]
knowledge:
  types: {place: {}}
  nodes: {robot: place, cell: place}
  edges:
    at: {label: RT, from: place, to: place, source: main_execution, valid_for: 10 s}
"""
    with load_start(planned(text)[0], "approach", tmp_path)(clock=SimClock(), resources={}) as codra:
        unknown = codra.preview("grasp")
        codra.set("gap", 0.01)
        codra.agent("main_execution").graph.place("robot", "at", "cell", Pose.of((0.5, 0.0, 0.0)))
        answer = codra.preview("grasp")
    assert {variable.name for variable in unknown.unknown} == {"distance(robot, cell) < 1 m", "gap"}
    assert answer.outcome is PreviewOutcome.HOLDS
