"""Findings as text for people, a line each for editors, and JSON for tools.

Text that comes from a spec is shown, never obeyed: what a terminal would take for a command appears as a replacement
character.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, Severity, Span

Sources = Callable[[str], str | None]
"""The text of a file by its path in findings; None where it cannot be had."""

_TAB = "    "
_REPLACEMENT = "\N{REPLACEMENT CHARACTER}"
_CROPPED = "..."
_WIDEST = 200
_MARGIN = 60
_WIDE = ("W", "F")
_MARKUP = str.maketrans({letter: f"\\{letter}" for letter in "\\`*_{}[]()<>#!|~&$:@^="})
_HALF_A_PAIR = re.compile("[\ud800-\udfff]")
_NOT_ASCII = re.compile("[^\x00-\x7f]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Palette:
    """What begins and ends a colour on a terminal."""

    error: str = ""
    warning: str = ""
    place: str = ""
    gutter: str = ""
    help: str = ""
    end: str = ""

    def of(self, severity: Severity) -> str:
        """Return the colour of a severity."""
        return self.error if severity is Severity.ERROR else self.warning


PLAIN = Palette()
COLOURED = Palette(
    error="\x1b[1;31m", warning="\x1b[1;33m", place="\x1b[1m", gutter="\x1b[34m", help="\x1b[36m", end="\x1b[0m"
)


def render_full(diagnostics: Iterable[Diagnostic], sources: Sources, palette: Palette = PLAIN) -> str:
    """Return findings with the lines that they are about, a caret below the offender, and the way out."""
    lines = _Lines(sources)
    return "\n".join("\n".join(_full(found, lines, palette)) + "\n" for found in diagnostics)


def render_concise(diagnostics: Iterable[Diagnostic], palette: Palette = PLAIN) -> str:
    """Return findings one a line: place, severity, code, message, way out, and where templates are used."""
    return "".join(f"{_headline(found, palette)}{_in_brackets(help(found))}\n" for found in diagnostics)


def render_json(diagnostics: Iterable[Diagnostic]) -> str:
    """Return findings as JSON, one object a line; lines and columns are 1-based, columns count code points."""
    lines = []
    for found, number in numbered(diagnostics):
        fingerprint = found.fingerprint if number == 1 else f"{found.fingerprint}:{number}"
        lines.append(as_json({**_object(found), "fingerprint": fingerprint}) + "\n")
    return "".join(lines)


def numbered(diagnostics: Iterable[Diagnostic]) -> Iterator[tuple[Diagnostic, int]]:
    """Yield each finding with its number, from 1 on, among those of the run that have its fingerprint."""
    seen: Counter[str] = Counter()
    for found in diagnostics:
        seen[found.fingerprint] += 1
        yield found, seen[found.fingerprint]


def as_json(value: object, indent: int | None = None) -> str:
    """Return JSON in ASCII letters; half a surrogate pair, which a reader of JSON may refuse, is replaced.

    Nothing in it is a command of GitHub's runner, should it go to a log.
    """
    text = _HALF_A_PAIR.sub(_REPLACEMENT, json.dumps(value, ensure_ascii=False, indent=indent))
    text = text.replace("##[", r"##\u005b")
    return _NOT_ASCII.sub(lambda letters: json.dumps(letters[0])[1:-1], text)  # outside strings JSON is ASCII


def help(found: Diagnostic) -> str:
    """Return on one line how to be rid of a finding and, of one in a template's text, which use gives it."""
    uses = list(dict.fromkeys(each.place.use for each in (found, *found.per_use) if each.place.use is not None))
    used = [f"used at {shown_place(uses[0])}{f' and {len(uses) - 1} more' if uses[1:] else ''}"] if uses else []
    return "; ".join([*([found.help] if found.help else []), *used])


def related_places(found: Diagnostic) -> tuple[Related, ...]:
    """Return all other places of a finding: those that it names, and the uses of templates that these stand in."""
    named = [(found.place, ""), *((each.place, each.message) for each in found.related)]
    places: list[Related] = []
    for place, message in named:
        places += [Related(message, Place(place.span))] if message else []
        places += [Related("used here", Place(place.use))] if place.use is not None else []
    return tuple(dict.fromkeys(places))


