"""Changes of knowledge and agents: single edits with the category, element and key of every change."""

from __future__ import annotations

from pathlib import Path

import pytest

from codra_dsl.compiler import plan_text
from codra_dsl.language.diagnostics import has_errors
from codra_dsl.tooling.diff import BrokenSpec, Level, Review, Version, review
from codra_dsl.tooling.diff.changes import Category
from tests.tooling.diff.versions import plan_version, review_edits

ROOT = Path(__file__).parents[3]
BASE = (ROOT / "tests/cases/valid/knowledge.yaml").read_text("utf-8")


def change_texts(diff_review: Review) -> list[str]:
    return sorted(
        f"{change.category} {change.element.removeprefix('picking_up/')} {change.key}" for change in diff_review.changes
    )


EDITS = [
    # Types
    ("    world: {}\n", "    world: {}\n    shelf: {source: fork}\n", ["added type/shelf "]),
    ("moving: {type: bool, valid_for: 1 s}", "", ["removed type/person attributes.moving"]),
    (
        "moving: {type: bool, valid_for: 1 s}",
        "moving: {type: int, valid_for: 1 s}",
        ["retyped type/person attributes.moving"],
    ),
    (
        "moving: {type: bool, valid_for: 1 s}",
        "moving: {type: bool}",
        ["weaker type/person attributes.moving.valid_for"],
    ),
    (
        "moving: {type: bool, valid_for: 1 s}",
        "moving: {type: bool, valid_for: 1 s, history: 5}",
        ["stronger type/person attributes.moving.history"],
    ),
    (
        "moving: {type: bool, valid_for: 1 s}",
        "moving: {type: bool, valid_for: 1 s}, name: {type: str}",
        ["added type/person attributes.name"],
    ),
    ("range: [0, 500]", "range: [0, 400]", ["narrowed type/roll_container attributes.weight"]),
    ("unit: kg, range: [0, 500]", "unit: g, range: [0, 500000]", ["retyped type/roll_container attributes.weight"]),
    ("range: [1, 12]", "range: [1, 20]", ["widened type/picking_area attributes.aisle"]),
    (
        "{type: bool, source: picker_page}",
        "{type: bool}",
        [
            "unwritable type/roll_container attributes.full.source",
            "widened type/roll_container attributes.full.source",
        ],
    ),
    (
        "{type: bool, source: picker_page}",
        "{type: bool, source: {picker_page: 2, fork: 1}}",
        ["widened type/roll_container attributes.full.source"],
    ),
    (
        "range: [0, 500], source: {fork: 2, container_detection: 1}",
        "range: [0, 500], source: {fork: 1, container_detection: 2}",
        ["redefined type/roll_container attributes.weight.source"],
    ),
    (
        "range: [0, 500], source: {fork: 2, container_detection: 1}",
        "range: [0, 500], source: {fork: 9, container_detection: 3}",
        [],
    ),
    ("label: Roll container", "label: Container", ["wording type/roll_container label"]),
    ("horizontal: 70 deg", "horizontal: 60 deg", ["redefined type/camera view"]),
    # Nodes
    ("    battery: battery\n", "    battery: battery\n    area_2: picking_area\n", ["added node/area_2 "]),
    ("with: {aisle: 3, ", "with: {aisle: 4, ", ["redefined node/area_1 with"]),
    ("label: Picking area 1", "label: Area 1", ["wording node/area_1 label"]),
    # Edges
    ("    has: {from: robot, to: [battery]}\n", "", ["removed edge/has "]),
    (
        "to: [roll_container, person], source",
        "to: [roll_container, person, battery], source",
        ["widened edge/close_to to"],
    ),
    ("to: [roll_container, person], source", "to: [roll_container], source", ["narrowed edge/close_to to"]),
    ("    at: {from: robot", "    at: {label: stands_at, from: robot", ["api edge/at label"]),
    ("extrapolate: 200 ms", "extrapolate: 300 ms", ["redefined edge/robot_pose motion"]),
    ("valid_for: 2 s, history", "valid_for: 1 s, history", ["stronger edge/robot_pose valid_for"]),
    ("z: 120 cm", "z: 130 cm", ["redefined edge/eye_pose pose"]),
    ("yaw: 180 deg", "yaw: 3.141592653589793 rad", []),
    (
        "    at: {from: robot, to: picking_area, source: navigation}",
        "    at: {from: robot, to: picking_area, source: picking}",
        [
            "unwritable edge/at source",
            "widened edge/at source",
        ],
    ),
    # Tasks
    ("results: [there, blocked]", "results: [there, blocked, late]", ["widened task/navigating results"]),
    ("results: [there, blocked]", "results: [there]", ["narrowed task/navigating results"]),
    ("requesters: [picking, main_execution]", "requesters: [picking]", ["unwritable task/navigating requesters"]),
    ("finish: 10 s", "finish: 5 s", ["stronger task/detecting finish"]),
    ("finish: 10 s", "finish: 1 min", ["slower task/detecting finish"]),
    (
        "finish: 3 min, results: [done",
        "acknowledge: 1 s, finish: 3 min, results: [done",
        ["stronger task/picking_up acknowledge"],
    ),
    # Agents
    (
        "  person_detection: {phase: monitor}",
        "  person_detection: {phase: analyse}",
        ["redefined agent/person_detection phase"],
    ),
    ("  picker_page: {}", "  picker_page: {reads: [roll_container.weight]}", []),
    (", battery_level < 10 percent]", "]", ["guard-changed agent/navigation wakes"]),
    (
        "battery_level < 10 percent]",
        "battery_level < 10 percent, robot -at-> some picking_area]",
        ["widened agent/navigation wakes"],
    ),
    ("label: The fork", "label: A fork", ["wording agent/fork label"]),
    (", not some person -near-> robot]", "]", ["weaker agent/container_detection rules.detect.before"]),
    (
        "not some person -near-> robot]",
        "not  some  person  -near->  robot, robot -at-> some picking_area]",
        ["stronger agent/container_detection rules.detect.before"],
    ),
    ("'person_distance > 1 m'", "'person_distance > 2 m'", ["stronger agent/container_detection rules.detect.during"]),
    ("'person_distance > 1 m'", "'person_distance > 50 cm'", ["weaker agent/container_detection rules.detect.during"]),
    ("'person_distance > 1 m'", "'person_distance > 100 cm'", []),
]


