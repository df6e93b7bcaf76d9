"""Derived variables in checks and plans: cycles, worst cases, Algorithm 2, and the dependency graph."""

from __future__ import annotations

import pytest

from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan.values import EdgeKind
from codra_dsl.language.check.latency import worst_cases
from tests.language.check.specs import check_sound_text, check_text, findings

SPEC = """\
codra: 1
name: ward
context:
  told: {type: bool, source: main_execution, valid_for: 10 s}
  door: {type: bool, valid_for: 10 s}
  lamp: {type: bool, valid_for: 10 s}
  tray: {type: bool, valid_for: 10 s}
  ready: {type: bool, derived: EXPRESSION}
  calm: {type: bool, derived: ready and not lamp}
perception:
  look_at_door: {call: "ward.eyes:look", timeout: 2 s, returns: {seen: {type: bool}}, identifies: {door: seen}}
  look_at_lamp: {call: "ward.eyes:look", timeout: 1 s, returns: {seen: {type: bool}}, identifies: {lamp: seen}}
  look_at_tray:
    call: ward.eyes:look
    timeout: 4 s
    observable_when: [CONDITION]
    returns: {seen: {type: bool}}
    identifies: {tray: seen}
skills:
  leave: {preview: [tray]}
"""


def spec_text(expression: str = "told and door", condition: str = "calm") -> str:
    return SPEC.replace("EXPRESSION", expression).replace("CONDITION", condition)


def test_algorithm_2_goes_on_with_the_inputs_without_a_tree() -> None:
    build_plan = plan(check_sound_text(spec_text()))
    assert [tree.name for tree in build_plan.forest] == ["look_at_lamp", "look_at_door", "look_at_tray"]
    assert build_plan.in_force == ("tray", "calm", "lamp", "ready", "door", "told")
    edges = [(edge.source.name, edge.target.name) for edge in build_plan.edges if edge.kind is EdgeKind.DERIVES]
    assert edges == [("door", "ready"), ("lamp", "calm"), ("ready", "calm"), ("told", "ready")]


def test_a_look_waits_for_the_looks_at_the_inputs() -> None:
    assert worst_cases(check_sound_text(spec_text())) == {"door": 2.0, "lamp": 1.0, "tray": 6.0}


@pytest.mark.parametrize("expression", ["tray and told", "tray if told else door", "tray else false", "known(tray)"])
def test_a_variable_does_not_wait_for_an_input_without_which_it_can_be_known(expression: str) -> None:
    text = spec_text(f'"{expression}"', "not ready")
    assert [finding.rule.code for finding in check_text(text)[1] if finding.rule.name == "cycle"] == []


@pytest.mark.parametrize("expression", ["tray", "not tray", "tray == told", "tray or tray", "false if tray else true"])
def test_a_variable_waits_for_an_input_without_which_it_is_unknown(expression: str) -> None:
    messages = [finding.message for finding in check_text(spec_text(expression, "not ready"))[1]]
    assert "context-variables wait for each other: ready -> tray -> ready" in messages


def test_derived_variables_that_read_each_other_are_a_cycle_even_if_each_can_be_known() -> None:
    messages = [finding.message for finding in check_text(spec_text('"calm else told"'))[1]]
    assert "context-variables wait for each other: calm -> ready -> calm" in messages


@pytest.mark.parametrize(
    ("expression", "condition", "waits"),
    [
        ("tray and told", "ready", True),
        ("tray and told", "calm", True),
        ("tray and told", "not ready", False),
        ("tray and told", "known(ready)", False),
        ("tray or told", "ready", False),
        ("tray or told", "not ready", True),
        ("told if tray else false", "ready", True),
    ],
)
def test_a_look_waits_for_what_makes_its_derived_condition_true(expression: str, condition: str, waits: bool) -> None:
    messages = [finding.message for finding in check_text(spec_text(f'"{expression}"', condition))[1]]
    assert ("context-variable 'tray' waits for itself: tray -> tray" in messages) is waits


