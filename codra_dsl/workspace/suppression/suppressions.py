"""Comments that silence findings: `# codra: ignore[CDR7102] reason`, and what is wrong with such comments.

In files of trees they are comments of XML: `<!-- codra: ignore[CDR3309] reason -->`.

A comment behind something is about the findings of its line; one on a line of its own is about the next line that
holds more than a comment. A finding that a template gives is silenced at the template's line for every use, or at the
line of one use for that use.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from codra_dsl.language.diagnostics import (
    Applicability,
    Diagnostic,
    Edit,
    Fix,
    Place,
    Severity,
    Span,
    in_file_order,
    once_per_template,
)
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.source import MAX_BYTES, Source, accept
from codra_dsl.language.project import covers
from codra_dsl.workspace.suppression.comments import XML_END, XML_START, comments, xml_comments
from codra_dsl.workspace.suppression.rules import OWN_PREFIX, RULES, known_rules, nearest_code
from codra_dsl.workspace.suppression.settings import Settings

_MAY_SUPPRESS = re.compile(rb"(?:#|<!--)[ \t]*codra[ \t]*:", re.IGNORECASE)
_MARKED = re.compile(
    r"(?:#|<!--)[ \t]*codra[ \t]*:[ \t]*(?P<verb>[A-Za-z-]+)(?P<rest>[ \t]*\[(?P<codes>[^\]]*)\](?P<reason>.*))?",
    re.IGNORECASE,
)
_CODE = re.compile(r"[^,\s](?:[^,]*[^,\s])?")
_WORD = re.compile(r"\w")
_VERB = "ignore"
_OTHER_VERBS = frozenset({"ignored", "ignores", "ignroe", "noqa", "disable", "disabled", "suppress", "allow", "skip"})
_WAY_OUT = "write '# codra: ignore[CDR7102] reason'"
_WAY_OUT_IN_XML = "write '<!-- codra: ignore[CDR3309] reason -->'"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """What a run has read, as far as comments in it may silence findings.

    Attributes:
        texts: of files that may have such comments, by their names in findings.
        paths: the files and folders that the run was asked about, relative to the root; all else is only included, and
            whether a comment there is of use to another spec is not known.
    """

    texts: Mapping[str, str]
    paths: tuple[str, ...]


def read_sources(
    files: Iterable[str], paths: Iterable[str], root: Path, texts: Mapping[str, bytes] | None = None
) -> Sources:
    """Return the texts of those files that may have suppression comments.

    Args:
        files: what specs were made of, relative to the root.
        paths: the files and folders that were asked about, relative to the root.
        root: the project's folder.
        texts: of files that are not read from disk.
    """
    given = {} if texts is None else texts
    found: dict[str, str] = {}
    for file in sorted(set(files)):
        path = root / file
        data = given[file] if file in given else _bytes(path) if path.is_file() else b""
        if _MAY_SUPPRESS.search(data):
            found[file] = data.decode("utf-8", "replace")
    return Sources(texts=found, paths=tuple(paths))


def _bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES)
    except (OSError, ValueError):
        return b""


@dataclass(frozen=True, slots=True)
class Code:
    """A code as a comment has it."""

    text: str
    span: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class Suppression:
    """One comment.

    Attributes:
        codes: in their order; none where the comment has not the form of a suppression.
        line: what findings must be on to be silenced; None where nothing follows the comment.
        removal: what to remove to be rid of it.
        used: which of its codes have silenced something.
    """

    span: Span
    codes: tuple[Code, ...]
    has_reason: bool
    line: int | None
    removal: Edit
    used: set[str] = field(default_factory=set)


class _Suppressions:
    """The suppression comments of a run, and what they have silenced so far."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._all = [each for file, text in sources.texts.items() for each in _read(file, text)]
        self._at: dict[tuple[str, int, str], list[Suppression]] = {}
        self._loud: dict[tuple[str, str], int] = {}
        for each in self._all:
            for code in each.codes if each.line is not None else ():
                rule = known_rules().get(code.text)
                if rule is not None and not rule.is_binding and not code.text.startswith(OWN_PREFIX):
                    self._at.setdefault((each.span.file, each.line or 0, code.text), []).append(each)

    def left(self, found: Diagnostic) -> tuple[Diagnostic, ...]:
        """Return what is left of a finding: itself, nothing, or what it is in other uses of a template."""
        if not self._at or found.rule.is_binding:
            return (found,)
        if self._silenced(found.code, found.place.span):
            return ()
        uses = found.per_use or (found,)
        left = tuple(each for each in uses if each.place.use is None or not self._silenced(each.code, each.place.use))
        for span in (span for each in left for span in (each.place.span, each.place.use) if span is not None):
            self._loud.setdefault((span.file, found.code), span.line)
        return (found,) if len(left) == len(uses) else once_per_template(left)

    def _silenced(self, code: str, span: Span) -> bool:
        last = span.end_line - 1 if span.end_column == 1 and span.end_line > span.line else span.end_line
        here = [each for line in {span.line, last} for each in self._at.get((span.file, line, code), ())]
        for each in here:
            each.used.add(code)
        return bool(here)

    def findings(self, *, complete: bool) -> Iterator[Diagnostic]:
        """Yield what is wrong with comments; `complete` says that no error hid what they may be meant for."""
        for each in self._all:
            if not each.codes:
                help = _WAY_OUT_IN_XML if _is_xml(each.span.file) else _WAY_OUT
                yield _finding("ill-formed-suppression", "this comment silences nothing", each.span, help)
            for index, code in enumerate(each.codes):
                yield from self._of_code(each, index, code, complete=complete)
            if each.used and not each.has_reason:
                message = "the comment does not say why it silences findings"
                help = f"write the reason behind it: # codra: ignore[{each.codes[0].text}] REASON"
                yield _finding("suppression-without-reason", message, each.span, help)

    def _of_code(self, each: Suppression, index: int, code: Code, *, complete: bool) -> Iterator[Diagnostic]:
        rule = known_rules().get(code.text)
        if rule is None:
            near = nearest_code(code.text)
            fix = None if near is None else _replacing(code, near)
            help = f"did you mean '{near}'?" if near else "codes are CDR and four digits; 'codra explain' knows them"
            yield _finding("unknown-code-suppressed", f"there is no code '{code.text}'", code.span, help, fix)
        elif rule.is_binding or code.text.startswith(OWN_PREFIX):
            why = "an error without which nothing compiles" if rule.is_binding else "about such comments themselves"
            message = f"'{code.text}' is {why}, and cannot be silenced"
            yield _finding(
                "binding-code-suppressed", message, code.span, "remove it; correct the spec", _without(each, index)
            )
        elif complete and code.text not in each.used and covers(self._sources.paths, each.span.file):
            message = f"'{code.text}' silences nothing: there is no such finding here"
            line = self._loud.get((each.span.file, code.text))
            help = "remove it" if line is None else f"move it to line {line}, where there is one, or remove it"
            fix = _without(each, index) if line is None else None  # to remove what is misplaced would lose the reason
            yield _finding("unused-suppression", message, code.span, help, fix)


