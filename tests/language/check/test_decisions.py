"""CDR7102, CDR7103, CDR7104, CDR7107 and CDR7110: variables that decisions need, and whether they can be observed."""

from __future__ import annotations

import pytest

from tests.language.check.specs import findings, marked_text

SPEC = """\
codra: 1
name: house
context:
  paged: {type: bool, source: page}
  payload: {type: float, unit: kg, source: main_execution}
  closed: {type: bool, valid_for: 20 s}
  near: {type: bool, when_unobservable: forget}
  loaded: {type: bool}
  state: {type: enum, values: [empty, half, full], valid_for: 20 s}
agents: {page: {}}
perception:
  look_at_lid:
    call: house.perception:look
    returns: {seen: {type: bool}}
    identifies: {closed: seen}
  come_near:
    call: house.perception:look
    returns: {seen: {type: bool}}
    observable_when: [not closed]
    identifies: {near: seen}
  look_inside:
    call: house.perception:look
    returns: {seen: {type: bool}}
    observable_when: [near]
    identifies: {loaded: seen}
  look_at_state:
    call: house.perception:look
    returns: {state: {type: enum, values: [empty, half, full]}}
    identifies: {state: state}
skills:
"""
USE_ALL = "  use_all: {preview: [closed, loaded, state]}\n"
CLOSE = "  close: {preview: [closed], monitor: [closed becomes true within 1 s]}\n"
START = "  start: {preview: [closed, loaded]}\n"
BOTH = CLOSE + START + "  rest: {monitor: [state, paged], preview: [payload]}\n"


def edit_spec(skills: str, *edits: tuple[str, str], more: str = "") -> str:
    text = SPEC
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text + skills + more


def rules_and_marked_texts(text: str, *rules: str) -> list[tuple[str, str]]:
    """Return the rule and the marked text of each finding of some rules, or of all rules."""
    return [
        (finding.rule.name, marked_text(text, finding))
        for finding in findings(text)
        if finding.rule.name in rules or not rules
    ]


def test_a_decision_that_only_an_agent_can_answer_is_reported_once_with_all_its_skills() -> None:
    text = edit_spec(
        USE_ALL + "  one: {preview: [paged], monitor: [payload becomes > 1 kg within 5 s]}\n  two: {preview: [paged]}\n"
    )
    (first, second) = (finding for finding in findings(text) if finding.rule.code in ("CDR7103", "CDR7104"))
    assert (marked_text(text, first), [related.message for related in first.related]) == (
        "paged",
        ["its source", "also in skill 'two'"],
    )
    assert (second.rule.name, marked_text(text, second)) == ("unwatched-monitor", "payload")


@pytest.mark.parametrize(
    ("skills", "old", "new"),
    [
        ("  one: {preview: [paged, payload]}\n", "source: page", "source: [page, main_execution]"),
        ("  one: {preview: [payload], monitor: [paged]}\n", "source: page", "source: page"),
        ("  one: {monitor: [paged, payload]}\n", "kg, source: main_execution", "kg, source: [main_execution, page]"),
    ],
)
def test_a_variable_that_can_be_observed_is_no_finding(skills: str, old: str, new: str) -> None:
    assert (
        rules_and_marked_texts(
            edit_spec(USE_ALL + skills, (old, new)), "decision-without-observer", "unwatched-monitor"
        )
        == []
    )


def test_an_unknown_source_silences_dependent_findings() -> None:
    text = edit_spec(USE_ALL + "  one: {preview: [paged], monitor: [payload]}\n", ("source: page", "source: pager"))
    assert [rule for rule, _ in rules_and_marked_texts(text)] == ["unknown-source", "unwatched-monitor"]


@pytest.mark.parametrize(
    "edits",
    [
        (),
        (
            (
                "near: {type: bool, when_unobservable: forget}",
                "near: {type: bool, when_unobservable: forget, valid_for: 5 min}",
            ),
        ),
        (("observable_when: [near]", "given: [near]"),),
        (("observable_when: [near]", "observable_when: [known(near)]"),),
        (("observable_when: [near]", "observable_when: [closed == false]"),),
        (("observable_when: [near]", "observable_when: [not known(closed)]"),),
        (("loaded: {type: bool}", "loaded: {type: bool, when_unobservable: forget}"),),
    ],
)
def test_variables_that_cannot_be_observed_after_a_skill_are_reported(edits: tuple[tuple[str, str], ...]) -> None:
    assert rules_and_marked_texts(edit_spec(BOTH, *edits), "excluded-preview") == [("excluded-preview", "loaded")]


