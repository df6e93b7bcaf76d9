"""Comments that silence findings, such as `# codra: ignore[CDR7102] reason`, and findings about such comments.

In files of trees, these comments are XML comments: `<!-- codra: ignore[CDR3309] reason -->`.

A comment at the end of a line applies to the findings of that line. A comment on a separate line applies to the next
line that is neither empty nor a comment. If a finding comes from a template, a comment at the line of the template
silences the finding for every use, and a comment at the line of a use silences the finding for this use.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import islice
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
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.source import MAX_BYTES, Source, accept
from codra_dsl.language.project import covers
from codra_dsl.regular_files import read_regular_file
from codra_dsl.workspace.suppression.comments import XML_END, XML_START, comments, xml_comments
from codra_dsl.workspace.suppression.rules import OWN_PREFIX, RULES, known_rules, nearest_code
from codra_dsl.workspace.suppression.settings import Settings

# Two patterns, because Python searches for a pattern that begins with a fixed text 15 times as fast as for another one.
_POSSIBLE_SUPPRESSIONS = tuple(re.compile(rb"%s[ \t]*(?i:codra)[ \t]*:" % begin) for begin in (b"#", b"<!--"))
_SUPPRESSION_COMMENT = re.compile(
    r"(?:#|<!--)[ \t]*codra[ \t]*:[ \t]*(?P<verb>[A-Za-z-]+)(?P<rest>[ \t]*\[(?P<codes>[^\]]*)\](?P<reason>.*))?",
    re.IGNORECASE,
)
_CODE = re.compile(r"[^,\s](?:[^,]*[^,\s])?")
_WORD = re.compile(r"\w")
_UNDECIDED_RULE = "undecided-conditions"
_IGNORE_VERB = "ignore"
_MAX_CODES = 1000
"""The maximum number of codes in a comment; further codes silence nothing."""

_MISTAKEN_VERBS = frozenset(
    {"ignored", "ignores", "ignroe", "noqa", "disable", "disabled", "suppress", "allow", "skip"}
)
_SYNTAX_HELP = "write '# codra: ignore[CDR7102] reason'"
_XML_SYNTAX_HELP = "write '<!-- codra: ignore[CDR3309] reason -->'"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sources:
    """The texts of a run in which comments may silence findings.

    Attributes:
        texts: the contents of files that may have such comments, by their names in findings.
        paths: the requested files and folders, relative to the root. A comment in any other file may be needed by a
            spec that is not part of this run.
    """

    texts: Mapping[str, str]
    paths: tuple[str, ...]


def read_sources(
    files: Iterable[str], paths: Iterable[str], root: Path, texts: Mapping[str, bytes] | None = None
) -> Sources:
    """Return the texts of those files that may have suppression comments.

    Args:
        files: the files of specs, of parts and of behaviour trees, relative to the root.
        paths: the requested files and folders, relative to the root.
        root: the project's folder.
        texts: the contents of files that are not read from disk.
    """
    texts_in_memory = {} if texts is None else texts
    texts_with_comments: dict[str, str] = {}
    for file in sorted(set(files)):
        data = texts_in_memory[file] if file in texts_in_memory else _read_bytes(root / file, root)
        if any(pattern.search(data) for pattern in _POSSIBLE_SUPPRESSIONS):
            texts_with_comments[file] = data.decode("utf-8", "replace")
    return Sources(texts=texts_with_comments, paths=tuple(paths))


def _read_bytes(path: Path, root: Path) -> bytes:
    try:
        return read_regular_file(path, MAX_BYTES, within=root)
    except OSError:  # a file that cannot be read has a finding of its own
        return b""


@dataclass(frozen=True, slots=True)
class Code:
    """A code in a comment."""

    text: str
    span: Span


@dataclass(frozen=True, slots=True, kw_only=True)
class Suppression:
    """One suppression comment.

    Attributes:
        codes: the codes of the comment, in order; empty if the comment does not have the form of a suppression.
        line: the line of the findings to silence; None if nothing follows the comment.
        removal: the edit that removes the comment.
        used_codes: those codes of the comment that have silenced a finding.
    """

    span: Span
    codes: tuple[Code, ...]
    has_reason: bool
    line: int | None
    removal: Edit
    used_codes: set[str] = field(default_factory=set)


class _Suppressions:
    """The suppression comments of a run, and the findings that they have silenced so far."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._suppressions = [
            suppression for file, text in sources.texts.items() for suppression in _read_suppressions(file, text)
        ]
        self._suppressions_by_line: dict[tuple[str, int, str], list[Suppression]] = {}
        self._unsilenced_lines: dict[tuple[str, str], int] = {}
        for suppression in self._suppressions:
            for code in suppression.codes if suppression.line is not None else ():
                rule = known_rules().get(code.text)
                if rule is not None and not rule.is_binding and not code.text.startswith(OWN_PREFIX):
                    self._suppressions_by_line.setdefault(
                        (suppression.span.file, suppression.line or 0, code.text), []
                    ).append(suppression)

    def remaining_findings(self, diagnostic: Diagnostic) -> tuple[Diagnostic, ...]:
        """Return the rest of a finding: nothing, the finding, or findings for the uses that are not silenced."""
        if not self._suppressions_by_line or diagnostic.rule.is_binding:
            return (diagnostic,)
        if self._silence(diagnostic.code, diagnostic.place.span):
            return ()
        uses = diagnostic.use_findings or (diagnostic,)
        remaining_uses = tuple(
            use for use in uses if use.place.use is None or not self._silence(use.code, use.place.use)
        )
        for span in (span for use in remaining_uses for span in (use.place.span, use.place.use) if span is not None):
            self._unsilenced_lines.setdefault((span.file, diagnostic.code), span.line)
        return (diagnostic,) if len(remaining_uses) == len(uses) else once_per_template(remaining_uses)

    def _silence(self, code: str, span: Span) -> bool:
        last_line = span.end_line - 1 if span.end_column == 1 and span.end_line > span.line else span.end_line
        suppressions = [
            suppression
            for line in {span.line, last_line}
            for suppression in self._suppressions_by_line.get((span.file, line, code), ())
        ]
        for suppression in suppressions:
            suppression.used_codes.add(code)
        return bool(suppressions)

    def findings(self, *, is_complete: bool) -> Iterator[Diagnostic]:
        """Yield the findings about comments.

        Args:
            is_complete: whether no error has hidden findings that comments may silence.
        """
        for suppression in self._suppressions:
            if not suppression.codes:
                help = _XML_SYNTAX_HELP if _is_xml(suppression.span.file) else _SYNTAX_HELP
                yield _create_finding("ill-formed-suppression", "this comment silences nothing", suppression.span, help)
            for index, code in enumerate(suppression.codes):
                yield from self._code_findings(suppression, index, code, is_complete=is_complete)
            if suppression.used_codes and not suppression.has_reason:
                message = "the comment does not state why it silences findings"
                help = f"write the reason after the code: # codra: ignore[{suppression.codes[0].text}] REASON"
                yield _create_finding("suppression-without-reason", message, suppression.span, help)

    def _code_findings(
        self, suppression: Suppression, index: int, code: Code, *, is_complete: bool
    ) -> Iterator[Diagnostic]:
        rule = known_rules().get(code.text)
        if rule is None:
            suggestion = nearest_code(code.text)
            fix = None if suggestion is None else _replacement_fix(code, suggestion)
            help = (
                f"did you mean '{suggestion}'?"
                if suggestion
                else "codes are CDR and four digits; 'codra explain' lists them"
            )
            yield _create_finding("unknown-code-suppressed", f"there is no code '{code.text}'", code.span, help, fix)
        elif rule.is_binding or code.text.startswith(OWN_PREFIX):
            problem = "an error that prevents compiling" if rule.is_binding else "about such comments themselves"
            message = f"'{code.text}' is {problem}, and cannot be silenced"
            yield _create_finding(
                "binding-code-suppressed",
                message,
                code.span,
                "remove the code; correct the spec",
                _removal_fix(suppression, index),
            )
        elif (
            is_complete
            and code.text not in suppression.used_codes
            and covers(self._sources.paths, suppression.span.file)
        ):
            message = f"'{code.text}' silences nothing: there is no such finding here"
            line = self._unsilenced_lines.get((suppression.span.file, code.text))
            help = "remove it" if line is None else f"move it to line {line}, which has such a finding, or remove it"
            # Removing a misplaced comment would lose its reason.
            fix = _removal_fix(suppression, index) if line is None else None
            yield _create_finding("unused-suppression", message, code.span, help, fix)


