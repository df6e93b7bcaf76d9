"""Findings as text for people, one line per finding for editors, and JSON for tools.

A replacement character replaces each character of a spec's text that a terminal would interpret as a command.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, Severity, Span
from codra_dsl.language.frozen import dataclass

Sources = Callable[[str], str | None]
"""Returns the text of a file, or None if the file is not available. The argument is the file's path in findings."""

MAX_SHOWN = 100
"""The maximum number of findings of one rule in one file that a report shows."""

_TAB = "    "
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_ELLIPSIS = "..."
_MAX_WIDTH = 200
_MARGIN = 60
_WIDE_CATEGORIES = ("W", "F")
_MARKUP_ESCAPES = str.maketrans({letter: f"\\{letter}" for letter in "\\`*_{}[]()<>#!|~&$:@^="})
_LONE_SURROGATE = re.compile("[\ud800-\udfff]")
_NON_ASCII_TEXT = re.compile("[^\x00-\x7f]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Palette:
    """The codes that begin and end a colour on a terminal."""

    error: str = ""
    warning: str = ""
    place: str = ""
    gutter: str = ""
    help: str = ""
    end: str = ""

    def severity_colour(self, severity: Severity) -> str:
        """Return the colour of a severity."""
        return self.error if severity is Severity.ERROR else self.warning


PLAIN = Palette()
COLOURED = Palette(
    error="\x1b[1;31m", warning="\x1b[1;33m", place="\x1b[1m", gutter="\x1b[34m", help="\x1b[36m", end="\x1b[0m"
)


def render_full(diagnostics: Iterable[Diagnostic], sources: Sources, palette: Palette = PLAIN) -> str:
    """Return each finding with the line that it is about, carets below the error, and the help."""
    lines = _Lines(sources)
    return "\n".join(
        "\n".join(_finding_lines(diagnostic, lines, palette)) + "\n" for diagnostic in shown_findings(diagnostics)
    )


def render_concise(diagnostics: Iterable[Diagnostic], palette: Palette = PLAIN) -> str:
    """Return one line per finding: place, severity, code, message, help, and places where templates are used."""
    return "".join(
        f"{_headline(diagnostic, palette)}{_parenthesised_text(help_text(diagnostic))}\n"
        for diagnostic in shown_findings(diagnostics)
    )


def render_json(diagnostics: Iterable[Diagnostic]) -> str:
    """Return findings as JSON, with one object per line. Lines and columns begin at 1; columns count code points."""
    lines = []
    for diagnostic, number in number_findings(shown_findings(diagnostics)):
        fingerprint = diagnostic.fingerprint if number == 1 else f"{diagnostic.fingerprint}:{number}"
        lines.append(as_json({**_finding_object(diagnostic), "fingerprint": fingerprint}) + "\n")
    return "".join(lines)


def shown_findings(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the findings that a report shows: of each rule in each file the first MAX_SHOWN, then their number.

    The number of the others is itself a finding of the rule, at the place of the first finding that is not shown. So
    every format shows it, and errors that are not shown still appear as an error.

    Only reports omit findings: comments that silence findings, fixes, counts and exit codes need every finding.
    """
    findings = tuple(diagnostics)
    totals = Counter(map(_rule_and_file, findings))
    if all(total <= MAX_SHOWN for total in totals.values()):
        return findings
    counts: Counter[tuple[str, str]] = Counter()
    shown: list[Diagnostic] = []
    for diagnostic in findings:
        key = _rule_and_file(diagnostic)
        counts[key] += 1
        if counts[key] <= MAX_SHOWN:
            shown.append(diagnostic)
        elif counts[key] == MAX_SHOWN + 1:
            shown.append(_rest_of_findings(diagnostic, totals[key] - MAX_SHOWN))
    return tuple(shown)


def _rule_and_file(diagnostic: Diagnostic) -> tuple[str, str]:
    return diagnostic.code, diagnostic.place.span.file


def _rest_of_findings(first: Diagnostic, count: int) -> Diagnostic:
    message = f"and {count:,} more finding{'' if count == 1 else 's'} of this rule in this file"
    place = Place(first.place.span)
    return replace(first, message=message, place=place, path="", help="", related=(), fix=None, use_findings=())


def number_findings(diagnostics: Iterable[Diagnostic]) -> Iterator[tuple[Diagnostic, int]]:
    """Yield each finding with a number. Findings with the same fingerprint are numbered from 1."""
    counts_by_fingerprint: Counter[str] = Counter()
    for diagnostic in diagnostics:
        counts_by_fingerprint[diagnostic.fingerprint] += 1
        yield diagnostic, counts_by_fingerprint[diagnostic.fingerprint]


def as_json(value: object, indent: int | None = None) -> str:
    """Return a value as JSON in ASCII. Half a surrogate pair, which a JSON parser may reject, is replaced.

    The result contains no command of GitHub's runner, which may read it in a log.
    """
    text = _LONE_SURROGATE.sub(_REPLACEMENT, json.dumps(value, ensure_ascii=False, indent=indent))
    text = text.replace("##[", r"##\u005b")
    return _NON_ASCII_TEXT.sub(lambda match: json.dumps(match[0])[1:-1], text)  # outside strings JSON is ASCII


def help_text(diagnostic: Diagnostic) -> str:
    """Return on one line how to fix a finding and, for a finding in a template, the place of a use that causes it."""
    uses = list(
        dict.fromkeys(
            finding.place.use for finding in (diagnostic, *diagnostic.use_findings) if finding.place.use is not None
        )
    )
    use_texts = [f"used at {span_text(uses[0])}{f' and {len(uses) - 1} more' if uses[1:] else ''}"] if uses else []
    return "; ".join([*([diagnostic.help] if diagnostic.help else []), *use_texts])


def related_places(diagnostic: Diagnostic) -> tuple[Related, ...]:
    """Return all places of a finding except its main place.

    These are the places that the finding names, and the uses of templates that contain one of these or the main place.
    """
    places_and_messages = [
        (diagnostic.place, ""),
        *((related.place, related.message) for related in diagnostic.related),
    ]
    places: list[Related] = []
    for place, message in places_and_messages:
        places += [Related(message, Place(place.span))] if message else []
        places += [Related("used here", Place(place.use))] if place.use is not None else []
    return tuple(dict.fromkeys(places))


def _finding_lines(diagnostic: Diagnostic, lines: _Lines, palette: Palette) -> list[str]:
    line = lines.line_of(diagnostic.place.span)
    text_lines = [_headline(diagnostic, palette)]
    help_ = f"{palette.help}help: {visible_text(diagnostic.help)}{palette.end}" if diagnostic.help else ""
    width = len(str(diagnostic.place.span.line))
    margin = f"{palette.gutter}{'':{width}} |{palette.end}"
    if line is not None:
        text, column_count_before, marked_column_count = _mark_line(line, diagnostic.place.span)
        number = f"{palette.gutter}{diagnostic.place.span.line} |{palette.end}"
        caret = f"{palette.severity_colour(diagnostic.severity)}{'^' * marked_column_count}{palette.end}"
        text_lines += [
            margin,
            f"{number} {text}".rstrip(),
            f"{margin} {' ' * column_count_before}{caret} {help_}".rstrip(),
        ]
    elif help_:
        text_lines.append(f"{'':{width}} {help_}")
    place_message_pairs = (
        (span_text(related.place.span), visible_text(related.message)) for related in related_places(diagnostic)
    )
    return text_lines + [
        f"{'':{width}} {palette.gutter}={palette.end} {place}: {message}" for place, message in place_message_pairs
    ]


def _headline(diagnostic: Diagnostic, palette: Palette) -> str:
    place = f"{palette.place}{span_text(diagnostic.place.span)}{palette.end}"
    kind = f"{palette.severity_colour(diagnostic.severity)}{diagnostic.severity}[{diagnostic.code}]{palette.end}"
    return f"{place}: {kind}: {visible_text(diagnostic.message)}"


def span_text(span: Span) -> str:
    """Return file, line and column as findings show them."""
    return f"{visible_text(span.file)}:{span.line}:{span.column}"


def _parenthesised_text(text: str) -> str:
    return f" ({visible_text(text)})" if text else ""


def _finding_object(diagnostic: Diagnostic) -> dict[str, object]:
    related = [
        {"message": related_place.message, **range_of(related_place.place.span)}
        for related_place in related_places(diagnostic)
    ]
    return {
        "code": diagnostic.code,
        "name": diagnostic.rule.name,
        "severity": diagnostic.severity.value,
        "message": diagnostic.message,
        **range_of(diagnostic.place.span),
        "path": diagnostic.path,
        "help": diagnostic.help,
        "related": related,
        "fix": _fix_object(diagnostic.fix),
    }


def _fix_object(fix: Fix | None) -> dict[str, object] | None:
    if fix is None:
        return None
    edits = [{**range_of(edit.span), "text": edit.text} for edit in fix.edits]
    return {"message": fix.message, "applicability": fix.applicability.value, "edits": edits}


def range_of(span: Span) -> dict[str, object]:
    """Return a span as an object of JSON."""
    return {
        "file": span.file,
        "line": span.line,
        "column": span.column,
        "end_line": span.end_line,
        "end_column": span.end_column,
    }


class _Lines:
    """The lines of files; each file is read once."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._lines_by_file: dict[str, list[str]] = {}

    def line_of(self, span: Span) -> str | None:
        """Return the first line of a span."""
        if span.file not in self._lines_by_file:
            text = self._sources(span.file)
            self._lines_by_file[span.file] = [] if text is None else text.replace("\r\n", "\n").split("\n")
        lines = self._lines_by_file[span.file]
        return lines[span.line - 1] if 0 < span.line <= len(lines) else None


def _mark_line(line: str, span: Span) -> tuple[str, int, int]:
    """Return a line as shown, the number of columns before its marked part, and the number of marked columns (>= 1)."""
    mark_start = min(span.column - 1, len(line))
    mark_end = len(line) if span.end_line > span.line else min(span.end_column - 1, len(line))
    start = max(0, mark_start - _MARGIN) if len(line) > _MAX_WIDTH else 0
    left_ellipsis = _ELLIPSIS if start else ""
    before, marked_part, after = (
        line[start:mark_start],
        line[mark_start:mark_end],
        line[max(mark_start, mark_end) : start + _MAX_WIDTH],
    )
    right_ellipsis = _ELLIPSIS if len(line) > start + _MAX_WIDTH else ""
    marked_part = marked_part[: _MAX_WIDTH - _MARGIN]
    text = left_ellipsis + visible_text(before) + visible_text(marked_part) + visible_text(after) + right_ellipsis
    return text, len(left_ellipsis) + _column_count(before), max(1, _column_count(marked_part))


def visible_text(text: str) -> str:
    """Return text for one line, with blanks for tabs and replacements for control, format and surrogate characters."""
    if text.isprintable():  # true for nearly every text; to check each character of a large report would take seconds
        return text
    return "".join(_TAB if letter == "\t" else letter if letter.isprintable() else _REPLACEMENT for letter in text)


def as_markdown(text: str) -> str:
    """Return text as Markdown that shows it unchanged."""
    return visible_text(text).translate(_MARKUP_ESCAPES)


def visible_lines(text: str) -> str:
    """Return text of several lines, each as `visible_text` returns it."""
    return "\n".join(map(visible_text, text.split("\n")))


def _column_count(text: str) -> int:
    """Return the number of columns of a text on a terminal."""
    return sum(_column_width(letter) for letter in visible_text(text))


def _column_width(letter: str) -> int:
    if unicodedata.combining(letter):
        return 0
    return 2 if unicodedata.east_asian_width(letter) in _WIDE_CATEGORIES else 1
