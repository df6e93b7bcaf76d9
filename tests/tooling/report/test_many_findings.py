"""Reports show a limited number of findings of each rule in each file, and the number of the others."""

from __future__ import annotations

import json
from dataclasses import replace
from xml.etree import ElementTree

import pytest

from codra_dsl.language.diagnostics import Applicability, Diagnostic, Edit, Fix, Place, Rule, Severity, Span, has_errors
from codra_dsl.tooling.report.findings import MAX_SHOWN, render_concise, render_full, render_json, shown_findings
from codra_dsl.tooling.report.github import render_github, render_summary
from codra_dsl.tooling.report.junit import render_junit
from codra_dsl.tooling.report.sarif import render_sarif

UNKNOWN_KEY = Rule(code="CDR2003", name="unknown-key", severity=Severity.ERROR)
UNUSED = Rule(code="CDR7102", name="unreached-variable", severity=Severity.WARNING)
REST = "and 2,907 more findings of this rule in this file"


def findings(count: int, rule: Rule = UNKNOWN_KEY, file: str = "door.yaml") -> tuple[Diagnostic, ...]:
    spans = (Span(file, line, 3, line, 9) for line in range(1, count + 1))
    return tuple(
        Diagnostic(rule=rule, message=f"number {span.line}", place=Place(span), path=f"context.v{span.line}", help="x")
        for span in spans
    )


MANY = findings(MAX_SHOWN + 2907)


def no_source(_: str) -> None:
    return None


def junit(diagnostics: tuple[Diagnostic, ...]) -> str:
    return render_junit(diagnostics, ["door.yaml"], no_source, is_failure=lambda _: True, suite_name="codra.lint")


@pytest.mark.parametrize(
    "text",
    [
        render_full(MANY, no_source),
        render_concise(MANY),
        render_json(MANY),
        render_sarif(MANY),
        render_github(MANY),
        render_summary(MANY, "codra lint"),
        junit(MANY),
    ],
    ids=["full", "concise", "json", "sarif", "github", "summary", "junit"],
)
def test_every_format_states_how_many_findings_are_not_shown(text: str) -> None:
    assert text.count(REST) == 1
    assert f"number {MAX_SHOWN}" in text
    assert f"number {MAX_SHOWN + 1}" not in text


def test_the_number_of_the_others_is_at_the_place_of_the_first_of_them_and_has_their_severity() -> None:
    *_, rest = shown_findings(MANY)

    assert (rest.code, rest.severity, rest.message) == ("CDR2003", Severity.ERROR, REST)
    assert rest.place == MANY[MAX_SHOWN].place
    assert (rest.path, rest.help, rest.related, rest.fix, rest.use_findings) == ("", "", (), None, ())


def test_findings_of_other_rules_and_other_files_are_shown_completely() -> None:
    others = (*findings(MAX_SHOWN, UNUSED), *findings(MAX_SHOWN, file="part.yaml"))

    shown = shown_findings((*MANY, *others))

    assert len(shown) == MAX_SHOWN + 1 + len(others)
    assert shown[-len(others) :] == others


def test_at_the_limit_every_finding_is_shown() -> None:
    assert shown_findings(MANY[:MAX_SHOWN]) == MANY[:MAX_SHOWN]
    assert shown_findings(MANY[: MAX_SHOWN + 1])[-1].message == "and 1 more finding of this rule in this file"


def test_an_error_after_many_warnings_is_shown() -> None:
    level = replace(findings(1, UNUSED)[0], level=Severity.WARNING)
    warnings = (level,) * (MAX_SHOWN + 5)

    assert has_errors(shown_findings((*warnings, *findings(1))))


def test_a_finding_that_stands_for_others_has_no_fix_of_its_own() -> None:
    span = Span("door.yaml", 1, 1, 1, 2)
    fix = Fix(message="Remove it", edits=(Edit(span, ""),), applicability=Applicability.SAFE)
    fixable = tuple(replace(finding, fix=fix) for finding in MANY[: MAX_SHOWN + 5])

    objects = [json.loads(line) for line in render_json(fixable).splitlines()]

    assert [item["fix"] is None for item in objects] == [False] * MAX_SHOWN + [True]


def test_a_test_report_counts_the_findings_that_it_does_not_show() -> None:
    failure = ElementTree.fromstring(junit(MANY)).find("testcase/failure")

    assert failure is not None
    assert failure.get("message") == f"number 1 (and {len(MANY) - 1} more)"


def test_the_notice_on_github_counts_the_findings_that_the_log_does_not_show() -> None:
    assert f"{len(MANY) - 10} more errors" in render_github(MANY)
