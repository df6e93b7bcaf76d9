"""Findings for GitHub Actions: annotations, the log, and the summary of the step.

GitHub shows ten errors and ten warnings of a step and drops the rest without a word. So the most severe findings
become annotations, one more says how many there are beside them, and the log and the summary have all.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

from codra_dsl.language.diagnostics import Diagnostic, Severity, Span
from codra_dsl.tooling.report.findings import as_markdown, help, related_places, render_concise, shown_place, visible

MAX_ANNOTATIONS = 10
"""How many annotations of one severity GitHub shows for a step."""
MAX_SUMMARY_BYTES = 512 * 1024
"""How much of the summary of a step, which GitHub refuses when it is larger than 1 MiB, findings may take."""

_COMMAND = "::"
_BEGINS_A_COMMAND = re.compile(r"^(?=[^\S\n]*::)", re.MULTILINE)
_STANDARD_INPUT = "-"
_DATA = {"%": "%25", "\r": "%0D", "\n": "%0A"}
_PROPERTY = _DATA | {":": "%3A", ",": "%2C"}


def render_github(diagnostics: Iterable[Diagnostic], folder: str = "") -> str:
    """Return findings as workflow commands, then all of them one a line.

    Args:
        diagnostics: in file order.
        folder: of the files' root within the repository, with `/`.
    """
    found = tuple(diagnostics)
    annotated = [each for severity in Severity for each in _of(found, severity)[:MAX_ANNOTATIONS]]
    commands = [_annotation(each, folder) for each in annotated]
    if len(annotated) < len(found):
        commands.append(_rest(found, annotated))
    return "".join(f"{command}\n" for command in commands) + without_commands(render_concise(found))


def without_commands(text: str) -> str:
    """Return text none of whose lines the runner takes for a command.

    It takes for one what begins with `::`, after blanks, and what holds `##[` anywhere.
    """
    return _BEGINS_A_COMMAND.sub("./", text.replace("##[", "## ["))


def render_summary(diagnostics: Sequence[Diagnostic], title: str) -> str:
    """Return findings as Markdown; empty if there are none."""
    if not diagnostics:
        return ""
    lines = [f"\n### {as_markdown(title)}\n\n", "| place | finding | message |\n", "| --- | --- | --- |\n"]
    size, told = 0, 0
    for found in diagnostics:
        row = _row(found)
        size += len(row.encode())
        if size > MAX_SUMMARY_BYTES:
            break
        lines.append(row)
        told += 1
    if told < len(diagnostics):
        lines.append(f"\nand {len(diagnostics) - told} more: see the log\n")
    return "".join(lines)


def _annotation(found: Diagnostic, folder: str) -> str:
    lines = [found.message, *([f"help: {found.help}"] if found.help else [])]
    lines += [f"{shown_place(each.place.span)}: {each.message}" for each in related_places(found)]
    properties = _place(found.place.span, folder) | {"title": f"{found.code} {found.rule.name}"}
    return _command(found.severity.value, properties, "\n".join(map(visible, lines)))


def _place(span: Span, folder: str) -> dict[str, str]:
    """Return where an annotation stands; GitHub takes columns within one line only."""
    if span.file == _STANDARD_INPUT:
        return {}
    file = visible(f"{folder}/{span.file}" if folder else span.file)
    place = {"file": file, "line": str(span.line), "endLine": str(span.end_line)}
    if span.line == span.end_line:
        place |= {"col": str(span.column), "endColumn": str(span.end_column)}
    return place


def _rest(found: Sequence[Diagnostic], annotated: Sequence[Diagnostic]) -> str:
    hidden = [(severity, len(_of(found, severity)) - len(_of(annotated, severity))) for severity in Severity]
    told = " and ".join(f"{number} more {severity.value}{'s' * (number > 1)}" for severity, number in hidden if number)
    return _command("notice", {"title": "codra"}, f"{told}: see the log or the summary of this step")


def _of(found: Iterable[Diagnostic], severity: Severity) -> list[Diagnostic]:
    return [each for each in found if each.severity is severity]


def _command(name: str, properties: Mapping[str, str], message: str) -> str:
    told = ",".join(f"{key}={_escaped(value, _PROPERTY)}" for key, value in properties.items())
    return f"{_COMMAND}{name} {told}{_COMMAND}{_escaped(message, _DATA)}"


def _escaped(text: str, escapes: Mapping[str, str]) -> str:
    return text.translate({ord(letter): escape for letter, escape in escapes.items()})


def _row(found: Diagnostic) -> str:
    span = found.place.span
    place = f"{as_markdown(span.file)}:{span.line}:{span.column}"
    more = help(found)
    help_ = f" *({as_markdown(more)})*" if more else ""
    return f"| {place} | {found.severity.value} {found.code} | {as_markdown(found.message)}{help_} |\n"
