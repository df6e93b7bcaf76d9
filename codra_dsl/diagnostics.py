"""Findings: what is wrong, where, and the way out. Every floor of the compiler reports with these values."""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

_LINE_NUMBER = re.compile(r"(?<=\bline )\d+")


class Severity(StrEnum):
    """How bad a finding is. Only errors keep a spec from being compiled."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True, order=True)
class Span:
    """A range of text. Lines and columns are 1-based, columns count code points, the end is exclusive.

    Attributes:
        file: relative to the project root, with `/`; `-` for standard input.
    """

    file: str
    line: int
    column: int
    end_line: int
    end_column: int


class HasSpans(Protocol):
    """A text that tells the spans of its ranges."""

    def span(self, start: int, end: int) -> Span:
        """Return the span of a range, given as offsets in code points."""
        ...


class _Late:
    """Lets a place work out its span when that is first asked for: of most places it never is."""

    __slots__ = ("_late",)
    _late: tuple[HasSpans, int, int]

    def __getattr__(self, name: str) -> object:
        """Fill the slot `span`, which is empty as long as Python comes here for it."""
        if name != "span":
            raise AttributeError(name)
        text, start, end = self._late
        span = text.span(start, end)
        object.__setattr__(self, "span", span)
        return span


@dataclass(frozen=True, slots=True, order=True)
class Place(_Late):
    """Where an element stands: its span and, for what a template made, the span of the `use` that made it."""

    span: Span
    use: Span | None = None


def late_place(text: HasSpans, start: int, end: int, use: Span | None) -> Place:
    """Return the place of a range of a text that can tell the spans of its ranges."""
    place = object.__new__(Place)
    object.__setattr__(place, "_late", (text, start, end))
    object.__setattr__(place, "use", use)
    return place


@dataclass(frozen=True, slots=True)
class Related:
    """Another place that belongs to a finding, with what is to be seen there."""

    message: str
    place: Place


class Applicability(StrEnum):
    """Who may apply a fix: a tool by itself, or a person who has read it."""

    SAFE = "safe"
    SUGGESTED = "suggested"


@dataclass(frozen=True, slots=True, order=True)
class Edit:
    """A range of text and what stands there after the fix; an empty range is an insertion."""

    span: Span
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """A way out that a tool can take.

    Attributes:
        message: what it does, as an order: `Replace 'moniter' by 'monitor'`.
        edits: do not overlap; all of them or none.
    """

    message: str
    edits: tuple[Edit, ...]
    applicability: Applicability


_FIRST_OF_QUALITY = "CDR7"


def replacing(place: Place, old: str, new: str, *, safe: bool) -> Fix | None:
    """Return the fix that puts one text in another's place; None in a template's text, which has other uses."""
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
        """Whether it can be neither silenced nor lowered: an error of phases 0 to 6, without which nothing compiles."""
        return self.severity is Severity.ERROR and self.code < _FIRST_OF_QUALITY


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostic:
    """One finding.

    Attributes:
        path: the element within the spec, e.g. `skills.open_door.monitor`; holds no line number.
        help: the way out, in one sentence; may be empty only where the message says it.
        fix: the way out as edits, where a tool can take it.
        level: the severity that the project's settings give it in place of the rule's.
        each_use: where the text of a template gives the same in several uses, what it gives in each of them.
    """

    rule: Rule
    message: str
    place: Place
    path: str = ""
    help: str = ""
    related: tuple[Related, ...] = ()
    fix: Fix | None = None
    level: Severity | None = None
    each_use: tuple[Diagnostic, ...] = ()

    @property
    def code(self) -> str:
        """Return the rule's code, `CDRnnnn`."""
        return self.rule.code

    @property
    def severity(self) -> Severity:
        """Return how bad it is: what the settings say, else what the rule does."""
        return self.level or self.rule.severity

    @property
    def fingerprint(self) -> str:
        """Return a name for this finding that stays the same when lines move."""
        message = _LINE_NUMBER.sub("", self.message)
        used_in = () if self.place.use is None else (self.place.use.file,)  # specs share parts
        text = "\0".join((self.code, self.place.span.file, self.path, message, *used_in))
        return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:16]


def is_safe(found: Diagnostic) -> bool:
    """Return whether a tool may fix a finding by itself."""
    return found.fix is not None and found.fix.applicability is Applicability.SAFE


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return whether any finding is an error: then nothing is compiled."""
    return any(diagnostic.severity is Severity.ERROR for diagnostic in diagnostics)


def has_binding_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Return whether any finding keeps the spec from being compiled whatever comments and settings say."""
    return any(diagnostic.rule.is_binding for diagnostic in diagnostics)


