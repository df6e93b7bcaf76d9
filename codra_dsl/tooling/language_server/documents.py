"""Texts of files, and the conversion of positions between codra and clients.

Codra counts columns in code points from 1, and a byte order mark has no column. The protocol counts from 0 in units of
an encoding that the client chooses (UTF-16, UTF-8 or UTF-32), and a byte order mark is a character like any other. Both
break lines only at CRLF, CR and LF.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from pathlib import Path

from lsprotocol import types

from codra_dsl.language.diagnostics import Span
from codra_dsl.language.file_queries import MAX_SPEC_BYTES
from codra_dsl.regular_files import read_regular_file

_LINE_BREAK = re.compile(r"\r\n|\r|\n")
_PATH = re.compile(r"[\w.-]+(?:/[\w.-]+)*\.\w+")
_BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"

Encoding = types.PositionEncodingKind | str
UTF16 = types.PositionEncodingKind.Utf16
_UNIT_BYTES: Mapping[str, tuple[str, int]] = {
    types.PositionEncodingKind.Utf8: ("utf-8", 1),
    types.PositionEncodingKind.Utf16: ("utf-16-le", 2),
    types.PositionEncodingKind.Utf32: ("utf-32-le", 4),
}
"""For each encoding of positions, the codec and the bytes of one unit."""


@dataclass(frozen=True)
class Document:
    """The text of one file.

    Attributes:
        encoding: the unit of positions.
    """

    text: str = field(repr=False)
    encoding: Encoding = UTF16

    @cached_property
    def line_starts(self) -> tuple[int, ...]:
        """The offset of the first character of each line."""
        return (0, *(line_break.end() for line_break in _LINE_BREAK.finditer(self.text)))

    @cached_property
    def data(self) -> bytes:
        """The content of the file. A lone surrogate, which no file can contain, gives bytes that are not UTF-8."""
        return self.text.encode("utf-8", "surrogatepass")

    def line(self, number: int) -> str:
        """Return a line without its line break; the first line has the number 0."""
        start = self.line_starts[number]
        end = self.line_starts[number + 1] if number + 1 < len(self.line_starts) else len(self.text)
        return self.text[start:end].rstrip("\r\n")

    def offset_at(self, position: types.Position) -> int:
        """Return the offset of a position; after the end of a line or of the text, this end."""
        if position.line >= len(self.line_starts):
            return len(self.text)
        line = self.line(position.line)
        return self.line_starts[position.line] + _code_points(line, position.character, self.encoding)

    def position_at(self, offset: int) -> types.Position:
        """Return the position of an offset."""
        line = bisect_right(self.line_starts, offset) - 1
        return types.Position(line, _units(self.text[self.line_starts[line] : offset], self.encoding))

    def offset_of(self, line: int, column: int) -> int:
        """Return the offset of a line and a column as spans count them; beyond the text, the end of the text."""
        if line > len(self.line_starts):
            return len(self.text)
        mark = 1 if line == 1 and self.text.startswith(_BYTE_ORDER_MARK) else 0
        return min(self.line_starts[line - 1] + mark + column - 1, len(self.text))

    def offsets_of(self, span: Span) -> tuple[int, int]:
        """Return the range of a span as offsets."""
        return self.offset_of(span.line, span.column), self.offset_of(span.end_line, span.end_column)

    def range_of(self, span: Span) -> types.Range:
        """Return the range of a span."""
        return self.range_between(*self.offsets_of(span))

    def span(self, file: str, start: int, end: int) -> Span:
        """Return the span of a range between two offsets; `file` is the name of the file."""
        first, last = (bisect_right(self.line_starts, offset) - 1 for offset in (start, end))
        columns = [offset - self.offset_of(line + 1, 1) + 1 for line, offset in ((first, start), (last, end))]
        return Span(file, first + 1, columns[0], last + 1, columns[1])

    def range_between(self, start: int, end: int) -> types.Range:
        """Return the range between two offsets."""
        return types.Range(self.position_at(start), self.position_at(end))

    def path_at(self, offset: int) -> str:
        """Return the path around an offset; empty if there is none."""
        paths = (match for match in _PATH.finditer(self.line(self.position_at(offset).line)))
        column = offset - self.line_starts[self.position_at(offset).line]
        return next((match[0] for match in paths if match.start() <= column <= match.end()), "")

    @property
    def line_break(self) -> str:
        """The first line break of the text."""
        match = _LINE_BREAK.search(self.text)
        return "\n" if match is None else match[0]

    def end_of_entry(self, offset: int) -> int:
        """Return the end of the YAML entry that begins at an offset: before the next line that is not indented more."""
        position = self.position_at(offset).line
        indent = offset - self.line_starts[position]
        last = position
        for number in range(position + 1, len(self.line_starts)):
            line = self.line(number)
            if line.strip() and len(line) - len(line.lstrip(" ")) <= indent:
                break
            last = number
        return self.line_starts[last] + len(self.line(last))

    def after(self, change: types.TextDocumentContentChangeEvent) -> Document:
        """Return the text after a change by the client."""
        if not isinstance(change, types.TextDocumentContentChangePartial):
            return Document(change.text, self.encoding)
        start, end = self.offset_at(change.range.start), self.offset_at(change.range.end)
        return Document(f"{self.text[:start]}{change.text}{self.text[max(start, end) :]}", self.encoding)


class Texts:
    """The texts of the files of a project: open documents, and files on disk, each of which is read once.

    Attributes:
        opened: the open documents by file.
    """

    def __init__(self, root: Path, documents: Mapping[str, Document], encoding: Encoding = UTF16) -> None:
        self.root = root
        self._encoding = encoding
        self.opened = documents
        self._documents = dict(documents)

    def document(self, file: str) -> Document:
        """Return the text of a file; an empty text if the file cannot be read."""
        if file not in self._documents:
            try:
                data = read_regular_file(self.root / file, MAX_SPEC_BYTES, within=self.root)
            except OSError:
                data = b""
            self._documents[file] = Document(data.decode("utf-8", "replace"), self._encoding)
        return self._documents[file]


class Move:
    """Moves ranges from an earlier text to a later one.

    The texts agree up to the first change and after the last one. Ranges between them have no place in the later text.
    """

    def __init__(self, before: str, after: str) -> None:
        self._is_same = before == after
        shorter_length = min(len(before), len(after))
        self._prefix = 0 if self._is_same else _agreement(shorter_length, lambda n: before[:n] == after[:n])
        limit = shorter_length - self._prefix
        suffix = 0 if self._is_same else _agreement(limit, lambda n: n == 0 or before[-n:] == after[-n:])
        self._suffix_start = len(before) - suffix
        self._added = len(after) - len(before)

    def range(self, start: int, end: int) -> tuple[int, int] | None:
        """Return a range of the earlier text in the later text. A change must not even touch the range."""
        if self._is_same or end < self._prefix:
            return start, end
        return (start + self._added, end + self._added) if start > self._suffix_start else None


def _agreement(limit: int, agrees: Callable[[int], bool]) -> int:
    """Return the largest length up to a limit at which two texts agree, given that they agree at smaller lengths."""
    return bisect_left(range(1, limit + 1), True, key=lambda length: not agrees(length))


def _units(text: str, encoding: Encoding) -> int:
    if text.isascii():
        return len(text)
    codec, unit_bytes = _UNIT_BYTES[encoding]
    return len(text.encode(codec, "surrogatepass")) // unit_bytes


def _code_points(line: str, units: int, encoding: Encoding) -> int:
    """Return how many characters of a line fit into a number of units."""
    if line.isascii():
        return min(units, len(line))
    ends = list(accumulate(_units(character, encoding) for character in line))
    return bisect_right(ends, units)