def _full(found: Diagnostic, lines: _Lines, palette: Palette) -> list[str]:
    line = lines.at(found.place.span)
    shown = [_headline(found, palette)]
    help_ = f"{palette.help}help: {visible(found.help)}{palette.end}" if found.help else ""
    width = len(str(found.place.span.line))
    bar = f"{palette.gutter}{'':{width}} |{palette.end}"
    if line is not None:
        text, before, marked = _marked(line, found.place.span)
        number = f"{palette.gutter}{found.place.span.line} |{palette.end}"
        caret = f"{palette.of(found.severity)}{'^' * marked}{palette.end}"
        shown += [bar, f"{number} {text}".rstrip(), f"{bar} {' ' * before}{caret} {help_}".rstrip()]
    elif help_:
        shown.append(f"{'':{width}} {help_}")
    notes = ((shown_place(each.place.span), visible(each.message)) for each in related_places(found))
    return shown + [f"{'':{width}} {palette.gutter}={palette.end} {place}: {message}" for place, message in notes]


def _headline(found: Diagnostic, palette: Palette) -> str:
    place = f"{palette.place}{shown_place(found.place.span)}{palette.end}"
    kind = f"{palette.of(found.severity)}{found.severity}[{found.code}]{palette.end}"
    return f"{place}: {kind}: {visible(found.message)}"


def shown_place(span: Span) -> str:
    """Return file, line and column as findings show them."""
    return f"{visible(span.file)}:{span.line}:{span.column}"


def _in_brackets(text: str) -> str:
    return f" ({visible(text)})" if text else ""


def _object(found: Diagnostic) -> dict[str, object]:
    related = [{"message": each.message, **range_of(each.place.span)} for each in related_places(found)]
    return {
        "code": found.code,
        "name": found.rule.name,
        "severity": found.severity.value,
        "message": found.message,
        **range_of(found.place.span),
        "path": found.path,
        "help": found.help,
        "related": related,
        "fix": _fix(found.fix),
    }


def _fix(fix: Fix | None) -> dict[str, object] | None:
    if fix is None:
        return None
    edits = [{**range_of(edit.span), "text": edit.text} for edit in fix.edits]
    return {"message": fix.message, "applicability": fix.applicability.value, "edits": edits}


def range_of(span: Span) -> dict[str, object]:
    """Return a span as JSON has it."""
    return {
        "file": span.file,
        "line": span.line,
        "column": span.column,
        "end_line": span.end_line,
        "end_column": span.end_column,
    }


class _Lines:
    """The lines of files, each file read once."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._files: dict[str, list[str]] = {}

    def at(self, span: Span) -> str | None:
        """Return the line where a span begins."""
        if span.file not in self._files:
            text = self._sources(span.file)
            self._files[span.file] = [] if text is None else text.replace("\r\n", "\n").split("\n")
        lines = self._files[span.file]
        return lines[span.line - 1] if 0 < span.line <= len(lines) else None


def _marked(line: str, span: Span) -> tuple[str, int, int]:
    """Return a line as it is shown, the columns before its marked part, and the columns of that part (1 or more)."""
    first = min(span.column - 1, len(line))
    last = len(line) if span.end_line > span.line else min(span.end_column - 1, len(line))
    start = max(0, first - _MARGIN) if len(line) > _WIDEST else 0
    cropped = _CROPPED if start else ""
    before, part, after = line[start:first], line[first:last], line[max(first, last) : start + _WIDEST]
    ended = _CROPPED if len(line) > start + _WIDEST else ""
    part = part[: _WIDEST - _MARGIN]
    text = cropped + visible(before) + visible(part) + visible(after) + ended
    return text, len(cropped) + _columns(before), max(1, _columns(part))


def visible(text: str) -> str:
    """Return text as it can be shown on one line: tabs as blanks, and no control, format or surrogate character."""
    return "".join(_TAB if letter == "\t" else letter if letter.isprintable() else _REPLACEMENT for letter in text)


def as_markdown(text: str) -> str:
    """Return text as Markdown that shows it and nothing else."""
    return visible(text).translate(_MARKUP)


def visible_lines(text: str) -> str:
    """Return text as it can be shown, line by line."""
    return "\n".join(map(visible, text.split("\n")))


def _columns(text: str) -> int:
    """Return how many columns of a terminal a text takes."""
    return sum(_column(letter) for letter in visible(text))


def _column(letter: str) -> int:
    if unicodedata.combining(letter):
        return 0
    return 2 if unicodedata.east_asian_width(letter) in _WIDE else 1
