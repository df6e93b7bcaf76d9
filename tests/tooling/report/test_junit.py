"""Findings as a test report: by the rules of the common schema, and as `colcon test-result` counts it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from xml.etree import ElementTree

from hypothesis import given

from codra_dsl.language.diagnostics import Diagnostic, Place, Severity, Span
from codra_dsl.tooling.report.findings import render_concise, render_full
from codra_dsl.tooling.report.junit import render_junit
from tests.tooling.report.hostile import RULES, hostile_findings

UNKNOWN_KEY, _, UNREACHED = RULES
DOOR = "specs/door.yaml"
MONITER = Diagnostic(
    rule=UNKNOWN_KEY,
    message="unknown key 'moniter' in skill 'open_door'",
    place=Place(Span(DOOR, 5, 5, 5, 12)),
    help="did you mean 'monitor'?",
)
UNUSED = replace(MONITER, rule=UNREACHED, message="nothing needs 'door_locked'")

# The schema of the Apache Ant tasks by Windy Road: the attributes of an element that are required and optional, and
# its children in order.
REQUIRED = {
    "testsuite": {"name", "timestamp", "hostname", "tests", "failures", "errors", "time"},
    "testcase": {"name", "classname", "time"},
    "failure": {"type"},
}
OPTIONAL = {"testsuite": {"skipped"}, "failure": {"message"}}
CHILDREN = {"testsuite": r"properties( testcase)* system-out system-err", "testcase": r"(failure)?"}


def assert_by_the_schema(root: ElementTree.Element) -> None:
    assert root.tag == "testsuite"
    for element in root.iter():
        required, optional = REQUIRED.get(element.tag, set()), OPTIONAL.get(element.tag, set())
        assert required <= set(element.keys()) <= required | optional, element.tag
        assert re.fullmatch(CHILDREN.get(element.tag, ""), " ".join(child.tag for child in element)), element.tag
        assert re.fullmatch(r"\d+(\.\d+)?", element.get("time", "0"))
    assert root.get("name")
    assert root.get("hostname")
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d", root.get("timestamp", ""))
    assert root.get("tests") == str(len(root.findall("testcase")))
    assert root.get("failures") == str(len(root.findall("testcase/failure")))
    assert (root.get("errors"), root.get("skipped")) == ("0", "0")


def render_suite(
    diagnostics: Iterable[Diagnostic], files: Iterable[str] = (), failing: Iterable[Severity] = (Severity.ERROR,)
) -> ElementTree.Element:
    failing_severities = tuple(failing)
    text = render_junit(
        diagnostics,
        files,
        lambda _: None,
        is_failure=lambda diagnostic: diagnostic.severity in failing_severities,
        suite_name="codra.lint",
    )
    assert text.isascii()
    root = ElementTree.fromstring(text)
    assert_by_the_schema(root)
    return root


def verdicts(root: ElementTree.Element) -> list[tuple[str | None, bool]]:
    return [(test.get("name"), test.find("failure") is None) for test in root.findall("testcase")]


def test_a_clean_file_is_a_test_that_passes() -> None:
    assert verdicts(render_suite([], [DOOR])) == [(DOOR, True)]


def test_a_file_with_errors_is_one_failing_test_with_all_of_them() -> None:
    second = replace(MONITER, message="unknown key 'contxt'", place=Place(Span(DOOR, 9, 1, 9, 7)))

    root = render_suite([MONITER, second], [DOOR, "specs/lab.yaml"])

    assert verdicts(root) == [(DOOR, False), ("specs/lab.yaml", True)]
    failure = root.find("testcase/failure")
    assert failure is not None
    assert failure.get("type") == "CDR2003"
    assert failure.get("message") == "unknown key 'moniter' in skill 'open_door' (and 1 more)"
    assert failure.text == "\n" + render_full([MONITER, second], lambda _: None)


def test_an_included_file_has_a_test_if_it_has_findings() -> None:
    part = replace(MONITER, place=Place(Span("specs/parts/machine.yaml", 5, 5, 5, 12)))

    assert verdicts(render_suite([part], [])) == [("specs/parts/machine.yaml", False)]


def test_warnings_fail_no_test_and_are_in_the_output_of_the_suite() -> None:
    root = render_suite([UNUSED], [DOOR])

    assert verdicts(root) == [(DOOR, True)]
    assert root.findtext("system-out") == render_concise([UNUSED])


def test_warnings_fail_a_test_when_they_fail_the_command() -> None:
    root = render_suite([UNUSED], [DOOR], failing=Severity)

    assert verdicts(root) == [(DOOR, False)]
    assert root.findtext("system-out") == ""


def test_the_suite_and_the_class_of_its_tests_have_the_name_of_the_command() -> None:
    root = render_suite([], [DOOR])

    assert (root.get("name"), root[1].get("classname")) == ("codra.lint", "codra.lint")


@given(hostile_findings)
def test_no_text_of_a_spec_makes_invalid_xml(findings: list[Diagnostic]) -> None:
    root = render_suite(findings, [DOOR], failing=Severity)

    texts = "".join(root.itertext()) + "".join(value for element in root.iter() for value in element.attrib.values())
    assert texts.replace("\n", "").isprintable()
    assert len(root.findall("testcase/failure")) == len({finding.place.span.file for finding in findings})
    assert "".join(root.itertext()).count("[CDR") >= len(findings)
