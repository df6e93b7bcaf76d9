from __future__ import annotations

import pytest

from tests.check.specs import DOOR, checked, edited, findings, sound, told

KEPT = "near_door: {type: bool, when_unobservable: keep}"
FORGET = "near_door: {type: bool, when_unobservable: forget}"
NEAR = "      - near_door\n"
UNGUARDED = ("    observable_when: [robot_is_localized]\n", "")


def unnoticed(*edits: tuple[str, str]) -> list[str]:
    return [found.path for found in findings(edited(*edits)) if found.rule.name == "unnoticed-precondition"]


@pytest.mark.parametrize(
    "edits",
    [
        [(FORGET, "near_door: {type: bool, valid_for: 5 s}")],
        [(FORGET, "near_door: {type: bool, valid_for: forever}")],
        [(FORGET, "near_door: {type: bool, valid_for: 5 s}"), UNGUARDED],
        [(FORGET, KEPT), (NEAR, "      - near_door and age(near_door) < 10 s\n")],
        [(FORGET, KEPT), (NEAR, "      - near_door\n      - 10 s >= age(near_door)\n")],
        [(FORGET, KEPT), (NEAR, "      - known(near_door)\n")],
        [(FORGET, KEPT), (NEAR, "      - not known(near_door) or age(near_door) > 10 s\n")],
        [(FORGET, KEPT), ("    observable_when:\n      - near_door\n", "")],
    ],
)
def test_what_goes_stale_by_itself_or_is_not_trusted_is_no_finding(edits: list[tuple[str, str]]) -> None:
    assert unnoticed(*edits) == []


@pytest.mark.parametrize(
    "edits",
    [
        [(FORGET, KEPT)],
        [(FORGET, "near_door: {type: bool}")],
        [UNGUARDED],
        [(FORGET, "near_door: {type: bool, when_unobservable: forget, source: [observer, page]}")],
        [(FORGET, KEPT), (NEAR, "      - near_door and age(near_door) > 10 s\n")],
        [(FORGET, KEPT), (NEAR, "      - near_door or age(near_door) < 10 s\n")],
        [(FORGET, KEPT), (NEAR, "      - known(near_door) and near_door\n")],
        [(FORGET, KEPT), (NEAR, "      - not near_door\n")],
    ],
)
def test_what_would_stay_true_unnoticed_is_found(edits: list[tuple[str, str]]) -> None:
    assert unnoticed(*edits) == ["context.near_door"]


def test_the_source_outside_of_observers_must_say_how_long_it_stands() -> None:
    assert told(edited(("source: main_execution, valid_for: forever", "source: main_execution"))) == [
        (
            "unnoticed-precondition",
            "robot_is_localized",
            "context-variable 'robot_is_localized' is a precondition and would stay true unnoticed: "
            "it has a source other than observers",
            "state 'valid_for', be it 'valid_for: forever'",
        )
    ]


def test_forgetting_is_offered_only_where_it_would_help() -> None:
    guarded, unguarded = findings(edited((FORGET, KEPT))), findings(edited((FORGET, KEPT), UNGUARDED))
    assert guarded[0].help.endswith("or 'when_unobservable: forget'")
    assert unguarded[0].help == "state 'valid_for', be it 'valid_for: forever'"


def test_a_condition_that_is_wrong_itself_trusts_nothing() -> None:
    assert unnoticed((FORGET, KEPT), (NEAR, "      - near_door > 3\n")) == []


def test_an_alternative_without_preconditions_keeps_a_variable_from_being_forgotten() -> None:
    guess = (
        "  guess:\n    call: a.b:c\n    returns: {near: {type: bool}}\n    identifies: {near_door: near}\n    rank: 2\n"
    )
    assert unnoticed(("  look_at_door:\n", f"{guess}  look_at_door:\n")) == ["context.near_door"]


def test_what_is_identified_beside_something_wanted_is_reached() -> None:
    assert findings(edited(("    monitor: [door_locked, people]\n", ""))) == ()


def test_what_a_joined_tree_identifies_is_reached() -> None:
    lamp = "  look_at_lamp:\n    call: a.b:c\n    given: [robot_is_localized]\n    returns: {lit: {type: bool}}\n"
    lamp += "    observable_when: [near_door]\n    identifies: {lamp_on: lit}\n"
    text = edited(("resources:\n", "  lamp_on: {type: bool}\nresources:\n"), ("skills:\n", f"{lamp}skills:\n"))
    assert [found.path for found in findings(text)] == ["context.lamp_on"]
    sound(
        edited(
            ("[door_state, door_gap, door_locked, people]", "[door_state, door_gap, door_locked, people, lamp_on]"),
            text=text,
        )
    )


def test_what_is_read_only_as_feedback_is_reached() -> None:
    preview = (
        "    preview: [door_state, door_gap]\n    monitor: [door_locked, people]\n",
        "    preview: [near_door]\n",
    )
    text = edited(
        preview, ("observable_when: [robot_is_localized]", "observable_when: [robot_is_localized, not known(people)]")
    )
    assert findings(text) == ()


def test_changes_alone_reach_nothing() -> None:
    preview = ("    preview: [door_state, door_gap]\n    monitor: [door_locked, people]\n", "")
    assert {found.rule.name for found in findings(edited(preview))} == {"unreached-variable", "unreached-observer"}


def test_without_skills_nothing_is_unreached() -> None:
    head, observers = DOOR.partition("skills:\n")[0], "observers:" + DOOR.partition("observers:")[2]
    assert findings(head + observers) == ()
    assert findings(head.replace("resources:", "  told: {type: bool, source: page}\nresources:") + observers) == ()


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
def test_what_the_runtime_does_beyond_a_plain_result_is_nothing_to_warn_of(
    old: str, new: str, rules: list[str]
) -> None:
    spec, found = checked(edited((old, new)))
    assert [each.rule.name for each in found] == rules
    assert spec is not None