@pytest.mark.parametrize(
    "edits",
    [
        (("near: {type: bool, when_unobservable: forget}", "near: {type: bool, valid_for: 5 min}"),),
        (
            (
                "near: {type: bool, when_unobservable: forget}",
                "near: {type: bool, when_unobservable: forget, valid_for: 5 min, source: [observer, page]}",
            ),
        ),
        (("loaded: {type: bool}", "loaded: {type: bool, source: [observer, main_execution]}"),),
        (("observable_when: [near]", "observable_when: [near or known(state)]"),),
        (("observable_when: [not closed]", "observable_when: [not closed or age(closed) < 15 s]"),),
        ((CLOSE.strip(), "close: {preview: [closed], monitor: [closed]}"),),
        ((CLOSE.strip(), "close: {preview: [closed, loaded], monitor: [closed becomes true within 1 s]}"),),
        ((START.strip(), "start: {preview: [loaded], monitor: [closed]}"),),
        ((START.strip(), "start: {preview: [closed, loaded], monitor: [closed becomes false within 1 s]}"),),
    ],
)
def test_variables_that_can_still_be_observed_or_known_are_no_finding(edits: tuple[tuple[str, str], ...]) -> None:
    text = edit_spec(BOTH)
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    assert rules_and_marked_texts(text) == []


def test_an_alternative_that_works_after_the_skill_takes_a_preview_out_of_the_exclusion() -> None:
    ask = "  ask:\n    call: a.b:c\n    returns: {seen: {type: bool}}\n    rank: 2\n    identifies: {loaded: seen}\n"
    assert rules_and_marked_texts(edit_spec(BOTH, ("skills:\n", f"{ask}skills:\n"))) == []


def test_the_skill_that_changes_the_variable_may_preview_the_other_one() -> None:
    skills = "  close: {preview: [closed, loaded], monitor: [closed becomes true within 1 s, state, paged]}\n"
    assert rules_and_marked_texts(edit_spec(skills + "  rest: {preview: [payload]}\n")) == []


@pytest.mark.parametrize(
    ("made", "asked", "expected"),
    [
        ('state becomes "full"', 'state != "full"', True),
        ('state becomes "full"', 'state in ("half", "full")', False),
        ('state becomes "empty"', 'state == "half" or closed and not closed', True),
    ],
)
def test_exclusion_compares_with_the_members_that_skills_set(made: str, asked: str, expected: bool) -> None:
    skills = f"  fill: {{monitor: ['{made} within 5 s']}}\n  start: {{preview: [state, loaded]}}\n"
    rest = "  rest: {preview: [payload, closed], monitor: [paged]}\n"
    text = edit_spec(skills + rest, ("observable_when: [near]", f"observable_when: ['{asked}', near]"))
    assert rules_and_marked_texts(text) == ([("excluded-preview", "loaded")] if expected else [])


def test_a_preview_is_excluded_only_if_every_resulting_value_excludes_it() -> None:
    asks = ("observable_when: [near]", "observable_when: ['state == \"half\"', near]")
    fill = "  fill: {monitor: ['state becomes \"full\" within 5 s']}\n"
    fill += "  drain: {monitor: ['state becomes \"WANTED\" within 5 s']}\n"
    rest = "  start: {preview: [state, loaded]}\n  rest: {preview: [payload, closed], monitor: [paged]}\n"
    assert rules_and_marked_texts(edit_spec(fill.replace("WANTED", "empty") + rest, asks)) == [
        ("excluded-preview", "loaded")
    ]
    assert rules_and_marked_texts(edit_spec(fill.replace("WANTED", "half") + rest, asks)) == []


def test_an_unneeded_observer_is_reported_instead_of_its_variables() -> None:
    skills = "  use: {preview: [loaded, payload], monitor: [paged]}\n"
    watch = "observers:\n  watch: {identifies: [state], period: 5 s}\n"
    assert rules_and_marked_texts(edit_spec(skills)) == [("unreached-variable", "state")]
    assert rules_and_marked_texts(edit_spec(skills, more=watch)) == [("unreached-observer", "watch")]
    assert rules_and_marked_texts(edit_spec(skills.replace("paged", "paged, state"), more=watch)) == []


def test_without_skills_every_observer_is_generated() -> None:
    watch = "observers:\n  watch: {identifies: [state], period: 5 s}\n"
    assert rules_and_marked_texts(edit_spec("", ("skills:\n", ""), more=watch)) == []


LOOPS = """\
metrics:
  comfort:
    rules: [if state is full and paged is true then high, if state is not full or paged is false then low]
adaptation:
  pace: {set: speed, value: 1 if comfort > 0.5 and near else 2}
loops:
  house: {analyse: [comfort], adapt: [pace]}
"""
SPEED = ("agents:", "  speed: {type: float, range: [0, 2], source: adaptation}\nagents:")


def test_variables_that_loops_read_are_needed_and_computed_ones_are_exempt() -> None:
    skills = "  use: {preview: [payload]}\n"
    assert rules_and_marked_texts(edit_spec(skills, SPEED, more=LOOPS), "unreached-variable") == [
        ("unreached-variable", "loaded")
    ]


def test_unreadable_rules_may_need_any_variable() -> None:
    text = edit_spec("  use: {preview: [payload]}\n", SPEED, more=LOOPS.replace("is full and", "is fool and"))
    assert rules_and_marked_texts(text, "unreached-variable") == []
