from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.language.check import RULES, check
from codra_dsl.language.diagnostics import Severity, in_file_order
from codra_dsl.language.load import load_text
from tests.language.check.specs import DOOR, HERE, check_sound_text, check_text, edit_spec, findings

CASES = Path(__file__).parents[2] / "cases"
WORDS = sorted(set(re.findall(r"[A-Za-z_]\w*|\d+", DOOR)))


def rule_names(text: str) -> list[str]:
    return [finding.rule.name for finding in findings(text)]


def test_a_spec_without_faults_is_checked_without_findings() -> None:
    spec = check_sound_text(DOOR)
    assert list(spec.variables) == [variable.name for variable in spec.spec.context]
    assert list(spec.algorithms) == ["measure_distance", "look_at_door"]


def test_a_spec_with_an_error_is_not_returned() -> None:
    spec, diagnostics = check_text(edit_spec(("markers >= 2", "markers >= 2 m")))
    assert spec is None
    assert [finding.severity for finding in diagnostics] == [Severity.ERROR]


def test_a_spec_with_only_warnings_is_returned() -> None:
    spec, diagnostics = check_text(edit_spec(("resources:\n", "resources:\n  spare: {}\n")))
    assert spec is not None
    assert [finding.severity for finding in diagnostics] == [Severity.WARNING]


def test_a_spec_that_was_read_only_partly_is_not_returned_even_without_other_errors() -> None:
    spec, diagnostics = load_text(edit_spec(("preview:", "previw:")), "spec.yaml", HERE)
    assert len(diagnostics) == 1
    assert spec is not None
    assert check(spec) == (None, ())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("  near_door: {type: bool, ", "  near_door: {type: boolean, "),
        ("  vision: {slots: 1}", "  vision: {slots: none}"),
        ("      - markers >= 2", "      - markers => 2"),
        ("      - near_door\n", "      - near_door = true\n"),
        ("      door_gap: width", "      door_gap: width and"),
        ("    preview: [door_state, door_gap]", "    preview: door_state, door_gap"),
        ("  page: {}", "  page: 3"),
        ("source: [observer, page]", "source: [observer, 7]"),
        ("values: [up, level]", "values: [up, $(level)]"),
        ("call: house.perception:look_at_door", "call: house.perception.look_at_door"),
        ("      angle: {type: float, unit: rad,", "      angle: {type: float, unit: radiant,"),
        ("door: {identifies: [door_state,", "door: {identifes: [door_state,"),
    ],
)
def test_an_unreadable_key_silences_dependent_findings(old: str, new: str) -> None:
    spec, diagnostics = load_text(edit_spec((old, new)), "spec.yaml", HERE)
    assert len(diagnostics) == 1
    assert spec is not None
    assert check(spec)[1] == ()


@pytest.mark.parametrize(
    ("damage", "mistake", "rule"),
    [
        (("gain: 3", "gain: 3 parsecs"), ("camera: read", "camera: command"), "commanded-resource"),
        (
            ("call: house.perception:look_at_door", "call: look"),
            ("markers >= 2", "marker >= 2"),
            "unknown-returned-value",
        ),
        (("unit: rad, opt", "unit: radiant, opt"), ("markers >= 2", "markers >= 2 m"), "missing-unit"),
        (
            ("door_gap: width", "door_gap: width and"),
            ("  door_locked: {type", "  lid: {type: int}\n  door_locked: {type"),
            "unidentified-variable",
        ),
        (
            ("door_locked: {type: bool}", "door_locked: {type: bol}"),
            ("[door_locked, people]", "[door_loked, people]"),
            "unknown-variable",
        ),
        (("vision: {slots: 1}", "vision: {slots: none}"), ("camera: read", "camera: slot"), "misused-resource"),
        (
            ("near_door: {type: bool, when", "near_door: {type: boolean, when"),
            (", when_unobservable: forget", ""),
            "unnoticed-precondition",
        ),
        (
            ("period: 2 s", "period: 2"),
            ("[door_state, door_gap, door_locked, people]", "[door_state]"),
            "observer-splits-tree",
        ),
        (("changes: [door_state]", "changes: [5]"), ("preview: [door_state", "preview: [camera"), "wrong-kind-of-name"),
    ],
)
def test_a_damaged_key_does_not_silence_the_rest_of_its_element_and_others(
    damage: tuple[str, str], mistake: tuple[str, str], rule: str
) -> None:
    spec, diagnostics = load_text(edit_spec(damage, mistake), "spec.yaml", HERE)
    assert len(diagnostics) == 1
    assert spec is not None
    checked_spec, check_findings = check(spec)
    assert checked_spec is None
    assert [finding.rule.name for finding in check_findings] == [rule]