def triage(
    diagnostics: Iterable[Diagnostic], settings: Settings, sources: Sources, *, has_all_findings: bool = True
) -> tuple[Diagnostic, ...]:
    """Return findings in file order, with the findings about suppression comments.

    Comments are applied before settings, so that no setting affects whether a comment is used. While an error is
    left, later checks may not have run, so no comment is reported as unused. The same is true if the analysis of
    conditions stopped, even if a comment silences the finding about this, and if `has_all_findings` is false.
    """
    suppressions = _Suppressions(sources)
    diagnostics = tuple(diagnostics)
    remaining_findings = [
        finding for diagnostic in diagnostics for finding in suppressions.remaining_findings(diagnostic)
    ]
    is_complete = has_all_findings and not (
        any(diagnostic.rule.severity is Severity.ERROR for diagnostic in remaining_findings)
        or any(diagnostic.rule.name == _UNDECIDED_RULE for diagnostic in diagnostics)
    )
    findings = (*remaining_findings, *suppressions.findings(is_complete=is_complete))
    return in_file_order(
        _with_level(diagnostic, settings) for diagnostic in findings if settings.selects(diagnostic.rule)
    )


def _with_level(diagnostic: Diagnostic, settings: Settings) -> Diagnostic:
    level = settings.level(diagnostic.rule)
    return diagnostic if level is diagnostic.rule.severity else replace(diagnostic, level=level)


