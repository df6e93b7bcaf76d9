"""Findings in GitHub Actions, read back as its runner reads a log: commands first, everything else as text."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given

from codra_dsl.language.diagnostics import Diagnostic, Place, Related, Span, in_file_order
from codra_dsl.tooling.report import github
from codra_dsl.tooling.report.findings import render_concise, render_full, render_json, visible_text
from codra_dsl.tooling.report.github import escape_commands, render_github, render_summary
from codra_dsl.tooling.report.junit import render_junit
from codra_dsl.tooling.report.sarif import render_sarif
from tests.tooling.report.hostile import RULES, hostile_findings
from tests.tooling.report.runner import read

UNKNOWN_KEY, _, UNREACHED = RULES
MONITER = Diagnostic(
    rule=UNKNOWN_KEY,
    message="unknown key 'moniter' in skill 'open_door'",
    place=Place(Span("specs/door.yaml", 5, 5, 5, 12)),
    help="did you mean 'monitor'?",
)
CONCISE = render_concise([MONITER])


def test_a_finding_is_an_annotation_and_a_line_of_the_log() -> None:
    assert render_github([MONITER]) == (
        "::error file=specs/door.yaml,line=5,endLine=5,col=5,endColumn=12,title=CDR2003 unknown-key"
        "::unknown key 'moniter' in skill 'open_door'%0Ahelp: did you mean 'monitor'?\n"
        f"{CONCISE}"
    )


def test_without_findings_the_output_is_empty() -> None:
    assert (render_github([]), render_summary([], "codra lint")) == ("", "")


def test_percent_signs_colons_and_commas_are_escaped_where_they_have_a_meaning() -> None:
    finding = replace(MONITER, message="50% :: a, b", help="", place=Place(Span("a:b,c%0A.yaml", 1, 1, 1, 2)))

    annotation, _, _ = render_github([finding]).partition("\n")

    assert annotation == (
        "::error file=a%3Ab%2Cc%250A.yaml,line=1,endLine=1,col=1,endColumn=2,title=CDR2003 unknown-key::50%25 :: a, b"
    )


def test_other_places_are_in_the_annotation() -> None:
    finding = replace(MONITER, related=(Related("first declared here", Place(Span("specs/part.yaml", 3, 1, 3, 7))),))

    (command,), _ = read(render_github([finding]))

    assert command.message.split("\n")[2:] == ["specs/part.yaml:3:1: first declared here"]


def test_a_finding_of_several_lines_has_no_columns() -> None:
    """GitHub rejects them: columns refer to a single line."""
    finding = replace(MONITER, place=Place(Span("specs/door.yaml", 5, 5, 7, 2)))

    (command,), _ = read(render_github([finding]))

    assert command.properties == {
        "file": "specs/door.yaml",
        "line": "5",
        "endLine": "7",
        "title": "CDR2003 unknown-key",
    }


def test_findings_about_standard_input_have_no_file() -> None:
    (command,), _ = read(render_github([replace(MONITER, place=Place(Span("-", 5, 5, 5, 12)))]))

    assert command.properties == {"title": "CDR2003 unknown-key"}


def test_files_of_a_project_within_a_repository_are_annotated_with_their_paths_in_the_repository() -> None:
    (command,), lines = read(render_github([MONITER], "robots/lab"))

    assert command.properties["file"] == "robots/lab/specs/door.yaml"
    assert lines[0].startswith("specs/door.yaml:5:5:")


def test_errors_come_first_and_one_annotation_has_the_number_of_the_rest() -> None:
    warnings = [replace(MONITER, rule=UNREACHED, place=Place(Span("a.yaml", line, 1, line, 2))) for line in range(11)]
    errors = [replace(MONITER, place=Place(Span("b.yaml", line, 1, line, 2))) for line in range(13)]

    commands, lines = read(render_github([*warnings, *errors]))

    assert [command.name for command in commands] == ["error"] * 10 + ["warning"] * 10 + ["notice"]
    assert commands[-1].message == "3 more errors and 1 more warning: see the log or the summary of this step"
    assert "\n".join(lines) == render_concise([*warnings, *errors])


def test_a_file_whose_name_is_a_command_is_shown_as_a_file() -> None:
    finding = replace(MONITER, place=Place(Span("::set-env name=x::y.yaml", 1, 1, 1, 2)))

    _, lines = read(render_github([finding]))

    assert lines[0].startswith("./::set-env name=x::y.yaml:1:1: error[CDR2003]")


@given(hostile_findings)
def test_no_text_of_a_spec_is_a_command(findings: list[Diagnostic]) -> None:
    commands, lines = read(render_github(findings))

    assert [command.name for command in commands] == sorted(finding.severity.value for finding in findings)
    assert len(lines) == len(findings) + 1
    assert all(line.isprintable() for line in lines)


@given(hostile_findings)
def test_no_other_format_has_a_command_in_the_log(findings: list[Diagnostic]) -> None:
    forms = [
        escape_commands(render_full(findings, lambda _: "::error::x ##[error]x")),
        escape_commands(render_concise(findings)),
        render_json(findings),
        render_sarif(findings),
        render_junit(findings, [], lambda _: "##[error]x", is_failure=lambda _: True, suite_name="codra.lint"),
    ]

    assert [read(text)[0] for text in forms] == [[]] * len(forms)


@given(hostile_findings)
def test_an_annotation_has_the_message_of_the_finding(findings: list[Diagnostic]) -> None:
    commands, _ = read(render_github(findings))

    sorted_findings = sorted(findings, key=lambda finding: finding.severity.value)
    for command, finding in zip(commands, sorted_findings, strict=True):
        assert command.message.split("\n")[0] == visible_text(finding.message)
        assert command.properties.keys() <= {"file", "line", "endLine", "col", "endColumn", "title"}
        assert command.properties["title"] == f"{finding.code} {finding.rule.name}"
        if finding.place.span.file != "-":
            assert command.properties["file"].strip() == visible_text(finding.place.span.file).strip().lstrip("=")


# The summary of the step


def cells(row: str) -> list[str]:
    return re.split(r"(?<!\\)\|", row)


def test_the_summary_is_a_table_of_all_findings() -> None:
    assert render_summary([MONITER], "codra lint: 1 error") == (
        "\n### codra lint\\: 1 error\n\n"
        "| place | finding | message |\n"
        "| --- | --- | --- |\n"
        "| specs/door.yaml:5:5 | error CDR2003 | unknown key 'moniter' in skill 'open\\_door' "
        "*(did you mean 'monitor'?)* |\n"
    )


@given(hostile_findings.filter(bool))
def test_no_text_of_a_spec_is_markup_in_the_summary(findings: list[Diagnostic]) -> None:
    findings = list(in_file_order(findings))

    rows = render_summary(findings, "codra lint").split("\n")[5:-1]

    assert len(rows) == len(findings)
    for row, finding in zip(rows, findings, strict=True):
        plain = row.replace("\\\\", "")  # a visible backslash
        assert len(cells(plain)) == 5
        assert re.findall(r"(?<!\\)[`<>\[\]#!~&$@]", plain) == []
        assert len(re.findall(r"(?<!\\)\*", plain)) == (2 if finding.help or finding.place.use else 0)


def test_a_summary_is_below_the_limit_of_github(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(github, "MAX_SUMMARY_BYTES", 300)

    text = render_summary([MONITER] * 9, "codra lint")

    assert text.count("specs/door.yaml") == 2
    assert text.endswith("\nand 7 more: see the log\n")
