"""Findings as SARIF: valid against the standard's schema, within GitHub's limits, and identified as lines move."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest
from hypothesis import given
from jsonschema_rs import Draft4Validator

from codra_dsl import __version__
from codra_dsl.language.diagnostics import Applicability, Diagnostic, Edit, Fix, Place, Related, Rule, Severity, Span
from codra_dsl.tooling.report import sarif
from codra_dsl.tooling.report.explain import as_text, page_of
from codra_dsl.tooling.report.sarif import render_sarif
from tests.tooling.report.hostile import CASES, RULES, findings_about, findings_of, hostile_findings

UNKNOWN_KEY, CYCLE, UNREACHED = RULES
DOOR = "specs/door.yaml"
INSERTED = "# a line more\n" * 50


def finding(rule: Rule = UNKNOWN_KEY, line: int = 5, **values: Any) -> Diagnostic:
    place = Place(Span(DOOR, line, 5, line, 12))
    return replace(Diagnostic(rule=rule, message="unknown key 'moniter'", place=place), **values)


@cache
def schema() -> Draft4Validator:
    path = Path(__file__).parents[2] / "data" / "sarif-2.1.0.json"
    standard = json.loads(path.read_text("utf-8"))
    for element in ("run", "toolComponent"):  # one bracket too many, which most dialects reject
        del standard["definitions"][element]["properties"]["language"]["pattern"]
    return Draft4Validator(standard)


def valid_run(diagnostics: Iterable[Diagnostic], folder: str = "") -> dict[str, Any]:
    text = render_sarif(diagnostics, folder)
    assert text.isascii()
    log = json.loads(text)
    assert [error.message for error in schema().iter_errors(log)] == []
    (run,) = log["runs"]
    return dict(run)


def fingerprints(diagnostics: Iterable[Diagnostic]) -> list[str]:
    return [result["partialFingerprints"]["codraFinding/v1"] for result in valid_run(diagnostics)["results"]]


def test_the_schema_refuses_documents_that_are_not_sarif() -> None:
    log = json.loads(render_sarif([finding()]))
    log["runs"][0]["results"][0]["locations"][0]["physicalLocation"]["region"]["startColumn"] = 0

    assert not schema().is_valid(log)


def test_a_run_without_findings_is_successful() -> None:
    run = valid_run([])

    assert run["results"] == []
    assert run["invocations"] == [{"executionSuccessful": True}]
    assert run["tool"]["driver"] == {"name": "codra", "version": __version__, "rules": []}


def test_a_result_has_place_element_level_and_help() -> None:
    run = valid_run([finding(path="skills.open_door.moniter", help="did you mean 'monitor'?")])

    (result,) = run["results"]
    assert run["columnKind"] == "unicodeCodePoints"
    assert (result["ruleId"], result["ruleIndex"], result["level"]) == ("CDR2003", 0, "error")
    assert result["message"]["text"] == "unknown key 'moniter'. Help: did you mean 'monitor'?"
    assert result["locations"] == [
        {
            "physicalLocation": {
                "artifactLocation": {"uri": DOOR, "uriBaseId": "%SRCROOT%"},
                "region": {"startLine": 5, "startColumn": 5, "endLine": 5, "endColumn": 12},
            },
            "logicalLocations": [{"fullyQualifiedName": "skills.open_door.moniter"}],
        }
    ]


def test_a_warning_is_a_warning() -> None:
    run = valid_run([finding(UNREACHED)])

    assert run["results"][0]["level"] == "warning"
    assert run["tool"]["driver"]["rules"][0]["defaultConfiguration"] == {"level": "warning"}


def test_only_broken_rules_are_described_without_duplicates() -> None:
    run = valid_run([finding(UNREACHED), finding(UNKNOWN_KEY), finding(UNREACHED, line=9)])

    rules = run["tool"]["driver"]["rules"]
    assert [rule["id"] for rule in rules] == ["CDR2003", "CDR7102"]
    assert [rules[result["ruleIndex"]]["id"] for result in run["results"]] == ["CDR7102", "CDR2003", "CDR7102"]
    assert all(rule["shortDescription"]["text"] and rule["help"]["text"] for rule in rules)


def test_a_rule_is_described_by_its_page() -> None:
    page = page_of("CDR2003")
    assert page is not None

    (rule,) = valid_run([finding()])["tool"]["driver"]["rules"]

    assert rule["help"] == {"text": as_text(page), "markdown": page.markdown}
    assert rule["shortDescription"]["text"].rstrip(".") == page.summary.replace("`", "").rstrip(".")
    assert rule["properties"] == {"tags": ["shape"]}


def test_a_rule_without_a_page_is_described_by_its_name() -> None:
    unheard_of = Rule(code="CDR9001", name="no-red-doors", severity=Severity.ERROR)

    (rule,) = valid_run([finding(unheard_of)])["tool"]["driver"]["rules"]

    assert rule["shortDescription"] == rule["help"] == {"text": "No red doors."}


def test_other_places_are_linked_from_the_message() -> None:
    related = (Related("first declared here", Place(Span(DOOR, 3, 1, 3, 7))),)

    (result,) = valid_run([finding(related=related)])["results"]

    assert result["message"]["text"].endswith("See: [first declared here](1).")
    assert [
        (place["id"], place["physicalLocation"]["region"]["startLine"]) for place in result["relatedLocations"]
    ] == [(1, 3)]


def test_the_use_of_a_template_is_a_related_place() -> None:
    place = Place(Span("parts/machine.yaml", 5, 5, 5, 12), use=Span("lab.yaml", 27, 3, 27, 13))

    (result,) = valid_run([finding(place=place)])["results"]

    (used,) = result["relatedLocations"]
    assert used["physicalLocation"]["artifactLocation"]["uri"] == "lab.yaml"
    assert used["message"] == {"text": "used here."}


def test_a_cycle_is_a_code_flow_edge_by_edge() -> None:
    (case,) = (case for case in CASES if case.stem == "cycle-of-two")

    (result,) = (result for result in valid_run(findings_of(case))["results"] if result["ruleId"] == "CDR5101")

    ((flow,),) = (flow["threadFlows"] for flow in result["codeFlows"])
    steps = [step["location"] for step in flow["locations"]]
    assert [step["message"]["text"][:13] for step in steps] == ["'a' needs 'b'", "'b' needs 'a'"]
    assert [step["physicalLocation"]["region"]["startLine"] for step in steps] == [10, 15]


def test_a_finding_in_another_use_of_a_template_is_no_edge_of_a_cycle() -> None:
    span, uses = Span("machine.yaml", 5, 5, 5, 12), [Span("lab.yaml", line, 3, line, 9) for line in (27, 28)]
    edge = Related("'a' needs 'a'", Place(span, uses[0]))
    other = Related("in another use: it waits for itself", Place(span, uses[1]))

    (result,) = valid_run([finding(CYCLE, place=Place(span, uses[0]), related=(edge, other))])["results"]

    ((step,),) = (flow["locations"] for flow in result["codeFlows"][0]["threadFlows"])
    assert step["location"]["message"]["text"] == "'a' needs 'a'."


def test_a_fix_has_deletions_and_insertions_file_by_file() -> None:
    edits = (
        Edit(Span(DOOR, 5, 5, 5, 12), "monitor"),
        Edit(Span("specs/part.yaml", 2, 1, 2, 1), "codra: 1\n"),
        Edit(Span(DOOR, 9, 1, 10, 1), ""),
    )
    fix = Fix(message="Replace 'moniter' by 'monitor'", edits=edits, applicability=Applicability.SAFE)

    (result,) = valid_run([finding(fix=fix)])["results"]

    (fix_object,) = result["fixes"]
    assert fix_object["description"] == {"text": "Replace 'moniter' by 'monitor'."}
    changes = [
        (
            change["artifactLocation"]["uri"],
            [replacement["insertedContent"]["text"] for replacement in change["replacements"]],
        )
        for change in fix_object["artifactChanges"]
    ]
    assert changes == [(DOOR, ["monitor", ""]), ("specs/part.yaml", ["codra: 1\n"])]
    assert fix_object["artifactChanges"][0]["replacements"][0]["deletedRegion"] == {
        "startLine": 5,
        "startColumn": 5,
        "endLine": 5,
        "endColumn": 12,
    }


@pytest.mark.parametrize(
    ("file", "uri"),
    [
        ("specs/my door.yaml", "specs/my%20door.yaml"),
        ("a:b/c%d#e?.yaml", "a%3Ab/c%25d%23e%3F.yaml"),
        ("戸.yaml", "%E6%88%B8.yaml"),
        ("not-utf8-\udcff.yaml", "not-utf8-%FF.yaml"),
    ],
)
def test_files_are_relative_references_with_escaped_characters(file: str, uri: str) -> None:
    (result,) = valid_run([finding(place=Place(Span(file, 1, 1, 1, 2)))])["results"]

    assert result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == uri


def test_files_of_a_project_within_a_repository_are_relative_to_the_repository() -> None:
    (result,) = valid_run([finding()], "robots/lab")["results"]

    assert result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == f"robots/lab/{DOOR}"


# Fingerprints


def test_equal_findings_in_one_file_are_numbered_and_keep_their_numbers() -> None:
    first, second = (finding(line=line) for line in (5, 9))
    moved = [finding(line=line) for line in (55, 59)]

    assert fingerprints([first, second]) == fingerprints(moved)
    assert fingerprints([first, second]) == [f"{first.fingerprint}:1", f"{first.fingerprint}:2"]


def with_lines_above(text: bytes) -> bytes:
    """Return a file with 50 lines inserted after its byte order mark, in its encoding."""
    marks = {b"\xef\xbb\xbf": "utf-8", b"\xff\xfe": "utf-16-le", b"": "utf-8"}
    mark = next(mark for mark in marks if text.startswith(mark))
    return mark + INSERTED.encode(marks[mark]) + text[len(mark) :]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_fingerprints_are_the_same_when_50_lines_are_inserted_above(case: Path, tmp_path: Path) -> None:
    before = fingerprints(findings_of(case))
    copy = tmp_path / case.name
    if case.is_dir():
        shutil.copytree(case, copy)
    else:
        shutil.copy(case, copy)
    for file in copy.rglob("*.yaml") if copy.is_dir() else [copy]:
        file.write_bytes(with_lines_above(file.read_bytes()))

    moved = findings_about(copy / "spec.yaml", copy) if case.is_dir() else findings_about(copy, tmp_path)

    assert fingerprints(moved) == before
    assert len(before) == len(set(before))


# Limits


def test_beyond_the_limit_of_github_warnings_are_dropped_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sarif, "MAX_RESULTS", 2)

    run = valid_run([finding(UNREACHED), finding(line=6), finding(UNREACHED, line=7), finding(line=8)])

    assert [result["ruleId"] for result in run["results"]] == ["CDR2003", "CDR2003"]
    (notification,) = run["invocations"][0]["toolExecutionNotifications"]
    assert notification["message"]["text"].startswith("2 findings are left out")


def test_no_result_has_more_places_than_github_accepts() -> None:
    related = tuple(Related("here", Place(Span(DOOR, line, 1, line, 2))) for line in range(1, 12_000))

    (result,) = valid_run([finding(CYCLE, related=related)])["results"]

    assert len(result["relatedLocations"]) == sarif.MAX_RELATED_LOCATIONS
    assert len(result["codeFlows"][0]["threadFlows"][0]["locations"]) == sarif.MAX_FLOW_STEPS


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_the_findings_about_an_invalid_spec_are_valid_sarif(case: Path) -> None:
    findings = findings_of(case)

    run = valid_run(findings)

    assert len(run["results"]) == len(findings)


@given(hostile_findings)
def test_no_text_of_a_spec_makes_invalid_sarif(findings: list[Diagnostic]) -> None:
    run = valid_run(findings)

    assert len(run["results"]) == len(findings)
    for finding, result in zip(findings, run["results"], strict=True):
        message = result["message"]["text"]
        links = re.findall(r"(?<!\\)(?:\\\\)*\]\(([^)]*)\)", message)
        assert links == [str(number) for number in range(1, len(links) + 1)]
        assert message.isprintable()
        uri = result["locations"][0]["physicalLocation"]["artifactLocation"]["uri"]
        assert re.fullmatch(r"[A-Za-z0-9_.~/%-]+", uri)
        if finding.place.span.file.isprintable():
            assert unquote(uri) == finding.place.span.file