def triaged(diagnostics: Iterable[Diagnostic], settings: Settings, sources: Sources) -> tuple[Diagnostic, ...]:
    """Return findings in file order, with those about suppression comments.

    Comments come first: whether one is of use depends on no setting. While any error is left, later checks may not
    have been made, and no comment is called unused.
    """
    comments = _Suppressions(sources)
    left = [each for found in diagnostics for each in comments.left(found)]
    complete = not any(each.rule.severity is Severity.ERROR for each in left)
    all_found = (*left, *comments.findings(complete=complete))
    return in_file_order(_leveled(found, settings) for found in all_found if settings.wants(found.rule))


def _leveled(found: Diagnostic, settings: Settings) -> Diagnostic:
    level = settings.level(found.rule)
    return found if level is found.rule.severity else replace(found, level=level)


def _finding(rule: str, message: str, span: Span, help: str, fix: Fix | None = None) -> Diagnostic:
    is_fixable = not _is_xml(span.file)  # only specs are mended
    return Diagnostic(rule=RULES[rule], message=message, place=Place(span), help=help, fix=fix if is_fixable else None)


def _replacing(code: Code, near: str) -> Fix:
    edit = Edit(code.span, near)
    message = f"Replace '{code.text}' by '{near}'"
    return Fix(message=message, edits=(edit,), applicability=Applicability.SUGGESTED)