def in_file_order(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return findings by file, place and code, each once."""
    unique = dict.fromkeys(diagnostics)
    return tuple(sorted(unique, key=lambda found: (found.place.span, found.code, found.message)))


MAX_USES_TOLD = 5
"""How many other uses of a template a finding names."""


def once_per_template(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return findings with what a template's text gives in each of its uses as one, which names the other uses."""
    same: dict[object, list[Diagnostic]] = {}
    in_one_use: Counter[object] = Counter()
    for found in diagnostics:
        key: object = found
        if found.place.use is not None:  # several that one use gives at a place stay several
            in_one_use[found.code, found.place] += 1
            key = found.code, found.place.span, in_one_use[found.code, found.place]
        same.setdefault(key, []).append(found)
    return tuple(_with_uses(*sorted(group, key=lambda each: each.place)) for group in same.values())


def _with_uses(first: Diagnostic, *others: Diagnostic) -> Diagnostic:
    uses = {each.place.use: each for each in others if each.place.use != first.place.use}
    told = list(uses.values())[:MAX_USES_TOLD]
    also = tuple(Related(f"in another use: {each.message}", each.place) for each in told)
    return replace(first, related=first.related + also, each_use=(first, *others)) if also else first


MAX_CANDIDATES = 2000
MAX_SUGGESTED_LENGTH = 64

_APART = re.compile(r"[_\s-]+")
_DIGIT = re.compile(r"[0-9]")
_SHORT_WORD = 4
_LONG_WORD = 8


def suggest(name: str, candidates: Iterable[str]) -> str | None:
    """Return the candidate that `name` most likely means, or None.

    At most a third of the letters may differ (insertions, deletions, replacements, neighbours swapped); of two that
    are as near, the one that begins alike. Cost is bounded: at most MAX_CANDIDATES names of similar length are
    compared.
    """
    if len(name) > MAX_SUGGESTED_LENGTH:
        return None
    limit = max(1, len(name) // 3)
    similar = [other for other in set(candidates) if abs(len(other) - len(name)) <= limit and other != name]
    similar.sort(key=lambda other: (other[:1] != name[:1], other))
    wanted, best = name.casefold(), None
    for other in similar[:MAX_CANDIDATES]:
        distance = _distance(wanted, other.casefold(), limit)
        if distance <= limit:
            best, limit = other, distance - 1  # only what is nearer still counts
        if limit < 0:
            break
    return best


def surely_means(name: str, near: str, candidates: Iterable[str]) -> bool:
    """Return whether a misspelt name can hardly mean anything but `near`, so that a tool may put it right.

    Either they differ in case or underscores only; or in one word of four letters, by one slip (two from eight letters
    on), and in no digit. No other candidate may be about as similar.
    """
    if not is_slip(name, near):
        return False
    wanted, limit = name.casefold(), _distance(name.casefold(), near.casefold(), len(near)) + 1
    others = [other for other in set(candidates) if other not in (name, near) and abs(len(other) - len(name)) <= limit]
    return len(others) <= MAX_CANDIDATES and all(_distance(wanted, other.casefold(), limit) > limit for other in others)


def is_slip(name: str, near: str) -> bool:
    """Return whether two names differ by so little that one is the other, misspelt."""
    if max(len(name), len(near)) > MAX_SUGGESTED_LENGTH:
        return False
    left, right = (_APART.split(each.casefold()) for each in (name, near))
    if "".join(left) == "".join(right):
        return True
    different = [(one, other) for one, other in zip(left, right, strict=False) if one != other]
    if len(left) != len(right) or len(different) != 1 or _DIGIT.findall(name) != _DIGIT.findall(near):
        return False
    one, other = different[0]
    slips = 1 if len(other) < _LONG_WORD else 2
    long_enough = max(len(one), len(other)) >= _SHORT_WORD and min(len(one), len(other)) >= _SHORT_WORD - 1
    return long_enough and _distance(one, other, slips) <= slips


def _distance(left: str, right: str, limit: int) -> int:
    """Return the optimal string alignment distance, or more than `limit` when it is larger."""
    if abs(len(left) - len(right)) > limit:
        return limit + 1
    start = _shared(left, right)
    left, right = left[start:], right[start:]
    end = _shared(left[::-1], right[::-1])
    left, right = left[: len(left) - end], right[: len(right) - end]
    before: list[int] = []
    previous = list(range(len(right) + 1))
    for row, letter in enumerate(left, start=1):
        current = [row]
        for column, other in enumerate(right, start=1):
            cost = min(previous[column] + 1, current[-1] + 1, previous[column - 1] + (letter != other))
            if row > 1 and column > 1 and letter == right[column - 2] and left[row - 2] == other:
                cost = min(cost, before[column - 2] + 1)
            current.append(cost)
        if min(current) > limit:
            return limit + 1
        before, previous = previous, current
    return previous[-1]


def _shared(left: str, right: str) -> int:
    """Return how many letters two texts share at their beginning."""
    pairs = enumerate(zip(left, right, strict=False))
    return next((index for index, (one, other) in pairs if one != other), min(len(left), len(right)))


def rules(*entries: tuple[str, str, Severity]) -> Mapping[str, Rule]:
    """Return rules by name from (code, name, severity) rows: each room keeps one table of its own."""
    return {name: Rule(code=code, name=name, severity=severity) for code, name, severity in entries}