def _create_finding(rule: str, message: str, span: Span, help: str, fix: Fix | None = None) -> Diagnostic:
    is_fixable = not _is_xml(span.file)  # fixes apply to specs only
    return Diagnostic(rule=RULES[rule], message=message, place=Place(span), help=help, fix=fix if is_fixable else None)


def _replacement_fix(code: Code, suggestion: str) -> Fix:
    edit = Edit(code.span, suggestion)
    message = f"Replace '{code.text}' by '{suggestion}'"
    return Fix(message=message, edits=(edit,), applicability=Applicability.SUGGESTED)


def _removal_fix(suppression: Suppression, index: int) -> Fix:
    """Return the fix that removes one code from a comment, or the complete comment if this is its only code."""
    codes, code = suppression.codes, suppression.codes[index]
    if len(codes) == 1:
        return Fix(message="Remove the comment", edits=(suppression.removal,), applicability=Applicability.SAFE)
    if index + 1 < len(codes):
        span = _span_between(code.span.column, codes[index + 1].span.column, code.span)
    else:
        span = _span_between(codes[index - 1].span.end_column, code.span.end_column, code.span)
    return Fix(message=f"Remove '{code.text}'", edits=(Edit(span, ""),), applicability=Applicability.SAFE)


def _span_between(column: int, end_column: int, line_span: Span) -> Span:
    return Span(line_span.file, line_span.line, column, line_span.line, end_column)


def _read_suppressions(file: str, text: str) -> Iterator[Suppression]:
    """Yield the suppression comments of a text; none if it contains characters that a spec must not contain."""
    source = accept(text, file, Findings())
    if source is None:
        return
    following_lines = _following_lines(source)
    for start, end in xml_comments(source.text) if _is_xml(file) else comments(source.text):
        comment_match = _SUPPRESSION_COMMENT.match(source.text, start, end)
        if comment_match is None:
            continue
        verb = comment_match["verb"].casefold()
        if verb == _IGNORE_VERB or (
            (verb in _MISTAKEN_VERBS or comment_match["rest"]) and "CDR" in source.text[start:end].upper()
        ):
            is_suppression = verb == _IGNORE_VERB
            yield _create_suppression(source, comment_match, end, following_lines, is_suppression=is_suppression)


def _is_xml(file: str) -> bool:
    return file.casefold().endswith(".xml")


def _create_suppression(
    source: Source,
    comment_match: re.Match[str],
    end: int,
    following_lines: Sequence[int | None],
    *,
    is_suppression: bool,
) -> Suppression:
    start = comment_match.start()
    end += len(XML_END) if source.text.startswith(XML_END, end) else 0
    codes_start = comment_match.start("codes")
    code_matches = _CODE.finditer(comment_match["codes"] or "") if is_suppression else ()
    codes = tuple(
        Code(code_match[0], source.span(codes_start + code_match.start(), codes_start + code_match.end()))
        for code_match in islice(code_matches, _MAX_CODES)
    )
    span = source.span(start, end)
    line_start = source.line_starts[span.line - 1]
    line_end = source.text.find("\n", end)
    text_after = source.text[end : line_end if line_end >= 0 else len(source.text)]
    is_on_own_line = not source.text[line_start:start].strip() and not text_after.strip()
    removal_start = line_start + len(source.text[line_start:start].rstrip(" \t"))
    return Suppression(
        span=span,
        codes=codes,
        has_reason=_WORD.search(comment_match["reason"] or "") is not None,
        line=following_lines[span.line - 1] if is_on_own_line else span.line,
        removal=Edit(_line_span(source, span.line) if is_on_own_line else source.span(removal_start, end), ""),
    )


def _following_lines(source: Source) -> list[int | None]:
    """Return for each line the number of the first later line that is neither empty nor a comment; None without one."""
    following_lines: list[int | None] = []
    following_line, end = None, len(source.text)
    for line in range(len(source.line_starts), 0, -1):
        following_lines.append(following_line)
        start = source.line_starts[line - 1]
        content = source.text[start:end].strip()
        if content and not content.startswith(("#", XML_START)):
            following_line = line
        end = start
    return following_lines[::-1]


def _line_span(source: Source, line: int) -> Span:
    if line < len(source.line_starts):
        return Span(source.file, line, 1, line + 1, 1)
    return source.span(source.line_starts[line - 1], len(source.text))
