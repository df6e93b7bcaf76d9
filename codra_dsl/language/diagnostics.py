"""Findings: a message, the place of the mistake, and how to fix the mistake.

Every layer of the compiler reports findings. A user's mistake becomes a finding, which is a value with a place. A
programmer's mistake raises an exception. Each phase reports every mistake that it finds. If a phase has a finding about
an element, findings of later phases about this element are silenced.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from enum import StrEnum
from typing import Protocol

from codra_dsl.language.frozen import dataclass

__all__ = [
    "Applicability",
    "Diagnostic",
    "Edit",
    "Fix",
    "Place",
    "Related",
    "Rule",
    "Severity",
    "Span",
    "has_errors",
    "suggest",
]

_LINE_NUMBER = re.compile(r"(?<=\bline )\d+")


class Severity(StrEnum):
    """The severity of a finding. Only errors prevent compilation."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True, order=True)
class Span:
    """A range of text. Lines and columns begin at 1. Columns count code points. The end is exclusive.

    Attributes:
        file: the path relative to the project root, with `/`; `-` for standard input.
    """

    file: str
    line: int
    column: int
    end_line: int
    end_column: int

    def contains(self, other: Span) -> bool:
        """Return whether another span is within this one."""
        starts_within = (self.line, self.column) <= (other.line, other.column)
        ends_within = (other.end_line, other.end_column) <= (self.end_line, self.end_column)
        return self.file == other.file and starts_within and ends_within


class HasSpans(Protocol):
    """A text that can convert its ranges to spans."""

    def span(self, start: int, end: int) -> Span:
        """Return the span of a range, given as offsets in code points."""
        ...


class _LazyPlace:
    """Computes the span of a place on first access, because the spans of most places are never used."""

    __slots__ = ("_text_range",)
    _text_range: tuple[HasSpans, int, int]

    def __getattr__(self, name: str) -> object:
        """Fill the slot `span`. Python calls this method only while the slot is empty."""
        if name != "span":
            raise AttributeError(name)
        text, start, end = self._text_range
        span = text.span(start, end)
        object.__setattr__(self, "span", span)
        return span


@dataclass(frozen=True, slots=True, order=True)
class Place(_LazyPlace):
    """The place of an element: its span and, if a template made the element, the span of the template's `use`."""

    span: Span
    use: Span | None = None


# A spec has many places. To make them faster, the functions that fill their slots are looked up only once.
_new_place = object.__new__
_set_text_range = _LazyPlace.__dict__["_text_range"].__set__
_set_use = Place.__dict__["use"].__set__


def lazy_place(text: HasSpans, start: int, end: int, use: Span | None) -> Place:
    """Return the place of a range of a text; the span of the place is computed on first access."""
    place = _new_place(Place)
    _set_text_range(place, (text, start, end))
    _set_use(place, use)
    return place


@dataclass(frozen=True, slots=True)
class Related:
    """Another place that belongs to a finding, with a message about this place."""

    message: str
    place: Place


class Applicability(StrEnum):
    """Who may apply a fix: a tool on its own, or only a person who has read the fix."""

    SAFE = "safe"
    SUGGESTED = "suggested"


@dataclass(frozen=True, slots=True, order=True)
class Edit:
    """A range of text and its replacement; if the range is empty, the replacement is inserted."""

    span: Span
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """A fix that a tool can apply.

    Attributes:
        message: describes the fix in the imperative: `Replace 'moniter' by 'monitor'`.
        edits: the changes of the text. They do not overlap; either all of them are applied, or none.
    """

    message: str
    edits: tuple[Edit, ...]
    applicability: Applicability


_FIRST_QUALITY_CODE = "CDR7"


