"""Adaptations that depend on themselves: which are errors, which are warnings, and which are allowed."""

from __future__ import annotations

import pytest

from tests.language.check.specs import findings

SPEC = """\
codra: 1
name: truck
context:
  distance: {{type: float, unit: m, range: [0, 10], source: laser, valid_for: forever}}
  max_speed: {{type: float, unit: m/s, range: [0, 1.5], source: {source}, valid_for: forever}}
agents: {{laser: {{}}}}
adaptation:
  speed: {{set: max_speed, value: '{value}', dwell: {dwell}}}
loops:
  driving: {{adapt: [speed]}}
"""


def codes(value: str, source: str = "adaptation", dwell: str = "0 s") -> list[str]:
    return [finding.rule.code for finding in findings(SPEC.format(value=value, source=source, dwell=dwell))]


@pytest.mark.parametrize(
    "value",
    [
        "0.3 m/s if max_speed > 1 m/s else 1.2 m/s",
        "0.3 m/s if known(max_speed) and max_speed > 1 m/s else 1.2 m/s",
        "max_speed",
        "0.3 m/s if distance < 2 m and max_speed > 1 m/s else max_speed",
        "1 m/s if not known(max_speed) or max_speed == 0 else 0",
    ],
)
def test_an_adaptation_that_never_sets_or_never_becomes_stable_is_an_error(value: str) -> None:
    assert codes(value) == ["CDR5134"]


@pytest.mark.parametrize(
    "value",
    [
        "0.3 m/s if distance < 2 m or known(max_speed) and max_speed < 1 m/s and distance < 3 m else 1.2 m/s",
        "0.3 m/s if not known(max_speed) or max_speed < 0.2 m/s else max_speed * 0.5",
        "0.3 m/s if max_speed > 0.1 m/s else 0.3 m/s",
    ],
)
def test_feedback_that_can_become_stable_is_a_warning(value: str) -> None:
    assert codes(value) == ["CDR7127"]


def test_feedback_that_alternates_with_a_dwell_is_a_warning() -> None:
    assert codes("0.3 m/s if known(max_speed) and max_speed > 1 m/s else 1.2 m/s", dwell="10 s") == ["CDR7127"]


def test_a_variable_with_another_source_does_not_wait_for_itself() -> None:
    assert codes("min(max_speed, 1 m/s)", source="[adaptation, laser]") == ["CDR7127"]


@pytest.mark.parametrize("value", ["0.3 m/s if distance < 2 m else 1.2 m/s", "0.3 m/s"])
def test_a_value_that_depends_only_on_other_variables_is_no_feedback(value: str) -> None:
    assert codes(value) == []


DERIVED_SPEC = """\
codra: 1
name: truck
context:
  gap: {type: float, unit: m, range: [0, 10], source: laser, valid_for: forever}
  max_speed: {type: float, unit: m/s, range: [0, 1.5], source: adaptation, valid_for: forever}
  fast: {type: bool, derived: READ}
  calm: {type: float, range: [0, 1], derived: 1.0 if fast else 0.0, terms: {much: ramp 0 1}}
agents: {laser: {}}
metrics:
  safety: {rules: [if calm is much then low, if calm is not much then high]}
adaptation:
  speed: {set: max_speed, value: 0.3 m/s if safety < 0.5 else 1.2 m/s, otherwise: 0.3 m/s}
loops:
  driving: {analyse: [safety], adapt: [speed]}
"""


@pytest.mark.parametrize(
    ("read", "messages"),
    {
        "max_speed > 1 m/s": [
            "adaptation 'speed' depends on a value that it sets itself: "
            "max_speed -> safety -> calm -> fast -> max_speed"
        ],
        "safety > 0.5": ["metric 'safety' depends on itself: safety -> calm -> fast -> safety"],
        "gap < 1 m": [],
    }.items(),
)
def test_feedback_through_derived_variables_is_a_warning(read: str, messages: list[str]) -> None:
    reported = findings(DERIVED_SPEC.replace("READ", read))
    assert [finding.message for finding in reported if finding.rule.code == "CDR7127"] == messages


def test_a_variable_of_an_agent_with_the_name_of_a_filtered_weight_is_no_feedback() -> None:
    text = DERIVED_SPEC.replace("fast: {type: bool, derived: READ}", "fast: {type: bool, derived: max_speed > 1 m/s}")
    text = text.replace(
        "adaptation:\n",
        """\
actions:
  go: {rules: [if safety is low then low, if safety is not low then high]}
adaptation:
  course: {choose: [go], in: mission, OF otherwise: go}
""",
    ).replace("value: 0.3 m/s if safety < 0.5", "value: 0.3 m/s if filtered_weight_of_go < 0.5")
    declared = "  filtered_weight_of_go: {type: float, range: [0, 1], source: laser, valid_for: forever}\nagents:"
    of_agent = text.replace("OF ", "").replace("agents:", declared)
    of_course = text.replace("OF ", "of: robot, ").replace("agents:", "knowledge: {nodes: {robot: robot}}\nagents:")
    codes_of_both = [[finding.rule.code for finding in findings(spec)] for spec in (of_agent, of_course)]
    assert ["CDR7127" in codes for codes in codes_of_both] == [False, True]
