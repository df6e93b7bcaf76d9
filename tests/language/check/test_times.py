"""CDR7108 and CDR7109: evidence that is not renewed in time, and slots without enough time."""

from __future__ import annotations

import pytest

from tests.language.check.specs import findings, marked_text

SPEC = """\
codra: 1
name: watch
context:
  near: {type: bool, valid_for: 3 s}
  open: {type: bool, valid_for: 10 s}
  lit: {type: bool, valid_for: 10 s}
  steady: {type: bool}
resources:
  vision: {slots: 1}
perception:
  find:
    call: watch.perception:find
    uses: {vision: slot}
    timeout: 2 s
    returns: {found: {type: bool}}
    identifies: {near: found}
  look:
    call: watch.perception:look
    timeout: 1 s
    returns: {found: {type: bool}}
    observable_when: [lit]
    identifies: {open: found}
  feel:
    call: watch.perception:feel
    timeout: 1 s
    rank: 2
    returns: {found: {type: bool}}
    identifies: {open: found}
  see_light:
    call: watch.perception:see_light
    uses: {vision: slot}
    timeout: 2 s
    returns: {found: {type: bool}}
    identifies: {lit: found, steady: found}
skills:
  enter: {preview: [near]}
  open: {preview: [near, open]}
"""
LOOK = "    observable_when: [lit]\n"


def edit_spec(*edits: tuple[str, str]) -> str:
    text = SPEC
    for old, new in edits:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def finding_summaries(*edits: tuple[str, str]) -> list[tuple[str, str, str]]:
    """Return the rule, the marked text and the message of each finding."""
    text = edit_spec(*edits)
    return [(finding.rule.name, marked_text(text, finding), finding.message) for finding in findings(text)]


def rules(*edits: tuple[str, str]) -> list[str]:
    return [rule for rule, _, _ in finding_summaries(*edits)]


def test_evidence_that_is_renewed_just_in_time_is_no_finding() -> None:
    assert finding_summaries() == []


def test_a_value_that_becomes_stale_before_it_is_renewed_is_reported_with_both_durations() -> None:
    (finding,) = finding_summaries(("valid_for: 3 s", "valid_for: 2.9 s"))
    assert finding == (
        "stale-before-renewed",
        "2.9 s",
        "context-variable 'near' can become stale although everything works: its evidence can be up to 3 s old before "
        "newer evidence arrives, but is valid for 2.9 s",
    )


def test_results_that_are_too_old_when_the_last_confirming_one_arrives_are_reported() -> None:
    assert finding_summaries(("{near: found}", "{near: {enter: found, confirm: 2 of 3}}")) == []
    (finding,) = finding_summaries(("{near: found}", "{near: {enter: found, confirm: 3 of 3}}"))
    assert finding == (
        "stale-before-renewed",
        "3 s",
        "context-variable 'near' may never be confirmed although everything works: the first result that 'confirm' "
        "needs can be 4 s older than the last result, but is valid for 3 s",
    )


@pytest.mark.parametrize(("timeout", "key"), [("2 s", "timeout"), ("500 ms", "period")])
def test_the_help_for_results_that_are_too_old_names_the_duration_between_two_looks(timeout: str, key: str) -> None:
    text = edit_spec(("{near: found}", "{near: {enter: found, confirm: 9 of 9}}"), ("valid_for: 3 s", "valid_for: 4 s"))
    (finding,) = findings(text.replace("timeout: 2 s", f"timeout: {timeout}", 1))

    assert f"a shorter '{key}', or a 'confirm'" in finding.help


def test_a_result_that_expires_exactly_when_the_last_confirming_one_arrives_is_too_old() -> None:
    confirmed = ("{near: found}", "{near: {enter: found, confirm: 3 of 3}}")

    assert rules(confirmed, ("valid_for: 3 s", "valid_for: 4 s")) == ["stale-before-renewed"]
    assert rules(confirmed, ("valid_for: 3 s", "valid_for: 4.1 s")) == []


def test_on_event_together_with_a_periodic_variable_has_no_effect() -> None:
    edits = [("steady: {type: bool}", "steady: {type: bool, refresh: on_event}")]
    (finding,) = finding_summaries(*edits)
    assert finding == (
        "ineffective-on-event",
        "on_event",
        "'refresh: on_event' of 'steady' has no effect: algorithm 'see_light' also identifies 'lit', for which it "
        "looks periodically",
    )
    lit = ("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: 10 s, refresh: on_event}")
    assert finding_summaries(*edits, lit) == []
    assert (
        finding_summaries(
            ("near: {type: bool, valid_for: 3 s}", "near: {type: bool, valid_for: 3 s, refresh: on_event}")
        )
        == []
    )


@pytest.mark.parametrize(("min_interval", "key"), [("1.5 s", "min_interval"), ("500 ms", "period")])
def test_the_help_names_the_key_that_determines_the_pause(min_interval: str, key: str) -> None:
    edits = (("  find:\n", f"  find:\n    min_interval: {min_interval}\n"), ("valid_for: 3 s", "valid_for: 2 s"))
    (help_text,) = [item.help for item in findings(edit_spec(*edits)) if item.rule.name == "stale-before-renewed"]

    assert help_text == f"write a longer 'valid_for', or a shorter 'timeout' or '{key}'"