def test_variables_that_read_each_other_often_are_judged_once_each() -> None:
    steps = [
        f"  step_{number}: {{type: bool, derived: step_{number - 1} or step_{number - 2}}}" for number in range(2, 60)
    ]
    first_steps = [f"  step_{number}: {{type: bool, derived: told and door}}" for number in range(2)]
    text = spec_text("step_59").replace("  ready:", "\n".join([*first_steps, *steps, "  ready:"]))
    text = text.replace(
        "context:", "context:\n  speed: {type: float, range: [0, 1], source: adaptation, valid_for: forever}"
    )
    text += "adaptation:\n  pace: {set: speed, value: 1 if step_59 else 0}\nloops:\n  pace: {adapt: [pace]}\n"
    rules = [finding.rule.name for finding in check_text(text)[1]]
    assert rules == ["unknown-adapted-value"]


NUMBER = """\
codra: 1
name: ward
agents: {lasers: {}}
context:
  gap: {type: float, unit: m, range: [0, 10], source: lasers, valid_for: 1 s}
  pallets: {type: int, range: [0, 9], source: lasers, valid_for: 1 s}
  number: {type: TYPE, derived: 'EXPRESSION'}
skills:
  leave: {preview: [number]}
"""


def number_findings(declared: str, expression: str) -> list[tuple[str, str]]:
    findings = check_text(NUMBER.replace("TYPE", declared).replace("EXPRESSION", expression))[1]
    return [(finding.code, finding.message) for finding in findings if finding.code != "CDR7102"]


@pytest.mark.parametrize(
    ("declared", "expression"),
    [
        ("float, unit: cm, range: [0, 500]", "gap + 6 m"),
        ("int, range: [0, 5]", "pallets + 6"),
        ("float, range: [0, 5]", "-pallets - 1 if known(gap) else 7"),
        ("float, range: [0, 5]", "(-pallets - 1) else 7"),
        ("float, range: [0, 5]", "pallets / (2 - 2)"),
    ],
)
def test_a_derived_number_that_is_always_outside_of_its_range_is_never_known(declared: str, expression: str) -> None:
    message = f"context-variable 'number' is never known: no value of '{expression}' is in its range"
    assert number_findings(declared, expression) == [("CDR7105", message)]


@pytest.mark.parametrize(
    ("declared", "expression"),
    [
        ("float, unit: cm, range: [0, 500]", "gap + 5 m"),
        ("int, range: [9, 20]", "max(pallets, 9)"),
        ("int, range: [0, 5]", "(pallets + 6) else 5"),
        ("float", "pallets / 2"),
    ],
)
def test_a_derived_number_that_can_be_in_its_range_is_not_reported(declared: str, expression: str) -> None:
    assert number_findings(declared, expression) == []


def test_a_division_by_the_number_0_is_an_error() -> None:
    message = "pallets / 0 has no value, because it divides by 0 ('derived' of context-variable 'number')"
    assert number_findings("float", "pallets / 0") == [("CDR4102", message)]


COUNTS = """\
codra: 1
name: hall
agents: {{eye: {{}}}}
knowledge:
  types: {{person: {{source: eye}}}}
  nodes: {{robot: robot}}
context:
  late: {{type: bool}}
  anyone: {{type: bool, derived: exists(some person)}}
  crowded: {{type: bool, derived: count(some person) > 2}}
  busy: {{type: bool, derived: crowded or late}}
  empty: {{type: bool, derived: not anyone and count(some person) == 0}}
  seen: {{type: bool}}
perception:
  look:
    call: robot.eyes:look
    returns: {{b: {{type: bool}}}}
    observable_when: [{conditions}]
    identifies: {{seen: b}}
  look_at_clock: {{call: robot.eyes:look_at_clock, returns: {{b: {{type: bool}}}}, identifies: {{late: b}}}}
skills:
  greet: {{preview: [seen, anyone, crowded, busy, empty]}}
"""


@pytest.mark.parametrize(
    ("conditions", "codes"),
    [
        ("not crowded", []),
        ("anyone or crowded", []),
        ("crowded, known(crowded)", []),
        ("not busy, anyone", ["CDR7101"]),
        ("known(late), crowded, not busy", ["CDR7101", "CDR5102"]),
    ],
)
def test_a_precondition_may_depend_on_a_count(conditions: str, codes: list[str]) -> None:
    assert [finding.rule.code for finding in findings(COUNTS.format(conditions=conditions))] == codes
