"""Findings as a test report, for the CI systems that read JUnit's XML.

The report is one suite with one test for each file. The test fails if the file has a finding that counts as a failure.
So a file has the same test in every run, and a report is never empty. The suite itself is the root element: both the
common schema (the one of the Apache Ant tasks) and `colcon test-result` expect this.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from xml.etree import ElementTree

from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.tooling.report.findings import Sources, render_concise, render_full, visible_text

_COMMAND_START = re.compile(r"^(\s*):(?=:)", re.MULTILINE)
_FIXED_INSTANT = "1970-01-01T00:00:00"  # the schema requires an instant; equal findings must give equal bytes
_FIXED_HOST = "localhost"
_FIXED_TIME_S = "0"


def render_junit(
    diagnostics: Iterable[Diagnostic],
    files: Iterable[str],
    sources: Sources,
    *,
    is_failure: Callable[[Diagnostic], bool],
    suite_name: str,
) -> str:
    """Return findings as XML in ASCII.

    Args:
        diagnostics: the findings, in file order.
        files: the files that were examined, with or without findings.
        sources: returns the texts of files, for the lines that findings are about.
        is_failure: returns whether a finding fails the test of its file; other findings are in the suite's output.
        suite_name: the command that examined the files; the name of the suite and of the class of its tests.
    """
    findings = tuple(diagnostics)
    failures_by_file: dict[str, list[Diagnostic]] = {file: [] for file in files}
    for diagnostic in findings:
        failures_by_file.setdefault(diagnostic.place.span.file, []).extend(
            [diagnostic] if is_failure(diagnostic) else []
        )
    other_findings = [diagnostic for diagnostic in findings if not is_failure(diagnostic)]
    root = _suite_element(
        suite_name, test_count=len(failures_by_file), failure_count=sum(map(bool, failures_by_file.values()))
    )
    ElementTree.SubElement(root, "properties")
    for file, file_findings in sorted(failures_by_file.items()):
        _add_test(root, suite_name, file, file_findings, sources)
    ElementTree.SubElement(root, "system-out").text = render_concise(other_findings)
    ElementTree.SubElement(root, "system-err")
    ElementTree.indent(root)
    data: bytes = ElementTree.tostring(root, "us-ascii", xml_declaration=True)
    return _escape_commands(data.decode()) + "\n"


def _escape_commands(text: str) -> str:
    """Return equivalent XML without commands of GitHub's runner, which may read it in a log."""
    return _COMMAND_START.sub(r"\1&#58;", text.replace("##[", "##&#91;"))


def _suite_element(name: str, *, test_count: int, failure_count: int) -> ElementTree.Element:
    counts = {"tests": str(test_count), "failures": str(failure_count), "errors": "0", "skipped": "0"}
    fixed_attributes = {"time": _FIXED_TIME_S, "timestamp": _FIXED_INSTANT, "hostname": _FIXED_HOST}
    return ElementTree.Element("testsuite", {"name": name} | counts | fixed_attributes)


def _add_test(
    root: ElementTree.Element, suite_name: str, file: str, file_findings: Sequence[Diagnostic], sources: Sources
) -> None:
    attributes = {"classname": suite_name, "name": visible_text(file), "time": _FIXED_TIME_S}
    test = ElementTree.SubElement(root, "testcase", attributes)
    if file_findings:
        first_finding, other_count = file_findings[0], len(file_findings) - 1
        others_text = f" (and {other_count} more)" if other_count else ""
        attributes = {"type": first_finding.code, "message": f"{visible_text(first_finding.message)}{others_text}"}
        ElementTree.SubElement(test, "failure", attributes).text = f"\n{render_full(file_findings, sources)}"