def _without(each: Suppression, index: int) -> Fix:
    """Return how to take one code out of a comment; the comment goes with its last code."""
    codes, code = each.codes, each.codes[index]
    if len(codes) == 1:
        return Fix(message="Remove the comment", edits=(each.removal,), applicability=Applicability.SAFE)
    if index + 1 < len(codes):
        span = _from_to(code.span.column, codes[index + 1].span.column, code.span)
    else:
        span = _from_to(codes[index - 1].span.end_column, code.span.end_column, code.span)
    return Fix(message=f"Remove '{code.text}'", edits=(Edit(span, ""),), applicability=Applicability.SAFE)


def _from_to(column: int, end_column: int, on: Span) -> Span:
    return Span(on.file, on.line, column, on.line, end_column)


def _read(file: str, text: str) -> Iterator[Suppression]:
    """Yield the suppression comments of a text; none where it holds what no spec may hold."""
    source = accept(text, file, Findings())
    if source is None:
        return
    for start, end in xml_comments(source.text) if _is_xml(file) else comments(source.text):
        marked = _MARKED.match(source.text, start, end)
        if marked is None:
            continue
        verb = marked["verb"].casefold()
        if verb == _VERB or ((verb in _OTHER_VERBS or marked["rest"]) and "CDR" in source.text[start:end].upper()):
            yield _suppression(source, marked, end, is_right=verb == _VERB)


def _is_xml(file: str) -> bool:
    return file.casefold().endswith(".xml")


def _suppression(source: Source, marked: re.Match[str], end: int, *, is_right: bool) -> Suppression:
    start = marked.start()
    end += len(XML_END) if source.text.startswith(XML_END, end) else 0
    first = marked.start("codes")
    found = _CODE.finditer(marked["codes"] or "") if is_right else ()
    codes = tuple(Code(each[0], source.span(first + each.start(), first + each.end())) for each in found)
    span = source.span(start, end)
    line_start = source.line_starts[span.line - 1]
    line_end = source.text.find("\n", end)
    behind = source.text[end : line_end if line_end >= 0 else len(source.text)]
    stands_alone = not source.text[line_start:start].strip() and not behind.strip()
    before = len(source.text[:start].rstrip(" \t"))
    return Suppression(
        span=span,
        codes=codes,
        has_reason=_WORD.search(marked["reason"] or "") is not None,
        line=_next_line(source, span.line) if stands_alone else span.line,
        removal=Edit(_whole_line(source, span.line) if stands_alone else source.span(before, end), ""),
    )


def _next_line(source: Source, line: int) -> int | None:
    """Return the number of the first line after another one that holds more than a comment."""
    starts = (*source.line_starts[line:], len(source.text))
    for number in range(line + 1, len(source.line_starts) + 1):
        content = source.text[starts[number - line - 1] : starts[number - line]].strip()
        if content and not content.startswith(("#", XML_START)):
            return number
    return None


def _whole_line(source: Source, line: int) -> Span:
    if line < len(source.line_starts):
        return Span(source.file, line, 1, line + 1, 1)
    return source.span(source.line_starts[line - 1], len(source.text))