def replacement_fix(place: Place, old: str, new: str, *, safe: bool) -> Fix | None:
    """Return the fix that replaces one text by another, or None in a template, because several uses share its text."""
    if place.use is not None:
        return None
    applicability = Applicability.SAFE if safe else Applicability.SUGGESTED
    return Fix(message=f"Replace '{old}' by '{new}'", edits=(Edit(place.span, new),), applicability=applicability)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One kind of finding. Codes are never reused."""

    code: str
    name: str
    severity: Severity

    @property
    def is_binding(self) -> bool:
        """Whether findings of this rule can be neither silenced nor reduced to warnings.

        These are the errors of phases 0 to 6, which prevent compilation.
        """
        return self.severity is Severity.ERROR and self.code < _FIRST_QUALITY_CODE


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostic:
    """One finding.

    Attributes:
        path: the path of the element within the spec, e.g. `skills.open_door.monitor`; it contains no line number.
        help: how to fix the mistake, in one sentence; empty only if the message already states how.
        fix: the fix as edits, if a tool can apply them.
        level: the severity from the project's settings, which replaces the severity of the rule; None if not set.
        use_findings: the finding of each use, if several uses of a template lead to the same finding about the
            template's text.
    """

    rule: Rule
    message: str
    place: Place
    path: str = ""
    help: str = ""
    related: tuple[Related, ...] = ()
    fix: Fix | None = None
    level: Severity | None = None
    use_findings: tuple[Diagnostic, ...] = ()

    @property
    def code(self) -> str:
        """Return the rule's code, `CDRnnnn`."""
        return self.rule.code

    @property
    def severity(self) -> Severity:
        """Return the severity from the settings or, if the settings state none, from the rule."""
        return self.level or self.rule.severity

    @property
    def fingerprint(self) -> str:
        """Return an identifier of this finding that stays the same when lines move."""
        message = _LINE_NUMBER.sub("", self.message)
        used_in = () if self.place.use is None else (self.place.use.file,)  # several specs may use the same part
        text = "\0".join((self.code, self.place.span.file, self.path, message, *used_in))
        return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:16]


def is_safe(diagnostic: Diagnostic) -> bool:
    """Return whether a tool may fix a finding on its own."""
    return diagnostic.fix is not None and diagnostic.fix.applicability is Applicability.SAFE


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return whether any finding is an error, which prevents compilation."""
    return any(diagnostic.severity is Severity.ERROR for diagnostic in diagnostics)


def has_binding_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return whether any finding prevents compilation regardless of comments and settings."""
    return any(diagnostic.rule.is_binding for diagnostic in diagnostics)


def in_file_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return findings sorted by file, place and code, without duplicates."""
    unique_diagnostics = dict.fromkeys(diagnostics)
    return tuple(
        sorted(unique_diagnostics, key=lambda diagnostic: (diagnostic.place.span, diagnostic.code, diagnostic.message))
    )


MAX_LISTED_USES = 5
"""The maximum number of other uses of a template that a merged finding lists."""


def once_per_template(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return the findings; findings of several uses about the same text of a template are merged into one.

    The merged finding lists the other uses.
    """
    groups: dict[object, list[Diagnostic]] = {}
    counts_by_code_and_place: Counter[object] = Counter()
    for diagnostic in diagnostics:
        key: object = diagnostic
        if diagnostic.place.use is not None:  # several findings of the same use at the same place stay separate
            counts_by_code_and_place[diagnostic.code, diagnostic.place] += 1
            key = diagnostic.code, diagnostic.place.span, counts_by_code_and_place[diagnostic.code, diagnostic.place]
        groups.setdefault(key, []).append(diagnostic)
    return tuple(_merge_uses(*sorted(group, key=lambda diagnostic: diagnostic.place)) for group in groups.values())


def _merge_uses(first: Diagnostic, *others: Diagnostic) -> Diagnostic:
    finding_by_use = {
        diagnostic.place.use: diagnostic for diagnostic in others if diagnostic.place.use != first.place.use
    }
    listed_findings = list(finding_by_use.values())[:MAX_LISTED_USES]
    related = tuple(Related(f"in another use: {finding.message}", finding.place) for finding in listed_findings)
    return replace(first, related=first.related + related, use_findings=(first, *others)) if related else first


MAX_CANDIDATES = 2000
MAX_SUGGESTED_LENGTH = 64

_WORD_SEPARATOR = re.compile(r"[_\s-]+")
_DIGIT = re.compile(r"[0-9]")
_MIN_WORD_LENGTH = 4
_LONG_WORD_LENGTH = 8


