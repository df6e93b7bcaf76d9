from __future__ import annotations

import pytest

from tests.language.check.specs import DOOR, check_sound_text, check_text, edit_spec, finding_texts, findings

KEEP_DECLARATION = "near_door: {type: bool, when_unobservable: keep}"
FORGET_DECLARATION = "near_door: {type: bool, when_unobservable: forget}"
NEAR = "      - near_door\n"
UNGUARDED = ("    observable_when: [robot_is_localized]\n", "")


def unnoticed_paths(*edits: tuple[str, str]) -> list[str]:
    return [finding.path for finding in findings(edit_spec(*edits)) if finding.rule.name == "unnoticed-precondition"]


@pytest.mark.parametrize(
    "edits",
    [
        [(FORGET_DECLARATION, "near_door: {type: bool, valid_for: 5 s}")],
        [(FORGET_DECLARATION, "near_door: {type: bool, valid_for: forever}")],
        [(FORGET_DECLARATION, "near_door: {type: bool, valid_for: 5 s}"), UNGUARDED],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - near_door and age(near_door) < 10 s\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - near_door\n      - 10 s >= age(near_door)\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - known(near_door)\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - not known(near_door) or age(near_door) > 10 s\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), ("    observable_when:\n      - near_door\n", "")],
    ],
)
def test_preconditions_that_expire_or_use_no_old_value_are_no_finding(edits: list[tuple[str, str]]) -> None:
    assert unnoticed_paths(*edits) == []


@pytest.mark.parametrize(
    "edits",
    [
        [(FORGET_DECLARATION, KEEP_DECLARATION)],
        [(FORGET_DECLARATION, "near_door: {type: bool}")],
        [UNGUARDED],
        [(FORGET_DECLARATION, "near_door: {type: bool, when_unobservable: forget, source: [observer, page]}")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - near_door and age(near_door) > 10 s\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - near_door or age(near_door) < 10 s\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - known(near_door) and near_door\n")],
        [(FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - not near_door\n")],
    ],
)
def test_preconditions_that_never_expire_are_reported(edits: list[tuple[str, str]]) -> None:
    assert unnoticed_paths(*edits) == ["context.near_door"]


def test_a_variable_with_another_source_must_state_its_validity() -> None:
    assert finding_texts(edit_spec(("source: main_execution, valid_for: forever", "source: main_execution"))) == [
        (
            "unnoticed-precondition",
            "robot_is_localized",
            "context-variable 'robot_is_localized' is a precondition, but its value never expires: "
            "it has a source other than observers",
            "add 'valid_for', for example 'valid_for: forever'",
        )
    ]


def test_forget_is_suggested_only_if_it_would_help() -> None:
    guarded_findings, unguarded_findings = (
        findings(edit_spec((FORGET_DECLARATION, KEEP_DECLARATION))),
        findings(edit_spec((FORGET_DECLARATION, KEEP_DECLARATION), UNGUARDED)),
    )
    assert guarded_findings[0].help.endswith("or 'when_unobservable: forget'")
    assert unguarded_findings[0].help == "add 'valid_for', for example 'valid_for: forever'"


def test_a_wrong_condition_is_not_reported_as_a_precondition() -> None:
    assert unnoticed_paths((FORGET_DECLARATION, KEEP_DECLARATION), (NEAR, "      - near_door > 3\n")) == []


def test_an_alternative_without_preconditions_keeps_a_variable_from_being_forgotten() -> None:
    guess = (
        "  guess:\n    call: a.b:c\n    returns: {near: {type: bool}}\n    identifies: {near_door: near}\n    rank: 2\n"
    )
    assert unnoticed_paths(("  look_at_door:\n", f"{guess}  look_at_door:\n")) == ["context.near_door"]


def test_variables_identified_together_with_a_needed_one_are_reached() -> None:
    assert findings(edit_spec(("    monitor: [door_locked, people]\n", ""))) == ()


def test_variables_of_a_joined_tree_are_reached() -> None:
    lamp = "  look_at_lamp:\n    call: a.b:c\n    given: [robot_is_localized]\n    returns: {lit: {type: bool}}\n"
    lamp += "    observable_when: [near_door]\n    identifies: {lamp_on: lit}\n"
    text = edit_spec(("resources:\n", "  lamp_on: {type: bool}\nresources:\n"), ("skills:\n", f"{lamp}skills:\n"))
    assert [finding.path for finding in findings(text)] == ["context.lamp_on"]
    check_sound_text(
        edit_spec(
            ("[door_state, door_gap, door_locked, people]", "[door_state, door_gap, door_locked, people, lamp_on]"),
            text=text,
        )
    )


def test_variables_read_only_as_feedback_are_reached() -> None:
    preview = (
        "    preview: [door_state, door_gap]\n    monitor: [door_locked, people]\n",
        "    preview: [near_door]\n",
    )
    text = edit_spec(
        preview, ("observable_when: [robot_is_localized]", "observable_when: [robot_is_localized, not known(people)]")
    )
    assert findings(text) == ()


def test_changes_alone_reach_no_variable() -> None:
    preview = ("    preview: [door_state, door_gap]\n    monitor: [door_locked, people]\n", "")
    assert {finding.rule.name for finding in findings(edit_spec(preview))} == {
        "unreached-variable",
        "unreached-observer",
    }


def test_without_skills_all_variables_are_reached() -> None:
    head, observers = DOOR.partition("skills:\n")[0], "observers:" + DOOR.partition("observers:")[2]
    assert findings(head + observers) == ()
    assert findings(head.replace("resources:", "  paged: {type: bool, source: page}\nresources:") + observers) == ()


@pytest.mark.parametrize(
    ("old", "new", "rules"),
    [
        ('door_locked: latched and handle == "level"', "door_locked: {enter: latched}", []),
        ('latched and handle == "level"', "{enter: latched, leave: not latched}", []),
        ('latched and handle == "level"', "{enter: latched, confirm: 2 of 2}", []),
        ("monitor: [door_locked, people]", "monitor: [door_locked stays true, people]", []),
        (
            "monitor: [door_locked, people]",
            "monitor: [people becomes > 2 within 1 min, door_locked]",
            [],
        ),
        ("monitor: [door_locked, people]", "monitor: [door_gap becomes < 5 mm within 1 min]", []),
        ("monitor: [door_locked, people]", "monitor: ['door_state becomes \"open\" within 1 s']", []),
        ("door_locked: {type: bool}", "door_locked: {type: bool, refresh: on_event}", ["ineffective-on-event"]),
        ("    given: [robot_is_localized]\n", "    isolate: process\n", []),
        ("    given: [robot_is_localized]\n", "    isolate: thread\n", []),
    ],
)
def test_runtime_features_beyond_plain_results_cause_no_warnings(old: str, new: str, rules: list[str]) -> None:
    spec, diagnostics = check_text(edit_spec((old, new)))
    assert [finding.rule.name for finding in diagnostics] == rules
    assert spec is not None
