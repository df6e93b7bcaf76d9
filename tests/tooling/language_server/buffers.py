"""The text of a file as an editor and the protocol see it: positions count lines from 0, and UTF-16 units."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from lsprotocol.types import Position, Range, TextEdit

_LINE_END = re.compile("\r\n|\n|\r")


@dataclass(frozen=True)
class Buffer:
    """A text and its version. It is independent of the server's code, so that it shows wrong positions."""

    text: str
    version: int = 1

    def position(self, offset: int) -> Position:
        """Return the position of an offset."""
        line = bisect_right(self._line_starts, offset) - 1
        return Position(line, len(self.text[self._line_starts[line] : offset].encode("utf-16-le")) // 2)

    def offset(self, position: Position) -> int:
        """Return the offset of a position.

        Raises:
            ValueError: if the text has no such position.
        """
        starts = self._line_starts
        if position.line >= len(starts):
            raise ValueError(f"there is no line {position.line + 1}")
        start = starts[position.line]
        line = _LINE_END.split(self.text[start:], maxsplit=1)[0]
        units = line.encode("utf-16-le")
        if position.character * 2 > len(units):
            raise ValueError(f"line {position.line + 1} has no column {position.character + 1}")
        return start + len(units[: position.character * 2].decode("utf-16-le"))

    def line_and_column(self, position: Position) -> tuple[int, int]:
        """Return a position as codra counts: lines and code points, both from 1."""
        return position.line + 1, self.offset(position) - self._line_starts[position.line] + 1

    def quoted(self, place: Range) -> str:
        """Return the text of a range."""
        return self.text[self.offset(place.start) : self.offset(place.end)]

    def place_of(self, excerpt: str) -> Range:
        """Return the range of an excerpt, which is in the text exactly once; `|` in it is the position that is meant.

        Two marks are both ends of a range.
        """
        marks = [match.start() - number for number, match in enumerate(re.finditer(r"\|", excerpt))]
        plain = excerpt.replace("|", "")
        assert marks, f"no mark in {excerpt!r}"
        assert self.text.count(plain) == 1, f"{plain!r} is in the text {self.text.count(plain)} times"
        start = self.text.index(plain)
        return Range(self.position(start + marks[0]), self.position(start + marks[-1]))

    def edited(self, edits: Iterable[TextEdit]) -> Buffer:
        """Return the next version, after edits whose ranges are in this version and do not overlap."""
        text, previous_start = self.text, len(self.text)
        ranges = ((self.offset(edit.range.start), self.offset(edit.range.end), edit.new_text) for edit in edits)
        for start, end, new_text in sorted(ranges, reverse=True):
            assert start <= end <= previous_start, "edits overlap"
            text, previous_start = f"{text[:start]}{new_text}{text[end:]}", start
        return Buffer(text, self.version + 1)

    @cached_property
    def _line_starts(self) -> list[int]:
        return [0, *(match.end() for match in _LINE_END.finditer(self.text))]