@pytest.mark.parametrize(
    ("edits", "rules"),
    [
        ([("near_door: {type: bool, when", "near_dor: {type: bool, when")], ["unknown-variable"]),
        ([("robot_is_localized: {type", "robot_is_localised: {type")], ["unknown-variable"]),
        ([("door_locked: {type: bool}", "door_loked: {type: bool}")], ["unknown-variable"]),
        ([("identifies: {near_door: distance", "identifies: {near_dor: distance")], ["unknown-variable"]),
        ([("monitor: [door_locked, people]", "monitor: [door_loked, people]")], ["unknown-variable"]),
        ([("  vision: {slots: 1}", "  visions: {slots: 1}")], ["unknown-resource"]),
        ([("      markers: {type: int", "      marker: {type: int")], ["unknown-returned-value"]),
        ([("  page: {}", "  pages: {}")], ["unknown-source"]),
        ([("values: [open, closed, ajar]", "values: [opened, closed, ajar]")], ["unknown-member"]),
        ([("door_gap: {type: float, unit: cm", "door_gap: {type: float, unit: s")], ["mismatched-units"]),
    ],
)
def test_one_wrong_declaration_gives_one_finding(edits: list[tuple[str, str]], rules: list[str]) -> None:
    assert rule_names(edit_spec(*edits)) == rules


def test_unrelated_mistakes_are_all_reported_in_file_order() -> None:
    text = edit_spec(
        ("people: {type: int, source: [observer, page]}", "people: {type: int, source: [observer, pgae]}"),
        ("uses: {base: read}", "uses: {base: command}"),
        ("      markers: {type: int, range: [0, 12]}", "      markers: {type: int, range: [0, 1.5]}"),
        ("      - markers >= 2", "      - markers >= 2 m"),
        ("door_gap: width", "door_gap: latched"),
        ("preview: [door_state, door_gap]", "preview: [door_state, camera]"),
    )
    diagnostics = findings(text)
    expected = ["unknown-source", "commanded-resource", "wrong-range", "missing-unit", "wrong-value-identified"]
    assert [finding.rule.name for finding in diagnostics] == [*expected, "wrong-kind-of-name"]
    assert diagnostics == in_file_order(diagnostics)


def test_a_mistake_in_a_template_is_one_finding_that_names_every_use() -> None:
    spec, diagnostics = load_text((CASES / "invalid/mistake-in-a-template.yaml").read_text("utf-8"), "spec.yaml", HERE)
    assert spec is not None
    assert diagnostics == ()
    for finding in check(spec)[1]:
        uses = {place.use.line for place in (finding.place, *(other.place for other in finding.related)) if place.use}
        assert len(uses) == 2


def test_twelve_unrelated_mistakes_are_twelve_findings() -> None:
    text = (CASES / "invalid/twelve-mistakes.yaml").read_text("utf-8")
    spec, diagnostics = load_text(text, "spec.yaml", HERE)
    assert spec is not None
    all_findings = in_file_order((*diagnostics, *check(spec)[1]))
    assert len(all_findings) == 12
    assert len({finding.place.span.line for finding in all_findings}) == 12


def test_every_finding_has_a_help_and_a_path_that_names_its_element() -> None:
    for case in sorted((CASES / "invalid").glob("*.yaml")):
        spec, _ = load_text(case.read_bytes(), case.name, case.parent)
        for finding in check(spec)[1] if spec is not None else ():
            section, name, *_ = finding.path.split(".")
            assert finding.help
            assert section in (
                "context",
                "perception",
                "skills",
                "observers",
                "resources",
                "agents",
                "templates",
                "knowledge",
                "metrics",
                "actions",
                "adaptation",
                "trees",
                "loops",
            )
            assert name


