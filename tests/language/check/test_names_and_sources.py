from __future__ import annotations

import pytest

from codra_dsl.language.check.index.spec_index import MAX_SUGGESTIONS
from tests.language.check.specs import DOOR, check_sound_text, check_text, edit_spec, finding_texts, findings


def test_an_undeclared_name_is_one_finding_with_all_its_mentions() -> None:
    text = edit_spec(
        ("given: [robot_is_localized]", "given: [robot_is_lost]"),
        (
            "observable_when: [robot_is_localized]",
            "observable_when: [robot_is_localized, robot_is_lost or not robot_is_lost]",
        ),
        ("preview: [door_state, door_gap]", "preview: [door_state, robot_is_lost]"),
    )
    (finding,) = findings(text)
    lines = [place.span.line for place in (finding.place, *(finding.place for finding in finding.related))]
    assert finding.rule.name == "unknown-variable"
    assert lines == sorted(lines)
    assert len(lines) == 4


RETURNED = "'angle', 'faces', 'handle', 'latched', 'markers', 'width'"


@pytest.mark.parametrize(
    ("old", "new", "help_text"),
    [
        ("given: [robot_is_localized]", "given: [camera_]", "declare 'camera_' under 'context'"),
        ("uses: {base: read}", "uses: {people: read}", "write the name of a resource"),
        (
            "uses: {base: read}",
            "uses: {peopl: read}",
            "write one of 'base', 'camera', 'vision', or declare 'peopl' under 'resources'",
        ),
        ("markers >= 2", "base >= 2", "write the name of a returned value"),
        ("markers >= 2", "door_gpa >= 2", f"write one of {RETURNED}, or declare 'door_gpa' under 'returns'"),
        ("markers >= 2", f"{'w' * 101} >= 2", f"write one of {RETURNED}, or declare '{'w' * 101}' under 'returns'"),
        ("preview: [door_state, door_gap]", "preview: [door_state, width_]", "declare 'width_' under 'context'"),
    ],
)
def test_only_names_of_the_right_kind_are_suggested(old: str, new: str, help_text: str) -> None:
    assert findings(edit_spec((old, new)))[0].help == help_text


def test_very_many_unknown_names_are_all_reported_but_not_all_compared() -> None:
    names = ", ".join(f"door_stat{index}" for index in range(MAX_SUGGESTIONS + 20))
    diagnostics = findings(edit_spec(("preview: [door_state, door_gap]", f"preview: [door_state, {names}]")))
    assert len(diagnostics) == MAX_SUGGESTIONS + 20
    assert len([finding for finding in diagnostics if finding.help.startswith("did you mean")]) <= MAX_SUGGESTIONS


def test_no_two_arguments_of_a_perception_function_have_one_name() -> None:
    assert finding_texts(edit_spec(("with: {gain: 3}", "with: {camera: 3, robot_is_localized: 2, vision: 1}"))) == [
        (
            "ambiguous-argument",
            "camera",
            "argument 'camera' of algorithm 'look_at_door' from 'uses' has the same name as an argument from 'with'",
            "rename one of the two",
        ),
        (
            "ambiguous-argument",
            "robot_is_localized",
            "argument 'robot_is_localized' of algorithm 'look_at_door' from 'given' has the same name as an "
            "argument from 'with'",
            "rename one of the two",
        ),
    ]


def test_an_argument_cannot_be_called_job() -> None:
    assert [finding.message for finding in findings(edit_spec(("gain: 3", "job: 3")))] == [
        "argument 'job' of algorithm 'look_at_door' from 'with' has the same name as the argument 'job', "
        "which every perception function gets"
    ]


def test_returned_values_may_be_named_like_context_variables() -> None:
    spec = check_sound_text(
        edit_spec(("faces: {type: int}", "people: {type: int}"), ("people: faces", "people: people"))
    )
    assert dict(spec.algorithms["look_at_door"].identifies)["people"].python == 'value("people")'


@pytest.mark.parametrize("source", ["observer", "[observer, main_execution]", "[page, observer]"])
def test_an_identified_variable_may_have_other_sources_beside_the_observer(source: str) -> None:
    page_edit = (
        "robot_is_localized: {type: bool, source: main_execution",
        "robot_is_localized: {type: bool, source: page",
    )
    people = ("people: {type: int, source: [observer, page]}", f"people: {{type: int, source: {source}}}")
    check_sound_text(edit_spec(page_edit, people))


def test_a_joined_tree_may_write_its_conditions_differently() -> None:
    lamp = "  look_at_lamp:\n    call: a.b:c\n    given: [robot_is_localized]\n    returns: {lit: {type: bool}}\n"
    lamp += "    observable_when: [(near_door)]\n    identifies: {lamp_on: lit}\n"
    text = edit_spec(
        ("resources:\n", "  lamp_on: {type: bool}\nresources:\n"),
        ("skills:\n", f"{lamp}skills:\n"),
        ("door_locked, people], period", "door_locked, people, lamp_on], period"),
    )
    check_sound_text(text)
    differing_text = edit_spec(("    given: [robot_is_localized]\n    returns: {lit", "    returns: {lit"), text=text)
    assert [finding.rule.name for finding in findings(differing_text)] == ["observer-mixes-trees"]


def test_a_tree_with_alternatives_cannot_be_joined() -> None:
    guess = (
        "  guess:\n    call: a.b:c\n    returns: {near: {type: bool}}\n    identifies: {near_door: near}\n    rank: 2\n"
    )
    text = edit_spec(
        ("  look_at_door:\n", f"{guess}  look_at_door:\n"),
        ("near_door: {type: bool, when_unobservable: forget}", "near_door: {type: bool, valid_for: 5 s}"),
        ("door_locked, people], period", "door_locked, people, near_door], period"),
    )
    (finding,) = findings(text)
    assert finding.message == (
        "observer 'door' joins algorithms 'look_at_door' and 'measure_distance', "
        "and 'measure_distance' has an alternative"
    )


@pytest.mark.parametrize(
    ("old", "new", "rules"),
    [
        (
            "door_locked, people], period: 2 s}",
            "door_locked], period: 2 s}\n  other: {identifies: [people]}",
            ["observer-splits-tree"],
        ),
        ("door_locked, people], period: 2 s}", "door_locked, peopel], period: 2 s}", ["unknown-variable"]),
        ("door_locked, people], period: 2 s}", "door_locked, people, near_dor], period: 2 s}", ["unknown-variable"]),
    ],
)
def test_a_tree_with_one_mistake_is_reported_once(old: str, new: str, rules: list[str]) -> None:
    assert [finding.rule.name for finding in findings(edit_spec((old, new)))] == rules


def test_observers_need_not_be_mentioned() -> None:
    check_sound_text(DOOR.partition("observers:")[0])


def test_three_alternatives_of_one_rank_are_one_finding() -> None:
    guess = "  guess{0}:\n    call: a.b:c\n    returns: {{near: {{type: bool}}}}\n    identifies: {{near_door: near}}\n"
    text = edit_spec(("  look_at_door:\n", f"{guess.format(1)}{guess.format(2)}  look_at_door:\n"))
    spec, diagnostics = check_text(text)
    assert spec is None
    assert [finding.message for finding in diagnostics if finding.rule.name == "same-rank"] == [
        "algorithms 'measure_distance' and 'guess1' and 'guess2' are alternatives for 'near_door' and share rank 1"
    ]
