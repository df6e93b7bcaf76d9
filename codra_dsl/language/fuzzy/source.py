"""Split FLL text into lines and words with places, and collect the findings about one text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator

from codra_dsl.language.diagnostics import Diagnostic, Place, Span, suggest
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.rules import RULES

MAX_BYTES = 1024 * 1024
"""The maximum size of a text."""

MAX_LINES = 20_000
"""The maximum number of lines in a text."""

MAX_WORDS = 2_000
"""The maximum number of words in a line."""

MAX_FINDINGS = 200
"""The maximum number of findings about one text."""

MAX_SHOWN = 60
"""The maximum number of characters that a message shows of a text."""

MAX_LISTED = 12
"""The maximum number of allowed words that a message lists."""

_NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf|nan)", re.ASCII)


@dataclass(frozen=True, slots=True)
class Word:
    """A word or value with its place."""

    text: str
    place: Place


@dataclass(frozen=True, slots=True)
class Line:
    """`key: value`, without its comment."""

    key: Word
    value: Word

    def words(self) -> tuple[Word, ...]:
        """Return the words of the value."""
        return tuple(split(self.value, r"\S+"))


class Findings:
    """An append-only list of findings about one text."""

    def __init__(self) -> None:
        self._findings: list[Diagnostic] = []

    def add(self, rule: str, message: str, place: Place, help: str) -> None:
        """Report one finding of a rule in `RULES`; after MAX_FINDINGS, further findings are dropped."""
        if len(self._findings) < MAX_FINDINGS:
            self._findings.append(Diagnostic(rule=RULES[rule], message=message, place=place, help=help))

    def all(self) -> tuple[Diagnostic, ...]:
        """Return the findings in the order of the text."""
        return tuple(sorted(self._findings, key=lambda finding: finding.place.span))

    def report_unknown(self, rule: str, noun: str, word: Word, known: Iterable[str]) -> None:
        """Report a word that is not one of the known words. The noun states what the word names."""
        names = sorted(known)
        suggestion = suggest(word.text, names)
        allowed_names = ", ".join(names[:MAX_LISTED]) + (", ..." if len(names) > MAX_LISTED else "")
        help = (
            f"did you mean '{suggestion}'?"
            if suggestion
            else f"allowed: {allowed_names}"
            if names
            else "none is declared"
        )
        self.add(rule, f"unknown {noun} {shown(word.text)}", word.place, help)


def shown(text: str) -> str:
    """Return a text quoted for a message: shortened, with printable letters only."""
    short_text = text if len(text) <= MAX_SHOWN else text[:MAX_SHOWN] + "..."
    return "'" + "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in short_text) + "'"


def split(word: Word, pattern: str) -> Iterator[Word]:
    """Yield the parts of a word that match a pattern, with their places."""
    span = word.place.span
    for match in re.finditer(pattern, word.text):
        yield Word(match[0], _place(span.file, span.line, span.column + match.start(), len(match[0])))


def decode(data: bytes, file: str, findings: Findings) -> str | None:
    """Return bytes as text, or None if they are not UTF-8, or there are too many bytes or lines."""
    start = _place(file, 1, 1, 0)
    if len(data) > MAX_BYTES:
        findings.add("fll-too-large", f"more than {MAX_BYTES} bytes", start, "name a file that describes one engine")
        return None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        place = _place(file, line, 1, 0)
        findings.add("fll-unreadable", "this line is not UTF-8", place, "save the file as UTF-8")
        return None
    if text.count("\n") >= MAX_LINES:
        findings.add("fll-too-large", f"more than {MAX_LINES} lines", start, "name a file that describes one engine")
        return None
    return text


def lines(text: str, file: str, findings: Findings) -> Iterator[Line]:
    """Yield the definitions of a text; report any other line, unless it is empty or a comment."""
    for number, raw_line in enumerate(text.split("\n"), start=1):
        content = raw_line.split("#", 1)[0].rstrip()
        body = content.lstrip()
        if not body:
            continue
        column = len(content) - len(body) + 1
        key, colon, value = body.partition(":")
        place = _place(file, number, column, len(body))
        if not colon:
            findings.add("fll-no-definition", f"{shown(body)} is not 'key: value'", place, "write a key and a colon")
        elif len(body.split(None, MAX_WORDS)) > MAX_WORDS:
            findings.add("fll-too-large", f"more than {MAX_WORDS} words in a line", place, "split it")
        else:
            yield Line(_stripped(key, file, number, column), _stripped(value, file, number, column + len(key) + 1))


def _stripped(text: str, file: str, line: int, column: int) -> Word:
    body = text.strip()
    before = len(text) - len(text.lstrip()) if body else 0
    return Word(body, _place(file, line, column + before, len(body)))


def _place(file: str, line: int, column: int, length: int) -> Place:
    return Place(Span(file, line, column, line, column + length))


def parse_number(word: Word, findings: Findings) -> float | None:
    """Return the number in a word, or None after a finding. Only the word `nan` gives NaN."""
    if not _NUMBER.fullmatch(word.text):
        findings.add("fll-wrong-value", f"{shown(word.text)} is not a number", word.place, "write a number such as 0.5")
        return None
    return float(word.text)


def parse_quantity(word: Word, findings: Findings) -> float | None:
    """Return the number in a word, or None after a finding. The number may be infinite, but not NaN."""
    value = parse_number(word, findings)
    if value is not None and math.isnan(value):
        findings.add("fll-wrong-value", "nan is not allowed here", word.place, "write a number")
        return None
    return value


def parse_natural(word: Word, most: int, findings: Findings) -> int | None:
    """Return the whole number in a word, from 0 to `most`, or None after a finding."""
    if re.fullmatch(r"\d{1,9}", word.text, re.ASCII) and int(word.text) <= most:
        return int(word.text)
    findings.add("fll-wrong-value", f"{shown(word.text)} is not a count", word.place, f"write a count from 0 to {most}")
    return None
