"""Findings in the forms for people, editors and tools."""

from __future__ import annotations

import json
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Applicability, Diagnostic, Edit, Fix, Place, Related, Rule, Severity, Span
from codra_dsl.tooling.report.findings import COLOURED, render_concise, render_full, render_json, visible_text
from tests.tooling.report.hostile import hostile_findings

UNKNOWN_KEY = Rule(code="CDR2003", name="unknown-key", severity=Severity.ERROR)
UNUSED = Rule(code="CDR7102", name="unreached-variable", severity=Severity.WARNING)

DOOR = """\
codra: 1
name: door
skills:
  open_door:
    moniter: [door_open]
"""


def span(
    line: int, column: int, end_column: int, *, file: str = "specs/door.yaml", end_line: int | None = None
) -> Span:
    return Span(file, line, column, line if end_line is None else end_line, end_column)


MONITER = Diagnostic(
    rule=UNKNOWN_KEY,
    message="unknown key 'moniter' in skill 'open_door'",
    place=Place(span(5, 5, 12)),
    path="skills.open_door.moniter",
    help="did you mean 'monitor'?",
)


def full_lines(finding: Diagnostic, text: str) -> list[str]:
    return render_full([finding], lambda _: text).splitlines()


def test_a_finding_shows_its_line_with_a_caret_and_the_help() -> None:
    assert render_full([MONITER], lambda _: DOOR) == (
        "specs/door.yaml:5:5: error[CDR2003]: unknown key 'moniter' in skill 'open_door'\n"
        "  |\n"
        "5 |     moniter: [door_open]\n"
        "  |     ^^^^^^^ help: did you mean 'monitor'?\n"
    )


def test_findings_are_separated_by_an_empty_line() -> None:
    text = render_full([MONITER, MONITER], lambda _: DOOR)

    assert text == "\n".join([render_full([MONITER], lambda _: DOOR)] * 2)


def test_the_margin_grows_with_the_line_number() -> None:
    finding = replace(MONITER, place=Place(span(12, 1, 4)))

    assert full_lines(finding, "\n" * 11 + "key: x")[1:] == [
        "   |",
        "12 | key: x",
        "   | ^^^ help: did you mean 'monitor'?",
    ]


def test_a_caret_is_below_the_text_after_a_tab() -> None:
    finding = replace(MONITER, place=Place(span(1, 5, 7)), help="")

    assert full_lines(finding, "a:\t\tbc")[2:] == ["1 | a:        bc", "  |           ^^"]


def test_a_caret_counts_wide_letters_twice_and_combining_ones_not_at_all() -> None:
    finding = replace(MONITER, place=Place(span(1, 5, 7)), help="")

    assert full_lines(finding, "戸e\u0301 開く")[2:] == ["1 | 戸e\u0301 開く", "  |     ^^^^"]


def test_a_finding_of_several_lines_is_marked_to_the_end_of_the_first() -> None:
    finding = replace(MONITER, place=Place(span(1, 4, 3, end_line=2)), help="")

    assert full_lines(finding, "a: [b,\n  c]")[2:] == ["1 | a: [b,", "  |    ^^^"]


def test_a_place_after_the_last_letter_still_has_a_caret() -> None:
    finding = replace(MONITER, place=Place(span(1, 3, 3)), help="")

    assert full_lines(finding, "a:")[2:] == ["1 | a:", "  |   ^"]


def test_a_long_line_is_cut_around_the_error() -> None:
    finding = replace(MONITER, place=Place(span(1, 501, 504)), help="")

    _, _, line, caret = full_lines(finding, "x" * 500 + "bad" + "y" * 500)

    assert len(line) < 220
    assert line[caret.index("^") : caret.rindex("^") + 1] == "bad"
    assert line.endswith("...")


@given(st.text(), st.text(min_size=1), st.text())
def test_the_caret_covers_exactly_the_marked_letters(before: str, marked: str, after: str) -> None:
    line = f"{before}{marked}{after}".replace("\n", " ").replace("\r", " ")
    finding = replace(MONITER, place=Place(span(1, len(before) + 1, len(before) + len(marked) + 1)), help="")

    shown = render_full([finding], lambda _: line).split("\n")

    assert shown[2].startswith("1 |")
    assert set(shown[3]) <= set("| ^")
    assert shown[3].count("^") >= 1


def test_without_its_source_a_finding_still_shows_the_help() -> None:
    assert render_full([MONITER], lambda _: None) == (
        "specs/door.yaml:5:5: error[CDR2003]: unknown key 'moniter' in skill 'open_door'\n"
        "  help: did you mean 'monitor'?\n"
    )


def test_other_places_and_the_uses_of_templates_are_named() -> None:
    use = span(27, 3, 13, file="specs/lab.yaml")
    declared = Related("first declared here", Place(span(3, 1, 7)))
    finding = replace(MONITER, place=Place(span(5, 5, 12), use=use), related=(declared,))

    assert full_lines(finding, DOOR)[4:] == [
        "  = specs/lab.yaml:27:3: used here",
        "  = specs/door.yaml:3:1: first declared here",
    ]