@pytest.mark.parametrize(("old", "new", "expected"), EDITS)
def test_an_edit_has_exactly_the_expected_changes(old: str, new: str, expected: list[str]) -> None:
    assert change_texts(review_edits(BASE, (old, new))) == expected


def test_a_changed_pose_is_shown_as_specs_write_it() -> None:
    (change,) = review_edits(BASE, ("z: 120 cm, yaw: 180 deg", "z: 130 cm, yaw: 0 deg")).changes

    texts = ["{x: 0.3 m, z: 1.2 m, yaw: 3.141592654 rad}", "{x: 0.3 m, z: 1.3 m}"]
    assert [change.old_text, change.new_text] == texts


def test_equal_specs_have_no_difference() -> None:
    assert change_texts(review_edits(BASE)) == []


def test_removed_and_added_rules_are_reported_by_name() -> None:
    result = review_edits(BASE, ("      lift:\n", "      raise_it:\n"))

    assert change_texts(result) == ["added agent/picking rules.raise_it", "removed agent/picking rules.lift"]


def test_with_knowledge_a_variable_at_another_node_is_a_change_of_the_api() -> None:
    result = review_edits(BASE, ("container_load: {of: robot", "container_load: {of: battery"))

    assert change_texts(result) == ["api context/container_load of"]


def test_an_agent_that_owns_a_variable_is_a_new_writer() -> None:
    result = review_edits(BASE, ("picking:\n    phase: plan", "picking:\n    phase: plan\n    owns: [container_load]"))

    assert change_texts(result) == ["widened context/container_load owns"]


def test_the_first_node_of_a_spec_is_added() -> None:
    plain = "codra: 1\nname: plain\ncontext: {lit: {type: bool, source: lamp}}\nagents: {lamp: {}}\n"
    knowing = plain + "knowledge: {nodes: {room: room}}\n"

    assert change_texts(review(plan_version(plain), plan_version(knowing))) == ["added plain/node/room "]
    assert change_texts(review(plan_version(knowing), plan_version(plain))) == ["removed plain/node/room "]


def test_an_error_in_knowledge_is_reported_at_its_element() -> None:
    text = BASE.replace("by: container_detection", "by: container_detectoin")
    findings = plan_text(text, "spec.yaml", ROOT / "tests").diagnostics
    broken_spec = BrokenSpec(
        name="picking_up", file="spec.yaml", errors=tuple(error for error in findings if has_errors([error]))
    )

    result = review(plan_version(BASE), Version(broken_specs=(broken_spec,)))

    assert change_texts(result) == ["invalid task/detecting "]


def test_a_change_has_the_place_where_it_was_made() -> None:
    (change,) = review_edits(BASE, ("results: [there, blocked]", "results: [there]")).changes

    assert change.level is Level.BREAKING
    assert change.text == "has lost results: was there, blocked, is there"
    assert change.old_place is not None
    assert change.old_place.span.line == BASE[: BASE.index("results: [there")].count("\n") + 1


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("default: 0.9 m", "default: 80 cm", ["stronger bay/perception/look_at_left observable_when"]),
        ("default: 0.9 m", "default: 90 cm", []),
        ("reach: 0.5 m", "reach: 0.6 m", ["weaker bay/perception/look_at_right observable_when"]),
        ("distance(robot, $(instance)) < $(reach)", "not $(reach) <= distance(robot, $(instance))", []),
    ],
)
def test_conditions_on_poses_are_compared_by_meaning(old: str, new: str, expected: list[str]) -> None:
    base = (ROOT / "tests/cases/valid/poses.yaml").read_text("utf-8")
    assert base.count(old) == 1
    result = review(plan_version(base), plan_version(base.replace(old, new)))
    assert change_texts(result) == expected


def test_a_longer_validity_of_a_pose_is_weaker() -> None:
    (change,) = review_edits(BASE, ("valid_for: 2 s, history", "valid_for: forever, history")).changes
    assert (change.category, change.key, change.old_text, change.new_text) == (
        Category.WEAKER,
        "valid_for",
        "2 s",
        "forever",
    )


def test_a_change_of_an_entry_names_the_entry() -> None:
    (change,) = review_edits(BASE, ("range: [0, 500]", "range: [0, 400]")).changes

    assert change.text.startswith("attributes.weight: has lost values: was float in kg from 0 to 500, is")
    assert change.old_place is not None
    assert BASE.splitlines()[change.old_place.span.line - 1][change.old_place.span.column - 1 :].startswith("weight")
