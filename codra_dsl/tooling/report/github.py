"""Findings for GitHub Actions: annotations, the log, and the summary of the step.

GitHub shows ten errors and ten warnings of a step and silently drops the rest. Therefore only the most severe findings
become annotations, and one more annotation states the number of the others. The log shows the findings as every
report does. The summary shows those that fit into its maximum size.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from codra_dsl.language.diagnostics import Diagnostic, Severity, Span
from codra_dsl.tooling.report.findings import (
    as_markdown,
    help_text,
    related_places,
    render_concise,
    shown_findings,
    span_text,
    visible_text,
)

MAX_ANNOTATIONS = 10
"""The number of annotations of one severity that GitHub shows for a step."""
MAX_SUMMARY_BYTES = 512 * 1024
"""The maximum size of findings in the summary of a step. GitHub rejects a summary of more than 1 MiB."""

_COMMAND_DELIMITER = "::"
_COMMAND_START = re.compile(r"^(?=[^\S\n]*::)", re.MULTILINE)
_STANDARD_INPUT = "-"
_DATA_ESCAPES = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_PROPERTY_ESCAPES = _DATA_ESCAPES | {":": "%3A", ",": "%2C"}


def render_github(diagnostics: Iterable[Diagnostic], folder: str = "") -> str:
    """Return findings as workflow commands, then all findings with one line each.

    Args:
        diagnostics: the findings, in file order.
        folder: the path of the files' root within the repository, with `/`.
    """
    findings = tuple(diagnostics)
    annotated_findings = [
        diagnostic
        for severity in Severity
        for diagnostic in _findings_with_severity(findings, severity)[:MAX_ANNOTATIONS]
    ]
    commands = [_annotation(diagnostic, folder) for diagnostic in annotated_findings]
    if len(annotated_findings) < len(findings):
        commands.append(_hidden_findings_notice(findings, annotated_findings))
    return "".join(f"{command}\n" for command in commands) + escape_commands(render_concise(findings))


def escape_commands(text: str) -> str:
    """Return text in which the runner recognises no line as a command.

    A line is a command if it begins with `::`, also after blanks, or if it contains `##[`.
    """
    return _COMMAND_START.sub("./", text.replace("##[", "## ["))


def render_summary(diagnostics: Sequence[Diagnostic], title: str) -> str:
    """Return findings as Markdown; empty without findings."""
    if not diagnostics:
        return ""
    lines = [f"\n### {as_markdown(title)}\n\n", "| place | finding | message |\n", "| --- | --- | --- |\n"]
    size, row_count = 0, 0
    shown = shown_findings(diagnostics)
    for diagnostic in shown:
        row = _row(diagnostic)
        size += len(row.encode())
        if size > MAX_SUMMARY_BYTES:
            break
        lines.append(row)
        row_count += 1
    if row_count < len(shown):
        lines.append(f"\nand {len(shown) - row_count} more: see the log\n")
    return "".join(lines)


def _annotation(diagnostic: Diagnostic, folder: str) -> str:
    lines = [diagnostic.message, *([f"help: {diagnostic.help}"] if diagnostic.help else [])]
    lines += [f"{span_text(related.place.span)}: {related.message}" for related in related_places(diagnostic)]
    properties = _place_properties(diagnostic.place.span, folder) | {
        "title": f"{diagnostic.code} {diagnostic.rule.name}"
    }
    return _command(diagnostic.severity.value, properties, "\n".join(map(visible_text, lines)))


def _place_properties(span: Span, folder: str) -> dict[str, str]:
    """Return the place of an annotation. As GitHub requires, only a place within one line has columns."""
    if span.file == _STANDARD_INPUT:
        return {}
    file = visible_text(f"{folder}/{span.file}" if folder else span.file)
    properties = {"file": file, "line": str(span.line), "endLine": str(span.end_line)}
    if span.line == span.end_line:
        properties |= {"col": str(span.column), "endColumn": str(span.end_column)}
    return properties


def _hidden_findings_notice(findings: Sequence[Diagnostic], annotated_findings: Sequence[Diagnostic]) -> str:
    hidden_counts = [
        (
            severity,
            len(_findings_with_severity(findings, severity))
            - len(_findings_with_severity(annotated_findings, severity)),
        )
        for severity in Severity
    ]
    counts_text = " and ".join(
        f"{count} more {severity.value}{'s' * (count > 1)}" for severity, count in hidden_counts if count
    )
    return _command("notice", {"title": "codra"}, f"{counts_text}: see the log or the summary of this step")


def _findings_with_severity(diagnostics: Iterable[Diagnostic], severity: Severity) -> list[Diagnostic]:
    return [diagnostic for diagnostic in diagnostics if diagnostic.severity is severity]


def _command(name: str, properties: Mapping[str, str], message: str) -> str:
    properties_text = ",".join(f"{key}={_escape(value, _PROPERTY_ESCAPES)}" for key, value in properties.items())
    return f"{_COMMAND_DELIMITER}{name} {properties_text}{_COMMAND_DELIMITER}{_escape(message, _DATA_ESCAPES)}"


def _escape(text: str, escapes: Mapping[str, str]) -> str:
    return text.translate({ord(letter): escape for letter, escape in escapes.items()})


def _row(diagnostic: Diagnostic) -> str:
    span = diagnostic.place.span
    place = f"{as_markdown(span.file)}:{span.line}:{span.column}"
    plain_help = help_text(diagnostic)
    help_ = f" *({as_markdown(plain_help)})*" if plain_help else ""
    return f"| {place} | {diagnostic.severity.value} {diagnostic.code} | {as_markdown(diagnostic.message)}{help_} |\n"