def test_codes_and_names_of_rules_are_unique() -> None:
    assert len({rule.code for rule in RULES.values()}) == len(RULES)
    assert all(re.fullmatch(r"CDR[34578]1\d\d", rule.code) for rule in RULES.values())


def test_every_rule_has_a_case() -> None:
    all_cases_text = "".join(path.read_text("utf-8") for path in sorted((CASES / "invalid").glob("*.txt")))
    assert [rule.code for rule in RULES.values() if f"[{rule.code}]" not in all_cases_text] == []


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(0, 200), st.sampled_from([*WORDS, "", "known", "3 m", "not"])), max_size=3))
def test_a_spec_with_exchanged_words_is_checked_without_an_exception(exchanges: list[tuple[int, str]]) -> None:
    text = DOOR
    for index, word in exchanges:
        places = [*re.finditer(r"[A-Za-z_]\w*|\d+", text)]
        place = places[index % len(places)]
        text = text[: place.start()] + word + text[place.end() :]
    spec, _ = load_text(text, "spec.yaml", HERE)
    lines = text.splitlines()
    for finding in check(spec)[1] if spec is not None else ():
        span = finding.place.span
        assert 1 <= span.line <= len(lines)
        assert 1 <= span.column <= len(lines[span.line - 1]) + 1


def test_decisions_are_what_skills_preview_and_monitor_in_order() -> None:
    assert check_sound_text(DOOR).decisions == ("door_state", "door_gap", "door_locked", "people")


def test_without_skills_every_variable_with_an_algorithm_is_decided_on() -> None:
    head, skills, observers = DOOR.partition("skills:\n")[0], "", "observers:" + DOOR.partition("observers:")[2]
    spec = check_sound_text(head + skills + observers)
    assert spec.decisions == ("near_door", "door_state", "door_gap", "door_locked", "people")


def test_conditions_are_lowered_with_the_names_that_they_read() -> None:
    algorithm = check_sound_text(DOOR).algorithms["look_at_door"]
    assert [(condition.text, condition.python, condition.variables) for condition in algorithm.observable_when] == [
        ("near_door", 'value("near_door")', ("near_door",))
    ]
    identified_conditions = dict(algorithm.identifies)
    assert identified_conditions["door_gap"].python == 'value("width") * 0.1'
    assert identified_conditions["door_locked"].python == 'value("latched") & (value("handle") == "level")'
    assert identified_conditions["door_locked"].variables == ("handle", "latched")
    assert (
        identified_conditions["door_state"].text == "open: angle > 1 rad; ajar: angle > 5 deg; closed: angle <= 5 deg"
    )
    assert identified_conditions["door_state"].python == (
        'first_of(("open", value("angle") > 1), ("ajar", value("angle") > 0.08726646259971647), '
        '("closed", value("angle") <= 0.08726646259971647))'
    )
    assert algorithm.needs == ("near_door", "robot_is_localized")


def test_enter_and_leave_are_lowered_to_between() -> None:
    spec, _ = check_text(
        edit_spec(
            ('latched and handle == "level"', "{enter: latched, leave: markers == 0}"),
            ("      people: faces", "      people: faces if markers > 1 else 0"),
        )
    )
    assert spec is not None
    identified_conditions = dict(spec.algorithms["look_at_door"].identifies)
    assert identified_conditions["door_locked"].python == 'between(value("latched"), value("markers") == 0)'
    assert identified_conditions["door_locked"].variables == ("latched", "markers")
    assert identified_conditions["people"].python == 'choose(value("faces"), value("markers") > 1, 0)'


def test_producers_are_listed_by_rank() -> None:
    text = (CASES / "valid/trees.yaml").read_text("utf-8")
    assert check_sound_text(text).producers["door_open"] == ("look_at_door", "feel_the_door")
    only_open_text = edit_spec(("{door_open: seen, door_locked: locked}", "{door_open: seen}\n    rank: 3"), text=text)
    text_without_lock = edit_spec(
        ("identifies: [door_locked, door_open]", "identifies: [door_open]"), text=only_open_text
    )
    spec, _ = check_text(
        text_without_lock.replace("  door_locked: {type: bool}\n", "").replace("    changes: [door_locked]\n", "")
    )
    assert spec is not None
    assert spec.producers["door_open"] == ("feel_the_door", "look_at_door")