def suggest(name: str, candidates: Iterable[str]) -> str | None:
    """Return the candidate that `name` most likely means, or None.

    At most a third of the letters may differ (insertions, deletions, replacements, swapped neighbours). Of two equally
    near candidates, the candidate with the first letter of `name` wins. To bound the cost, at most MAX_CANDIDATES names
    of similar length are compared.
    """
    if len(name) > MAX_SUGGESTED_LENGTH:
        return None
    limit = max_slips(name)
    similar_names = [other for other in set(candidates) if abs(len(other) - len(name)) <= limit and other != name]
    similar_names.sort(key=lambda other: (other[:1] != name[:1], other))
    folded_name, best_candidate = name.casefold(), None
    for other in similar_names[:MAX_CANDIDATES]:
        distance = _distance(folded_name, other.casefold(), limit)
        if distance <= limit:
            best_candidate, limit = other, distance - 1  # only a nearer candidate can still replace this one
        if limit < 0:
            break
    return best_candidate


def max_slips(name: str) -> int:
    """Return the maximum number of letters in which a suggestion for a name may differ from the name."""
    return max(1, len(name) // 3)


def surely_means(name: str, suggestion: str, candidates: Iterable[str]) -> bool:
    """Return whether a misspelt name almost certainly means `suggestion`, so that a tool may correct it.

    Either the two names differ only in case or underscores. Or they differ in one word of at least four letters, by one
    typing error (by up to two if the word has at least eight letters), and not in a digit. In both cases, no other
    candidate may be about as similar to `name`.
    """
    if not is_slip(name, suggestion):
        return False
    folded_name, limit = name.casefold(), _distance(name.casefold(), suggestion.casefold(), len(suggestion)) + 1
    other_names = [
        other for other in set(candidates) if other not in (name, suggestion) and abs(len(other) - len(name)) <= limit
    ]
    return len(other_names) <= MAX_CANDIDATES and all(
        _distance(folded_name, other.casefold(), limit) > limit for other in other_names
    )


def is_slip(name: str, suggestion: str) -> bool:
    """Return whether two names differ so little that one is probably a misspelling of the other."""
    if max(len(name), len(suggestion)) > MAX_SUGGESTED_LENGTH:
        return False
    name_words, suggestion_words = (_WORD_SEPARATOR.split(text.casefold()) for text in (name, suggestion))
    if "".join(name_words) == "".join(suggestion_words):
        return True
    different_words = [(one, other) for one, other in zip(name_words, suggestion_words, strict=False) if one != other]
    if (
        len(name_words) != len(suggestion_words)
        or len(different_words) != 1
        or _DIGIT.findall(name) != _DIGIT.findall(suggestion)
    ):
        return False
    one, other = different_words[0]
    max_word_slips = 1 if len(other) < _LONG_WORD_LENGTH else 2
    is_long_enough = max(len(one), len(other)) >= _MIN_WORD_LENGTH and min(len(one), len(other)) >= _MIN_WORD_LENGTH - 1
    return is_long_enough and _distance(one, other, max_word_slips) <= max_word_slips


def _distance(left: str, right: str, limit: int) -> int:
    """Return the optimal string alignment distance; if that is above `limit`, return any number above `limit`."""
    if abs(len(left) - len(right)) > limit:
        return limit + 1
    start = _common_prefix_length(left, right)
    left, right = left[start:], right[start:]
    end = _common_prefix_length(left[::-1], right[::-1])
    left, right = left[: len(left) - end], right[: len(right) - end]
    row_before_previous: list[int] = []
    previous_row = list(range(len(right) + 1))
    for row, letter in enumerate(left, start=1):
        current_row = [row]
        for column, other in enumerate(right, start=1):
            cost = min(previous_row[column] + 1, current_row[-1] + 1, previous_row[column - 1] + (letter != other))
            if row > 1 and column > 1 and letter == right[column - 2] and left[row - 2] == other:
                cost = min(cost, row_before_previous[column - 2] + 1)
            current_row.append(cost)
        if min(current_row) > limit:
            return limit + 1
        row_before_previous, previous_row = previous_row, current_row
    return previous_row[-1]


def _common_prefix_length(left: str, right: str) -> int:
    """Return how many letters two texts share at their beginning."""
    pairs = enumerate(zip(left, right, strict=False))
    return next((index for index, (one, other) in pairs if one != other), min(len(left), len(right)))


def rules(*entries: tuple[str, str, Severity]) -> Mapping[str, Rule]:
    """Return a mapping from names to rules, made from rows (code, name, severity)."""
    return {name: Rule(code=code, name=name, severity=severity) for code, name, severity in entries}