def test_a_finding_in_one_line() -> None:
    warning = replace(MONITER, rule=UNUSED, help="")

    assert render_concise([MONITER, warning]) == (
        "specs/door.yaml:5:5: error[CDR2003]: unknown key 'moniter' in skill 'open_door' (did you mean 'monitor'?)\n"
        "specs/door.yaml:5:5: warning[CDR7102]: unknown key 'moniter' in skill 'open_door'\n"
    )


def test_a_finding_as_json_has_all_keys() -> None:
    finding = replace(MONITER, related=(Related("first declared here", Place(span(3, 1, 7))),))

    (line,) = render_json([finding]).splitlines()

    assert json.loads(line) == {
        "code": "CDR2003",
        "name": "unknown-key",
        "severity": "error",
        "message": "unknown key 'moniter' in skill 'open_door'",
        "file": "specs/door.yaml",
        "line": 5,
        "column": 5,
        "end_line": 5,
        "end_column": 12,
        "path": "skills.open_door.moniter",
        "help": "did you mean 'monitor'?",
        "related": [
            {
                "message": "first declared here",
                "file": "specs/door.yaml",
                "line": 3,
                "column": 1,
                "end_line": 3,
                "end_column": 7,
            }
        ],
        "fix": None,
        "fingerprint": finding.fingerprint,
    }


def test_a_fix_as_json_has_its_edits_with_their_ranges() -> None:
    edit = Edit(MONITER.place.span, "monitor")
    fix = Fix(message="Replace 'moniter' by 'monitor'", edits=(edit,), applicability=Applicability.SAFE)

    (line,) = render_json([replace(MONITER, fix=fix)]).splitlines()

    place = {"file": "specs/door.yaml", "line": 5, "column": 5, "end_line": 5, "end_column": 12}
    assert json.loads(line)["fix"] == {
        "message": "Replace 'moniter' by 'monitor'",
        "applicability": "safe",
        "edits": [{**place, "text": "monitor"}],
    }


@given(hostile_findings)
def test_every_finding_is_one_line_of_json_that_every_parser_accepts(findings: list[Diagnostic]) -> None:
    lines = render_json(findings).split("\n")[:-1]

    assert len(lines) == len(findings)
    for line, finding in zip(lines, findings, strict=True):
        assert line.isascii()
        message = json.loads(line)["message"]
        assert message == finding.message.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def test_a_line_names_the_use_that_gives_a_finding_in_a_templates_text() -> None:
    uses = [Place(MONITER.place.span, span(line, 3, 6, file="specs/a.yaml")) for line in (8, 9, 10)]
    use_findings = tuple(replace(MONITER, place=place) for place in uses)

    one, several = render_concise([use_findings[1], replace(use_findings[0], use_findings=use_findings)]).splitlines()

    assert one.endswith(" (did you mean 'monitor'?; used at specs/a.yaml:9:3)")
    assert several.endswith(" (did you mean 'monitor'?; used at specs/a.yaml:8:3 and 2 more)")


def test_no_two_findings_have_the_same_fingerprint() -> None:
    """Two mentions of one unknown name differ, and so do the findings in one template that two specs use."""
    again = replace(MONITER, place=Place(Span("specs/door.yaml", 9, 5, 9, 12)))
    in_template = [replace(MONITER, place=Place(MONITER.place.span, Span(f, 3, 3, 3, 6))) for f in ("a.yaml", "b.yaml")]

    objects = [json.loads(line) for line in render_json([MONITER, again, *in_template]).splitlines()]

    assert len({finding["fingerprint"] for finding in objects}) == 4
    assert objects[1]["fingerprint"] == f"{MONITER.fingerprint}:2"


def test_a_fingerprint_is_the_same_when_lines_move() -> None:
    moved = replace(MONITER, place=Place(span(105, 5, 12)))

    assert json.loads(render_json([moved]))["fingerprint"] == json.loads(render_json([MONITER]))["fingerprint"]


def test_colours_mark_severity_and_keep_all_characters() -> None:
    coloured = render_full([MONITER], lambda _: DOOR, COLOURED)

    assert "\x1b[1;31merror[CDR2003]\x1b[0m" in coloured
    plain = coloured
    for colour in ("\x1b[1;31m", "\x1b[1m", "\x1b[34m", "\x1b[36m", "\x1b[0m"):
        plain = plain.replace(colour, "")
    assert plain == render_full([MONITER], lambda _: DOOR)


@given(st.text())
def test_text_of_a_spec_cannot_control_a_terminal(text: str) -> None:
    finding = replace(MONITER, message=text, help=text, place=Place(span(1, 1, 2, file=text)))

    for shown in (render_full([finding], lambda _: text.replace("\n", " ")), render_concise([finding])):
        assert all(letter.isprintable() for letter in shown.replace("\n", ""))
    assert all(letter.isprintable() for letter in visible_text(text))