@pytest.mark.parametrize(
    ("edits", "expected"),
    [
        (
            [
                (
                    "    timeout: 2 s\n    returns: {found: {type: bool}}\n    identifies: {near",
                    "    timeout: 2.5 s\n    returns: {found: {type: bool}}\n    identifies: {near",
                )
            ],
            1,
        ),
        ([("  find:\n", "  find:\n    min_interval: 1.5 s\n")], 1),
        ([("  find:\n", "  find:\n    min_interval: 1 s\n")], 0),
        ([("skills:\n", "observers:\n  near_watch: {identifies: [near], period: 1.2 s}\nskills:\n")], 1),
        ([("skills:\n", "observers:\n  near_watch: {identifies: [near], period: 500 ms}\nskills:\n")], 0),
        ([("  feel:\n", "  feel:\n    min_interval: 1 min\n")], 1),
        (
            [
                (
                    "near: {type: bool, valid_for: 3 s}",
                    "near: {type: bool, valid_for: 1 s, source: [observer, main_execution]}",
                )
            ],
            1,
        ),
        ([("near: {type: bool, valid_for: 3 s}", "near: {type: bool, valid_for: forever}")], 0),
    ],
)
def test_the_slowest_renewal_counts(edits: list[tuple[str, str]], expected: int) -> None:
    assert rules(*edits).count("stale-before-renewed") == expected


def test_variables_that_are_unneeded_or_have_no_algorithm_are_not_reported_as_stale() -> None:
    assert rules(
        ("  enter: {preview: [near]}\n  open: {preview: [near, open]}", "  open: {preview: [open]}"), ("3 s", "1 s")
    ) == ["unreached-variable"]
    paged_edit = (
        "  near: {type: bool, valid_for: 3 s}\n",
        "  near: {type: bool, valid_for: 3 s}\n  paged: {type: bool, source: main_execution, valid_for: 1 s}\n",
    )
    assert rules(paged_edit, ("enter: {preview: [near]}", "enter: {preview: [near, paged]}")) == []


@pytest.mark.parametrize(
    ("condition", "offender"),
    [
        ("age(lit) < 2 s", "age(lit) < 2 s"),
        ("lit and 2999 ms >= age(lit)", "2999 ms >= age(lit)"),
        ("0 s < age(lit) < 2 s", "0 s < age(lit) < 2 s"),
        ("not (age(lit) > 2 s or known(near))", "age(lit) > 2 s or known(near)"),
    ],
)
def test_a_maximum_age_that_observers_cannot_guarantee_is_reported(condition: str, offender: str) -> None:
    (finding,) = finding_summaries((LOOK, f"    observable_when: ['{condition}']\n"))
    assert finding[0] == "stale-before-renewed"
    assert offender in finding[1]
    assert "evidence about 'lit' can be up to 3 s old" in finding[2]


@pytest.mark.parametrize(
    "edits",
    [
        [(LOOK, "    observable_when: [age(lit) < 3 s]\n")],
        [(LOOK, "    observable_when: [age(lit) > 2 s]\n")],
        [(LOOK, "    observable_when: [age(lit) < 2 s or lit]\n")],
        [
            (LOOK, "    observable_when: [age(lit) < 2 s]\n"),
            (
                "lit: {type: bool, valid_for: 10 s}",
                "lit: {type: bool, valid_for: 10 s, source: [observer, main_execution]}",
            ),
        ],
        [
            (LOOK, "    observable_when: [age(lit) < limit]\n"),
            ("context:\n", "context:\n  limit: {type: float, unit: s, source: main_execution, valid_for: 1 h}\n"),
        ],
    ],
)
def test_a_maximum_age_that_observers_may_guarantee_is_no_finding(edits: list[tuple[str, str]]) -> None:
    assert rules(*edits) == []


def test_a_skill_that_needs_too_much_time_of_a_slot_is_reported_at_the_resource() -> None:
    edits = [("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: 5 s}")]
    text = edit_spec(*edits)
    (finding,) = findings(text)
    assert (finding.rule.name, marked_text(text, finding)) == ("oversubscribed-slot", "vision")
    assert finding.message == (
        "resource 'vision' has 1 slot, but the observers of skill 'open' need 1.067: "
        "whatever the order of the looks, some value becomes stale"
    )
    assert [finding.message for finding in finding.related] == [
        "the skill that needs most",
        "algorithm 'find' takes a slot for up to 2 s in every 3 s",
        "algorithm 'see_light' takes a slot for up to 2 s in every 5 s",
    ]


@pytest.mark.parametrize(
    "edits",
    [
        [("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: 6 s}")],
        [("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: 5 s}"), ("{slots: 1}", "{slots: 2}")],
        [
            ("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: 5 s}"),
            ("  open: {preview: [near, open]}\n", "  open: {preview: [open]}\n"),
        ],
        [("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: forever}")],
    ],
)
def test_observers_that_fit_into_the_slots_are_no_finding(edits: list[tuple[str, str]]) -> None:
    assert rules(*edits) == []


def test_the_largest_share_of_alternatives_counts() -> None:
    slot = ("    call: watch.perception:look\n", "    call: watch.perception:look\n    uses: {vision: slot}\n")
    feel = ("    call: watch.perception:feel\n", "    call: watch.perception:feel\n    uses: {vision: slot}\n")
    assert rules(slot, feel) == []
    assert rules(slot, feel, ("open: {type: bool, valid_for: 10 s}", "open: {type: bool, valid_for: 5 s}")) == [
        "oversubscribed-slot"
    ]


def test_without_skills_all_observers_count() -> None:
    text = edit_spec(("lit: {type: bool, valid_for: 10 s}", "lit: {type: bool, valid_for: 5 s}"))
    (finding,) = findings(text.partition("skills:\n")[0])
    assert "but all observers together need 1.067" in finding.message
